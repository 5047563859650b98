"""The endless fabric `Growth`: heights of any window, maps, genomes."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.condensation import Condensation
from evocity.errors import GenomeError, OperatorError, keyword, setting
from evocity.genome import Genome, Pieces, laid, merged, merged_cities
from evocity.growth._kernels import WINDOW, window_keys
from evocity.growth.plane import Plane
from evocity.operators.repair import collage_repair

#: The largest row or column of an endless fabric, pixels.
FARTHEST = 1 << 50


@dataclass(frozen=True, eq=False)
class Growth:
    """Endless fabric that `grow` grows from one or several original genomes.

    The seed and the place determine the content of every place. So you may compute windows in any
    order and in any process. A cache keeps the last ones.

    originals : genomes that the fabric grows from. The first original appears in the fabric; groups
        come from all.
    plane : content of every place.
    shape : size ``(H, W)`` of the map to be written, px. This map is a rectangle of the fabric.
    place : (row, column) of the first original's north-west pixel. All rows and columns count from
        the north-west pixel of the map to be written.
    made : parameters of the growth.
    """

    originals: tuple[Genome, ...]
    plane: Plane
    shape: tuple[int, int]
    place: tuple[int, int]
    made: Mapping

    @property
    def cell(self) -> int:
        """Side of a cell, px. A cell is the square that groups consist of."""
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
        """Coordinates of the map's north-west corner. The first original keeps its place on
        Earth."""
        return self._origin_of(0, 0)

    def at(self, top: int, left: int, height: int, width: int) -> "Growth":
        """Return the same fabric with another rectangle to be written. Rows and columns then count
        from its north-west pixel (``top``, ``left``)."""
        top, left, height, width = _rectangle(top, left, height, width, whole=True)
        place = self.place[0] - top, self.place[1] - left
        return dataclasses.replace(self, shape=(height, width), place=place)

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Compute heights from the pixel (``top``, ``left``) on, float32 ``(height, width)``,
        metres. Rows and columns may be negative."""
        top, left, height, width = _rectangle(top, left, height, width)
        return self.plane.window(top - self.place[0], left - self.place[1], height, width)

    def city(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> CityMap:
        """Make a map of a rectangle, by default of the whole map to be written. The map takes four
        bytes per pixel, and each view takes as much again."""
        top, left, height, width = self._rectangle(top, left, height, width, whole=True)
        return CityMap(
            self.window(top, left, height, width),
            self.metres_per_pixel,
            name=self.name,
            attribution=self.attribution,
            origin=self._origin_of(top, left),
            crs=self.crs,
        )

    def sources(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> dict[str, np.ndarray]:
        """List the source of each cell of a rectangle: the number of its original, the cell's row
        and column there, and the isometry. Each is int64 ``(rows, columns)``.

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
        """Report the quality of the growth, over the tiles that a rectangle touches.

        The report has these entries. The entry ``groups`` is the number of groups. The entry
        ``step`` is the mean step along their outlines, metres. The entry ``forced`` counts groups
        without an admissible candidate; the candidate with the least step was used. The entry
        ``repeated`` counts groups that repeat a known window of 64 px, because every candidate did.
        The function ``progress`` is called with (done, total) tiles.
        """
        top, left, height, width = self._rectangle(top, left, height, width)
        top, left = top - self.place[0], left - self.place[1]
        ends = -(-(top + height) // self.cell), -(-(left + width) // self.cell)
        return self.plane.account(top // self.cell, left // self.cell, *ends, progress)

    def repeats(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> int:
        """Count the windows of 64 × 64 px that appear more than once in a rectangle, each window
        once. Windows that the originals repeat do not count. The count takes some 24 bytes per
        pixel."""
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
        """Make a genome of a rectangle. Each lifs keeps its place in its group, and its domain
        block.

        A domain block keeps its place relative to its range block, and turns with the group. If a
        border of the group or of the rectangle cuts the domain block, it covers other fabric, and
        the range block crumbles. Collage repair therefore matches some range blocks again: those
        that differ from `window` by more than ``repair`` metres (root mean square) after decoding.
        It searches domain blocks within ``reach``, as for every operator. None skips the repair.

        The lifs keep the ``parent`` and ``source`` of the originals' lifs. The first original keeps
        its condensation. Decoding and searching the rectangle take some 170 bytes per pixel.

        Raises `OperatorError` if the borders of the rectangle cut cells, or if halving the
        originals' range blocks does not lead to the cells.
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
                f"sides that are multiples of {cell} px, row {rows}, column {columns}",
                "choose these sides, row and column",
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
        within = raster[
            max(y, 0) : max(y + layer.shape[0], 0), max(x, 0) : max(x + layer.shape[1], 0)
        ]
        v, u = max(-y, 0), max(-x, 0)
        within[:] = layer.raster[v : v + within.shape[0], u : u + within.shape[1]]
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
            f"growth: {', '.join(faults)}",
            f"pixels: {', '.join(faults.values())}",
            "choose another rectangle; rectangles that meet fit each other",
        )
    if height * width > MAX_PIXELS:
        raise OperatorError(
            f"growth: {setting('height', height)}, {setting('width', width)}: "
            f"{height * width / 1e6:.0f} million px are too many",
            f"at most {MAX_PIXELS // 10**6} million px, about 11 500 × 11 500",
            "choose several rectangles that meet: they fit each other",
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
    """Lay a genome from the parents' lifs, cell by cell of ``cell`` px.

    which, row, column, iso : int ``(rows, columns)`` each: the parent at each cell, the cell of
        that parent, the isometry. Parents have one pixel size.

    A domain block keeps its place relative to its range block and turns with it; one that would
    leave the map moves inside. Leaves split where a group's border crosses them.

    Raises `OperatorError` for range blocks that do not halve to the cells, and for a map smaller
    than a domain block.
    """
    bare = [parent.replace(condensation=None) for parent in parents]
    largest = max(int(max(parent.dx.max(), parent.dy.max())) for parent in parents)
    if largest > min(which.shape) * cell:
        raise OperatorError(
            f"growth: the genome has only {which.shape[0] * cell} × {which.shape[1] * cell} px",
            f"sides of at least {largest} px, the side of its largest domain block",
            "choose a larger height and width",
        )
    try:
        child = laid(bare, Pieces(cell, which, row, column, iso), carried=True).genome
    except GenomeError as error:
        sides = " and ".join(str(p.pavement.finest) for p in parents)
        raise OperatorError(
            f"growth: {error.found}, in cells of {cell} px",
            "range blocks whose sides are halves of each other, in cells of whole range blocks",
            f"grow with {keyword('cell')} a multiple of {sides} px, or encode the maps again",
        ) from None
    return merged(child, max(parent.pavement.coarsest for parent in parents))


def is_whole(value) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
