"""Births as columns that are filtered, and as the page reads them."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.errors import EvocityError, near_miss, shown

#: What lets births pass: of a column of numbers spans (low, high), of one of words some of these.
Brushes = Mapping[str, Sequence]


@dataclass(frozen=True)
class Column:
    """What each birth has under a ``name``: float32 ``(n,)``, NaN where it has nothing.

    words : what the ``values`` stand for, where they are places in this.
    sign, wanted : what was wanted of it, in a sign and in words.
    goal : "max" or "min" where more or less is better; ``target`` where one value is best.
    """

    name: str
    values: np.ndarray
    words: tuple[str, ...] = ()
    unit: str = ""
    sign: str = ""
    wanted: str = ""
    goal: str | None = None
    target: float | None = None

    @classmethod
    def of_words(cls, name: str, values: np.ndarray) -> "Column":
        """Of texts."""
        words, places = np.unique(np.asarray(values, str), return_inverse=True)
        return cls(name, places.astype(np.float32), tuple(words.tolist()))

    @classmethod
    def of_flags(cls, name: str, values: np.ndarray) -> "Column":
        """Of bools."""
        return cls(name, np.asarray(values, np.float32), ("no", "yes"))

    @cached_property
    def span(self) -> tuple[float, float]:
        """The least and the largest finite value; 0 and 1 where there is none."""
        finite = self.values[np.isfinite(self.values)]
        return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)

    @property
    def ranks(self) -> np.ndarray:
        """Float32 ``(n,)``: lower is earlier in the gallery; NaN where there is no value."""
        if self.target is not None:
            return np.abs(self.values.astype(float) - self.target).astype(np.float32)
        return -self.values if self.goal == "max" else self.values

    def passing(self, brush: Sequence) -> np.ndarray:
        """Bool ``(n,)``: who has a value in one of the spans, or one of the words."""
        kept = np.zeros(len(self.values), bool)
        values = self.values.astype(float)
        for one in brush:
            if self.words:
                kept |= values == self.words.index(one)
            else:
                kept |= (one[0] <= values) & (values <= one[1])
        return kept

    def checked(self, brush: object) -> list:
        """A ``brush`` of this column, as plain values; an end that is None is the column's own.
        Raises `EvocityError` for one that is none."""
        listed = list(brush) if isinstance(brush, Sequence | np.ndarray) else [brush]
        if isinstance(brush, str):
            listed = [brush]
        if self.words:
            for one in listed:
                if one not in self.words:
                    raise EvocityError(
                        f"{self.name} = {shown(one)}",
                        f"some of {', '.join(self.words)}",
                        near_miss(str(one), self.words) or "leave the brush out, or name some",
                    )
            return list(dict.fromkeys(map(str, listed)))
        if len(listed) == 2 and all(one is None or _is_number(one) for one in listed):
            listed = [listed]  # one span, not a list of them
        return sorted(self._span(one) for one in listed)

    def _span(self, one: object) -> list[float]:
        ends = list(one) if isinstance(one, Sequence) and not isinstance(one, str) else []
        right = len(ends) == 2 and all(end is None or _is_number(end) for end in ends)
        low, high = (
            float(usual if end is None else end)
            for end, usual in zip(ends if right else self.span, self.span, strict=True)
        )
        if not right or not low <= high:
            raise EvocityError(
                f"{self.name} within {shown(one)}",
                "spans of two numbers, the lower first; None for the column's own end",
                f'write for example {{"{self.name}": [(0.2, 0.4)]}}',
            )
        return [low, high]


def _is_number(value: object) -> bool:
    plain = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    return plain and math.isfinite(value)


@dataclass(frozen=True)
class Table:
    """Births: their ``ids``, int64 ``(n,)``, rising; what each has."""

    ids: np.ndarray
    columns: tuple[Column, ...]

    def __len__(self) -> int:
        return len(self.ids)

    def among(self, ids: Iterable[int]) -> list[int]:
        """Those of some ``ids`` that are here, in their order."""
        asked = [one for one in ids if 0 <= one <= self.ids.max(initial=-1)]
        return [n for n, here in zip(asked, np.isin(asked, self.ids).tolist(), strict=True) if here]

    def column(self, name: str) -> Column:
        """Raises `EvocityError` for a name that is none."""
        for one in self.columns:
            if one.name == name:
                return one
        names = [one.name for one in self.columns]
        raise EvocityError(
            f"there is no column {shown(name)}",
            f"one of {', '.join(names)}",
            near_miss(str(name), names) or "name one that there is",
        )

    def checked(self, brushes: Brushes) -> dict[str, list]:
        """``brushes`` as plain values; empty ones left out. Raises `EvocityError` for a name that
        is none, and for what is no brush of its column."""
        if not isinstance(brushes, Mapping):
            raise EvocityError(
                f"brushes = {shown(brushes)}",
                "a brush a column",
                'write for example {"fsi": [(1, 2)]}; {} for none',
            )
        found = {name: self.column(name).checked(brush) for name, brush in brushes.items()}
        return {name: brush for name, brush in found.items() if brush}

    def passing(self, brushes: Brushes) -> np.ndarray:
        """Bool ``(n,)``: who passes all ``brushes``, as the page shows them."""
        kept = np.ones(len(self), bool)
        for name, brush in self.checked(brushes).items():
            kept &= self.column(name).passing(brush)
        return kept

    def ordered(self, name: str, is_reversed: bool = False) -> np.ndarray:
        """Int ``(n,)``: all rows as the gallery has them by the column ``name``: best first, lowest
        first, or by the alphabet; turned, if it ``is_reversed``. Those without a value come last,
        of equal ones the first by id comes first."""
        ranks = self.column(name).ranks
        return np.argsort(-ranks if is_reversed else ranks, kind="stable")

    @property
    def about(self) -> dict:
        """What the page is told of the columns, plain values."""
        columns = [
            {
                "name": one.name,
                "words": list(one.words),
                "unit": one.unit,
                "sign": one.sign,
                "wanted": one.wanted,
                "goal": one.goal,
                "target": one.target,
            }
            for one in self.columns
        ]
        return {"count": len(self), "columns": columns}

    @property
    def buffer(self) -> bytes:
        """Ids as int32, then the columns one after the other as float32; little-endian."""
        parts = [self.ids.astype("<i4"), *(one.values.astype("<f4") for one in self.columns)]
        return b"".join(part.tobytes() for part in parts)


__all__ = ["Brushes", "Column", "Table"]
