"""Colours of heights, values and changes, mixed in OKLab so that steps look even."""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.pictures.change import STOPS

PAPER = (250, 248, 244)
GROUND = (241, 238, 231)
INK = (52, 48, 46)
FAINT = (128, 121, 114)
# Where a field has no value: grey, bluer than ground.
NOTHING = (196, 202, 209)

# From the lowest roof to the highest, each step as much darker as the one before (OKLab).
_RAMP = ("#edd5ae", "#e8b682", "#de9262", "#cb6b54", "#a94a56", "#7c355c", "#4e2655", "#241741")


def ramp(heights: np.ndarray, highest: float) -> np.ndarray:
    """Colours of ``heights`` (metres, any shape ``(H, W)``): uint8 ``(H, W, 3)``.

    Ground is pale; from `BUILT_ABOVE` on, colours darken evenly up to ``highest`` metres and
    stay there above. Traces lower than a building are drawn fainter. About 0.5 ms at 256².
    """
    table = _table(max(float(highest), 2 * BUILT_ABOVE))
    steps = np.minimum(heights * ((len(table) - 1) / max(float(highest), 2 * BUILT_ABOVE)), 1023)
    return table.take(steps.astype(np.int16), axis=0)


def scale_end(*cities: CityMap, share: float = 0.98) -> float:
    """A round number of metres to end the colour scale of maps: above nearly all roofs of each.

    A single tower does not turn the rest pale: the scale ends below it if it is more than
    twice as high as a ``share`` of what is built on its map.
    """
    return max((_end(city, share) for city in cities), default=10.0)


def _end(city: CityMap, share: float) -> float:
    roofs = city.heights[city.built]
    if not roofs.size:
        return 10.0
    usual, top = float(np.quantile(roofs, share)), float(roofs.max())
    end = usual if top > 2 * usual else top
    step = 5 if end <= 50 else 10 if end <= 150 else 50
    return float(max(10, step * math.ceil(end / step)))


def even(values: np.ndarray, end: float) -> np.ndarray:
    """Colours of ``values`` ``(H, W)``, pale at 0, dark at ``end`` and above, grey where NaN."""
    colours = gradient(("#" + bytes(GROUND).hex(), *_RAMP))(np.clip(values / end, 0, 1))
    colours[np.isnan(values)] = NOTHING
    return colours


def change_colours(values: np.ndarray, end: float) -> np.ndarray:
    """Colours of changes, metres, any shape: blue for less, pale at 0, red for more, as strong as
    they get at ``end``; uint8, a last axis of 3 longer."""
    return gradient(STOPS)(np.clip((values / end + 1) / 2, 0, 1))


def gradient(stops: Sequence[str]) -> Callable[[np.ndarray], np.ndarray]:
    """What gives each share of 0…1, any shape, its colour between the ``stops``, ``#rrggbb``, that
    lie evenly: uint8, a last axis of 3 longer."""
    ends = oklab(np.array([rgb(text) for text in stops]) / 255)
    where, steps = np.linspace(0, 1, len(stops)), np.linspace(0, 1, 1024)
    between = np.column_stack([np.interp(steps, where, channel) for channel in ends.T])
    table = np.round(srgb(between) * 255).astype(np.uint8)
    return lambda shares: table[np.round(np.nan_to_num(shares) * 1023).astype(np.int16)]


@lru_cache(8)  # many pictures are on one scale
def _table(highest: float) -> np.ndarray:
    """Uint8 ``(1024, 3)``: colours from 0 to ``highest`` metres, mixed in OKLab."""
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
    """The numbers of "#rrggbb", 0 to 255 each."""
    return tuple(bytes.fromhex(text[1:]))


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
    """OKLab of sRGB colours from 0 to 1, a last axis of 3 (Ottosson 2020)."""
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return np.cbrt(linear @ _TO_LMS.T) @ _TO_LAB.T


def srgb(lab: np.ndarray) -> np.ndarray:
    """sRGB colours from 0 to 1 of `oklab`, the nearest there are."""
    linear = (lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_LMS).T
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


__all__ = [
    "FAINT",
    "GROUND",
    "INK",
    "NOTHING",
    "PAPER",
    "change_colours",
    "even",
    "gradient",
    "oklab",
    "ramp",
    "rgb",
    "scale_end",
    "srgb",
]
