"""Region fusion: cross groups of lifs that wholly contain the buildings they bring."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity import isometries
from evocity.citymap import MAX_PIXELS
from evocity.coding.decoded import decoded
from evocity.genome import Genome, Pieces
from evocity.operators._kernels import give_back, inject_regions
from evocity.operators.crossing import Draft, raw_heights
from evocity.operators.footings import Footings, footings_of
from evocity.operators.grid import in_cells, side_checks
from evocity.operators.parameters import Check
from evocity.operators.pavement_fusion import PavementFusion
from evocity.operators.turning import swaps, turned_blocks
from evocity.pavement import Pavement

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
    isometries : whether donors are laid turned and mirrored: at each size the donor's whole map
        lies under one of the 8 isometries, drawn; of maps that are no squares, one of the 4 that
        make no rows of columns. So a region brings another part of the donor than what stood
        there, turned, with its domain blocks. The parent that fills the map lies as it is.
    repair, reach, domains : as in `PavementFusion`.
    """

    tolerance: float = 12.0
    cut: float = 0.4
    area_max: float | None = None
    limit: int | None = None
    tries: int | None = 60
    isometries: bool = False

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

    def _pave(self, parents, grid, sizes, shares, rng) -> tuple[Pieces, np.ndarray]:
        limit = in_cells(
            self.name, "limit", self.area_max, self.limit, _AREA, grid, parents, power=2
        )
        first = int(np.argmax(shares))
        sizes = self._sizes(grid, *sizes, len(parents))
        donors = [(first + 1 + turn) % len(parents) for turn in range(len(sizes))]
        turned = _TurnedMaps(parents, grid)
        sides = self._sides(donors, first, parents, turned, grid, rng)
        maps, components, buildings = turned.maps(), *turned.footings()
        kin, margin = np.array(turned.whose), self.margin
        owner, current = np.full(len(grid), first), maps[first].copy()
        standing = np.where(buildings.whose == first, buildings.whole, 0)
        kept = np.zeros(standing.size, bool)
        for size, donor, side in zip(sizes, donors, sides, strict=True):
            pixel = parents[0].metres_per_pixel
            corners = np.stack(self._candidates(grid, pixel, size, rng, self.tries), axis=1)
            least = (shares[donor] - margin) * owner.size if margin < shares[donor] else 0
            most = (shares[donor] + margin) * owner.size if shares[donor] > 0 else 0
            for share in _STAGES if self.cut else (1.0,):
                inject_regions(
                    current,
                    maps[side],
                    owner,
                    side,
                    kin,
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
        give_back(current, maps, owner, buildings, standing)
        return turned.pieces(owner), grid.raster(current)

    def _sides(self, donors, first, parents, turned: "_TurnedMaps", grid, rng) -> list[int]:
        """Which of the ``turned`` maps each of the ``donors``, one a change of parent, shows."""
        if not self.isometries:
            return donors
        still = {first, len(parents) - 1} if self.void else {first}  # ground is bare under any
        square = grid.rows == grid.columns
        able = [iso for iso in range(isometries.COUNT) if square or not swaps(iso)]
        isos = rng.choice(able, len(donors)).tolist()
        return [
            turned.number(donor, 0 if donor in still else iso)
            for donor, iso in zip(donors, isos, strict=True)
        ]


class _TurnedMaps:
    """The maps of some parents as they lie, in their order, then those that are asked for turned.

    whose, iso : of each map, which parent's it is and under which isometry.
    """

    def __init__(self, parents: Sequence[Genome], grid: Pavement):
        self._parents, self._grid = parents, grid
        self.whose, self.iso = list(range(len(parents))), [0] * len(parents)

    def number(self, parent: int, iso: int) -> int:
        """Which of the maps is this parent's under this isometry."""
        pairs = list(zip(self.whose, self.iso, strict=True))
        if (parent, iso) not in pairs:
            self.whose.append(parent)
            self.iso.append(iso)
            return len(pairs)
        return pairs.index((parent, iso))

    def maps(self) -> np.ndarray:
        """What the maps show, float32 ``(m, n, B, B)``, cut along the cells."""
        return np.stack(
            [
                turned_blocks(self._grid, raw_heights(self._parents[parent]), iso)[0]
                for parent, iso in zip(self.whose, self.iso, strict=True)
            ]
        )

    def footings(self) -> tuple[Footings, Footings]:
        """Of their built components, and of their buildings."""
        cities = [decoded(self._parents[parent]).city for parent in self.whose]
        kinds = [city.labels for city in cities], [city.building_labels for city in cities]
        turned = (
            [
                np.ascontiguousarray(isometries.apply(iso, one))
                for iso, one in zip(self.iso, kind, strict=True)
            ]
            for kind in kinds
        )
        first, second = (footings_of(self._grid, kind) for kind in turned)
        return first, second

    def pieces(self, owner: np.ndarray) -> Pieces:
        """What stands in each cell, where ``owner`` ``(n,)`` tells of which map it is."""
        shape = self._grid.rows, self._grid.columns
        cells = np.arange(owner.size).reshape(shape)
        seen = np.stack([isometries.apply(iso, cells).ravel() for iso in self.iso])
        row, column = np.divmod(seen[owner, np.arange(owner.size)].reshape(shape), shape[1])
        whose, iso = (np.array(one)[owner].reshape(shape) for one in (self.whose, self.iso))
        return Pieces(self._grid.block, whose, row, column, iso.astype(np.uint8))
