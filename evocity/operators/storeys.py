"""Changes of buildings by whole storeys that keep each building a building of its own."""

import numpy as np
import scipy

from evocity.views.buildings import STEP

#: The margin over `STEP` of a wall that shrinks, metres: the possible error of decoding.
_MARGIN = 0.5
#: Heights within this are equal, metres: a roof of 6 m may decode to 5.9999 m.
_SAME = 1e-3


class Storeys:
    """The buildings of a map with their changes in storeys.

    A building keeps its footprint: it stays at least one storey high, and no wall to a neighbour
    shrinks to a step that no longer separates buildings (`STEP`). Parts of a lowered building that
    are below a storey already, the smeared foot of a wall, stay.

    heights : float32 ``(H, W)``, metres.
    labels : int32 ``(H, W)``: 0 on open ground, 1…n on n buildings.
    roofs : ``(n + 1,)``, the height of each building, metres.
    storey : height of a storey, metres.
    highest : no building rises above this, metres.

    change : int64 ``(n + 1,)``: storeys that each building rises; below 0 it falls.
    """

    def __init__(self, heights, labels, roofs: np.ndarray, storey: float, highest: float):
        self._heights, self._labels, self._roofs, self._storey = heights, labels, roofs, storey
        self.change = np.zeros(roofs.size, np.int64)
        self._pixels = np.bincount(labels.ravel(), minlength=roofs.size)
        self._least = np.minimum(-np.floor((roofs + _SAME) / storey - 1), 0).astype(np.int64)
        self._most = np.maximum(np.floor((highest - roofs + _SAME) / storey), 0).astype(np.int64)
        self._find_walls()

    def _find_walls(self) -> None:
        """Find the walls: sides between pixels of two buildings where the pixels or the roofs
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
        self._building, self._neighbour, self._height, self._neighbour_height = (
            np.concatenate(column)[order] for column in (near, far, low, high)
        )

    def shift(self, heights: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Raise ``heights`` of buildings by ``change`` storeys."""
        moved = heights + np.asarray(change * self._storey, np.float32)
        # heights below a storey stay; raised ones are above this in any case
        return np.maximum(moved, np.minimum(heights, np.float32(self._storey)))

    def lay(self) -> np.ndarray:
        """Compute the map with all changes, float32 ``(H, W)``, metres."""
        change = self.change[self._labels]
        return np.where(change == 0, self._heights, self.shift(self._heights, change))

    def scale(self, buildings: np.ndarray, factor: float, at_least_one: bool = True) -> bool:
        """Multiply the heights of ``buildings``, numbers from 1, by about ``factor``, in whole
        storeys; returns False if none changes.

        With ``at_least_one`` the highest changes by a storey at least. A single building that would
        merge with a neighbour changes by another number of storeys, at most one more than it
        should. Of several, those that would merge change by the same number.
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
                if not self._vanishing_walls(np.array([building])).any():
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
            walls = self._vanishing_walls(buildings)
            if not walls.any():
                return bool(self.change[buildings].any())
            near, far = (group[place[side[walls]]] for side in (self._building, self._neighbour))
            # a wall within a group vanishes only where the foot of a storey falls: it stays
            still |= np.isin(group, near[near == far])
            links = scipy.sparse.coo_array((np.ones(near.size), (near, far)), (count, count))
            group = scipy.sparse.csgraph.connected_components(links, directed=False)[1][group]

    def _vanishing_walls(self, buildings: np.ndarray) -> np.ndarray:
        """Find the walls of ``buildings`` that no longer separate any: bool, one for each wall."""
        mask = np.zeros(self._building.size, bool)
        for start, stop in zip(self._starts[buildings], self._starts[buildings + 1], strict=True):
            mask[start:stop] = True
        rows = np.flatnonzero(mask)
        low, high = self._height[rows], self._neighbour_height[rows]
        ours = self.shift(low, self.change[self._building[rows]])
        theirs = self.shift(high, self.change[self._neighbour[rows]])
        mask[rows] = np.abs(ours - theirs) < np.minimum(np.abs(low - high) - _SAME, STEP + _MARGIN)
        return mask
