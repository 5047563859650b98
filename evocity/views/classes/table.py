"""The table of classes: which limits of area, height and shape make an object of a class."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from evocity.errors import MapError, add_near_miss, spell
from evocity.views.limit_tables import (
    Box,
    Feature,
    LimitTable,
    TableFormat,
    intersection,
    read_only,
    remainder,
)

#: What a table may limit.
FEATURES: Mapping[str, Feature] = {
    "area": Feature("m²", math.inf, 100.0),
    "height": Feature("m", math.inf, 9.0),
    "roundness": Feature("", 1.0, 0.5),
    "slenderness": Feature("", math.inf, 0.9),
}
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}\Z")


@dataclass(frozen=True, eq=False)
class ClassTable(LimitTable):
    """Classes of objects, each with one box of limits or several; the first that matches wins.

    `ClassTable.read` reads a file, `ClassTable.of` its text.

    entries : name and box of each ``[[class]]``; a row of a box is a feature of `FEATURES`.
    colours : the sRGB colour of each class, ``#rrggbb``, in the order of `names`.
    """

    FORMAT: ClassVar = TableFormat(
        *("class", "classes", "an object", "colours", FEATURES, MapError),
        'for example height = { from = 3, below = 20 } under [[class]] name = "tree"',
    )
    colours: tuple[str, ...]

    @classmethod
    def of(cls, text: str | bytes) -> "ClassTable":
        """Read the table from its TOML ``text``.

        Each ``[[class]]`` has a ``name`` and limits, ``FEATURE = { from = LOWEST, below = END }``:
        the lowest value belongs to the class, the end does not. Limits and features may be left
        out. An object has the class of the first entry that takes it; a class may have several
        entries. ``[colours]`` gives each class its sRGB colour, ``"#rrggbb"``.

        Raises `MapError` for parts, features or colours that do not exist, for numbers below 0 or
        NaN, if no entry takes some object, and if earlier entries leave nothing to an entry.
        """
        document = cls.FORMAT.document(text)
        table = cls(cls.FORMAT.entries(document), ())
        _check_entries(table)
        cls.FORMAT.check_gaps(
            table.entries, "let the last entry take all that is left, with only a name"
        )
        return cls(table.entries, _colours(document.get("colours"), table.names))

    @cached_property
    def rgb(self) -> np.ndarray:
        """Uint8 ``(k, 3)``: `colours` as numbers."""
        return read_only(np.array([list(bytes.fromhex(c[1:])) for c in self.colours], np.uint8))


@cache
def packaged() -> ClassTable:
    """Read the table of this package, ``evocity/data/classes.toml``."""
    return ClassTable.read(Path(__file__).parents[2] / "data" / "classes.toml")


def _colours(colours: object, names: tuple[str, ...]) -> tuple[str, ...]:
    example = f'for example {names[0]} = "#8fa1b3" under [colours]'
    if not isinstance(colours, Mapping):
        found = "no [colours]" if colours is None else f"colours = {spell(colours)}"
        raise MapError(found, "[colours] with a colour for each class", example)
    for name, colour in colours.items():
        if name not in names:
            raise MapError(
                add_near_miss(f"the colour of {name}, which is not a class", name, names),
                f"colours of {', '.join(names)}",
                "correct the name, or take it out",
            )
        if not (isinstance(colour, str) and _COLOUR.match(colour)):
            raise MapError(
                f"{name} = {spell(colour)} under [colours]",
                "sRGB as # and six hexadecimal digits",
                example,
            )
    missing = [name for name in names if name not in colours]
    if missing:
        raise MapError(
            f"no colour for {', '.join(missing)}", "one for each class under [colours]", example
        )
    return tuple(colours[name].lower() for name in names)


def _check_entries(table: ClassTable) -> None:
    """Raise if an entry takes nothing: no object has such features, or earlier entries take all."""
    for k, (name, box) in enumerate(table.entries):
        found = f"entry {k + 1}, class {name}, takes nothing"
        if not _is_possible(box):
            raise MapError(
                f"{found}: no object has {table.FORMAT.describe_box(box)}",
                "limits that some object can meet; slenderness is height divided by √area",
                "correct the limits of this entry, or remove the entry",
            )
        if remainder(box, [earlier for _, earlier in table.entries[:k]]) is None:
            first = [
                f"{j} ({other})"
                for j, (other, earlier) in enumerate(table.entries[:k], 1)
                if intersection(box, earlier) is not None
            ]
            raise MapError(
                f"{found}: earlier entries, {', '.join(first)}, include all objects of this entry",
                "an entry with some objects that no earlier entry includes",
                "move this entry before the earlier entries, narrow the earlier entries, or "
                "remove this entry",
            )


def _is_possible(box: Box) -> bool:
    """Whether some object lies in a ``box``: slenderness follows from height and area."""
    (area, height, _, slender), (area_end, height_end, _, slender_end) = box
    least = height / math.sqrt(area_end) if math.isfinite(area_end) else 0.0
    most = height_end / math.sqrt(area) if area > 0 else math.inf
    return slender < most and least < slender_end
