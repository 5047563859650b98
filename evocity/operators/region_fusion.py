"""Region fusion: cross groups of lifs that wholly contain the buildings they bring."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity.citymap import MAX_PIXELS
from evocity.coding.decoded import decoded
from evocity.genome import Genome
from evocity.operators._kernels import give_back, inject_regions
from evocity.operators.crossing import Draft, raw_heights
from evocity.operators.footings import footings_of
from evocity.operators.grid import in_cells, side_checks
from evocity.operators.parameters import Check
from evocity.operators.pavement_fusion import PavementFusion

#: Regions that cut nothing come first, then those that cut up to so much of what they may.
_STAGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
#: The largest region unless told, m².
_AREA = 25_600.0


@dataclass(frozen=True)
class RegionFusion(PavementFusion):
    """Pavement fusion with regions that follow the buildings (Marsault 2002 §6.2).

    As in `PavementFusion`, but before it is injected a macro-block grows: over the donor's built
    components that it touches (`CityMap.labels` of the decoded map: buildings side by side share
    range blocks, and come together), over standing buildings of which it would take too much and
    leave a part (told apart by gaps and steps, `CityMap.buildings`), and over the courts these
    enclose. It holds a component of the donor at least, unless that has none. What is injected is
    never cut later: another region replaces such a building wholly, or grows over it, or is
    refused. At the end, buildings that were cut are given back what they lost where nothing is
    built in its place.

    Parameters
    ----------
    side_min, side_max : sides of the macro-blocks that regions grow from, metres; None for 32
        and 96.
    fill, margin, void, places : as in `PavementFusion`. Dense fabric, whose components
        are as large as the map, takes few regions: see ``made["fill_reached"]``.
    tolerance : S, metres, along a region's outline.
    cut : share of a standing building that regions may take away while the rest stays, 0…1. At
        each size regions that take nothing come first, then those that take up to a fifth of
        ``cut``, two fifths, and so on to all of it: six rounds. 0 leaves every building of the
        child whole; with 1 any but those injected before may be cut.
    area_max : regions that grow beyond this are refused, m²; None for 25 600.
    limit, size_min, size_max, positions : the same in range blocks, of uniform pavements;
        deprecated.
    tries : macro-blocks tried at each size in each round of ``cut``; None tries them all.
    repair, reach, domains : as in `PavementFusion`.
    """

    tolerance: float = 12.0
    cut: float = 0.4
    area_max: float | None = None
    limit: int | None = None
    tries: int | None = 60

    name = "region_fusion"
    _largest: ClassVar[float] = 96.0

    def _checks(self) -> dict[str, Check]:
        return {
            **super()._checks(),
            **side_checks(self, "limit"),
            "cut": (lambda share: 0 <= share <= 1, "0…1"),
            "tries": (
                lambda tries: tries is None or 1 <= tries <= MAX_PIXELS,
                f"1…{MAX_PIXELS}, or none for all",
            ),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        draft = super()._draft(parents, rng)
        return replace(draft, made={**draft.made, "cut": self.cut, "tries": self.tries})

    def _pave(self, parents, grid, sizes, shares, rng) -> tuple[np.ndarray, np.ndarray]:
        limit = in_cells(
            self.name, "limit", self.area_max, self.limit, _AREA, grid, parents, power=2
        )
        maps = [grid.blocks(raw_heights(parent)) for parent in parents]
        cities = [decoded(parent).city for parent in parents]
        components = footings_of(grid, [city.labels for city in cities])
        buildings = footings_of(grid, [city.building_labels for city in cities])
        margin, donor = self.margin, int(np.argmax(shares))
        owner, current = np.full(len(grid), donor), maps[donor].copy()
        standing = np.where(buildings.whose == donor, buildings.whole, 0)
        kept = np.zeros(standing.size, bool)
        for size in self._sizes(grid, *sizes, len(parents)):
            donor = (donor + 1) % len(parents)
            pixel = parents[0].metres_per_pixel
            corners = np.stack(self._candidates(grid, pixel, size, rng, self.tries), axis=1)
            least = (shares[donor] - margin) * owner.size if margin < shares[donor] else 0
            most = (shares[donor] + margin) * owner.size if shares[donor] > 0 else 0
            for share in _STAGES if self.cut else (1.0,):
                inject_regions(
                    current,
                    maps[donor],
                    owner,
                    donor,
                    size,
                    corners,
                    grid.columns,
                    components,
                    buildings,
                    standing,
                    kept,
                    self.tolerance,
                    share * self.cut,
                    limit,
                    least,
                    most,
                )
            margin *= 0.8
        give_back(current, np.stack(maps), owner, buildings, standing)
        return owner, grid.raster(current)
