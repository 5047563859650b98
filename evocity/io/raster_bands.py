"""Bands of rows of maps that may be too large for memory."""

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

# Rows of a band, as of the tiles of a GeoTIFF.
_ROWS = 256


class WindowSource(Protocol):
    """A map that may be too large for memory, and gives windows of itself."""

    shape: tuple[int, int]
    metres_per_pixel: float
    name: str
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Compute float32 ``(height, width)``, metres, from pixel (top, left) on."""
        ...


def bands(
    what: WindowSource, progress: Callable[[int, int], None] | None = None
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the map from north to south, as (first row, heights) of bands of its width; calls
    ``progress`` with (done, total), rows."""
    height, width = what.shape
    for top in range(0, height, _ROWS):
        rows = min(_ROWS, height - top)
        yield top, what.window(top, 0, rows, width)
        if progress is not None:
            progress(top + rows, height)
