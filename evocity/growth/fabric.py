"""`Growth`: what was grown, as heights of any window, as a map, as a genome."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.condensation import Condensation
from evocity.errors import OperatorError, setting
from evocity.genome import Genome, merged_cities
from evocity.growth._kernels import WINDOW, window_keys
from evocity.growth.lifs import lifs_laid
from evocity.growth.plane import Plane
from evocity.operators.repair import collage_repair

#: Rows and columns of an endless fabric are counted so far, pixels.
FARTHEST = 1 << 50


@dataclass(frozen=True, eq=False)
class Growth:
    """An endless fabric grown from one or several originals, as `grow` returns it.

    What stands at a place is a function of the seed and of the place alone. A window is laid
    when it is asked for, in any order and in any process; what was laid last is kept.

    originals : the genomes it grows from. The first stands in it; of all, groups are laid.
    plane : what stands where.
    shape : (H, W) in pixels of the map it is written as: a rectangle of the fabric.
    place : (row, column) of the first original's north-west pixel, counted, as all rows and
        columns are, from the north-west pixel of that rectangle.
    made : how it came about: parameters.
    """

    originals: tuple[Genome, ...]
    plane: Plane
    shape: tuple[int, int]
    place: tuple[int, int]
    made: Mapping

    @property
    def cell(self) -> int:
        """Side of the squares that are laid, pixels."""
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
        """North-west corner of the map: such that the first original lies where it lay."""
        return self._origin_of(0, 0)

    def at(self, top: int, left: int, height: int, width: int) -> "Growth":
        """The same fabric with another rectangle to be written; rows and columns are counted
        from its north-west pixel (top, left)."""
        top, left, height, width = _rectangle(top, left, height, width, whole=True)
        place = self.place[0] - top, self.place[1] - left
        return dataclasses.replace(self, shape=(height, width), place=place)

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Float32 ``(height, width)`` heights, metres, from pixel (top, left) on, wherever that
        lies; rows and columns may be negative."""
        top, left, height, width = _rectangle(top, left, height, width)
        return self.plane.window(top - self.place[0], left - self.place[1], height, width)

    def city(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> CityMap:
        """A rectangle as a map: four bytes a pixel, and as much again for each view. The whole
        map, if nothing is given."""
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
        """What stands where: of each cell of a rectangle, which ``original``, which ``row`` and
        ``column`` of its cells, and under which isometry ``iso``; int64 ``(rows, columns)`` each.

        Raises `OperatorError` for a rectangle that does not begin and end between two cells.
        """
        rectangle = self._rectangle(top, left, height, width)
        first, west, bottom, right = self._cells(*rectangle)
        stones = self.plane.stones(first, west, bottom, right).astype(np.int64)
        sides, index = self.plane.sides, stones >> 3
        one = np.searchsorted(sides[:, 2], index, side="right") - 1
        row, column = np.divmod(index - sides[one, 2], sides[one, 1])
        return {"original": one, "row": row, "column": column, "iso": stones & 7}

    def account(
        self,
        top: int = 0,
        left: int = 0,
        height: int | None = None,
        width: int | None = None,
        *,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict:
        """How well it was laid, over the tiles that a rectangle touches: ``groups``, their number;
        ``step``, the mean step along their outlines, metres; ``forced``, how many were laid
        without an admissible candidate (the least step was taken); ``repeated``, how many make
        a window of 64 px come twice among those known (every candidate did). ``progress`` is
        called with (done, total), counted in tiles."""
        top, left, height, width = self._rectangle(top, left, height, width)
        top, left = top - self.place[0], left - self.place[1]
        ends = -(-(top + height) // self.cell), -(-(left + width) // self.cell)
        return self.plane.account(top // self.cell, left // self.cell, *ends, progress)

    def repeats(
        self, top: int = 0, left: int = 0, height: int | None = None, width: int | None = None
    ) -> int:
        """How many windows of 64 × 64 px stand in a rectangle more than once, counted once each,
        and those left out that the originals repeat themselves. It takes some 24 bytes a pixel."""
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
        """A rectangle as a genome: its lifs stand in their groups, domain blocks carried along.

        A domain block keeps its place beside its range block, turned with the group; where
        the group's border or the rectangle's cuts it off, what it covers is another city than it
        was, and the block crumbles. Collage repair then brings the blocks that decode further
        than ``repair`` metres (root mean square) from `window` back to it, searching in
        ``domains`` within ``reach``, as for every operator; None leaves them.

        ``parent`` and ``source`` are those of the originals' lifs. What the first original
        condenses is condensed in its place alone. The rectangle is decoded and searched whole:
        some 170 bytes a pixel.

        Raises `OperatorError` for a rectangle that does not begin and end between two cells, and
        for originals whose range blocks are not of one side that divides the cell.
        """
        rectangle = self._rectangle(top, left, height, width, whole=True)
        stands = self.sources(*rectangle)
        made = {**self.made, **self.account(*rectangle)}
        made["corner"] = [
            (at - by) // self.cell for at, by in zip(self.place, rectangle, strict=False)
        ]
        genome = lifs_laid(
            self.originals, self.cell,
            stands["original"], stands["row"], stands["column"], stands["iso"],
        ).replace(
            origin=self._origin_of(*rectangle[:2]),
            crs=self.crs,
            made=made,
            condensation=self._condensation(*rectangle),
        )  # fmt: skip
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
        """The cells of a rectangle, from the first original's on: top, left, bottom, right."""
        cell, (y, x) = self.cell, self.place
        if (top - y) % cell or (left - x) % cell or height % cell or width % cell:
            rows, columns = (f"{at % cell} + n · {cell}" for at in (y, x))
            raise OperatorError(
                f"growth: a rectangle of {height} × {width} px at row {top}, column {left}",
                f"one of whole cells: sides that are multiples of {cell} px, row {rows}, "
                f"column {columns}",
                "choose such sides and such a place",
            )
        top, left = (top - y) // cell, (left - x) // cell
        return top, left, top + height // cell, left + width // cell

    def _origin_of(self, top: int, left: int) -> tuple[float, float] | None:
        """The place on Earth of a pixel's north-west corner."""
        if self.originals[0].origin is None:
            return None
        x, y = self.originals[0].origin
        down, along = (
            (at - by) * self.metres_per_pixel
            for at, by in zip(self.place, (top, left), strict=True)
        )
        return x - along, y + down

    def _condensation(self, top: int, left: int, height: int, width: int) -> Condensation | None:
        """What of the first original's layer lies in a rectangle, in its place."""
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
    """A rectangle of the plane, or `OperatorError`; ``whole``: it becomes a map."""
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
            "ask for another rectangle; several that meet fit each other",
        )
    if height * width > MAX_PIXELS:
        raise OperatorError(
            f"growth: {setting('height', height)}, {setting('width', width)}: "
            f"{height * width / 1e6:.0f} million px",
            f"at most {MAX_PIXELS // 10**6} million, about 11 500 × 11 500",
            "ask for several rectangles that meet: they fit each other",
        )
    return int(top), int(left), int(height), int(width)


def is_whole(value) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
