"""A table of building types: which limits of area, height and shape make a building of a type."""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from evocity.errors import FitnessError, near_miss, shown, with_near_miss
from evocity.views.boxes import Box, corner_near, left_over, meet
from evocity.views.limits import is_number, parsed

#: What a table may set limits to: by name the unit, the highest value there is, and what a house
#: has, for examples.
FEATURES: Mapping[str, tuple[str, float, float]] = {
    "area": ("m²", math.inf, 100.0),
    "height": ("m", math.inf, 9.0),
    "party_walls": ("", 1.0, 0.0),
    "courts": ("", math.inf, 0.0),
    "elongation": ("", 1.0, 0.7),
}
#: Parts that recipes have, and tables of types have not.
_OF_RECIPES = frozenset(
    ("run", "map", "parents", "genome", "operators", "fitness", "locked", "evaluation", "search")
)
#: Most entries of a table.
MOST = 100

# Beyond the highest value, since the upper end of a box is not of it.
_ENDS = np.array([np.nextafter(highest, np.inf) for _, highest, _ in FEATURES.values()])
_SPACE = np.zeros(len(FEATURES)), _ENDS
_USUAL = [usual for _, _, usual in FEATURES.values()]
_PARTS = "[[type]] and [shares]"
_HOW = 'for example height = { from = 10, below = 16 } under [[type]] name = "slab"'


@dataclass(frozen=True, eq=False)
class TypeTable:
    """Types of buildings, each of one box of limits or several; every building is of one type.

    Made by `TypeTable.read` of a file, or `TypeTable.of` its text.

    entries : name and box of each ``[[type]]``; boxes are as in `FEATURES`, a row a feature.
    shares : what share of the built ground each type has where the table tells a distribution to
        come to, a number a type, together 1; None if it does not.
    """

    entries: tuple[tuple[str, Box], ...]
    shares: np.ndarray | None = None

    @classmethod
    def read(cls, path: str | os.PathLike) -> "TypeTable":
        """The table in a TOML file. Raises `FitnessError` as `of` does, naming the file, and if
        there is none."""
        path = Path(path)
        try:
            content = path.read_bytes()
        except OSError as error:
            raise FitnessError(
                f"{path} cannot be read: {error.strerror}", "a TOML file of types", "check the path"
            ) from None
        try:
            return cls.of(content)
        except FitnessError as error:
            raise FitnessError(f"{path}: {error.found}", error.expected, error.remedy) from None

    @classmethod
    def of(cls, text: str | bytes) -> "TypeTable":
        """The table that a TOML ``text`` tells.

        Each ``[[type]]`` has a ``name`` and limits, ``FEATURE = { from = LOWEST, below = END }``:
        the lowest value is of the type, the end is not; either may be left out. A type of several
        entries takes what any of them takes. ``[shares]`` may tell how much of the built ground
        each type shall have; with it alone the types are those of this package.

        Raises `FitnessError` for what is no such table; and if a building there may be is of no
        type, or of two.
        """
        told = parsed(text, "types", FitnessError)
        listed = told.get("type", [])
        _check_parts(told)
        if not isinstance(listed, list) or not (listed or "shares" in told):
            raise FitnessError(
                "no type",
                f"1 to {MOST} entries [[type]], or [shares] alone",
                'write [[type]], below it name = "slab" and limits such as '
                "height = { from = 10, below = 16 }",
            )
        if len(listed) > MOST:
            raise FitnessError(
                f"{len(listed)} entries [[type]]", f"at most {MOST}", "leave some out"
            )
        table = cls(tuple(_entry(one) for one in listed)) if listed else packaged()
        _check_overlaps(table.entries)
        _check_gaps(table.entries)
        return cls(table.entries, _shares(told.get("shares"), table.names))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The types, in the order of the table."""
        return tuple(dict.fromkeys(name for name, _ in self.entries))

    def classified(self, features: np.ndarray) -> np.ndarray:
        """Int64 ``(n,)``: of which of `names` each building is, by its number.

        features : float64 ``(5, n)``, rows as in `FEATURES`.
        """
        low, high = self._bounds
        taken = (low <= features) & (features < high)
        return self._types[taken.all(axis=1).argmax(axis=0)]

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return tuple(np.array([box[k] for _, box in self.entries])[:, :, None] for k in (0, 1))

    @cached_property
    def _types(self) -> np.ndarray:
        return np.array([self.names.index(name) for name, _ in self.entries])


def packaged() -> TypeTable:
    """The table of this package, ``evocity/data/building-types.toml``."""
    return TypeTable.read(Path(__file__).parent.parent / "data" / "building-types.toml")


def _check_parts(told: Mapping) -> None:
    """Raise unless a table has no other parts than it may have."""
    strange = [name for name in told if name not in ("type", "shares")]
    if not strange:
        return
    recipe = _OF_RECIPES.intersection(told)
    if "fitness" in told or len(recipe) > 1:
        raise FitnessError(
            f"a recipe, with {', '.join(one for one in told if one in recipe)}",
            f"a table of building types, with {_PARTS}",
            "breed by a recipe with: evocity run; name a table or a measure here",
        )
    raise FitnessError(
        f"{', '.join(strange)} in a table of types",
        _PARTS,
        near_miss(strange[0], ("type", "shares")) or "take it out",
    )


def _entry(told) -> tuple[str, Box]:
    """Name and box of one ``[[type]]``."""
    name = told.get("name") if isinstance(told, dict) else None
    if not isinstance(name, str) or not name.isidentifier():
        raise _fault(
            f"a [[type]] with name = {shown(name)}",
            "a name of letters, digits and _, no digit first",
        )
    low, high = np.zeros(len(FEATURES)), _ENDS.copy()
    for feature, limits in told.items():
        if feature == "name":
            continue
        if feature not in FEATURES:
            raise FitnessError(
                f"{feature} of the type {name}",
                f"limits of {', '.join(FEATURES)}",
                near_miss(feature, FEATURES) or _HOW,
            )
        k = list(FEATURES).index(feature)
        low[k], high[k] = _limits(name, feature, limits, _ENDS[k])
    return name, (low, high)


def _limits(name: str, feature: str, told, end: float) -> tuple[float, float]:
    what = f"{feature} = {_typed(told)} of the type {name}"
    if not isinstance(told, dict) or not told or set(told) - {"from", "below"}:
        raise _fault(what, "{ from = NUMBER, below = NUMBER }, either left out where there is none")
    low, high = told.get("from", 0), told.get("below", end)
    if not all(is_number(one) for one in (low, high)):
        raise _fault(what, "numbers, 0 or more")
    if not low < min(high, end):
        raise _fault(what, f"a number from which on, of 0 to {end:g}, below the number it ends at")
    return float(low), float(min(high, end))


def _shares(told, names: tuple[str, ...]) -> np.ndarray | None:
    if told is None:
        return None
    expected = "a share of the built ground a type, 0 or more, together 1"
    example = f"for example {names[0]} = {1 if len(names) == 1 else 0.6} under [shares]"
    if not isinstance(told, dict):
        raise FitnessError(f"shares = {shown(told)}", f"[shares], {expected}", example)
    faults = []
    for name, share in told.items():
        if name not in names:
            faults.append(with_near_miss(f"{name}, which is no type", name, names))
        if not is_number(share):
            faults.append(f"{name} = {_typed(share)}")
    if faults:
        raise FitnessError(
            f"[shares] has {'; '.join(faults)}",
            f"{expected}, of {', '.join(names)}",
            f"correct that, {example}",
        )
    whole = sum(told.values())
    if not math.isclose(whole, 1, abs_tol=1e-6):
        raise FitnessError(
            f"[shares] that sum to {whole:g}",
            expected,
            "divide each by that sum" if 0 < whole < math.inf else f"write them, {example}",
        )
    shares = np.array([told.get(name, 0.0) for name in names], float)
    return shares / shares.sum()


def _check_overlaps(entries) -> None:
    for k, (name, box) in enumerate(entries):
        for other, beside in entries[:k]:
            common = meet(box, beside)
            if other != name and common is not None:
                raise FitnessError(
                    f"both {other} and {name} take a building of {_example(common)}",
                    "one type for each building",
                    f"let one of the two begin where the other ends: both take {_extent(common)}",
                )


def _check_gaps(entries) -> None:
    gap = left_over(_SPACE, [box for _, box in entries])
    if gap is None:
        return
    beside = dict(filter(None, (_touching(name, box, gap) for name, box in entries)))
    near = " or ".join(f"{feature} of {name}" for name, feature in beside.items())
    raise FitnessError(
        f"no type takes a building of {_example(gap)}",
        "one type for each building",
        f"widen {near or 'the limits of a type'}, or add a type: none takes {_extent(gap)}",
    )


def _touching(name: str, box: Box, gap: Box) -> tuple[str, str] | None:
    """``name``, and the feature in which its ``box`` ends where the ``gap`` begins, or begins where
    that ends; None if it does not lie beside it."""
    (low, high), (start, end) = box, gap
    apart = np.flatnonzero((high <= start) | (end <= low))
    touching = apart.size == 1 and ((high == start) | (end == low))[apart[0]]
    return (name, list(FEATURES)[apart[0]]) if touching else None


def _example(box: Box) -> str:
    point = corner_near(box, _USUAL)
    told = zip(FEATURES.items(), point, strict=True)
    return ", ".join(f"{name} {value:.9g}{_unit(unit)}" for (name, (unit, _, _)), value in told)


def _extent(box: Box) -> str:
    """The limits of a ``box`` that are any."""
    told = []
    for (name, (unit, highest, _)), low, high in zip(FEATURES.items(), *box, strict=True):
        ends = [f"from {low:.9g}{_unit(unit)}"] if low else []
        if high <= highest and math.isfinite(high):
            ends += [f"below {high:.9g}{_unit(unit)}"]
        told += [f"{name} {' '.join(ends)}"] if ends else []
    return ", ".join(told) or "all buildings"


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _typed(value) -> str:
    """``value`` as TOML has it, cut short."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{key} = {_typed(one)}" for key, one in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, bool):
        return str(value).lower()
    return shown(value)


def _fault(found: str, expected: str) -> FitnessError:
    return FitnessError(found, expected, _HOW)


__all__ = ["FEATURES", "MOST", "TypeTable", "packaged"]
