"""Tables of limits in TOML: classes of objects, types of buildings, kinds of streets.

Each entry of a table has a name and a box of features. A thing belongs to the first entry whose
box holds its features.
"""

import math
import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import ClassVar, NamedTuple, Self

import numpy as np

from evocity.bounded_toml import LimitError, parse_toml
from evocity.errors import EvocityError, near_miss, reason_of, spell

#: A box: its lowest corner, which belongs to it, and its highest, which does not; float64 ``(d,)``.
Box = tuple[np.ndarray, np.ndarray]
Entries = Sequence[tuple[str, Box]]
#: Most entries of a table.
MOST = 100


class Feature(NamedTuple):
    """A feature that limits name: its unit, its highest value, and a usual value for examples."""

    unit: str
    highest: float
    usual: float


@dataclass(frozen=True)
class TableFormat:
    """How one table of limits is written, and how its faults are reported.

    entry : the word for an entry, listed as ``[[entry]]``. plural : entries, in words. subject : a
    thing that an entry takes. part : the other part of the table. example : limits of an entry,
    as a remedy. reserved : names that no entry may have. sections : further parts of the table.
    """

    entry: str
    plural: str
    subject: str
    part: str
    features: Mapping[str, Feature]
    fault: type[EvocityError]
    example: str
    reserved: tuple[str, ...] = ()
    sections: tuple[str, ...] = ()

    @cached_property
    def space(self) -> Box:
        """All values that features may have; the highest value lies within."""
        highest = [feature.highest for feature in self.features.values()]
        return np.zeros(len(highest)), np.nextafter(highest, np.inf)

    def document(self, text: str | bytes) -> dict:
        """The TOML document ``text``. Raises the table's error if it is not TOML, or has another
        part."""
        try:
            document = parse_toml(text if isinstance(text, str) else text.decode("utf-8"))
        except LimitError as error:
            raise self.fault(str(error), error.expected, error.remedy) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            found = f"no TOML: {error}"
        except ValueError:  # its text speaks of Python
            found = "a number of thousands of digits"
        else:
            self.check_parts(document)
            return document
        raise self.fault(found, f"a table of {self.plural} in TOML", "correct that place")

    def check_parts(self, document: Mapping) -> None:
        parts = (self.entry, self.part, *self.sections)
        if strange := [name for name in document if name not in parts]:
            raise self.fault(
                f"{', '.join(strange)} in a table of {self.plural}",
                f"[[{self.entry}]] and " + " and ".join(f"[{part}]" for part in parts[1:]),
                near_miss(strange[0], parts) or "take it out",
            )

    def entries(self, document: Mapping) -> tuple[tuple[str, Box], ...]:
        """Name and box of each ``[[entry]]``, 1 to `MOST`; a row of a box is a feature."""
        listed = document.get(self.entry, [])
        if not isinstance(listed, list) or not 1 <= len(listed) <= MOST:
            count = len(listed) if isinstance(listed, list) else "no"
            raise self.fault(f"{count} entries [[{self.entry}]]", f"1 to {MOST}", self.example)
        return tuple(self._entry(number, entry) for number, entry in enumerate(listed, 1))

    def _entry(self, number: int, entry: object) -> tuple[str, Box]:
        name = entry.get("name") if isinstance(entry, Mapping) else None
        if not isinstance(name, str) or not name.isidentifier() or name in self.reserved:
            other = f", other than {', '.join(self.reserved)}" if self.reserved else ""
            raise self.fault(
                f"entry {number}, a [[{self.entry}]] with name = {spell(name)}",
                f"a name of letters, digits and _, no digit first{other}",
                self.example,
            )
        low, high = (side.copy() for side in self.space)
        for feature, limits in entry.items():
            if feature == "name":
                continue
            place = f"entry {number}, {self.entry} {name}"
            if feature not in self.features:
                raise self.fault(
                    f"{feature} of {place}",
                    f"limits of {', '.join(self.features)}",
                    near_miss(feature, self.features) or self.example,
                )
            k = list(self.features).index(feature)
            low[k], high[k] = self._limits(
                f"{feature} = {toml(limits)} of {place}", limits, high[k]
            )
        return name, (read_only(low), read_only(high))

    def _limits(self, found: str, limits: object, end: float) -> tuple[float, float]:
        if not isinstance(limits, Mapping) or not limits or set(limits) - {"from", "below"}:
            expected = "{ from = NUMBER, below = NUMBER }, either left out where there is none"
            raise self.fault(found, expected, self.example)
        low, high = limits.get("from", 0), limits.get("below", end)
        if not (is_number(low) and is_number(high)):
            raise self.fault(found, "numbers, 0 or more", self.example)
        if not low < min(high, end):
            expected = f"a lowest value of 0 to {end:g}, below the value at which the limits end"
            raise self.fault(found, expected, self.example)
        return float(low), float(min(high, end))

    def check_gaps(self, entries: Entries, remedy: str = "") -> None:
        """Raise the table's error if some thing fits no entry."""
        gap = remainder(self.space, [box for _, box in entries])
        if gap is None:
            return
        near = dict(filter(None, (self._neighbour(name, box, gap) for name, box in entries)))
        widen = " or ".join(f"{feature} of {name}" for name, feature in near.items())
        remedy = (
            remedy or f"widen {widen or f'the limits of a {self.entry}'}, or add a {self.entry}"
        )
        raise self.fault(
            f"no {self.entry} includes {self.subject} of {self.describe_thing(gap)}",
            f"one {self.entry} for each {self.subject.split()[-1]}",
            f"{remedy}; the gap between the entries is {self.describe_box(gap)}",
        )

    def check_overlaps(self, entries: Entries) -> None:
        """Raise the table's error if some thing fits entries of two names."""
        for k, (name, box) in enumerate(entries):
            for other, earlier in entries[:k]:
                common = intersection(box, earlier)
                if other != name and common is not None:
                    raise self.fault(
                        f"the limits of {other} and of {name} both include {self.subject} of "
                        f"{self.describe_thing(common)}",
                        f"one {self.entry} for each {self.subject.split()[-1]}",
                        f"let the limits of {other} end where the limits of {name} begin; their "
                        f"overlap is {self.describe_box(common)}",
                    )

    def _neighbour(self, name: str, box: Box, gap: Box) -> tuple[str, str] | None:
        """``name``, and the only feature by which its ``box`` touches the ``gap``; None if the two
        do not touch."""
        (low, high), (start, end) = box, gap
        parted = np.flatnonzero((high <= start) | (end <= low))
        touching = parted.size == 1 and ((high == start) | (end == low))[parted[0]]
        return (name, list(self.features)[parted[0]]) if touching else None

    def describe_thing(self, box: Box) -> str:
        """A thing within ``box``, as usual as may be."""
        point = point_within(box, [feature.usual for feature in self.features.values()])
        pairs = zip(self.features.items(), point, strict=True)
        return ", ".join(f"{name} {value:.9g}{_unit(of)}" for (name, of), value in pairs)

    def describe_box(self, box: Box) -> str:
        """The limits of a ``box``."""
        texts = []
        for (name, feature), low, high in zip(self.features.items(), *box, strict=True):
            ends = [f"from {low:.9g}{_unit(feature)}"] if low else []
            if high <= feature.highest and math.isfinite(high):
                ends += [f"below {high:.9g}{_unit(feature)}"]
            texts += [f"{name} {' '.join(ends)}"] if ends else []
        return ", ".join(texts) or f"all {self.subject.split()[-1]}s"


@dataclass(frozen=True, eq=False)
class LimitTable:
    """Named boxes of limits, read from TOML.

    entries : name and box of each entry; a row of a box is a feature of `FORMAT`.
    """

    FORMAT: ClassVar[TableFormat]
    entries: tuple[tuple[str, Box], ...]

    @classmethod
    def read(cls, path: str | os.PathLike) -> Self:
        """Read the table in a TOML file. Raises the same errors as `of`, with the path, and one if
        the file cannot be read."""
        path, fault = Path(path), cls.FORMAT.fault
        try:
            return cls.of(path.read_bytes())
        except OSError as error:
            found, expected = f"{path} cannot be read: {reason_of(error)}", cls.FORMAT.plural
            raise fault(found, f"a TOML file of {expected}", "check the path") from None
        except fault as error:
            raise fault(f"{path}: {error.found}", error.expected, error.remedy) from None

    @classmethod
    def of(cls, text: str | bytes) -> Self:
        """Read the table from its TOML ``text``."""
        raise NotImplementedError

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names, in the order in which the table has them first."""
        return tuple(dict.fromkeys(name for name, _ in self.entries))

    def classified(self, features: np.ndarray) -> np.ndarray:
        """Uint8 ``(n,)``: the index in `names` of each thing.

        features : float64 ``(d, n)``, a row a feature.
        """
        low, high = self._bounds
        fits = (low <= features) & (features < high)
        return self._indices[fits.all(axis=1).argmax(axis=0)]

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, ...]:
        return tuple(np.array([box[k] for _, box in self.entries])[:, :, None] for k in (0, 1))

    @cached_property
    def _indices(self) -> np.ndarray:
        return np.array([self.names.index(name) for name, _ in self.entries], np.uint8)


def is_number(value: object) -> bool:
    """Whether ``value`` is a number, 0 or more, that a float can hold; infinity is a number."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return float(value) >= 0  # false for NaN
    except OverflowError:
        return False


def toml(value: object) -> str:
    """``value`` as TOML writes it, cut short."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{key} = {toml(part)}" for key, part in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    return str(value).lower() if isinstance(value, bool) else spell(value)


def read_only(array: np.ndarray) -> np.ndarray:
    """``array``, which nobody may write to any more."""
    array.setflags(write=False)
    return array


def intersection(box: Box, other: Box) -> Box | None:
    """The part that two boxes share; None if they share nothing."""
    low, high = np.maximum(box[0], other[0]), np.minimum(box[1], other[1])
    return (low, high) if (low < high).all() else None


def remainder(space: Box, boxes: Iterable[Box]) -> Box | None:
    """A part of ``space`` outside all ``boxes``; None if they fill it. Exact for half-open boxes.

    Cuts one box after the other out of the space, along the sides of the box.
    """
    rest = [space]
    for box in boxes:
        rest = [part for piece in rest for part in _without(piece, box)]
    return rest[0] if rest else None


def point_within(box: Box, usual: Sequence[float]) -> np.ndarray:
    """A point of ``box``, float64 ``(d,)``: on each axis the ``usual`` value where it lies within,
    else the middle, or the low end where the box has no high end."""
    low, high = box
    middle = np.where(np.isinf(high), low, (low + np.minimum(high, 1e300)) / 2)
    within = (low <= usual) & (usual < high)
    return np.where(within, usual, np.where(middle < high, middle, low))


def _without(piece: Box, box: Box) -> Iterator[Box]:
    """``piece`` without ``box``, in at most 2 d boxes that do not overlap."""
    common = intersection(piece, box)
    if common is None:
        yield piece
        return
    low, high = (side.copy() for side in piece)
    for axis in range(low.size):
        for start, end in ((low[axis], common[0][axis]), (common[1][axis], high[axis])):
            if start < end:
                part = low.copy(), high.copy()
                part[0][axis], part[1][axis] = start, end
                yield part
        low[axis], high[axis] = common[0][axis], common[1][axis]


def _unit(feature: Feature) -> str:
    return f" {feature.unit}" if feature.unit else ""
