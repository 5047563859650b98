"""`Growth`: what was grown, as heights of any window, as a map, as a genome."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evocity import isometries
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.growth._kernels import fabric_window
from evocity.operators.repair import collage_repair
from evocity.pavement import Pavement


def _lays() -> np.ndarray:
    table = np.empty((isometries.COUNT, 6), np.int64)
    for row, sources in zip(table, isometries.sources(2), strict=True):
        corner, east, south, _ = (np.array(divmod(int(flat), 2)) for flat in sources)
        row[:] = [*corner, *(south - corner), *(east - corner)]
    table.setflags(write=False)
    return table


#: How each isometry lays a rectangle: int64 ``(8, 6)``. Its target's north-west pixel comes from
#: the source's first (0) or last (1) row and column; then (rows, columns) to go in the source for
#: a step south in the target, and for one east.
LAYS = _lays()


@dataclass(frozen=True, eq=False)
class Growth:
    """A fabric grown from an original, as `grow` returns it.

    It holds no heights but the original's: four bytes a range block say what stands there, and
    any window is drawn from that. So it can be far larger than what memory holds as a map.

    original : the genome it grew from.
    heights : float32, the original's decoded map.
    pavement : of the whole fabric.
    corner : (row, column) of the original's north-west range block in it.
    stones : int32 ``(rows, columns)``: 8·lifs + isometry of the lifs of the original that is
        laid at each range block.
    steps : float64, mean step along the outline of each group laid, metres.
    made : how it came about: parameters, and what was reached.
    """

    original: Genome
    heights: np.ndarray
    pavement: Pavement
    corner: tuple[int, int]
    stones: np.ndarray
    steps: np.ndarray
    made: Mapping

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in pixels."""
        return self.pavement.height, self.pavement.width

    @property
    def metres_per_pixel(self) -> float:
        return self.original.metres_per_pixel

    @property
    def name(self) -> str:
        return f"{' × '.join(self.original.cities)}, grown"

    @property
    def attribution(self) -> str:
        return self.original.attribution

    @property
    def crs(self) -> str | None:
        return self.original.crs

    @property
    def origin(self) -> tuple[float, float] | None:
        """North-west corner: such that the original lies where it lay."""
        if self.original.origin is None:
            return None
        x, y = self.original.origin
        down, along = (side * self.pavement.block * self.metres_per_pixel for side in self.corner)
        return x - along, y + down

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Float32 ``(height, width)`` heights, metres, from pixel (top, left) on.

        Raises `OperatorError` if the window reaches beyond the fabric.
        """
        tall, wide = self.shape
        if min(top, left, height, width) < 0 or top + height > tall or left + width > wide:
            raise OperatorError(
                f"a window of {height} × {width} px at row {top}, column {left}",
                f"one inside the fabric of {tall} × {wide} px",
                "ask for windows that end at its border",
            )
        out = np.empty((height, width), np.float32)
        block = self.pavement.block
        fabric_window(self.stones, self.heights, LAYS, block, top, left, out)
        return out

    def city(self) -> CityMap:
        """The whole fabric as a map: four bytes a pixel, and as much again for each view."""
        return CityMap(
            self.window(0, 0, *self.shape),
            self.metres_per_pixel,
            name=self.name,
            attribution=self.attribution,
            origin=self.origin,
            crs=self.crs,
        )

    def genome(
        self,
        *,
        repair: float | None = 0.5,
        reach: int | None = 24,
        domains: Sequence[int] = (2,),
    ) -> Genome:
        """The fabric as a genome: its lifs stand in their groups, domain blocks carried along.

        A domain block keeps its place beside its range block, turned with the group; where
        the group's border or the fabric's cuts it off, what it covers is another city than it
        was, and the block crumbles. Collage repair then brings the blocks that decode further
        than ``repair`` metres (root mean square) from `window` back to it, searching in
        ``domains`` within ``reach``, as for every operator; None leaves them.

        ``parent`` and ``source`` are those of the original's lifs. What the original condenses
        is condensed in its place alone. The whole map is decoded and searched: some 170 bytes
        a pixel.
        """
        one, pavement = self.original, self.pavement
        lifs, iso = self.stones.ravel() >> 3, (self.stones & 7).ravel()
        x, y, dx, dy = self._carried(lifs, iso)
        turned = isometries.COMPOSITION[iso, one.iso[lifs]]
        turned = isometries.COMPOSITION[turned, isometries.INVERSE[iso]]
        genome = Genome(
            pavement,
            sigma=one.sigma[lifs],
            beta=one.beta[lifs],
            x=x,
            y=y,
            dx=dx,
            dy=dy,
            iso=np.where(one.uniform[lifs], 0, turned).astype(np.uint8),
            parent=one.parent[lifs],
            source=one.source[lifs],
            metres_per_pixel=one.metres_per_pixel,
            cities=one.cities,
            sigma_max=one.sigma_max,
            attribution=one.attribution,
            origin=self.origin,
            crs=one.crs,
            made=self.made,
            condensation=self._condensation(),
        )
        if repair is None:
            return genome
        intended = self.window(0, 0, *self.shape)
        genome, repaired = collage_repair(
            genome, intended, threshold=repair, reach=reach, domains=domains
        )
        return genome.replace(made={**self.made, "repaired": repaired})

    def _carried(self, lifs: np.ndarray, iso: np.ndarray) -> tuple[np.ndarray, ...]:
        """Domain blocks ``(x, y, dx, dy)`` of the lifs laid, where their groups bring them;
        moved inside the fabric if they would reach beyond."""
        one, block = self.original, self.pavement.block
        corner_y, corner_x = (corner[lifs].astype(np.int64) for corner in one.pavement.corners)
        top, left = (corner.astype(np.int64) for corner in self.pavement.corners)
        origin_y, origin_x, down_y, down_x, along_y, along_x = LAYS[iso].T
        # from the source's pixel that the target's north-west one shows, to the domain's two ends
        from_y, from_x = corner_y + origin_y * (block - 1), corner_x + origin_x * (block - 1)
        tall, wide = one.dy[lifs].astype(np.int64), one.dx[lifs].astype(np.int64)
        near_y, near_x = one.y[lifs] - from_y, one.x[lifs] - from_x
        far_y, far_x = near_y + tall - 1, near_x + wide - 1
        y = top + np.minimum(near_y * down_y + near_x * down_x, far_y * down_y + far_x * down_x)
        x = left + np.minimum(
            near_y * along_y + near_x * along_x, far_y * along_y + far_x * along_x
        )
        swapped = down_y == 0
        dy, dx = np.where(swapped, wide, tall), np.where(swapped, tall, wide)
        y, x = (
            np.where(one.uniform[lifs], 0, np.clip(corner, 0, side - extent))
            for corner, extent, side in ((y, dy, self.shape[0]), (x, dx, self.shape[1]))
        )
        return tuple(column.astype(np.int16) for column in (x, y, dx, dy))

    def _condensation(self) -> Condensation | None:
        """The original's layer, in its place."""
        layer = self.original.condensation
        if layer is None or layer.shape == self.shape:
            return layer
        raster = np.full(self.shape, np.nan, np.float32)
        top, left = (side * self.pavement.block for side in self.corner)
        raster[top : top + layer.shape[0], left : left + layer.shape[1]] = layer.raster
        return Condensation.from_raster(raster)
