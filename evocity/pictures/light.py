"""Light from the north-west: cast shadows, and the edges of roofs."""

import math

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap

# The fall of the light, metres in 1 m, and the greatest length of shadows, metres.
_LIGHT_FALL, _LONGEST_SHADOW = 2.0, 40.0
_SHADE = np.array([70, 66, 92], np.float32)


def add_light(city: CityMap, colours: np.ndarray, zoom: int) -> np.ndarray:
    """Add cast shadows and roof edges to ``colours`` ``(H·zoom, W·zoom, 3)`` of a city."""
    heights = city.heights
    if zoom > 1:
        heights = heights.repeat(zoom, axis=0).repeat(zoom, axis=1)
    depth = _shadow_depth(heights, city.metres_per_pixel / zoom)
    tint = blur(depth, 0.6 * zoom**0.5)
    tint /= 4
    np.minimum(tint, 1, out=tint)
    tint *= np.where(heights <= BUILT_ABOVE, np.float32(0.24), np.float32(0.14))
    roofs = edges(heights) if zoom > 1 else None
    shaded, change = np.empty(colours.shape, np.uint8), np.empty_like(tint)
    for channel, shade in enumerate(_SHADE):  # numpy is slow along an axis of three
        plane = colours[..., channel].astype(np.float32)
        np.subtract(shade, plane, out=change)
        change *= tint
        plane += change
        if roofs is not None:
            plane[roofs] *= 0.78
        plane += 0.5  # rounds where the cast truncates
        shaded[..., channel] = plane
    return shaded


def blur(field: np.ndarray, sigma: float) -> np.ndarray:
    """Blur a float32 ``field`` by a Gaussian of ``sigma`` pixels, mirrored at its edges, as
    `scipy.ndimage.gaussian_filter` does, whose import takes a fifth of a second."""
    reach = int(4 * sigma + 0.5)
    weights = np.exp(-0.5 / sigma**2 * np.arange(-reach, reach + 1) ** 2)
    weights = (weights / weights.sum()).astype(np.float32)
    for down in (True, False):
        around = ((reach, reach), (0, 0)) if down else ((0, 0), (reach, reach))
        line, size = np.pad(field, around, mode="symmetric"), field.shape[0 if down else 1]
        shifted = [
            line[k : k + size] if down else line[:, k : k + size] for k in range(2 * reach + 1)
        ]
        field = shifted[reach] * weights[reach]
        pair = np.empty_like(field)
        for k in range(reach, 0, -1):
            np.add(shifted[reach - k], shifted[reach + k], out=pair)
            pair *= weights[reach - k]
            field += pair
    return field


def _shadow_depth(heights: np.ndarray, side: float) -> np.ndarray:
    """Compute metres of each point below the light that passes its north-west neighbours."""
    fall = side * math.sqrt(2) * _LIGHT_FALL  # metres the light falls in one diagonal step
    highest = min(float(heights.max(initial=0)), _LONGEST_SHADOW * _LIGHT_FALL)
    roof, cast = np.zeros_like(heights), np.empty_like(heights)
    for step in range(1, min(int(highest / fall) + 1, min(heights.shape) - 1) + 1):
        here = cast[step:, step:]
        np.subtract(heights[:-step, :-step], np.float32(step * fall), out=here)
        np.maximum(roof[step:, step:], here, out=roof[step:, step:])
    roof -= heights
    return np.maximum(roof, 0, out=roof)


def edges(heights: np.ndarray) -> np.ndarray:
    """Mark the last pixels of a roof before a drop of a storey or more, bool."""
    found = np.zeros(heights.shape, dtype=bool)
    for axis in (0, 1):
        drop = np.diff(heights, axis=axis)
        first, last = [slice(None)] * 2, [slice(None)] * 2
        first[axis], last[axis] = slice(None, -1), slice(1, None)
        found[tuple(first)] |= drop < -2
        found[tuple(last)] |= drop > 2
    return found
