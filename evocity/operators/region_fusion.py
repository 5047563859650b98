"""Region fusion: cross groups of lifs that wholly contain buildings, so that none is cut."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evocity.citymap import MAX_PIXELS
from evocity.coding.decode import decode
from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.operators._kernels import inject_regions
from evocity.operators.crossing import Draft
from evocity.operators.footings import footings_of
from evocity.operators.parameters import at_fault, check_parameters
from evocity.operators.pavement_fusion import PavementFusion


@dataclass(frozen=True)
class RegionFusion(PavementFusion):
    """Pavement fusion with regions that follow the buildings (Marsault 2002 §6.2).

    As in `PavementFusion`, but before it is injected a macro-block grows until it cuts no
    building: over the donor's buildings (`CityMap.labels` of the decoded map) that it touches,
    over standing ones of which it would take too much and leave a part, and over the courts
    they enclose. It holds one of the donor's buildings at least, unless that has none. What is
    injected is never cut later: another region replaces such a building wholly, or grows over
    it, or is refused.

    Parameters
    ----------
    size_min, size_max : sides of the macro-blocks that regions grow from, in range blocks.
    fill, margin, void, positions : as in `PavementFusion`. Dense fabric, whose buildings are
        as large as the map, takes few regions: see ``made["fill_reached"]``.
    tolerance : S, metres, along a region's outline.
    cut : share of a standing building that regions may take away while the rest stays, 0…1.
        0 leaves every building of the child whole; 1 grows over the donor's buildings alone,
        and over those injected before.
    limit : regions that grow beyond so many range blocks are refused.
    tries : macro-blocks tried at each size; None tries them all.
    repair, reach, domains : as in `PavementFusion`.
    """

    size_max: int = 12
    tolerance: float = 12.0
    cut: float = 0.2
    limit: int = 400
    tries: int | None = 60

    name = "region_fusion"

    def __post_init__(self):
        checks = {
            "cut": (lambda share: 0 <= share <= 1, "0…1"),
            "limit": (lambda blocks: 1 <= blocks <= MAX_PIXELS, f"1…{MAX_PIXELS} blocks"),
            "tries": (
                lambda tries: tries is None or 1 <= tries <= MAX_PIXELS,
                f"1…{MAX_PIXELS}, or none for all",
            ),
        }
        faults = {}
        for check in (super().__post_init__, lambda: check_parameters(self, checks)):
            try:
                check()
            except OperatorError as error:
                faults |= error.faults
        if faults:
            raise at_fault(self.name, faults)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        draft = super()._draft(parents, rng)
        return replace(draft, made={**draft.made, "cut": self.cut, "limit": self.limit})

    def _pave(self, parents, shares, rng) -> tuple[np.ndarray, np.ndarray]:
        pavement = parents[0].pavement
        cities = [decode(parent).city for parent in parents]
        maps = [pavement.blocks(city.heights) for city in cities]
        buildings = footings_of(pavement, cities)
        margin, donor = self.margin, int(np.argmax(shares))
        owner, current = np.full(len(pavement), donor), maps[donor].copy()
        standing = np.where(buildings.whose == donor, buildings.whole, 0)
        kept = np.zeros(standing.size, bool)
        for size in self._sizes(pavement, len(parents)):
            donor = (donor + 1) % len(parents)
            corners = np.stack(self._candidates(pavement, size, rng), axis=1)
            inject_regions(
                current,
                maps[donor],
                owner,
                donor,
                size,
                corners[: self.tries],
                pavement.columns,
                buildings,
                standing,
                kept,
                self.tolerance,
                self.cut,
                self.limit,
                (shares[donor] - margin) * owner.size if margin < shares[donor] else 0,
                (shares[donor] + margin) * owner.size if shares[donor] > 0 else 0,
            )
            margin *= 0.8
        return owner, pavement.raster(current)
