"""A table of classes: which limits of area, height and shape make an object of a class."""

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from evocity.errors import MapError, near_miss, shown, with_near_miss
from evocity.views.boxes import Box, corner_near, left_over, meet
from evocity.views.limits import is_number, parsed

#: What a table may set limits to: by name the unit, the highest value there is, and what a house
#: has, for examples.
FEATURES: Mapping[str, tuple[str, float, float]] = {
    "area": ("m²", math.inf, 100.0),
    "height": ("m", math.inf, 9.0),
    "roundness": ("", 1.0, 0.5),
    "slenderness": ("", math.inf, 0.9),
}
#: Most entries of a table.
MOST = 100

# Beyond the highest value, since the upper end of a box is not of it.
_ENDS = np.array([np.nextafter(highest, np.inf) for _, highest, _ in FEATURES.values()])
_SPACE: Box = (np.zeros(len(FEATURES)), _ENDS)
_USUAL = [usual for _, _, usual in FEATURES.values()]
_HOW = 'for example height = { from = 3, below = 20 } under [[class]] name = "tree"'
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}\Z")
_PARTS = ("class", "colours")


@dataclass(frozen=True, eq=False)
class ClassTable:
    """Classes of objects, each of one box of limits or several; the first that matches wins.

    Made by `ClassTable.read` of a file, or `ClassTable.of` its text.

    entries : name and box of each ``[[class]]``; boxes are as in `FEATURES`, a row a feature.
    colours : of each class its sRGB colour, ``#rrggbb``, in the order of `names`.
    """

    entries: tuple[tuple[str, Box], ...]
    colours: tuple[str, ...]

    @classmethod
    def read(cls, path: str | os.PathLike) -> "ClassTable":
        """The table in a TOML file. Raises `MapError` as `of` does, naming the file, and if there
        is none."""
        path = Path(path)
        try:
            return cls.of(path.read_bytes())
        except OSError as error:
            raise MapError(
                f"{path} cannot be read: {error.strerror}",
                "a TOML file of classes",
                "check the path",
            ) from None
        except MapError as error:
            raise MapError(f"{path}: {error.found}", error.expected, error.remedy) from None

    @classmethod
    def of(cls, text: str | bytes) -> "ClassTable":
        """The table that a TOML ``text`` tells.

        Each ``[[class]]`` has a ``name`` and limits, ``FEATURE = { from = LOWEST, below = END }``:
        the lowest value is of the class, the end is not; either may be left out, and so may a
        feature. An object is of the class of the first entry that takes it; a class may have
        several. ``[colours]`` gives each class its sRGB colour, ``"#rrggbb"``.

        Raises `MapError` for what is no such table: parts, features or colours that are none,
        numbers that are not finite; if there is an object that no entry takes; and if an entry
        takes none, for those before it take all that it would.
        """
        told = parsed(text, "classes", MapError)
        for name in told:
            if name not in _PARTS:
                raise MapError(
                    f"{name} in a table of classes",
                    "[[class]] and [colours]",
                    near_miss(name, _PARTS) or "take it out",
                )
        listed = told.get("class", [])
        if not isinstance(listed, list) or not 1 <= len(listed) <= MOST:
            found = len(listed) if isinstance(listed, list) else "no"
            raise MapError(f"{found} entries [[class]]", f"1 to {MOST}", _HOW)
        entries = tuple(_entry(k, one) for k, one in enumerate(listed, 1))
        _check_overlaps(entries)
        _check_gaps(entries)
        return cls(entries, _colours(told.get("colours"), _names(entries)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The classes, in the order in which the table names them first."""
        return _names(self.entries)

    @cached_property
    def rgb(self) -> np.ndarray:
        """Uint8 ``(k, 3)``: `colours` as numbers."""
        return _read_only(
            np.array([list(bytes.fromhex(one[1:])) for one in self.colours], np.uint8)
        )

    def classified(self, features: np.ndarray) -> np.ndarray:
        """Uint8 ``(n,)``: of which of `names` each object is, by its number.

        features : float64 ``(4, n)``, rows as in `FEATURES`.
        """
        low, high = self._bounds
        taken = (low <= features) & (features < high)
        return self._classes[taken.all(axis=1).argmax(axis=0)]

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        sides = (np.array([box[k] for _, box in self.entries]) for k in (0, 1))
        return tuple(_read_only(side[:, :, None]) for side in sides)

    @cached_property
    def _classes(self) -> np.ndarray:
        found = [self.names.index(name) for name, _ in self.entries]
        return _read_only(np.array(found, np.uint8))


@cache
def packaged() -> ClassTable:
    """The table of this package, ``evocity/data/classes.toml``."""
    return ClassTable.read(Path(__file__).parents[2] / "data" / "classes.toml")


def _names(entries) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for name, _ in entries))


def _entry(number: int, told: object) -> tuple[str, Box]:
    """Name and box of the ``number``-th ``[[class]]``."""
    name = told.get("name") if isinstance(told, Mapping) else None
    if not isinstance(name, str) or not name.isidentifier():
        raise MapError(
            f"entry {number}, a [[class]] with name = {shown(name)}",
            "a name of letters, digits and _, no digit first",
            _HOW,
        )
    low, high = np.zeros(len(FEATURES)), _ENDS.copy()
    for feature, limits in told.items():
        if feature == "name":
            continue
        if feature not in FEATURES:
            raise MapError(
                f"{feature} of entry {number}, class {name}",
                f"limits of {', '.join(FEATURES)}",
                near_miss(feature, FEATURES) or _HOW,
            )
        k = list(FEATURES).index(feature)
        low[k], high[k] = _limits(number, name, feature, limits, _ENDS[k])
    return name, (_read_only(low), _read_only(high))


def _limits(number: int, name: str, feature: str, told, end: float) -> tuple[float, float]:
    what = f"{feature} = {shown(told)} of entry {number}, class {name}"
    if not isinstance(told, Mapping) or not told or set(told) - {"from", "below"}:
        expected = "{ from = NUMBER, below = NUMBER }, either left out where there is none"
        raise MapError(what, expected, _HOW)
    if not all(is_number(one) and math.isfinite(one) for one in told.values()):
        raise MapError(what, "finite numbers, 0 or more", _HOW)
    low, high = float(told.get("from", 0)), min(float(told.get("below", end)), end)
    if not low < high:
        highest = "" if math.isinf(end) else f", of at most {FEATURES[feature][1]:g}"
        raise MapError(what, f"the lowest value below the end{highest}", _HOW)
    return low, high


def _colours(told: object, names: tuple[str, ...]) -> tuple[str, ...]:
    example = f'for example {names[0]} = "#8fa1b3" under [colours]'
    if not isinstance(told, Mapping):
        found = "no [colours]" if told is None else f"colours = {shown(told)}"
        raise MapError(found, "[colours] with a colour for each class", example)
    for name, colour in told.items():
        if name not in names:
            raise MapError(
                with_near_miss(f"the colour of {name}, which is no class", name, names),
                f"colours of {', '.join(names)}",
                "correct the name, or take it out",
            )
        if not (isinstance(colour, str) and _COLOUR.match(colour)):
            raise MapError(
                f"{name} = {shown(colour)} under [colours]",
                "sRGB as # and six hexadecimal digits",
                example,
            )
    missing = [name for name in names if name not in told]
    if missing:
        raise MapError(
            f"no colour for {', '.join(missing)}", "one for each class under [colours]", example
        )
    return tuple(told[name].lower() for name in names)


def _check_overlaps(entries) -> None:
    """Raise where an entry takes nothing: no object has such features, or earlier entries take all
    of them."""
    for k, (name, box) in enumerate(entries):
        what = f"entry {k + 1}, class {name}, takes nothing"
        if not _possible(box):
            raise MapError(
                f"{what}: no object has {_extent(box)}",
                "limits that some object keeps; slenderness is height by the root of the area",
                "correct its limits, or take it out",
            )
        if left_over(box, [one for _, one in entries[:k]]) is None:
            first = [
                f"{j + 1} ({other})"
                for j, (other, one) in enumerate(entries[:k])
                if meet(box, one) is not None
            ]
            raise MapError(
                f"{what}: it overlaps with {', '.join(first)}, which come first",
                "entries that each take something the earlier ones do not",
                "put it before these, narrow them, or take it out",
            )


def _check_gaps(entries) -> None:
    gap = left_over(_SPACE, [box for _, box in entries])
    if gap is None:
        return
    raise MapError(
        f"no class takes an object of {_example(gap)}",
        "a class for each object, the first entry that takes it",
        f"let the last entry take all that is left, with a name alone: none takes {_extent(gap)}",
    )


def _possible(box: Box) -> bool:
    """Whether some object lies in a ``box``, for slenderness follows from height and area."""
    (area, height, _, slender), (area_end, height_end, _, slender_end) = box
    least = height / math.sqrt(area_end) if math.isfinite(area_end) else 0.0
    most = height_end / math.sqrt(area) if area > 0 else math.inf
    return slender < most and least < slender_end


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
    return ", ".join(told) or "all objects"


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


__all__ = ["FEATURES", "MOST", "ClassTable", "packaged"]
