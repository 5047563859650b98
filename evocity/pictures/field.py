"""`Field`, `Shares`: values on a city's grid that are no heights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap


@dataclass(frozen=True, eq=False)
class Field:
    """One number a pixel of a city.

    city : whose grid it is; its name and attribution go into every file and picture.
    values : float32 ``(H, W)``, finite, 0 or more; NaN where there is no value.
    title : what the values are, a few words.
    symbol : the same for a colour scale.
    unit : of the values; "" for a plain number.
    """

    city: CityMap
    values: np.ndarray
    title: str
    symbol: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Shares:
    """How much of each pixel of a city belongs to each of several parts.

    city : whose grid it is; its name and attribution go into every picture.
    weights : float32 ``(H, W, n)``, 0…1, summing to 1 in each pixel.
    parts : n names, in the order of the last axis.
    title : what the shares are, a few words.
    """

    city: CityMap
    weights: np.ndarray
    parts: Sequence[str]
    title: str


__all__ = ["Field", "Shares"]
