"""Heights of a genome's buildings: changes by whole storeys, and lifs fitted to a changed map."""

import numpy as np

from evocity.citymap import STOREY
from evocity.coding.decode import CollageMap
from evocity.coding.decoding_cache import decoded
from evocity.genome import Genome
from evocity.operators.crossover import Draft, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check
from evocity.operators.storeys import Storeys
from evocity.operators.street_blocks import street_blocks
from evocity.views.buildings import CRUMB

#: The highest legal storey and roof, metres.
_MOST = 1000.0
#: Changes of a pixel up to this do not count, metres.
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

    Where both change by a constant each, the fit is exact, and σ stays. A range block with a height
    that changes along an edge fits as well as its domain block allows. Domain blocks, isometries
    and provenance stay.

    before, after : float32 ``(H, W)``, metres; ``before`` is the attractor of ``genome``.
    """
    pavement, domain = genome.pavement, ~genome.uniform
    domains = CollageMap(genome).recoded(domain, np.zeros(domain.size))
    read, reads = domains(before), domains(after)
    moved = np.abs(after - before) + np.abs(reads - read)
    free = np.ones(after.shape)
    if genome.condensation is not None:
        free[genome.condensation.mask] = 0
    pixels = pavement.sums(free)
    changed = (pavement.maxima(moved * free) > _SAME) & (pixels > 0)
    pixels = np.maximum(pixels, 1)

    def mean(raster: np.ndarray) -> np.ndarray:
        return pavement.sums(raster * free) / pixels

    s, t = reads.astype(float), after.astype(float)
    mean_s, mean_t = mean(s), mean(t)
    variance, relief = mean(s * s) - mean_s**2, mean(t * t) - mean_t**2
    together = mean(s * t) - mean_s * mean_t
    sigma = genome.sigma.astype(float)
    left = relief - 2 * sigma * together + sigma**2 * variance
    steepest = genome.sigma_max
    if steepest >= 1:
        steepest = np.maximum(np.abs(sigma), _CONTRACTIVE)
    able = domain & (left > _CLOSE**2) & (variance > _SAME**2)
    best = np.divide(together, variance, out=sigma.copy(), where=able)
    sigma = np.clip(best, -steepest, steepest)
    beta = mean_t - sigma * mean_s
    return genome.replace(
        sigma=np.where(changed, sigma.astype(np.float32), genome.sigma),
        beta=np.where(changed, beta.astype(np.float32), genome.beta),
    )
