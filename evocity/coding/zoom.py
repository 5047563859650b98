"""Legal zooms of a partition, and means between them for continuous levels of detail."""

from math import ceil, floor

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE
from evocity.errors import GenomeError, is_number, setting
from evocity.pavement import Pavement


def legal_zoom(pavement: Pavement, zoom: float) -> float:
    """Find the least zoom of ``zoom`` or more that makes all sides whole numbers of pixels, 2 or
    more. Raises `GenomeError` for an illegal zoom, or a map too large."""
    number = is_number(zoom)
    height, width = (side * zoom if number else 0 for side in (pavement.height, pavement.width))
    if not (number and 0 < zoom < np.inf and min(height, width) >= 1):
        raise GenomeError(
            setting("zoom", zoom),
            "a number above 0 that leaves the map one pixel or more",
            "use for example 2 for twice as many pixels along each side, or 0.5 for half",
        )
    steps = max(2, ceil(pavement.finest * zoom - 1e-9))
    legal = steps / pavement.finest
    height, width = (side * max(legal, zoom) for side in (pavement.height, pavement.width))
    if max(height, width) > MAX_SIDE or height * width > MAX_PIXELS:
        raise GenomeError(
            f"{setting('zoom', zoom)}: the map would have {height:.0f} × {width:.0f} px",
            f"sides of at most {MAX_SIDE} px, and at most {MAX_PIXELS // 10**6} million pixels in "
            "all",
            "choose a smaller zoom",
        )
    return legal


def zoomed_pavement(pavement: Pavement, zoom: float) -> Pavement:
    """Multiply the sides of a pavement by ``zoom``, a `legal_zoom`."""
    steps = round(pavement.finest * zoom)
    return pavement if steps == pavement.finest else pavement.scaled(steps, pavement.finest)


def zoomed_corner(corner: np.ndarray, zoom: float) -> tuple[np.ndarray, np.ndarray]:
    """Split ``corner`` on the zoomed map into whole pixels, int32, and a fraction, 0…1."""
    if zoom == 1:
        return corner.astype(np.int32), np.zeros(corner.size)
    exact = corner * zoom
    whole = np.floor(exact + 1e-9)
    return whole.astype(np.int32), np.maximum(np.round(exact - whole, 9), 0)


def area_means(raster: np.ndarray, step: float) -> np.ndarray:
    """Average a ``(H, W)`` raster over squares of ``step`` px, 1 or more, from the north-west
    corner on: float32 ``(⌊H / step⌋, ⌊W / step⌋)``. Pixels at rims count by area; an incomplete
    last square is omitted."""
    for axis in (0, 1):
        count = floor(raster.shape[axis] / step + 1e-9)
        sums = np.insert(np.cumsum(raster, axis=axis, dtype=np.float64), 0, 0, axis=axis)
        ends = np.minimum(np.arange(count + 1) * step, raster.shape[axis])
        whole = np.minimum(ends.astype(int), raster.shape[axis] - 1)
        share = (ends - whole)[:, None] if axis == 0 else ends - whole
        low, high = sums.take(whole, axis), sums.take(whole + 1, axis)
        raster = np.diff(low + share * (high - low), axis=axis) / step
    return raster.astype(np.float32)


def most_common(raster: np.ndarray, step: float) -> np.ndarray:
    """Find the most frequent value in each square of ``step`` px, 1 or more, of a ``(H, W)``
    raster; of equals the most north-western. Squares lie as in `area_means`, sampled at up to 8 × 8
    places. Returns ``(⌊H / step⌋, ⌊W / step⌋)``, of the raster's type."""
    height, width = (floor(side / step + 1e-9) for side in raster.shape)
    few = min(ceil(step), 8)
    within = (np.arange(few) + 0.5) / few
    rows, columns = (
        ((np.arange(count)[:, None] + within) * step).astype(int) for count in (height, width)
    )
    samples = raster[rows[:, None, :, None], columns[None, :, None, :]].reshape(-1, few * few)
    votes = np.zeros(samples.shape, np.int8)
    for place in range(samples.shape[1]):
        votes += samples == samples[:, place, None]
    return samples[np.arange(len(samples)), votes.argmax(axis=1)].reshape(height, width)
