"""The table of births: columns with filters and orders, and the bytes that the page reads."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.errors import EvocityError, is_number, near_miss, spell

#: Filters by column: spans (low, high) of a column of numbers, some words of a column of words.
Brushes = Mapping[str, Sequence]


@dataclass(frozen=True)
class Column:
    """The values of all births under a ``name``: float32 ``(n,)``, NaN for no value.

    words : the texts that the ``values`` index, for a column of words.
    sign, wanted : the goal of the column, as a sign and in words.
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
        """Make a column of texts."""
        words, places = np.unique(np.asarray(values, str), return_inverse=True)
        return cls(name, places.astype(np.float32), tuple(words.tolist()))

    @classmethod
    def of_flags(cls, name: str, values: np.ndarray) -> "Column":
        """Make a column of bools."""
        return cls(name, np.asarray(values, np.float32), ("no", "yes"))

    @cached_property
    def span(self) -> tuple[float, float]:
        """The least and the largest finite value; 0 and 1 without any."""
        finite = self.values[np.isfinite(self.values)]
        return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)

    @property
    def ranks(self) -> np.ndarray:
        """Float32 ``(n,)``: a lower rank is earlier in the gallery; NaN for no value."""
        if self.target is not None:
            return np.abs(self.values.astype(float) - self.target).astype(np.float32)
        return -self.values if self.goal == "max" else self.values

    def matches(self, brush: Sequence) -> np.ndarray:
        """Return bool ``(n,)``: the births in one of the spans, or with one of the words."""
        kept = np.zeros(len(self.values), bool)
        values = self.values.astype(float)
        for part in brush:
            if self.words:
                kept |= values == self.words.index(part)
            else:
                kept |= (part[0] <= values) & (values <= part[1])
        return kept

    def check_brush(self, brush: object) -> list:
        """Return a ``brush`` of this column as plain values. Raises `EvocityError`."""
        is_listed = isinstance(brush, Sequence | np.ndarray) and not isinstance(brush, str)
        listed = list(brush) if is_listed else [brush]
        if self.words:
            for word in listed:
                if word not in self.words:
                    raise EvocityError(
                        f"the column {self.name} has no word {spell(word)}",
                        f"one or more of the words {', '.join(self.words)}",
                        near_miss(str(word), self.words)
                        or "leave the filter out, or choose some of these words",
                    )
            return list(dict.fromkeys(map(str, listed)))
        if len(listed) == 2 and all(end is None or _is_number(end) for end in listed):
            listed = [listed]  # a single span
        return sorted(self._check_span(span) for span in listed)

    def _check_span(self, span: object) -> list[float]:
        ends = list(span) if isinstance(span, Sequence) and not isinstance(span, str) else []
        if len(ends) == 2 and all(end is None or _is_number(end) for end in ends):
            pairs = zip(ends, self.span, strict=True)
            low, high = (float(usual if end is None else end) for end, usual in pairs)
            if low <= high:
                return [low, high]
        raise EvocityError(
            f"{spell(span)} cannot filter the column {self.name}",
            "pairs of two numbers, the lower number first; None in place of a number means no "
            "limit",
            f'write for example {{"{self.name}": [(0.2, 0.4)]}}',
        )


def _is_number(value: object) -> bool:
    return is_number(value) and math.isfinite(value)


@dataclass(frozen=True)
class Table:
    """Births: their ``ids``, int64 ``(n,)``, rising, and their columns."""

    ids: np.ndarray
    columns: tuple[Column, ...]

    def __len__(self) -> int:
        return len(self.ids)

    def known_ids(self, ids: Iterable[int]) -> list[int]:
        """Return those of ``ids`` that are in the table, in their order."""
        possible = [n for n in ids if 0 <= n <= self.ids.max(initial=-1)]
        known = np.isin(possible, self.ids).tolist()
        return [n for n, is_known in zip(possible, known, strict=True) if is_known]

    def column(self, name: str) -> Column:
        """Return the column with a ``name``. Raises `EvocityError` for an unknown name."""
        for column in self.columns:
            if column.name == name:
                return column
        names = [column.name for column in self.columns]
        raise EvocityError(
            f"the table has no column {spell(name)}",
            f"one of {', '.join(names)}",
            near_miss(str(name), names) or "choose one of these columns",
        )

    def check_brushes(self, brushes: Brushes) -> dict[str, list]:
        """Return ``brushes`` as plain values, without empty ones. Raises `EvocityError`."""
        if not isinstance(brushes, Mapping):
            raise EvocityError(
                f"brushes = {spell(brushes)} is not a mapping",
                "a mapping from columns to filters",
                'write for example {"fsi": [(1, 2)]}, or {} for no filter',
            )
        checked = {name: self.column(name).check_brush(brush) for name, brush in brushes.items()}
        return {name: brush for name, brush in checked.items() if brush}

    def matches(self, brushes: Brushes) -> np.ndarray:
        """Return bool ``(n,)``: the births that pass all ``brushes``, as on the page."""
        kept = np.ones(len(self), bool)
        for name, brush in self.check_brushes(brushes).items():
            kept &= self.column(name).matches(brush)
        return kept

    def row_order(self, name: str, is_reversed: bool = False) -> np.ndarray:
        """Return all rows in the gallery's order by the column ``name``, reversed if it
        ``is_reversed``; births without a value come last, of equal ones the lower id first."""
        ranks = self.column(name).ranks
        return np.argsort(-ranks if is_reversed else ranks, kind="stable")

    @property
    def about(self) -> dict:
        """The columns for the page, as plain values."""
        keys = ("name", "unit", "sign", "wanted", "goal", "target")
        columns = [
            {"words": list(column.words)} | {key: getattr(column, key) for key in keys}
            for column in self.columns
        ]
        return {"count": len(self), "columns": columns}

    @property
    def buffer(self) -> bytes:
        """Ids as int32, then each column as float32; little-endian."""
        parts = [self.ids.astype("<i4"), *(column.values.astype("<f4") for column in self.columns)]
        return b"".join(part.tobytes() for part in parts)
