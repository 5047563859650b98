"""Rules for the height of a building, in the order in which they are tried.

1. ``height_column``: metres, from the column that the caller names.
2. ``levels_column``: storeys × 3 m, from the column that the caller names.
3. ``height``: metres, or a text as in OpenStreetMap ("12 m", "12,5", "11' 4\\"", "36 ft").
4. ``HAUTEUR`` of BD TOPO: metres from the ground to the eaves.
5. ``measuredHeight`` of CityJSON: metres.
6. ``solid``: metres from the lowest to the highest point of a solid.
7. ``levels``: storeys above ground × 3 m, from ``building:levels``, ``NB_ETAGES``,
   ``nombre_d_etages``, ``num_floors``, ``storeysAboveGround`` or ``levels``. ``roof:levels`` are
   not added: they lie under the slope of the roof, and the heights of rule 4 end at the eaves too.
8. ``default``: the height that the caller gives for missing ones.

No building is 0 m high: BD TOPO and others write 0 for "unknown". So a rule does not apply to 0,
negative numbers, NaN, heights over 1000 m and unreadable text. Names are compared without case,
``:`` and ``_`` alike, and as Shapefile cuts them after 10 letters. A list ("3;4") counts as its
largest number. A comma is a decimal comma in metres, and separates a list of storeys.

A height is that of the top above the building's own foot. A ``building:part`` that starts at a
``min_height`` stands on the ground here, as everything does on a map of heights; where part and
building overlap, the highest wins.
"""

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping

from evocity.citymap import STOREY
from evocity.errors import MapError, keyword, near_miss, setting

#: The greatest height of a building, metres; greater ones count as missing.
TALLEST = 1000.0

_FOOT = 0.3048
_DECIMAL = r"[0-9]+(?:[.,][0-9]+)?"
_METRES = re.compile(rf"({_DECIMAL})\s*(?:m|mtrs?|m[eèé]t(?:re|er|ro)s?)?\.?", re.IGNORECASE)
_FEET = re.compile(
    rf"({_DECIMAL})\s*(?:['′’]|ft\.?|feet|foot)"
    rf"\s*(?:({_DECIMAL})\s*(?:[\"″”]|''|′′|’’|in\.?|inch(?:es)?)?)?",
    re.IGNORECASE,
)

# rule -> the attributes it reads, normalised; those of ``levels`` count storeys
_RULES = {
    "height": ("height",),
    "HAUTEUR": ("hauteur",),
    "measuredHeight": ("measuredheight", "measuredhe"),
    "solid": ("solid_height",),
    "levels": (
        "building_levels",
        "building_l",
        "nb_etages",
        "nombre_d_etages",
        "nombre_d_e",
        "num_floors",
        "storeysaboveground",
        "storeysabo",
        "levels",
    ),
}
_LEVELS, _SOLID = "levels", "solid"

#: Names of the rules in their order.
RULES = ("height_column", "levels_column", *_RULES, "default")

# names of layers of buildings in several languages
_BUILDING_NAME = re.compile(
    r"build|footprint|b[aâ]ti|geb(ae|ä)ude|edific|edifíc|pand|edifici|budov|budyn|здан", re.I
)

# Attributes of a building whose foot is above the ground.
_FEET_ABOVE = ("min_height", "building_min_level", "building_m", "min_level", "min_floor")

#: Attributes that only buildings have; a layer with one of them is a layer of buildings.
BUILDING_FIELDS = frozenset(
    {"building", "building_part", "building_p"}.union(
        *(names for rule, names in _RULES.items() if rule != "height")
    )
    - {"levels"}
)


class HeightRules:
    """Rules for the heights of one file, with counts of how they were used.

    Parameters
    ----------
    default : height of buildings to which no rule applies, metres.
    height_column, levels_column : names of columns to try first, or None.
    unit : metres of a number without a unit, in columns of heights.

    Attributes
    ----------
    used : for each rule, the number of heights by this rule.
    remarks : for each remark in words, the number of heights to which the remark applies.
    """

    def __init__(
        self,
        default: float,
        height_column: str | None = None,
        levels_column: str | None = None,
        unit: float = 1.0,
    ):
        self._default, self._unit = default, unit
        self._columns = [
            (rule, column)
            for rule, column in zip(RULES, (height_column, levels_column), strict=False)
            if column is not None
        ]
        self.used: Counter[str] = Counter()
        self.remarks: Counter[str] = Counter()

    def apply(self, tags: Mapping[str, object]) -> float:
        """Find the height of a building, metres, and count the rule that gave it."""
        height, rule, value = self._first(tags)
        self.used[rule] += 1
        if isinstance(value, str):
            if ";" in value or (rule in ("levels", "levels_column") and "," in value):
                self.remarks["from the largest of a list"] += 1
            if "levels" not in rule and _FEET.fullmatch(_bare(re.split(";", value)[0])):
                self.remarks["in feet"] += 1
        known = {plain_name(name): value for name, value in tags.items()}
        if any(metres(known.get(name)) for name in _FEET_ABOVE):
            self.remarks["with a foot above the ground, which is not subtracted"] += 1
        return height

    def _first(self, tags: Mapping[str, object]) -> tuple[float, str, object]:
        """Return metres, rule and value of the first rule that applies."""
        known = {plain_name(name): value for name, value in tags.items()}
        for rule, column in self._columns:
            value = tags.get(column, known.get(plain_name(column)))
            height = self._height(value, rule == "levels_column", self._unit)
            if height is not None:
                return height, rule, value
        for rule, names in _RULES.items():
            for name in names:
                value = known.get(name)
                unit = 1.0 if rule == _SOLID else self._unit
                height = self._height(value, rule == _LEVELS, unit)
                if height is not None:
                    return height, rule, value
        return self._default, "default", None

    @staticmethod
    def _height(value: object, is_storeys: bool, unit: float) -> float | None:
        if value is None:
            return None
        number = storeys(value) if is_storeys else metres(value, unit)
        if number is None:
            return None
        height = number * STOREY if is_storeys else number
        return height if height <= TALLEST else None

    @property
    def note(self) -> str:
        """The rules with their counts, in plain words; "" without a height."""
        names = dict(self._columns)
        parts = [
            f"{self.used[rule]} by default"
            if rule == "default"
            else f"{self.used[rule]} from {names.get(rule, rule)}"
            for rule in RULES
            if rule in self.used
        ]
        parts += [f"{count} of them {remark}" for remark, count in self.remarks.items()]
        return ", ".join(parts)


def height_of(tags: Mapping[str, object], default_height: float) -> tuple[float, str]:
    """Find the height of a building, metres, and the rule that gave it."""
    height, rule, _ = HeightRules(default_height)._first(tags)
    return height, rule


def inherit(own: Mapping[str, object], above: Iterable[Mapping[str, object]]) -> dict[str, object]:
    """Return the tags of a part of a building with those of its ancestors ``above``, the nearest
    first. A part with a height of its ``own`` inherits no height."""
    inherited: dict[str, object] = {}
    for tags in above:
        inherited = {**tags, **inherited}
    if height_of(own, 0.0)[1] != "default":
        inherited = without_heights(inherited)
    return {**inherited, **own}


def without_heights(tags: Mapping[str, object]) -> dict[str, object]:
    """Leave out the tags that a rule for heights reads."""
    return {
        key: value for key, value in tags.items() if height_of({key: value}, 0.0)[1] == "default"
    }


def metres(value: object, unit: float = 1.0) -> float | None:
    """Parse ``value`` as a positive length, metres; None for any other value. A number without a
    unit counts ``unit`` metres; a list counts as its largest length."""
    if isinstance(value, str):
        return _largest(_length(_bare(part), unit) for part in value.split(";"))
    return _positive(None if isinstance(value, bool) else value, unit)


def storeys(value: object) -> float | None:
    """Parse ``value`` as a positive number of storeys; None for any other value. A list counts as
    its largest number."""
    if isinstance(value, str):
        return _largest(_positive(_bare(part)) for part in re.split("[;,]", value))
    return _positive(None if isinstance(value, bool) else value)


def _bare(text: str) -> str:
    return text.strip().lstrip("~").strip()


def _largest(numbers: Iterable[float | None]) -> float | None:
    return max((number for number in numbers if number is not None), default=None)


def _length(text: str, unit: float) -> float | None:
    if match := _FEET.fullmatch(text):
        return _positive(_FOOT * (_number(match[1]) + _number(match[2] or "0") / 12))
    if match := _METRES.fullmatch(text):
        bare = text.rstrip(".")[-1:].isdigit()
        return _positive(_number(match[1]), unit if bare else 1.0)
    return _positive(text, unit)  # what is written like 1.2e1


def _positive(value: object, unit: float = 1.0) -> float | None:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return None
    return number * unit if math.isfinite(number * unit) and number > 0 else None


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def plain_name(name: str) -> str:
    """Normalise an attribute's name: lower case, ``_`` for ``:``."""
    return str(name).lower().replace(":", "_")


def has_building_fields(names: Iterable[str]) -> bool:
    """Tell whether the ``names`` of columns include one that only buildings have, beside
    ``building`` and ``building:part``."""
    only = BUILDING_FIELDS - {"building", "building_part", "building_p"}
    return any(plain_name(name) in only for name in names)


def is_building_name(title: object) -> bool:
    """Tell whether the ``title`` of a layer names buildings, in one of several languages."""
    return isinstance(title, str) and bool(_BUILDING_NAME.search(title))


def check_columns(
    name: str, columns: Collection[str], requested: tuple[str | None, str | None]
) -> None:
    """Raise `MapError` unless a table with ``columns``, of the file ``name``, has at most one
    column for each name of a height rule. ``requested`` are the columns of heights and of storeys
    that the caller names; they settle the choice of a column of heights, and of one of storeys."""
    height_column, levels_column = requested
    if height_column is not None:
        return
    rules = [rule for rule in _RULES if rule != _LEVELS or levels_column is None]
    for plain in sorted({one for rule in rules for one in _RULES[rule]}):
        same = [column for column in columns if plain_name(column) == plain]
        if len(same) > 1:
            raise MapError(
                f"{name} has two columns of heights: {', '.join(map(repr, same[:4]))}",
                f"one column that reads {plain!r} in lower case",
                f"name the right column with {keyword('height_column', same[0])}"
                + (f" or {keyword('levels_column', same[0])}" if levels_column is None else ""),
            )


def check_requested(name: str, columns: Collection[str], option: str, column: str) -> None:
    """Raise `MapError` unless the file ``name`` with ``columns`` has the ``column`` that the
    ``option`` names."""
    if column in columns or plain_name(column) in map(plain_name, columns):
        return
    listed = ", ".join(sorted(map(str, columns))[:20]) or "no columns"
    near = near_miss(column, map(str, columns))
    raise MapError(
        f"{name} has no column for {setting(option, column)}",
        f"one of the file's columns: {listed}",
        near or f"correct {keyword(option)}, or leave it out",
    )


def is_building(tags: Mapping[str, object]) -> bool:
    """Tell whether OpenStreetMap tags describe a building or a part of a building."""
    values = (tags.get("building"), tags.get("building:part"))
    return any(value not in (None, "", "no", False) and value == value for value in values)
