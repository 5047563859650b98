"""The endless fabric `Growth`: heights of any window, maps, genomes."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.condensation import Condensation
from evocity.errors import GenomeError, OperatorError, is_whole, keyword, setting
from evocity.genome import Genome, Pieces, laid, merged, merged_cities, most_roofs, roof_codes
from evocity.growth._kernels import WINDOW, fabric_window, window_keys
from evocity.growth.plane import Plane, paste
from evocity.growth.quarter_plane import QuarterPlane
from evocity.isometries import AFFINE
from evocity.operators.repair import collage_repair

#: The largest row or column of an endless fabric, pixels.
FARTHEST = 1 << 50


@dataclass(frozen=True, eq=False)
class Growth:
    """Endless city fabric that the function `grow` makes from one or several original genomes.

    The seed and the position determine the content of every position in the fabric. Windows of the
    fabric may be computed in any order and in any process. A cache keeps the tiles of the fabric
    that were computed last.

    originals : genomes of the cities from which the fabric grows. The first original appears
        unchanged in the fabric, and groups of cells come from all originals.
    plane : object that computes the cells of an endless plane at any position.
    shape : size ``(H, W)`` of the map to be written, px. The map to be written is a rectangle of
        the fabric.
    place : row and column of the first original's north-west pixel. All rows and columns count from
        the north-west pixel of the map that is to be written.
    made : parameters of the growth, as `Genome` records them.
    """

    originals: tuple[Genome, ...]
    plane: Plane | QuarterPlane
    shape: tuple[int, int]
    place: tuple[int, int]
    made: Mapping

    @property
    def cell(self) -> int:
        """Side of a cell, px; the groups of cells that make up the fabric consist of whole
        cells."""
        return self.plane.cell

    @property
    def metres_per_pixel(self) -> float:
        return self.originals[0].metres_per_pixel

    @property
    def name(self) -> str:
        return f"{' × '.join(self._cities[0])}, grown"

    @property
    def attribution(self) -> str:
        return self._cities[2]

    @property
    def _cities(self):
        return merged_cities(self.originals)

    @property
    def crs(self) -> str | None:
        return self.originals[0].crs

    @property
    def origin(self) -> tuple[float, float] | None:
        """Coordinates of the map's north-west corner; with these coordinates, the first original
        keeps its place on Earth."""
        return self._origin_of(0, 0)

    def at(self, top: int, left: int, height: int, width: int) -> "Growth":
        """Return the same fabric for another rectangle to be written. Rows and columns of the new
        object count from the pixel (``top``, ``left``)."""
        top, left, height, width = _rectangle(top, left, height, width, whole=True)
        place = self.place[0] - top, self.place[1] - left
        return dataclasses.replace(self, shape=(height, width), place=place)

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Compute the heights of a rectangle, float32 ``(height, width)``, metres. The rectangle
        begins at the pixel (``top``, ``left``); row and column may be negative."""
        top, left, height, width = _rectangle(top, left, height, width)
        return self.plane.window(top - self.place[0], left - self.place[1], height, width)

    def city(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> CityMap:
        """Make a map of a rectangle of the fabric; by default, the rectangle is the whole map to be
        written. The map takes four bytes per pixel; each view that the map computes, such as
        ``labels``, takes four bytes per pixel in addition."""
        top, left, height, width = self._rectangle(top, left, height, width, whole=True)
        return CityMap(
            self.window(top, left, height, width),
            self.metres_per_pixel,
            name=self.name,
            attribution=self.attribution,
            origin=self._origin_of(top, left),
            crs=self.crs,
        )

    def building_roofs(self, city: CityMap, top: int = 0, left: int = 0) -> np.ndarray | None:
        """Return the roof of each building of a ``city`` of this fabric that begins at the pixel
        (``top``, ``left``), as `evocity.genome.building_roofs`. None if no original has roofs. In a
        fabric with streets, the nearest cells of the originals decide."""
        if not any(one.roofs for one in self.originals):
            return None
        cell, (height, width) = self.cell, city.shape
        y, x = top - self.place[0], left - self.place[1]
        first, west = y // cell, x // cell
        ends = -(-(y + height) // cell), -(-(x + width) // cell)
        brought = np.concatenate([roof_codes(one).ravel() for one in self.originals])
        codes = np.empty((height, width), np.float32)
        at = y - first * cell, x - west * cell
        stones = self.plane.stones(first, west, *ends)
        heights = brought.astype(np.float32)
        fabric_window(stones, heights, self.plane.sides, AFFINE, cell, *at, codes)
        return most_roofs(city, codes.astype(np.int16))

    def sources(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> dict[str, np.ndarray]:
        """Find the source of each cell in a rectangle, and return four int64 arrays ``(rows,
        columns)``. The four arrays hold the number of the original, the row and the column of the
        cell in this original, and the isometry of the cell. In a fabric with streets,
        buildings turn by any angle: the arrays then hold the cell of the original and the isometry
        that come nearest to the true place.

        Raises `OperatorError` if the borders of the rectangle cut cells.
        """
        rectangle = self._rectangle(top, left, height, width)
        first, west, bottom, right = self._cells(*rectangle)
        stones = self.plane.stones(first, west, bottom, right).astype(np.int64)
        sides, index = self.plane.sides, stones >> 3
        original = np.searchsorted(sides[:, 2], index, side="right") - 1
        row, column = np.divmod(index - sides[original, 2], sides[original, 1])
        return {"original": original, "row": row, "column": column, "iso": stones & 7}

    def account(
        self,
        top: int = 0,
        left: int = 0,
        height: int | None = None,
        width: int | None = None,
        *,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict:
        """Report the quality of the growth in all tiles of the fabric that a rectangle touches.

        The entry ``groups`` of the result is the number of groups of cells. The entry ``step`` is
        the mean difference of heights along the outlines of all groups of cells, metres. The entry
        ``forced`` counts groups for which no candidate was admissible; each of these groups took
        the candidate with the least difference. The entry ``repeated`` counts groups for which
        every candidate repeated a window of 64 × 64 px from elsewhere. In a fabric with streets,
        each group of cells is a quarter between streets. With streets, the entry ``front`` replaces
        ``step`` and ``repeated``: it is the mean share of built ground, 0…1, in a strip along the
        outlines of quarters. With streets, the entry ``forced`` counts quarters that stay open
        because no place of an original fits. The function ``progress`` is called with two numbers:
        the number of finished tiles, and the number of all tiles.
        """
        top, left, height, width = self._rectangle(top, left, height, width)
        top, left = top - self.place[0], left - self.place[1]
        ends = -(-(top + height) // self.cell), -(-(left + width) // self.cell)
        return self.plane.account(top // self.cell, left // self.cell, *ends, progress)

    def repeats(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> int:
        """Count the different windows of 64 × 64 px that appear more than once in a rectangle.
        Windows that repeat within the originals do not count. The count takes about 24 bytes of
        memory per pixel."""
        top, left, height, width = self._rectangle(top, left, height, width)
        keys = window_keys(self.window(top, left, height, width), WINDOW).ravel()
        keys.sort()
        twice = np.unique(keys[1:][keys[1:] == keys[:-1]])
        return int((~np.isin(twice, self.plane.windows.allowed)).sum())

    def genome(
        self,
        top: int = 0,
        left: int = 0,
        height: int | None = None,
        width: int | None = None,
        *,
        repair: float | None = 0.5,
        reach: int | None = 24,
        domains: Sequence[int] = (2,),
    ) -> Genome:
        """Make a genome of a rectangle of the fabric. Inside a group of cells, each lifs keeps its
        place.

        A domain block moves and turns together with its range block. Near the border of a group or
        of the rectangle, a domain block may cover fabric that differs from the original. Collage
        repair gives damaged range blocks new domain blocks within the distance ``reach``, as in
        every operator. A range block is damaged if its decoded heights differ by more than
        ``repair`` metres (root mean square) from the heights that `window` returns. If ``repair``
        is None, the method does not repair the genome.

        The lifs keep the fields ``parent`` and ``source`` of the originals. The genome has the
        condensation of the first original. Decoding and repair take about 170 bytes of memory per
        pixel.

        Raises `OperatorError` if the rectangle cuts cells, or if repeated halving of the originals'
        range blocks never gives the side of a cell.
        """
        rectangle = self._rectangle(top, left, height, width, whole=True)
        made = {**self.made, **self.account(*rectangle)}
        made["corner"] = [
            (at - by) // self.cell for at, by in zip(self.place, rectangle, strict=False)
        ]
        sources = self.sources(*rectangle).values()
        genome = lay_lifs(self.originals, self.cell, *sources).replace(
            origin=self._origin_of(*rectangle[:2]),
            crs=self.crs,
            made=made,
            condensation=self._condensation(*rectangle),
        )
        if repair is None:
            return genome
        intended = self.window(*rectangle)
        genome, repaired = collage_repair(
            genome, intended, threshold=repair, reach=reach, domains=domains
        )
        return genome.replace(made={**made, "repaired": repaired})

    def _rectangle(self, top, left, height, width, whole=False) -> tuple[int, int, int, int]:
        height = self.shape[0] if height is None else height
        width = self.shape[1] if width is None else width
        return _rectangle(top, left, height, width, whole)

    def _cells(self, top: int, left: int, height: int, width: int) -> tuple[int, int, int, int]:
        """Convert a rectangle to cells of the first original: top, left, bottom, right."""
        cell, (y, x) = self.cell, self.place
        if (top - y) % cell or (left - x) % cell or height % cell or width % cell:
            rows, columns = (f"{at % cell} + n · {cell}" for at in (y, x))
            raise OperatorError(
                f"growth: a rectangle of {height} × {width} px at row {top}, column {left} "
                "does not consist of whole cells",
                f"height and width in multiples of {cell} px, the row {rows} and the column "
                f"{columns}, with any whole number n",
                "choose a rectangle of whole cells",
            )
        top, left = (top - y) // cell, (left - x) // cell
        return top, left, top + height // cell, left + width // cell

    def _origin_of(self, top: int, left: int) -> tuple[float, float] | None:
        """Compute the place on Earth of a pixel's north-west corner."""
        if self.originals[0].origin is None:
            return None
        x, y = self.originals[0].origin
        down, along = (
            (at - by) * self.metres_per_pixel
            for at, by in zip(self.place, (top, left), strict=True)
        )
        return x - along, y + down

    def _condensation(self, top: int, left: int, height: int, width: int) -> Condensation | None:
        """Cut the first original's condensation to a rectangle."""
        layer = self.originals[0].condensation
        if layer is None:
            return None
        y, x = self.place[0] - top, self.place[1] - left
        if (y, x, height, width) == (0, 0, *layer.shape):
            return layer
        raster = np.full((height, width), np.nan, np.float32)
        paste(raster, layer.raster, y, x)
        return None if np.isnan(raster).all() else Condensation.from_raster(raster)


def _rectangle(top, left, height, width, whole=False) -> tuple[int, int, int, int]:
    """Check a rectangle of the plane, or raise `OperatorError`; ``whole``: it becomes a map."""
    faults = {}
    for name, at in {"top": top, "left": left}.items():
        if not is_whole(at) or abs(at) > FARTHEST:
            faults[setting(name, at)] = f"{name} a whole number, at most 2⁵⁰ from 0"
    for name, side in {"height": height, "width": width}.items():
        if not is_whole(side) or not whole <= side <= MAX_SIDE:
            faults[setting(name, side)] = f"{name} {int(whole)} to {MAX_SIDE}"
    if faults:
        raise OperatorError(
            f"growth: the rectangle is out of range: {', '.join(faults)}",
            f"a rectangle within these limits, in pixels: {', '.join(faults.values())}",
            "choose a rectangle within these limits; neighbouring rectangles fit together",
        )
    if height * width > MAX_PIXELS:
        raise OperatorError(
            f"growth: {setting('height', height)}, {setting('width', width)}: "
            f"{height * width / 1e6:.0f} million px are too many for one map",
            f"a map of at most {MAX_PIXELS // 10**6} million px, for example 11 500 × 11 500 px",
            "write several smaller rectangles; neighbouring rectangles fit together",
        )
    return int(top), int(left), int(height), int(width)


def lay_lifs(
    parents: Sequence[Genome],
    cell: int,
    which: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
    iso: np.ndarray,
) -> Genome:
    """Lay a genome from the parents' lifs, cell by cell of ``cell`` px, see `laid` with
    ``carried``: int ``(rows, columns)`` are the parent at each cell, the cell of that parent, the
    isometry.

    Raises `OperatorError` for range blocks that do not halve to the cells, and for a map smaller
    than a domain block.
    """
    bare = [parent.replace(condensation=None) for parent in parents]
    largest = max(int(max(parent.dx.max(), parent.dy.max())) for parent in parents)
    if largest > min(which.shape) * cell:
        raise OperatorError(
            f"growth: the genome has only {which.shape[0] * cell} × {which.shape[1] * cell} px",
            f"height and width of at least {largest} px, the side of the largest domain block",
            "choose a larger height and width",
        )
    try:
        child = laid(bare, Pieces(cell, which, row, column, iso), carried=True).genome
    except GenomeError as error:
        sides = " and ".join(str(p.pavement.finest) for p in parents)
        raise OperatorError(
            f"growth in cells of {cell} px: {error.found}",
            "range blocks that give whole cells by repeated halving",
            f"set {keyword('cell')} to a multiple of {sides} px, or encode the maps again",
        ) from None
    return merged(child, max(parent.pavement.coarsest for parent in parents))
