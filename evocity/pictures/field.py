"""Values on a city's grid other than heights: `Field`, `Shares`, and `Change` of two cities."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.citymap import STOREY, CityMap
from evocity.errors import EvocityError

#: Colours of less, of no difference, of more.
STOPS = ("#3f74a3", "#f1eee7", "#b0403f")


@dataclass(frozen=True, eq=False)
class Field:
    """A number for each pixel of a city.

    city : the city whose grid the values use; its name and attribution go into every file and
        picture.
    values : float32 ``(H, W)``, finite, 0 or more; NaN for missing values.
    title : a few words about the values.
    symbol : the title of the colour scale.
    unit : the unit of the values; "" for a plain number.
    """

    city: CityMap
    values: np.ndarray
    title: str
    symbol: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Shares:
    """Shares of several parts in each pixel of a city.

    city : the city whose grid the shares use; its name and attribution go into every picture.
    weights : the shares, float32 ``(H, W, n)``, each 0 to 1. The shares of a pixel add up to 1.
    parts : the names of the n parts, in the order of the last axis of ``weights``.
    title : a few words about the shares.
    """

    city: CityMap
    weights: np.ndarray
    parts: Sequence[str]
    title: str


@dataclass(frozen=True, eq=False)
class Change:
    """The difference of two cities in metres, above 0 where the second city is higher than the
    first.

    Raises `EvocityError` if the two maps have different grids of pixels.
    """

    first: CityMap
    second: CityMap

    def __post_init__(self):
        grids = [
            f"{city.shape[0]} × {city.shape[1]} px of {city.metres_per_pixel:g} m"
            for city in (self.first, self.second)
        ]
        if self.first.shape != self.second.shape or (
            self.first.metres_per_pixel != self.second.metres_per_pixel
        ):
            raise EvocityError(
                f"the maps have different grids, {grids[0]} and {grids[1]}",
                "two maps with the same number and size of pixels",
                "compare two maps of one run, or read both with the same window and pixels",
            )

    @cached_property
    def metres(self) -> np.ndarray:
        """The difference, ``(H, W)``, metres."""
        return self.second.heights - self.first.heights

    @cached_property
    def end(self) -> float:
        """Metres at which colours end, above nearly all differences; 1 without differences."""
        sizes = abs(self.metres[self.metres != 0])
        return float(np.quantile(sizes, 0.98)) if sizes.size else 1.0

    @cached_property
    def apart(self) -> float:
        """Share of the map that differs by over a storey."""
        return float(np.mean(abs(self.metres) > STOREY))

    @cached_property
    def attribution(self) -> str:
        """The attributions of both cities."""
        lines = filter(None, (self.first.attribution, self.second.attribution))
        return "; ".join(dict.fromkeys(lines))
