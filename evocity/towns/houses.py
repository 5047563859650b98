"""Houses along the edges of blocks, and checks of the parameters of drawn towns."""

import math
from collections.abc import Sequence

import numpy as np
import scipy

from evocity.citymap import MAX_PIXELS, MAX_SIDE, STOREY, CityMap
from evocity.errors import MapError, check_number, is_number, is_whole, setting

#: The least area of a piece of houses, m²: smaller ones are slivers where lots meet, or at the
#: border.
SMALLEST = 30.0

#: The greatest length of a town, metres.
LONGEST = 1e6


def keys(*parts: np.ndarray) -> np.ndarray:
    """Number each pixel's combination of ``parts``, whole numbers from −1 up."""
    key = np.zeros(np.broadcast_shapes(*(np.shape(part) for part in parts)), np.int64)
    for part in parts:
        part = np.asarray(part, np.int64) + 1
        key = key * (int(part.max()) + 1) + part
    return key


def build_town(
    name: str,
    inside: np.ndarray,
    lots: np.ndarray,
    level: np.ndarray,
    depth: float,
    storeys: Sequence[int],
    metres_per_pixel: float,
    rng: np.random.Generator | None,
) -> CityMap:
    """Build houses along the edges of blocks, as a map called ``name``.

    inside : ``(H, W)``, metres from a block's edge inwards, below 0 in a street.
    lots : int ``(H, W)``, the number of the house at each pixel.
    level : ``(H, W)``, 0…1, from the lowest to the highest house; a house has the mean.
    depth : of the houses, metres; with ``rng`` up to a quarter more or less.
    """
    _, lots = np.unique(lots, return_inverse=True)
    lots = lots.reshape(inside.shape)
    count = np.bincount(lots.ravel())
    mean = np.bincount(lots.ravel(), np.broadcast_to(level, inside.shape).ravel()) / count
    deep = np.full(count.size, float(depth))
    if rng is not None:
        deep *= rng.uniform(0.75, 1.25, count.size)
    heights = height_of(mean, storeys, rng)
    built = (inside >= 0) & (inside < deep[lots])
    pieces, _ = scipy.ndimage.label(built)
    small = np.bincount(pieces.ravel()) < SMALLEST / metres_per_pixel**2
    return CityMap(np.where(built & ~small[pieces], heights[lots], 0), metres_per_pixel, name=name)


def height_of(
    level: np.ndarray | float, storeys: Sequence[int], rng: np.random.Generator | None
) -> np.ndarray:
    """Compute the height of houses of a ``level``, 0…1, metres; ``rng`` varies it by a storey."""
    low, high = storeys
    count = np.round(low + (high - low) * np.clip(level, 0, 1))
    if rng is not None:
        count = count + rng.integers(-1, 2, np.shape(level))
    return STOREY * np.maximum(count, 1)


def check_town(
    pixels: int, metres_per_pixel: float, rng: object, storeys: Sequence[int], **lengths: float
) -> float:
    """Return the side of the requested map, metres. Raises `MapError` unless ``lengths`` are
    numbers of metres, a pixel or more, and ``storeys`` of the lowest and the highest house."""
    most = min(MAX_SIDE, math.isqrt(MAX_PIXELS))
    check("pixels", pixels, is_whole(pixels) and 1 <= pixels <= most, f"a whole number, 1…{most}")
    right = is_number(metres_per_pixel) and 0 < metres_per_pixel <= LONGEST
    check("metres_per_pixel", metres_per_pixel, right, f"metres, above 0, at most {LONGEST:g}")
    check("rng", rng, rng is None or isinstance(rng, np.random.Generator), "a numpy Generator")
    for name, length in lengths.items():
        expected = f"metres, from the side of a pixel, {metres_per_pixel:g}, to {LONGEST:g}"
        remedy = f"correct {name}, or choose smaller pixels"
        check_number(name, length, metres_per_pixel, LONGEST, expected, MapError, remedy)
    pair = isinstance(storeys, Sequence) and len(storeys) == 2 and all(map(is_whole, storeys))
    right = pair and 1 <= storeys[0] <= storeys[1] <= 300
    check("storeys", storeys, right, "two whole numbers 1…300, the lowest and the highest")
    return float(pixels * metres_per_pixel)


def check(name: str, value: object, right: bool, expected: str) -> None:
    """Raise `MapError` about the ``value`` of a parameter unless it is ``right``."""
    if not right:
        raise MapError(setting(name, value), expected, f"correct {name}, or leave it out")
