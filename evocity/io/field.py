"""`Field`: values on a city's grid that are no heights."""

from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap


@dataclass(frozen=True, eq=False)
class Field:
    """One number a pixel of a city.

    city : whose grid it is; its name and attribution go into every file and picture.
    values : float32 ``(H, W)``, finite, 0 or more.
    title : what the values are, a few words.
    symbol : the same for a colour scale.
    unit : of the values; "" for a plain number.
    """

    city: CityMap
    values: np.ndarray
    title: str
    symbol: str
    unit: str = ""


__all__ = ["Field"]
