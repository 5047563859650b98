"""`Pavement`: where the range blocks lie."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.errors import GenomeError


@dataclass(frozen=True)
class Pavement:
    """Jacquin's uniform square partition: range blocks of ``block`` px, row by row.

    Raises `GenomeError` where the map's sides are not multiples of the block.
    """

    height: int
    width: int
    block: int

    def __post_init__(self):
        if self.block < 2:
            raise GenomeError(
                f"block = {self.block}", "a range block of at least 2 px", "use for example block=4"
            )
        if self.height % self.block or self.width % self.block or min(self.height, self.width) < 1:
            fits = [
                f"{low} or {low + self.block}" if side % self.block else f"{side}"
                for side in (self.height, self.width)
                for low in [max(side // self.block, 1) * self.block]
            ]
            raise GenomeError(
                f"a map of {self.height} × {self.width} px for range blocks of {self.block} px",
                f"sides that are multiples of {self.block}: height {fits[0]}, width {fits[1]}",
                "crop or read the map at such a size, or choose another block",
            )

    @property
    def rows(self) -> int:
        return self.height // self.block

    @property
    def columns(self) -> int:
        return self.width // self.block

    def __len__(self) -> int:
        """Number of range blocks."""
        return self.rows * self.columns

    @cached_property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """(y, x) of each range block's north-west pixel, int32 ``(n,)`` each."""
        y, x = np.divmod(np.arange(len(self), dtype=np.int32), self.columns)
        return y * self.block, x * self.block

    def blocks(self, raster: np.ndarray) -> np.ndarray:
        """``(n, B, B)`` copy of a ``(H, W)`` raster cut along the pavement."""
        b = self.block
        cut = raster.reshape(self.rows, b, self.columns, b).swapaxes(1, 2)
        return np.ascontiguousarray(cut).reshape(len(self), b, b)

    def raster(self, blocks: np.ndarray) -> np.ndarray:
        """``(H, W)`` raster from ``(n, B, B)`` blocks, or from ``(n,)`` one value a block."""
        b = self.block
        if blocks.ndim == 1:
            return blocks.reshape(self.rows, self.columns).repeat(b, 0).repeat(b, 1)
        tiles = blocks.reshape(self.rows, self.columns, b, b).swapaxes(1, 2)
        return np.ascontiguousarray(tiles).reshape(self.height, self.width)
