"""The table of building types: which limits of area, height and shape make a building of a type."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from evocity.errors import FitnessError, add_near_miss, spell
from evocity.views.limit_tables import Feature, LimitTable, TableFormat, is_number, toml

#: What a table may limit.
FEATURES: Mapping[str, Feature] = {
    "area": Feature("m²", math.inf, 100.0),
    "height": Feature("m", math.inf, 9.0),
    "party_walls": Feature("", 1.0, 0.0),
    "courts": Feature("", math.inf, 0.0),
    "elongation": Feature("", 1.0, 0.7),
}
#: Parts that recipes have, and tables of types have not.
_RECIPE_PARTS = frozenset(
    ("run", "map", "parents", "genome", "operators", "fitness", "locked", "evaluation", "search")
)


class _Format(TableFormat):
    def check_parts(self, document: Mapping) -> None:
        recipe = [name for name in document if name in _RECIPE_PARTS]
        if "fitness" in document or len(recipe) > 1:
            raise FitnessError(
                f"this file is a recipe, because it has the sections {', '.join(recipe)}",
                "a table of building types, with [[type]] and [shares]",
                "run the recipe with evocity run, or give a table of types in place of the recipe",
            )
        super().check_parts(document)


@dataclass(frozen=True, eq=False)
class TypeTable(LimitTable):
    """Types of buildings, each with one or more sets of limits; every building has exactly one
    type.

    The method `TypeTable.read` reads the table from a file, and `TypeTable.of` reads it from text.

    entries : name and limits of each ``[[type]]``; the rows of the limits follow the order of the
        list `FEATURES`.
    shares : desired share of each type in the built ground; the shares sum to 1. The attribute
        ``shares`` is None if the table of types has no section ``[shares]``.
    """

    FORMAT: ClassVar = _Format(
        *("type", "types", "a building", "shares", FEATURES, FitnessError),
        'for example height = { from = 10, below = 16 } under [[type]] name = "slab"',
    )
    shares: np.ndarray | None = None

    @classmethod
    def of(cls, text: str | bytes) -> "TypeTable":
        """Read the table from its TOML ``text``.

        Each section ``[[type]]`` has a ``name`` and limits of features; each limit is written as
        ``FEATURE = { from = LOWEST, below = END }``. The value LOWEST belongs to the type, and the
        value END does not; a limit may omit LOWEST or END. Entries with the same name form one
        type, which includes the buildings of all these entries. The section ``[shares]`` may give
        the desired share of each type in the built ground. If a table has only the section
        ``[shares]``, its types are the default types of evocity.

        Raises `FitnessError` if the document is not a table of types. The method `TypeTable.of`
        raises `FitnessError` if some building would have no type, or two types.
        """
        document = cls.FORMAT.document(text)
        only_shares = "shares" in document and "type" not in document
        table = packaged() if only_shares else cls(cls.FORMAT.entries(document))
        cls.FORMAT.check_overlaps(table.entries)
        cls.FORMAT.check_gaps(table.entries)
        return cls(table.entries, _shares(document.get("shares"), table.names))


def packaged() -> TypeTable:
    """Read the table of this package, ``evocity/data/building-types.toml``."""
    return TypeTable.read(Path(__file__).parent.parent / "data" / "building-types.toml")


def _shares(shares: object, names: tuple[str, ...]) -> np.ndarray | None:
    if shares is None:
        return None
    expected = "for each type a share of the built ground, 0 or more, with the sum 1"
    example = f"for example {names[0]} = {1 if len(names) == 1 else 0.6} under [shares]"
    if not isinstance(shares, dict):
        raise FitnessError(f"shares = {spell(shares)}", f"[shares], {expected}", example)
    faults = []
    for name, share in shares.items():
        if name not in names:
            faults.append(add_near_miss(f"{name}, which is not a type", name, names))
        if not is_number(share):
            faults.append(f"{name} = {toml(share)}")
    if faults:
        raise FitnessError(
            f"[shares] has {'; '.join(faults)}",
            f"{expected}; the types are {', '.join(names)}",
            f"correct [shares], {example}",
        )
    total = sum(shares.values())
    if not math.isclose(total, 1, abs_tol=1e-6):
        raise FitnessError(
            f"[shares] that sum to {total:g}",
            expected,
            "divide each by that sum" if 0 < total < math.inf else f"write them, {example}",
        )
    array = np.array([shares.get(name, 0.0) for name in names], float)
    return array / array.sum()
