"""Heights of a genome's buildings: changes by whole storeys, and lifs fitted to a changed map."""

import numpy as np
import scipy

from evocity.citymap import STOREY
from evocity.coding.collage_map import CollageMap
from evocity.coding.decoding_cache import decoded
from evocity.genome import Genome
from evocity.genome.genome import derived
from evocity.operators._kernels import block_moments
from evocity.operators.crossover import Draft, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check
from evocity.operators.street_blocks import street_blocks
from evocity.views.buildings import CRUMB, STEP

#: The highest legal storey and roof, metres.
_MOST = 1000.0
#: The margin over `STEP` of a wall that shrinks, metres: the possible error of decoding.
_MARGIN = 0.5
#: Heights within this are equal, metres: a roof of 6 m may decode to 5.9999 m.
_SAME = 1e-3
#: σ stays where β fits to within this, metres, root mean square.
_CLOSE = 0.05
#: The cap on the |σ| of fitted lifs where the code has no cap below 1, as in repair; a steeper
#: lifs may stay as steep.
_CONTRACTIVE = 0.9


def height_checks() -> dict[str, Check]:
    """Return the checks of the parameters ``storey`` and ``highest``."""
    return {
        "storey": (lambda storey: 2 <= storey <= _MOST, f"2…{_MOST:g} m"),
        "highest": (lambda roof: 0 <= roof <= _MOST, f"0…{_MOST:g} m"),
    }


class Storeys:
    """The buildings of a map with their changes in storeys.

    A building stays at least one storey high, and no wall to a neighbour shrinks to a step that no
    longer separates buildings (`STEP`). Parts of a building below a storey already stay.

    heights, labels : float32 and int32 ``(H, W)``: metres; 0 on ground, 1…n on n buildings.
    roofs : the height of each building, metres, ``(n + 1,)``.
    storey, highest : heights of a storey and of the highest roof, metres.

    change : storeys that each building rises, int64 ``(n + 1,)``; below 0 it falls.
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


class Heights:
    """The buildings of ``parent``'s map with their changes in storeys; ``storey`` and ``highest``
    in metres, as in `Storeys`."""

    def __init__(self, parent: Genome, storey: float, highest: float):
        self._parent, self.city = parent, decoded(parent).city
        self._raw = raw_heights(parent)
        self.labels = self.city.building_labels
        self._pixels = np.bincount(self.labels.ravel())
        total = np.bincount(self.labels.ravel(), self.city.heights.ravel())
        roofs = total / np.maximum(self._pixels, 1)
        self._storeys = Storeys(self._raw, self.labels, roofs, storey, highest)
        #: Scales a building, or the buildings of a street block: `Storeys.scale`.
        self.scale = self._storeys.scale

    def draft(self, made: dict) -> Draft:
        """Draft the parent with its changed buildings; adds the changes to ``made``."""
        intended = self._storeys.lay()
        change, gained = self._storeys.change, (intended - self._raw).mean(dtype=float)
        child = self._parent
        if change.any():
            attractor = decoded(self._parent).attractor
            child = refit_lifs(self._parent, attractor, attractor + (intended - self._raw))
        changes = {
            "buildings": int(np.count_nonzero(change)),
            "raised": int(change[change > 0].sum()),
            "lowered": int(-change[change < 0].sum()),
            "fsi_change": round(float(gained) / STOREY, 4),
        }
        return Draft(child, intended, made | changes)

    def groups(self, what: str, name: str) -> list[np.ndarray]:
        """Group the numbers of the buildings that may change, an array for each building or street
        block: ``what`` is "buildings" or "quarters". ``name``: the operator, for messages."""
        pixels, parent = self._pixels, self._parent
        labels, locked = self.labels, np.zeros(pixels.size, bool)
        if parent.condensation is not None:
            locked[labels[parent.condensation.mask]] = True
        large = pixels * self.city.metres_per_pixel**2 >= CRUMB
        large[0] = False
        if what == "buildings":
            return [np.array([number]) for number in np.flatnonzero(large & ~locked)]
        grid = common_grid(name, [parent], 0.0)
        quarter = np.zeros(pixels.size, np.int64)
        blocks = street_blocks(self.city, grid).labels
        quarter[labels.ravel()] = grid.raster(blocks.ravel()).ravel()  # the block of each building
        held = np.zeros(int(blocks.max()) + 1, bool)
        held[quarter[1:][locked[1:]]] = True
        free = np.flatnonzero(large & ~held[quarter])
        order = np.argsort(quarter[free], kind="stable")
        numbers, first = np.unique(quarter[free][order], return_index=True)
        return np.split(free[order], first[1:]) if numbers.size else []


def refit_lifs(genome: Genome, before: np.ndarray, after: np.ndarray) -> Genome:
    """Turn the code of a map ``before`` into a code of ``after``: fit σ and β of every lifs whose
    range block or domain block changes, by least squares.

    Where both change by a constant each, the fit is exact, and σ stays. Domain blocks, isometries
    and provenance stay.

    before, after : float32 ``(H, W)``, metres; ``before`` is the attractor of ``genome``.
    """
    pavement, domain = genome.pavement, ~genome.uniform
    domains = CollageMap(genome).recoded(domain, np.zeros(domain.size))
    read, reads = domains(before), domains(after)
    free = np.ones(after.shape, bool)
    if genome.condensation is not None:
        free = ~genome.condensation.mask
    moments = np.empty((7, len(pavement)))
    squares = *pavement.corners, pavement.side
    block_moments(before, after, read, reads, free, *squares, moments)
    changed = (moments[0] > _SAME) & (moments[1] > 0)
    mean_s, mean_t, square_s, square_t, product = moments[2:] / np.maximum(moments[1], 1)
    variance, relief = square_s - mean_s**2, square_t - mean_t**2
    together = product - mean_s * mean_t
    sigma = genome.sigma.astype(float)
    left = relief - 2 * sigma * together + sigma**2 * variance
    steepest = genome.sigma_max
    if steepest >= 1:
        steepest = np.maximum(np.abs(sigma), _CONTRACTIVE)
    able = domain & (left > _CLOSE**2) & (variance > _SAME**2)
    best = np.divide(together, variance, out=sigma.copy(), where=able)
    sigma = np.clip(best, -steepest, steepest)
    beta = mean_t - sigma * mean_s
    return derived(
        genome,
        sigma=np.where(changed, sigma.astype(np.float32), genome.sigma),
        beta=np.where(changed, beta.astype(np.float32), genome.beta),
    )
