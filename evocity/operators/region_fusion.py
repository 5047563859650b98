"""Region fusion: groups of lifs that contain whole buildings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity import isometries
from evocity.citymap import MAX_PIXELS
from evocity.coding.decoding_cache import decoded
from evocity.genome import Genome, Pieces
from evocity.operators._kernels import give_back, inject_regions
from evocity.operators.crossover import Draft, raw_heights
from evocity.operators.grid import in_cells, side_checks, swaps_axes, turn_blocks
from evocity.operators.groups import Footings, footings_of
from evocity.operators.parameters import MOST_METRES, SHARE, Check
from evocity.operators.pavement_fusion import PavementFusion, share_bounds
from evocity.pavement import Pavement

#: Rounds at each size, as shares of ``cut``: regions that cut nothing come first.
_STAGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
#: The default area of the largest region, m².
_AREA = 25_600.0


@dataclass(frozen=True)
class RegionFusion(PavementFusion):
    """Fuse parents by regions that follow the buildings (Marsault 2002 §6.2).

    The operator works like `PavementFusion`, but each macro-block grows to a region before the
    operator injects it.

    - The region includes the donor's built components that the macro-block touches
      (`CityMap.labels` of the decoded map). Adjacent buildings share range blocks, so the operator
      injects adjacent buildings together.
    - The region includes standing buildings (`CityMap.buildings`) that the region would cut too
      much, and the courts that these buildings enclose.
    - The region contains at least one built component of the donor, if the donor has any.

    No later region cuts an injected building: a later region replaces the whole building, grows
    over it, or is refused. At the end, buildings that were cut get back the parts that they lost,
    except where something else is built.

    Parameters
    ----------
    side_min, side_max : smallest and largest side of the macro-blocks that grow to regions, metres.
        By default, the macro-blocks have sides from 32 m to 96 m.
    fill, base, margin, void, places : shares of the parents, and corners of the macro-blocks, as in
        `PavementFusion`. In dense fabric, built components are as large as the map, so few regions
        are admissible; see ``made["fill_reached"]``.
    tolerance : largest mean difference along the outline of a region, metres, called S in the
        papers.
    cut : share of a standing building, 0…1, that regions may take away while the rest of the
        building stays. At each size there are six rounds, which allow 0, 20, 40, 60, 80 and 100 %
        of the value of ``cut``. If ``cut`` is 0, every building of the child stays whole; if
        ``cut`` is 1, only injected buildings are protected.
    area_max : largest area of a region, m²; larger regions are refused. By default, a region has at
        most 25 600 m².
    limit, size_min, size_max, positions : limits of regions and macro-blocks, counted in range
        blocks of equal size. Deprecated.
    tries : number of macro-blocks that the operator tries at each size in each round; None for all.
    isometries : whether the operator turns and mirrors donors. At each size, one of the 8
        isometries, drawn at random, turns the donor's whole map with its domain blocks. On maps
        that are not square, the operator draws one of the 4 isometries that keep rows horizontal.
        The operator never turns the parent that fills the map.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`.
    """

    tolerance: float = 12.0
    cut: float = 0.4
    area_max: float | None = None
    limit: int | None = None
    tries: int | None = 60
    isometries: bool = False

    name = "region_fusion"
    takes_turns: ClassVar[bool] = True
    _largest: ClassVar[float] = 96.0

    def _checks(self) -> dict[str, Check]:
        return {
            **super()._checks(),
            **side_checks(self, "limit"),
            "cut": SHARE,
            "tries": (
                lambda tries: tries is None or 1 <= tries <= MAX_PIXELS,
                f"1…{MAX_PIXELS}, or none for all",
            ),
        }

    def relaxed(self) -> "RegionFusion":
        """Return an operator that admits more regions: it may cut more, has twice the
        ``tolerance``, and twice the largest area."""
        area = min(2 * (self.area_max or _AREA), MOST_METRES)
        wider = {} if self.limit is not None else {"area_max": area}
        return replace(super().relaxed(), cut=min(1.0, self.cut + 0.4), **wider)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        draft = super()._draft(parents, rng)
        return replace(draft, made={**draft.made, "cut": self.cut, "tries": self.tries})

    def _pave(self, parents, grid, sizes, shares, rng) -> tuple[Pieces, np.ndarray]:
        limit = in_cells(self, "limit", _AREA, grid, parents, power=2)
        first = self._first(shares)
        sizes = self._sizes(grid, *sizes, len(parents))
        donors = [(first + 1 + turn) % len(parents) for turn in range(len(sizes))]
        turned = _TurnedMaps(parents, grid)
        sides = self._sides(donors, first, parents, turned, grid, rng)
        maps, components, buildings = turned.maps(), *turned.footings()
        kin, margin = np.array(turned.owner), self.margin
        owner, current = np.full(len(grid), first), maps[first].copy()
        standing = np.where(buildings.whose == first, buildings.whole, 0)
        kept = np.zeros(standing.size, bool)
        for size, donor, side in zip(sizes, donors, sides, strict=True):
            pixel = parents[0].metres_per_pixel
            corners = np.stack(self._candidates(grid, pixel, size, rng, self.tries), axis=1)
            bounds = [*map(float, share_bounds(shares[donor], margin, owner.size))]
            for share in _STAGES if self.cut else (1.0,):
                inject_regions(
                    current, maps[side], owner, side, kin, size, corners, grid.columns,
                    components, buildings, standing, kept,
                    float(self.tolerance), float(share * self.cut), limit, *bounds,
                )  # fmt: skip
            margin *= 0.8
        give_back(current, maps, owner, buildings, standing)
        return turned.pieces(owner), grid.raster(current)

    def _sides(self, donors, first, parents, turned: "_TurnedMaps", grid, rng) -> list[int]:
        """Draw which of the ``turned`` maps each of the ``donors`` shows."""
        if not self.isometries:
            return donors
        still = {first, len(parents) - 1} if self.void else {first}  # bare ground need not turn
        square = grid.rows == grid.columns
        able = [iso for iso in range(isometries.COUNT) if square or not swaps_axes(iso)]
        isos = rng.choice(able, len(donors)).tolist()
        return [
            turned.number(donor, 0 if donor in still else iso)
            for donor, iso in zip(donors, isos, strict=True)
        ]


class _TurnedMaps:
    """The unturned maps of some parents, in their order, then turned ones in the order of requests.

    owner, iso : parent and isometry of each map.
    """

    def __init__(self, parents: Sequence[Genome], grid: Pavement):
        self._parents, self._grid = parents, grid
        self.owner, self.iso = list(range(len(parents))), [0] * len(parents)

    def number(self, parent: int, iso: int) -> int:
        """Number the map of a parent under an isometry."""
        pairs = list(zip(self.owner, self.iso, strict=True))
        if (parent, iso) not in pairs:
            self.owner.append(parent)
            self.iso.append(iso)
            return len(pairs)
        return pairs.index((parent, iso))

    def maps(self) -> np.ndarray:
        """Cut the maps along the cells, float32 ``(m, n, B, B)``."""
        return np.stack(
            [
                turn_blocks(self._grid, raw_heights(self._parents[parent]), iso)[0]
                for parent, iso in zip(self.owner, self.iso, strict=True)
            ]
        )

    def footings(self) -> tuple[Footings, Footings]:
        """Tabulate the footings of built components, and of buildings."""
        cities = [decoded(self._parents[parent]).city for parent in self.owner]

        def footings(kind: str) -> Footings:
            labels = [
                np.ascontiguousarray(isometries.apply(iso, getattr(city, kind)))
                for iso, city in zip(self.iso, cities, strict=True)
            ]
            return footings_of(self._grid, labels)

        return footings("labels"), footings("building_labels")

    def pieces(self, owner: np.ndarray) -> Pieces:
        """Make pieces of cells, whose map is ``owner`` ``(n,)``."""
        shape = self._grid.rows, self._grid.columns
        cells = np.arange(owner.size).reshape(shape)
        sources = np.stack([isometries.apply(iso, cells).ravel() for iso in self.iso])
        row, column = np.divmod(sources[owner, np.arange(owner.size)].reshape(shape), shape[1])
        parent, iso = (np.array(column)[owner].reshape(shape) for column in (self.owner, self.iso))
        return Pieces(self._grid.block, parent, row, column, iso.astype(np.uint8))
