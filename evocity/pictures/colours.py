"""Colours of heights, values, changes and source cities, mixed in OKLab for even steps."""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.pictures.field import STOPS

PAPER = (250, 248, 244)
GROUND = (241, 238, 231)
INK = (52, 48, 46)
FAINT = (128, 121, 114)
# The colour of missing values of a field: grey, bluer than ground.
NOTHING = (196, 202, 209)

# From the lowest roof to the highest, in equal steps of lightness (OKLab).
_RAMP = ("#edd5ae", "#e8b682", "#de9262", "#cb6b54", "#a94a56", "#7c355c", "#4e2655", "#241741")

# Any two differ by .09 in OKLab at least, also for viewers with colour blindness (Machado, Oliveira
# & Fernandes 2009); the first two, most runs' parents, by .3.
_CITIES = (
    "#33699e",
    "#e2a33a",
    "#5fa98f",
    "#8a3a66",
    "#a5cbe8",
    "#c2603a",
    "#443e09",
    "#293898",
)
#: The colour of bare ground, which replaces omitted buildings and is not a city.
BARE = "#d9d2c6"
_VOID = "void"  # evocity.genome.VOID: genomes lie above pictures
#: The label of bare ground in a key.
VOID_LABEL = f"{_VOID} (bare ground)"


def ramp(heights: np.ndarray, highest: float) -> np.ndarray:
    """Colour ``heights`` (metres, ``(H, W)``): uint8 ``(H, W, 3)``. Ground is pale; from
    `BUILT_ABOVE` on, colours darken evenly up to ``highest`` metres and stay the same above. Traces
    lower than a building are fainter. About 0.5 ms at 256²."""
    table = _table(max(float(highest), 2 * BUILT_ABOVE))
    steps = np.minimum(heights * ((len(table) - 1) / max(float(highest), 2 * BUILT_ABOVE)), 1023)
    return table.take(steps.astype(np.int16), axis=0)


def scale_end(*cities: CityMap, share: float = 0.98) -> float:
    """Choose a round number of metres as the end of the colour scale of maps: above nearly all
    roofs of each map.

    A single tower does not make the rest pale: the scale ends below it if it is more than twice as
    high as a ``share`` of the built pixels of its map.
    """
    return max((_end(city, share) for city in cities), default=10.0)


def _end(city: CityMap, share: float) -> float:
    return roofs_end(city.heights[city.built], share)


def roofs_end(roofs: np.ndarray, share: float = 0.98) -> float:
    """Choose the end of the colour scale as `scale_end`, for the heights of ``roofs``, metres."""
    if not roofs.size:
        return 10.0
    top = end = float(roofs.max())
    # a quantile takes ten times as long, and only a map with a tower needs one
    if np.count_nonzero(roofs >= top / 2) < roofs.size - math.floor(share * (roofs.size - 1)):
        usual = float(np.quantile(roofs, share))
        end = usual if top > 2 * usual else top
    step = 5 if end <= 50 else 10 if end <= 150 else 50
    return float(max(10, step * math.ceil(end / step)))


def field_colours(values: np.ndarray, end: float) -> np.ndarray:
    """Colour ``values`` ``(H, W)``: pale at 0, dark at ``end`` and above, grey where NaN."""
    colours = gradient(("#" + bytes(GROUND).hex(), *_RAMP))(np.clip(values / end, 0, 1))
    colours[np.isnan(values)] = NOTHING
    return colours


def change_colours(values: np.ndarray, end: float) -> np.ndarray:
    """Colour changes, metres, any shape: blue for less, pale at 0, red for more, strongest at
    ``end``; uint8, with a last axis of 3 more."""
    return gradient(STOPS)(np.clip((values / end + 1) / 2, 0, 1))


def gradient(stops: Sequence[str]) -> Callable[[np.ndarray], np.ndarray]:
    """Make the function that colours shares of 0…1, any shape, between evenly spaced ``stops``,
    ``#rrggbb``: uint8, with a last axis of 3 more."""
    ends = oklab(np.array([rgb(text) for text in stops]) / 255)
    where, steps = np.linspace(0, 1, len(stops)), np.linspace(0, 1, 1024)
    between = np.column_stack([np.interp(steps, where, channel) for channel in ends.T])
    table = np.round(srgb(between) * 255).astype(np.uint8)
    return lambda shares: table[np.round(np.nan_to_num(shares) * 1023).astype(np.int16)]


@lru_cache(8)  # many pictures share a scale
def _table(highest: float) -> np.ndarray:
    """Mix the colours from 0 to ``highest`` metres in OKLab: uint8 ``(1024, 3)``."""
    stops = oklab(np.array([rgb(text) for text in _RAMP]) / 255)
    ground = oklab(np.array([GROUND]) / 255)
    at = np.linspace(BUILT_ABOVE, highest, len(stops))
    # a trace just under the threshold is half-way from the ground to the lowest roof
    where = np.concatenate([[0.0, BUILT_ABOVE * 0.999], at])
    colours = np.concatenate([ground, (ground + stops[:1]) / 2, stops])
    metres = np.linspace(0, highest, 1024)
    mixed = np.column_stack([np.interp(metres, where, channel) for channel in colours.T])
    return np.round(srgb(mixed) * 255).astype(np.uint8)


def rgb(text: str) -> tuple[int, ...]:
    """Parse "#rrggbb" as numbers, 0 to 255 each."""
    return tuple(bytes.fromhex(text[1:]))


def city_colours(cities: Sequence[str]) -> list[str]:
    """Return a colour ``#rrggbb`` for each city of a run or genome, in the order of the cities. The
    colours repeat if there are more cities than colours."""
    colours, place = [], 0
    for city in cities:
        bare = city in (_VOID, VOID_LABEL)
        colours.append(BARE if bare else _CITIES[place % len(_CITIES)])
        place += not bare
    return colours


# Ottosson, "A perceptual color space for image processing" (2020)
_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def oklab(srgb: np.ndarray) -> np.ndarray:
    """Convert sRGB colours from 0 to 1, with a last axis of 3, to OKLab (Ottosson 2020)."""
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return np.cbrt(linear @ _TO_LMS.T) @ _TO_LAB.T


def srgb(lab: np.ndarray) -> np.ndarray:
    """Convert colours of `oklab` to the nearest sRGB colours from 0 to 1."""
    linear = (lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_LMS).T
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
