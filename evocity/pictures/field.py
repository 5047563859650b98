"""What a picture shows besides heights: `Field`, `Shares`, `Leaves`, `Faces`, and `Change` of two
cities."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.citymap import STOREY, CityMap
from evocity.errors import EvocityError
from evocity.pavement import Pavement

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
    """Shares of several parts, for example source cities, in each pixel of a city.

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
class Leaves:
    """Range blocks of a genome, together with a map on which they are drawn.

    city : the map, usually the decoded map of the genome; its name and attribution go into every
        picture.
    pavement : the range blocks, for a map of the same size as the city.
    """

    city: CityMap
    pavement: Pavement

    @property
    def title(self) -> str:
        p = self.pavement
        sides = f"{p.block}" if p.uniform else f"{p.finest}…{p.coarsest}"
        return f"{len(p)} range blocks of {sides} px"


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces between the streets of a map, with the ground on which buildings may stand.

    city : the map on which the faces are drawn; its name and attribution go into every picture.
    labels : int32 ``(H, W)``, the face of each pixel, 1…n; 0 on the axes of streets.
    lots : int32 ``(H, W)``, the face of each pixel in a lot (ground where buildings may stand); 0
        elsewhere.
    centres : float64 ``(n, 2)``, row and column of the middle of each face, px.
    angles : float64 ``(n,)``, direction of the walls in each face, radians from east towards south;
        NaN for a face without walls.
    """

    city: CityMap
    labels: np.ndarray
    lots: np.ndarray
    centres: np.ndarray
    angles: np.ndarray

    @property
    def title(self) -> str:
        return f"{len(self.angles)} faces between streets"


@dataclass(frozen=True, eq=False)
class Change:
    """The difference in height between two cities, metres; above 0 where the second city is higher
    than the first.

    Raises `EvocityError` if the two maps differ in the number or the size of their pixels.
    """

    first: CityMap
    second: CityMap

    def __post_init__(self):
        first, second = ((*city.shape, city.metres_per_pixel) for city in (self.first, self.second))
        if first != second:
            text = "{} × {} px of {:g} m"
            raise EvocityError(
                f"the maps have different grids, {text.format(*first)} and {text.format(*second)}",
                "two maps with the same number and size of pixels",
                "compare two maps of one run, or read both with the same window and pixels",
            )

    @cached_property
    def metres(self) -> np.ndarray:
        """Difference of heights, ``(H, W)``, metres."""
        return self.second.heights - self.first.heights

    @cached_property
    def end(self) -> float:
        """End of the colour scale, metres, above nearly all differences; 1 if the maps are
        equal."""
        sizes = abs(self.metres[self.metres != 0])
        return float(np.quantile(sizes, 0.98)) if sizes.size else 1.0

    @cached_property
    def apart(self) -> float:
        """Share of the map that differs by more than a storey."""
        return float(np.mean(abs(self.metres) > STOREY))

    @cached_property
    def attribution(self) -> str:
        """The attributions of both cities."""
        lines = filter(None, (self.first.attribution, self.second.attribution))
        return "; ".join(dict.fromkeys(lines))
