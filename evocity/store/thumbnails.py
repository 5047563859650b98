"""Thumbnails: births as small maps in the log. Many are looked at, and none need be decoded."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pyarrow as pa
from pydantic import ConfigDict, Field

from evocity.citymap import MAX_SIDE, CityMap

#: Cells of a thumbnail along its longer side, at most. A map of no more pixels has none: it is
#: decoded as soon.
LONGEST = 128

_STEPS = 255  # of heights


@dataclass(frozen=True)
class Thumbnails:
    """How the thumbnails of a log are made: mean heights of cells of ``pixels`` × ``pixels`` of the
    map, of what is left of it in the last row and column, in 255ths of ``metres``, rounded; what is
    higher is told as high as that."""

    pixels: Annotated[int, Field(ge=2, le=MAX_SIDE)]
    metres: Annotated[float, Field(gt=0, le=float(np.finfo(np.float32).max))]

    __pydantic_config__ = ConfigDict(strict=True, extra="forbid")

    @classmethod
    def of(cls, height: int, width: int, metres: float) -> "Thumbnails | None":
        """Those of maps of ``height`` × ``width`` px whose colours end at ``metres``; None if the
        maps are small."""
        pixels = -(-max(height, width) // LONGEST)
        return cls(pixels, float(metres)) if pixels > 1 else None

    def shape(self, height: int, width: int) -> tuple[int, int]:
        """Cells of a thumbnail of a map of ``height`` × ``width`` px, rows and columns."""
        return -(-height // self.pixels), -(-width // self.pixels)

    def packed(self, city: CityMap) -> bytes:
        """The thumbnail of a ``city``: a byte a cell, row by row, the first in the north-west."""
        means = city.heights
        for axis, size in enumerate(city.shape):
            starts = np.arange(0, size, self.pixels)
            counts = np.diff(starts, append=size).astype(np.float32)
            sums = np.add.reduceat(means, starts, axis=axis)
            means = sums / (counts[:, None] if axis == 0 else counts)
        steps = np.rint(np.minimum(means / np.float32(self.metres), 1) * np.float32(_STEPS))
        return steps.astype(np.uint8).tobytes()

    def unpacked(self, content: bytes, height: int, width: int, metres_per_pixel: float) -> CityMap:
        """`packed` the other way round: a map of cells, of a map of ``height`` × ``width`` px."""
        steps = np.frombuffer(content, np.uint8).reshape(self.shape(height, width))
        heights = steps * np.float32(self.metres / _STEPS)
        return CityMap(heights, metres_per_pixel * self.pixels)


def thumbnail_fields(header) -> list[tuple[str, pa.DataType]]:
    """The column of births in runs by a ``header`` whose log has thumbnails; else none."""
    if header.thumbnails is None:
        return []
    rows, columns = header.thumbnails.shape(header.height, header.width)
    return [("thumbnail", pa.binary(rows * columns))]


def thumbnail_columns(births: Sequence, header) -> dict[str, list]:
    """This column of ``births``: null of those of which nothing was decoded."""
    return {} if header.thumbnails is None else {"thumbnail": [one.thumbnail for one in births]}


__all__ = ["LONGEST", "Thumbnails", "thumbnail_columns", "thumbnail_fields"]
