"""Light from the north-west: shadows that roofs cast, and the edges of roofs."""

import math

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap

# The light comes from the north-west and falls 2 m in 1 m; its shadows, metres, end here.
_LIGHT_FALL, _LONGEST_SHADOW = 2.0, 40.0
_SHADE = np.array([70, 66, 92], np.float32)


def lit(city: CityMap, colours: np.ndarray, zoom: int) -> np.ndarray:
    """``colours`` ``(H·zoom, W·zoom, 3)`` of a city with cast shadows and roof edges."""
    heights = city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1)
    depth = _shadow_depth(heights, city.metres_per_pixel / zoom)
    dark = np.clip(softened(depth, 0.6 * zoom**0.5) / 4, 0, 1)
    tint = np.where(heights <= BUILT_ABOVE, np.float32(0.24), np.float32(0.14)) * dark
    roofs = edges(heights) if zoom > 1 else None
    found = np.empty(colours.shape, np.uint8)
    for channel, shade in enumerate(_SHADE):  # a plane each: numpy is slow along an axis of three
        plane = colours[..., channel].astype(np.float32)
        plane += (shade - plane) * tint
        if roofs is not None:
            plane[roofs] *= 0.78
        found[..., channel] = np.round(plane)
    return found


def softened(field: np.ndarray, sigma: float) -> np.ndarray:
    """A float32 ``field`` under a Gaussian of ``sigma`` pixels, mirrored at its edges: bit for bit
    what `scipy.ndimage.gaussian_filter` makes, which takes a fifth of a second to load."""
    reach = int(4 * sigma + 0.5)
    weights = np.exp(-0.5 / sigma**2 * np.arange(-reach, reach + 1) ** 2)
    weights /= weights.sum()
    for _ in range(2):  # along rows, then along columns
        line = np.pad(field, ((reach, reach), (0, 0)), mode="symmetric").astype(np.float64)
        end = line.shape[0] - reach
        soft = line[reach:end] * weights[reach]
        for k in range(reach, 0, -1):
            soft += (line[reach - k : end - k] + line[reach + k : end + k]) * weights[reach - k]
        field = soft.astype(np.float32).T
    return field


def _shadow_depth(heights: np.ndarray, side: float) -> np.ndarray:
    """Metres by which each point lies below the light that passes its north-west neighbours."""
    fall = side * math.sqrt(2) * _LIGHT_FALL  # metres the light falls in one diagonal step
    highest = min(float(heights.max(initial=0)), _LONGEST_SHADOW * _LIGHT_FALL)
    roof = np.zeros_like(heights)
    for step in range(1, min(int(highest / fall) + 1, min(heights.shape) - 1) + 1):
        cast = heights[:-step, :-step] - np.float32(step * fall)
        np.maximum(roof[step:, step:], cast, out=roof[step:, step:])
    return np.maximum(roof - heights, 0)


def edges(heights: np.ndarray) -> np.ndarray:
    """Bool: the last pixels of a roof before a drop of a storey or more."""
    found = np.zeros(heights.shape, dtype=bool)
    for axis in (0, 1):
        drop = np.diff(heights, axis=axis)
        first = [slice(None)] * 2
        last = [slice(None)] * 2
        first[axis], last[axis] = slice(None, -1), slice(1, None)
        found[tuple(first)] |= drop < -2
        found[tuple(last)] |= drop > 2
    return found


__all__ = ["edges", "lit", "softened"]
