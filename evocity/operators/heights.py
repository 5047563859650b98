"""The buildings of a genome's map, raised and lowered: what operators of heights share."""

import numpy as np

from evocity.citymap import STOREY
from evocity.coding.decoded import decoded
from evocity.genome import Genome
from evocity.operators.crossing import Draft, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check
from evocity.operators.refitting import refitted
from evocity.operators.storeys import Storeys
from evocity.operators.street_blocks import street_blocks
from evocity.views.buildings import CRUMB

#: The highest storey and roof that are one, metres.
_MOST = 1000.0


def height_checks() -> dict[str, Check]:
    """Checks of the parameters ``storey`` and ``highest``."""
    return {
        "storey": (lambda storey: 2 <= storey <= _MOST, f"2…{_MOST:g} m"),
        "highest": (lambda roof: 0 <= roof <= _MOST, f"0…{_MOST:g} m"),
    }


class Heights:
    """The buildings of ``parent``'s map, and by how many storeys each changes; ``storey`` and
    ``highest`` in metres, as in `Storeys`."""

    def __init__(self, parent: Genome, storey: float, highest: float):
        self._parent, self.city = parent, decoded(parent).city
        self._raw = raw_heights(parent)
        self.labels = self.city.building_labels
        self._pixels = np.bincount(self.labels.ravel())
        total = np.bincount(self.labels.ravel(), self.city.heights.ravel())
        roofs = total / np.maximum(self._pixels, 1)
        self._storeys = Storeys(self._raw, self.labels, roofs, storey, highest)
        #: The buildings, or those of a street block, get a factor: see `Storeys.scale`.
        self.scale = self._storeys.scale

    def draft(self, made: dict) -> Draft:
        """The parent with its buildings as they are to be; ``made`` and what has changed."""
        intended = self._storeys.laid()
        change, gained = self._storeys.change, (intended - self._raw).mean(dtype=float)
        child = self._parent
        if change.any():
            attractor = decoded(self._parent).attractor
            child = refitted(self._parent, attractor, attractor + (intended - self._raw))
        told = {
            "buildings": int(np.count_nonzero(change)),
            "raised": int(change[change > 0].sum()),
            "lowered": int(-change[change < 0].sum()),
            "fsi_change": round(float(gained) / STOREY, 4),
        }
        return Draft(child, intended, made | told)

    def groups(self, what: str, name: str) -> list[np.ndarray]:
        """Numbers of the buildings that may change, those that change together in one array:
        ``what`` is "buildings" or "quarters". ``name``: the operator, for messages."""
        pixels, parent = self._pixels, self._parent
        labels, locked = self.labels, np.zeros(pixels.size, bool)
        if parent.condensation is not None:
            locked[labels[parent.condensation.mask]] = True
        large = pixels * self.city.metres_per_pixel**2 >= CRUMB
        large[0] = False
        if what == "buildings":
            return [np.array([one]) for one in np.flatnonzero(large & ~locked)]
        grid = common_grid(name, [parent], 0.0)
        quarter = np.zeros(pixels.size, np.int64)
        blocks = street_blocks(self.city, grid).labels
        quarter[labels.ravel()] = grid.raster(blocks.ravel()).ravel()  # one of each building
        held = np.zeros(int(blocks.max()) + 1, bool)
        held[quarter[1:][locked[1:]]] = True
        mine = np.flatnonzero(large & ~held[quarter])
        order = np.argsort(quarter[mine], kind="stable")
        numbers, first = np.unique(quarter[mine][order], return_index=True)
        return np.split(mine[order], first[1:]) if numbers.size else []
