"""The table of street kinds: limits of width and length, and what makes a place."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from evocity.errors import MapError, near_miss, spell
from evocity.views.limit_tables import Feature, LimitTable, TableFormat, is_number

#: What a table may limit.
FEATURES: Mapping[str, Feature] = {
    "width": Feature("m", math.inf, 8.0),
    "length": Feature("m", math.inf, 50.0),
}
#: Names of ground that has no limits of width and length.
RESERVED = ("place", "water")
_PLACE = ("width", "longest", "filled")


@dataclass(frozen=True, eq=False)
class StreetKinds(LimitTable):
    """Kinds of streets by width and length, and what makes a place.

    `StreetKinds.read` reads a file, `StreetKinds.of` its text.

    entries : name and box of each ``[[kind]]``; rows of a box are width and length, metres.
    place_width : a disc of this diameter, metres, has room at the middle of a place.
    place_longest : the highest ratio of length to breadth of a place.
    place_filled : the least share of its smallest rectangle that a place fills.
    """

    FORMAT: ClassVar = TableFormat(
        *("kind", "kinds of streets", "a street", "place", FEATURES, MapError),
        'for example width = { from = 9.75, below = 20 } under [[kind]] name = "street"',
        RESERVED,
    )
    place_width: float
    place_longest: float
    place_filled: float

    @classmethod
    def of(cls, text: str | bytes) -> "StreetKinds":
        """Read the table from its TOML ``text``.

        Each ``[[kind]]`` has a ``name`` and limits of ``width`` and ``length``, metres,
        ``{ from = LOWEST, below = END }``: the lowest value belongs to the kind, the end does not;
        each may be left out. ``[place]`` has ``width``, ``longest`` and ``filled``; values that it
        leaves out are those of this package.

        Raises `MapError` for a document that is not a table of kinds; and if some street has no
        kind, or two.
        """
        document = cls.FORMAT.document(text)
        entries = cls.FORMAT.entries(document)
        cls.FORMAT.check_overlaps(entries)
        cls.FORMAT.check_gaps(entries)
        return cls(entries, *_place(document.get("place", {})))

    def named(self, width: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Name the kind of each street by its ``width`` and ``length``, metres; str ``(n,)``."""
        return np.array(self.names)[self.classified(np.stack([width, length]))]


@cache
def packaged() -> StreetKinds:
    """Read the table of this package, ``evocity/data/street-kinds.toml``."""
    return StreetKinds.read(Path(__file__).parents[2] / "data" / "street-kinds.toml")


def _place(place: object) -> tuple[float, ...]:
    if not isinstance(place, Mapping):
        raise MapError(
            f"place = {spell(place)} is not a section",
            f"a section [place] with the keys {', '.join(_PLACE)}",
            "write a section [place] with these keys",
        )
    for name in place:
        if name not in _PLACE:
            raise MapError(
                f"{name} of [place]", ", ".join(_PLACE), near_miss(name, _PLACE) or "take it out"
            )
    if len(place) < len(_PLACE):
        usual = packaged()
        place = {name: getattr(usual, f"place_{name}") for name in _PLACE} | dict(place)
    lowest, highest = (0.0, 1.0, 0.0), (math.inf, math.inf, 1.0)
    for name, low, high in zip(_PLACE, lowest, highest, strict=True):
        if not (is_number(place[name]) and low <= place[name] <= high and place[name] > 0):
            raise MapError(
                f"the section [place] has the invalid value {name} = {spell(place[name])}",
                f"a number from {low:g} to {high:g}, above 0",
                f"correct the key {name}, or remove the key to use the default value",
            )
    return tuple(float(place[name]) for name in _PLACE)
