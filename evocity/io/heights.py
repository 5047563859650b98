"""Rules for the height of a building, in the order in which they are tried.

1. ``height``: metres, or an OpenStreetMap text ("12 m", "12,5", "40'", "40 ft").
2. ``HAUTEUR`` of BD TOPO: metres from the ground to the eaves.
3. ``measuredHeight`` of CityJSON: metres.
4. ``solid``: from the lowest to the highest point of a CityJSON solid, metres.
5. ``levels``: storeys above ground × 3 m, from ``building:levels``, ``NB_ETAGES`` or
   ``levels``. ``roof:levels`` are not added: they lie under the slope of the roof, and the
   heights of rule 2 end at the eaves too.
6. ``default``: the height that the caller gives for missing ones.

No building is 0 m high: BD TOPO and others write 0 for "unknown". So a rule does not apply to 0,
negative numbers, NaN, heights over 1000 m and unreadable text. Names are compared without case,
``:`` and ``_`` alike, and as Shapefile cuts them after 10 letters.

A ``building:part`` that starts at a ``min_height`` stands on the ground here, as everything does on
a map of heights; where part and building overlap, the highest wins.
"""

import math
import re
from collections.abc import Mapping

from evocity.citymap import STOREY

#: The greatest height of a building, metres; greater ones count as missing.
TALLEST = 1000.0

_FOOT = 0.3048
_METRES = re.compile(r"([0-9]+(?:[.,][0-9]+)?)\s*(?:m|metres?|meters?)?\.?", re.IGNORECASE)
_FEET = re.compile(
    r"([0-9]+(?:[.,][0-9]+)?)\s*(?:'|′|ft|feet|foot)\s*(?:([0-9]+(?:[.,][0-9]+)?)\s*(?:\"|″|in)?)?",
    re.IGNORECASE,
)

# rule -> the attributes it reads, normalised, and what one unit of them is in metres
_RULES = {
    "height": (("height",), 1.0),
    "HAUTEUR": (("hauteur",), 1.0),
    "measuredHeight": (("measuredheight", "measuredhe"), 1.0),
    "solid": (("solid_height",), 1.0),
    "levels": (("building_levels", "building_l", "nb_etages", "levels"), STOREY),
}

#: Names of the rules in their order.
RULES = (*_RULES, "default")

#: Attributes that only buildings have; a layer with one of them is a layer of buildings.
BUILDING_FIELDS = frozenset(
    {"building", "building_part", "building_p"}.union(
        *(names for rule, (names, _) in _RULES.items() if rule != "height")
    )
    - {"levels"}
)


def height_of(tags: Mapping[str, object], default_height: float) -> tuple[float, str]:
    """Find the height of a building, metres, and the rule that gave it."""
    known = {plain_name(name): value for name, value in tags.items()}
    for rule, (names, unit) in _RULES.items():
        for name in names:
            number = metres(known.get(name))
            if number is not None and number * unit <= TALLEST:
                return number * unit, rule
    return default_height, "default"


def metres(value: object) -> float | None:
    """Parse ``value`` as a positive number of metres; None for any other value."""
    if isinstance(value, str):
        number = _metres_in(value.strip().lstrip("~").lstrip())
    else:
        try:
            number = None if isinstance(value, bool) else float(value)
        except (TypeError, ValueError, OverflowError):
            number = None
    return number if number is not None and math.isfinite(number) and number > 0 else None


def _metres_in(text: str) -> float | None:
    if match := _METRES.fullmatch(text):
        return _number(match[1])
    if match := _FEET.fullmatch(text):
        return _FOOT * (_number(match[1]) + _number(match[2] or "0") / 12)
    try:
        return float(text)  # what is written like 1.2e1
    except ValueError:
        return None


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def plain_name(name: str) -> str:
    """Normalise an attribute's name: lower case, ``_`` for ``:``."""
    return str(name).lower().replace(":", "_")


def is_building(tags: Mapping[str, object]) -> bool:
    """Tell whether OpenStreetMap tags describe a building or a part of a building."""
    values = (tags.get("building"), tags.get("building:part"))
    return any(value not in (None, "", "no", False) and value == value for value in values)
