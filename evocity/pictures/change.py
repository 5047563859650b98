"""`Change`: what one city has more and less than another on the same grid."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError

#: Metres by which two heights differ that differ by a storey.
STOREY = 3.0
#: Colours of less, of no difference, of more.
STOPS = ("#3f74a3", "#f1eee7", "#b0403f")


@dataclass(frozen=True, eq=False)
class Change:
    """What ``second`` has more (above 0) and less (below) than ``first``, metres.

    Raises `EvocityError` for maps that do not lie on each other.
    """

    first: CityMap
    second: CityMap

    def __post_init__(self):
        if len({(one.shape, one.metres_per_pixel) for one in (self.first, self.second)}) > 1:
            sizes = [
                f"{one.shape[0]} × {one.shape[1]} px of {one.metres_per_pixel:g} m"
                for one in (self.first, self.second)
            ]
            raise EvocityError(
                f"maps of {sizes[0]} and of {sizes[1]}",
                "two maps with as many pixels of one size",
                "compare two of one run, or read both with the same window and pixels",
            )

    @cached_property
    def metres(self) -> np.ndarray:
        """``(H, W)``."""
        return self.second.heights - self.first.heights

    @cached_property
    def end(self) -> float:
        """Metres at which colours end, above nearly all that differs; 1 where nothing does."""
        sizes = abs(self.metres[self.metres != 0])
        return float(np.quantile(sizes, 0.98)) if sizes.size else 1.0

    @cached_property
    def apart(self) -> float:
        """Share of the map that differs by over a storey."""
        return float(np.mean(abs(self.metres) > STOREY))

    @cached_property
    def attribution(self) -> str:
        return "; ".join(
            dict.fromkeys(filter(None, (self.first.attribution, self.second.attribution)))
        )


__all__ = ["STOPS", "STOREY", "Change"]
