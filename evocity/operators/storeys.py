"""By how many storeys may buildings rise or fall, so that each stays the building it is?"""

import numpy as np
import scipy

from evocity.views.buildings import STEP

#: A wall that shrinks is left so much higher than `STEP`, metres: as far as decoding may stray.
_MARGIN = 0.5
#: Heights within this are the same, metres: a roof of 6 m may be decoded at 5.9999 m.
_SAME = 1e-3


class Storeys:
    """The buildings of a map, and by how many storeys each is raised or lowered.

    A building keeps its footprint: it is never lower than one storey, and no wall between it and
    a building beside it shrinks to a step that tells none apart (`STEP`). What of a lowered
    building is lower than a storey already, the foot of a wall that decoding has smeared, stays
    as it is.

    heights : float32 ``(H, W)``, metres.
    labels : int32 ``(H, W)``: 0 on open ground, 1…n on n buildings.
    roofs : ``(n + 1,)``, the height of each building, metres.
    storey : height of a storey, metres.
    highest : no building is raised above this, metres.

    change : int64 ``(n + 1,)``: by how many storeys each building is raised, below 0 lowered.
    """

    def __init__(self, heights, labels, roofs: np.ndarray, storey: float, highest: float):
        self._heights, self._labels, self._roofs, self._storey = heights, labels, roofs, storey
        self.change = np.zeros(roofs.size, np.int64)
        self._pixels = np.bincount(labels.ravel(), minlength=roofs.size)
        self._least = np.minimum(-np.floor((roofs + _SAME) / storey - 1), 0).astype(np.int64)
        self._most = np.maximum(np.floor((highest - roofs + _SAME) / storey), 0).astype(np.int64)
        self._walls()

    def _walls(self) -> None:
        """Find the walls: where pixels of two buildings touch by sides, and these or the roofs
        differ by more than `STEP`; each from both sides, sorted by building."""
        near, far, low, high = [], [], [], []
        roofs = self._roofs[self._labels].astype(np.float32)
        for axis in (0, 1):
            labels = np.moveaxis(self._labels, axis, 0)
            ours, theirs = labels[:-1], labels[1:]
            touch = (ours != theirs) & (ours > 0) & (theirs > 0)
            for heights in (np.moveaxis(self._heights, axis, 0), np.moveaxis(roofs, axis, 0)):
                here, there = heights[:-1], heights[1:]
                wall = touch & (np.abs(here - there) > STEP)
                near += [ours[wall], theirs[wall]]
                far += [theirs[wall], ours[wall]]
                low += [here[wall], there[wall]]
                high += [there[wall], here[wall]]
        building = np.concatenate(near)
        order = np.argsort(building, kind="stable")
        self._starts = np.searchsorted(building[order], np.arange(self._roofs.size + 1))
        self._own, self._beside, self._height, self._height_beside = (
            np.concatenate(one)[order] for one in (near, far, low, high)
        )

    def shifted(self, heights: np.ndarray, change: np.ndarray) -> np.ndarray:
        """``heights`` of buildings that are raised by ``change`` storeys."""
        moved = heights + np.asarray(change * self._storey, np.float32)
        # what is lower than a storey stays; what is raised is above this in any case
        return np.maximum(moved, np.minimum(heights, np.float32(self._storey)))

    def laid(self) -> np.ndarray:
        """The map with all changes made, float32 ``(H, W)``, metres."""
        change = self.change[self._labels]
        return np.where(change == 0, self._heights, self.shifted(self._heights, change))

    def scale(self, buildings: np.ndarray, factor: float, at_least_one: bool = True) -> bool:
        """Change the height of ``buildings``, numbers from 1, to about ``factor`` times what it
        is, by whole storeys; False if none changes.

        The highest changes by one storey if it is to be ``at_least_one``. A lone one that would
        become one with a building beside it changes by another number of storeys, up to one more
        than it should. Of several, those that would become one change by the same number.
        """
        wish = (factor - 1) * self._roofs[buildings] / self._storey
        way = 1 if factor > 1 else -1
        if np.abs(wish).max(initial=0) < 0.5:
            if not at_least_one:
                return False
            wish = np.full(buildings.size, float(way))
        if buildings.size == 1:
            return self._scale_one(int(buildings[0]), int(np.rint(wish[0])), way)
        return self._scale_all(buildings, wish)

    def _scale_one(self, building: int, wish: int, way: int) -> bool:
        counts = np.arange(1, abs(wish) + 2)
        for count in counts[np.argsort(np.abs(counts - abs(wish)), kind="stable")] * way:
            if self._least[building] <= count <= self._most[building]:
                self.change[building] = count
                if not self._vanishing(np.array([building])).any():
                    return True
        self.change[building] = 0
        return False

    def _scale_all(self, buildings: np.ndarray, wish: np.ndarray) -> bool:
        group, still = np.arange(buildings.size), np.zeros(buildings.size, bool)
        place = np.zeros(self._roofs.size, np.int64)
        place[buildings] = np.arange(buildings.size)
        weight = self._pixels[buildings]
        while True:
            count = group.max() + 1
            total = np.bincount(group, weight * wish, count) / np.bincount(group, weight, count)
            least, most = np.full(count, -np.inf), np.full(count, np.inf)
            np.maximum.at(least, group, self._least[buildings])
            np.minimum.at(most, group, self._most[buildings])
            total = np.where(np.bincount(group, still, count) > 0, 0, np.clip(total, least, most))
            self.change[buildings] = np.rint(total)[group]
            walls = self._vanishing(buildings)
            if not walls.any():
                return bool(self.change[buildings].any())
            one, other = (group[place[side[walls]]] for side in (self._own, self._beside))
            # a wall within a group vanishes only where a storey's foot is lowered: it stays
            still |= np.isin(group, one[one == other])
            links = scipy.sparse.coo_array((np.ones(one.size), (one, other)), (count, count))
            group = scipy.sparse.csgraph.connected_components(links, directed=False)[1][group]

    def _vanishing(self, buildings: np.ndarray) -> np.ndarray:
        """Bool, one a wall: those of ``buildings`` that shrink until they tell none apart."""
        mine = np.zeros(self._own.size, bool)
        for start, stop in zip(self._starts[buildings], self._starts[buildings + 1], strict=True):
            mine[start:stop] = True
        rows = np.flatnonzero(mine)
        ours = self.shifted(self._height[rows], self.change[self._own[rows]])
        theirs = self.shifted(self._height_beside[rows], self.change[self._beside[rows]])
        step, was = np.abs(ours - theirs), np.abs(self._height[rows] - self._height_beside[rows])
        mine[rows] = step < np.minimum(was - _SAME, STEP + _MARGIN)
        return mine
