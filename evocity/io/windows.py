"""Maps that may be too large to be held, a band of rows at a time."""

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

# Rows of a band: those of the tiles of a GeoTIFF.
_ROWS = 256


class Windowed(Protocol):
    """A map that may be too large to be held: it is asked for its windows."""

    shape: tuple[int, int]
    metres_per_pixel: float
    name: str
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Float32 ``(height, width)``, metres, from pixel (top, left) on."""
        ...


def bands(
    what: Windowed, progress: Callable[[int, int], None] | None = None
) -> Iterator[tuple[int, np.ndarray]]:
    """The map from north to south, as (first row, heights) of bands as wide as it is; ``progress``
    is called with (done, total), rows."""
    height, width = what.shape
    for top in range(0, height, _ROWS):
        rows = min(_ROWS, height - top)
        yield top, what.window(top, 0, rows, width)
        if progress is not None:
            progress(top + rows, height)


__all__ = ["Windowed", "bands"]
