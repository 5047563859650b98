"""Thumbnails: births as small maps in the log, shown without decoding."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pyarrow as pa
from pydantic import ConfigDict, Field

from evocity.citymap import MAX_SIDE, CityMap

#: Cells of a thumbnail along its longer side, at most. Maps of no more pixels have none: they
#: decode as fast.
LONGEST = 128

# The most rows that are summed one after the other.
_FEW = 8
_STEPS = 255  # of heights


@dataclass(frozen=True)
class Thumbnails:
    """How the thumbnails of a log are made: mean heights of cells of ``pixels`` × ``pixels`` of the
    map, smaller in the last row and column, in 255ths of ``metres``, rounded, at most
    ``metres``."""

    pixels: Annotated[int, Field(ge=2, le=MAX_SIDE)]
    metres: Annotated[float, Field(gt=0, le=float(np.finfo(np.float32).max))]

    __pydantic_config__ = ConfigDict(strict=True, extra="forbid")

    @classmethod
    def of(cls, height: int, width: int, metres: float) -> "Thumbnails | None":
        """Return those of maps of ``height`` × ``width`` px up to ``metres``; None for small
        maps."""
        pixels = -(-max(height, width) // LONGEST)
        return cls(pixels, float(metres)) if pixels > 1 else None

    def shape(self, height: int, width: int) -> tuple[int, int]:
        """Return the rows and columns of a thumbnail of a map of ``height`` × ``width`` px."""
        return -(-height // self.pixels), -(-width // self.pixels)

    def packed(self, city: CityMap) -> bytes:
        """Return the thumbnail of a ``city``: a byte per cell, row by row from the north-west."""
        means = city.heights
        for axis, size in enumerate(city.shape):
            starts = np.arange(0, size, self.pixels)
            counts = np.diff(starts, append=size).astype(np.float32)
            sums = _sums(means, self.pixels, axis)
            means = sums / (counts[:, None] if axis == 0 else counts)
        steps = np.rint(np.minimum(means / np.float32(self.metres), 1) * np.float32(_STEPS))
        return steps.astype(np.uint8).tobytes()

    def unpacked(self, content: bytes, height: int, width: int, metres_per_pixel: float) -> CityMap:
        """Return the map of cells of a thumbnail, of a map of ``height`` × ``width`` px."""
        steps = np.frombuffer(content, np.uint8).reshape(self.shape(height, width))
        heights = steps * np.float32(self.metres / _STEPS)
        return CityMap(heights, metres_per_pixel * self.pixels)


def _sums(values: np.ndarray, step: int, axis: int) -> np.ndarray:
    """Sum every ``step`` rows (axis 0) or columns (axis 1), and those left over, with the bits of
    `np.add.reduceat`, which is slow on few."""
    size = values.shape[axis]
    if step > _FEW or size % step:
        return np.add.reduceat(values, np.arange(0, size, step), axis=axis)
    lines = values if axis == 0 else values.T
    rest = lines[1::step].copy()  # numpy sums all but the first before
    for k in range(2, step):
        rest += lines[k::step]
    sums = lines[0::step] + rest
    return sums if axis == 0 else sums.T


def thumbnail_fields(header) -> list[tuple[str, pa.DataType]]:
    """Return the column of births of a log with thumbnails; none for other logs."""
    if header.thumbnails is None:
        return []
    rows, columns = header.thumbnails.shape(header.height, header.width)
    return [("thumbnail", pa.binary(rows * columns))]


def thumbnail_columns(births: Sequence, header) -> dict[str, list]:
    """Return this column of ``births``: null where nothing was decoded."""
    return {} if header.thumbnails is None else {"thumbnail": [one.thumbnail for one in births]}
