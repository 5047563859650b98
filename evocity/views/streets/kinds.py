"""A table of kinds of streets, and of what is a place."""

import itertools
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from evocity.errors import MapError, near_miss, shown
from evocity.views.limits import is_number, parsed

#: What a table may set limits to, both in metres.
FEATURES = ("width", "length")
#: Names that are told otherwise than by limits.
KEPT = ("place", "water")
#: Most entries of a table.
MOST = 100

_PLACE = ("width", "longest", "filled")
_HOW = 'for example width = { from = 9.75, below = 20 } under [[kind]] name = "street"'


@dataclass(frozen=True, eq=False)
class StreetKinds:
    """Kinds of streets by width and length, and what a place is.

    Made by `StreetKinds.read` of a file, or `StreetKinds.of` its text.

    names : of each entry the kind. limits : float64 ``(entries, 2, 2)``: of width and of length the
    lowest value that is of the kind, and the lowest that is not any more, metres.
    place_width : where a disc so wide, metres, has room, is the middle of a place. place_longest :
    longest to breadth that a place may be. place_filled : least share of the smallest rectangle
    about a place that it fills.
    """

    names: tuple[str, ...]
    limits: np.ndarray
    place_width: float
    place_longest: float
    place_filled: float

    @classmethod
    def read(cls, path: str | os.PathLike) -> "StreetKinds":
        """The table in a TOML file. Raises `MapError` as `of` does, naming the file, and if there
        is none."""
        path = Path(path)
        try:
            return cls.of(path.read_bytes())
        except OSError as error:
            raise MapError(
                f"{path} cannot be read: {error.strerror}",
                "a TOML file of kinds of streets",
                "check the path",
            ) from None
        except MapError as error:
            raise MapError(f"{path}: {error.found}", error.expected, error.remedy) from None

    @classmethod
    def of(cls, text: str | bytes) -> "StreetKinds":
        """The table that a TOML ``text`` tells.

        Each ``[[kind]]`` has a ``name`` and limits of ``width`` and ``length``,
        ``{ from = LOWEST, below = END }``, metres: the lowest value is of the kind, the end is not;
        each may be left out. ``[place]`` has ``width``, ``longest`` and ``filled``; what it does
        not tell is as in the table of this package.

        Raises `MapError` for what is no such table; and if a street there may be is of no kind, or
        of two.
        """
        told = parsed(text, "kinds of streets", MapError)
        for name in told:
            if name not in ("kind", "place"):
                raise MapError(
                    f"{name} in a table of kinds of streets",
                    "[[kind]] and [place]",
                    near_miss(name, ("kind", "place")) or "take it out",
                )
        listed = told.get("kind", [])
        if not isinstance(listed, list) or not 1 <= len(listed) <= MOST:
            found = len(listed) if isinstance(listed, list) else "no"
            raise MapError(f"{found} entries [[kind]]", f"1 to {MOST}", _HOW)
        entries = [_entry(one) for one in listed]
        names, limits = tuple(name for name, _ in entries), np.array([own for _, own in entries])
        _check_cover(names, limits)
        limits.setflags(write=False)
        return cls(names, limits, *_place(told.get("place", {})))

    def named(self, width: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Str ``(n,)``: the kind of each street by its ``width`` and ``length``, metres."""
        own = np.stack([width, length], axis=-1)[:, None]
        taken = ((self.limits[..., 0] <= own) & (own < self.limits[..., 1])).all(axis=-1)
        return np.array(self.names)[taken.argmax(axis=1)]


@cache
def packaged() -> StreetKinds:
    """The table of this package, ``evocity/data/street-kinds.toml``."""
    return StreetKinds.read(Path(__file__).parents[2] / "data" / "street-kinds.toml")


def _entry(told: object) -> tuple[str, np.ndarray]:
    """Name and limits of one ``[[kind]]``."""
    name = told.get("name") if isinstance(told, Mapping) else None
    if not isinstance(name, str) or not name.isidentifier() or name in KEPT:
        raise MapError(
            f"a [[kind]] with name = {shown(name)}",
            f"a name of letters, digits and _, no digit first, other than {', '.join(KEPT)}",
            _HOW,
        )
    limits = np.array([[0.0, math.inf]] * len(FEATURES))
    for feature, own in told.items():
        if feature == "name":
            continue
        if feature not in FEATURES:
            raise MapError(
                f"{feature} of the kind {name}",
                f"limits of {' and '.join(FEATURES)}",
                near_miss(feature, FEATURES) or _HOW,
            )
        if not isinstance(own, Mapping) or not own or set(own) - {"from", "below"}:
            raise MapError(
                f"{feature} = {shown(own)} of the kind {name}",
                "{ from = NUMBER, below = NUMBER }, either left out where there is none",
                _HOW,
            )
        low, high = own.get("from", 0.0), own.get("below", math.inf)
        if not (is_number(low) and is_number(high) and low < high):
            raise MapError(
                f"{feature} from {shown(low)} below {shown(high)} of the kind {name}",
                "metres, 0 or more, the first below the second",
                _HOW,
            )
        limits[FEATURES.index(feature)] = low, high
    return name, limits


def _place(told: object) -> tuple[float, float, float]:
    if not isinstance(told, Mapping):
        raise MapError(f"place = {shown(told)}", f"[place] with {', '.join(_PLACE)}", "correct it")
    for name in told:
        if name not in _PLACE:
            raise MapError(
                f"{name} of [place]", ", ".join(_PLACE), near_miss(name, _PLACE) or "take it out"
            )
    if len(told) < len(_PLACE):
        own = packaged()
        usual = own.place_width, own.place_longest, own.place_filled
        told = dict(zip(_PLACE, usual, strict=True)) | dict(told)
    lowest, highest = (0.0, 1.0, 0.0), (math.inf, math.inf, 1.0)
    for name, low, high in zip(_PLACE, lowest, highest, strict=True):
        if not (is_number(told[name]) and low <= told[name] <= high and told[name] > 0):
            raise MapError(
                f"{name} = {shown(told[name])} of [place]",
                f"a number, {low:g} to {high:g}, not 0",
                f"leave {name} out for the usual",
            )
    return tuple(float(told[name]) for name in _PLACE)


def _check_cover(names: tuple[str, ...], limits: np.ndarray) -> None:
    """Raise unless every width and length is of one kind: between neighbouring limits nothing
    changes, so the lower corner of each box of them tells."""
    ends = [np.unique([*limits[:, k, 0].tolist(), 0.0]) for k in range(len(FEATURES))]
    tops = [limits[:, k, 1][np.isfinite(limits[:, k, 1])] for k in range(len(FEATURES))]
    ends = [np.unique(np.concatenate(both)) for both in zip(ends, tops, strict=True)]
    for width, length in itertools.product(*ends):
        own = np.array([width, length])
        taken = ((limits[..., 0] <= own) & (own < limits[..., 1])).all(axis=1)
        found = sorted({name for name, one in zip(names, taken, strict=True) if one})
        if len(found) == 1:
            continue
        what = f"a street {width:g} m wide and {length:g} m long"
        if found:
            raise MapError(
                f"{what} is of the kinds {' and '.join(found)}",
                "one kind for each street",
                "let one of the two begin where the other ends",
            )
        raise MapError(
            f"{what} is of no kind",
            "one kind for each street",
            "widen the limits of a kind beside it, or add one",
        )


__all__ = ["FEATURES", "KEPT", "MOST", "StreetKinds", "packaged"]
