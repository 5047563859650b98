"""What a recipe says of operators: weights, parameters, and ranges that each birth draws from."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from evocity import operators
from evocity.errors import shown, with_near_miss
from evocity.genome import MOST_PARENTS, Genome
from evocity.kinds import KINDS
from evocity.operators.parameters import number_of
from evocity.search.values import fault

#: The keys of a range.
ENDS = ("from", "to")

# Whole numbers up to this are numbers of their own as floats too.
_LARGEST = 2**53


class OperatorEntry(BaseModel):
    """A weight, or a table of a weight, parameters of the operator, and how many parents."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    weight: float = Field(1.0, ge=0, le=1_000_000, allow_inf_nan=False)
    parents: int | None = Field(None, ge=1, le=MOST_PARENTS)

    @property
    def parameters(self) -> dict[str, Any]:
        """As TOML has them: "none", and reach = "all", stand for None; ranges are tables."""
        return dict(self.model_extra or {})


def usual_operators(kind: str = "fabric") -> dict[str, OperatorEntry]:
    """The mixture of a recipe without ``[operators]``, of runs that breed this ``kind``."""
    return {name: OperatorEntry(**dict(entry)) for name, entry in KINDS[kind].usual.items()}


def entry_of(value: Any) -> Any:
    """What `OperatorEntry` is made of, from what a recipe has under an operator's name."""
    if isinstance(value, bool) or not isinstance(value, int | float | dict | OperatorEntry):
        raise fault(f"{value!r}", "a weight, or a table such as { weight = 4, fill = 0.5 }")
    return {"weight": value} if isinstance(value, int | float) else value


@dataclass(frozen=True)
class Range:
    """The values a parameter is drawn from, all alike; whole numbers if it takes these alone."""

    low: float
    high: float
    whole: bool

    def draw(self, rng: np.random.Generator) -> int | float:
        if self.whole:
            return int(rng.integers(self.low, self.high, endpoint=True))
        return min(float(rng.uniform(self.low, self.high)), float(self.high))


def parted(kind: type, parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Range]]:
    """The ``parameters`` of operators of a ``kind`` that are fixed, and those that are ranges,
    which have no faults."""
    ranges = {
        key: Range(value["from"], value["to"], number_of(kind, key) is int)
        for key, value in parameters.items()
        if is_range(kind, key, value)
    }
    return {key: value for key, value in parameters.items() if key not in ranges}, ranges


def is_range(kind: type, key: str, value: Any) -> bool:
    """Whether ``value`` is meant as a range: a table, for a number. Where a parameter takes tables
    of its own (of another package's operator), it is one if it has the keys of a range."""
    if not isinstance(value, Mapping) or number_of(kind, key) is None:
        return False
    own = not operators.wrong_types(kind, {key: dict(value)})
    return not own or set(value) == set(ENDS)


def range_faults(kind: type, key: str, value: Mapping) -> list[tuple[str, str, str]]:
    """Faults (key, found, allowed) of one range by itself."""
    faults = [
        (f"{key}.{strange}", with_near_miss("unknown key", strange, ENDS), ", ".join(ENDS))
        for strange in value
        if strange not in ENDS
    ]
    faults += [(f"{key}.{end}", "missing", "it is required") for end in ENDS if end not in value]
    whole = number_of(kind, key) is int
    for end in ENDS:
        if end in value and not _is_end(value[end], whole):
            allowed = "a whole number" if whole else "a finite number"
            faults.append((f"{key}.{end}", shown(value[end]), allowed))
    if not faults and value["from"] > value["to"]:
        found = f"from = {shown(value['from'])}, to = {shown(value['to'])}"
        faults.append((key, found, "a from that is not above the to"))
    return faults


def _is_end(value: Any, whole: bool) -> bool:
    kinds = int if whole else int | float
    number = isinstance(value, kinds) and not isinstance(value, bool)
    bound = _LARGEST if isinstance(value, int) else 1e300
    return number and -bound <= value <= bound  # not NaN


def corners(ranges: Mapping[str, Range]) -> list[dict[str, str]]:
    """Which end (from or to) each of the ``ranges`` stands at, in cases that hold every pair of
    ends of two of them: conditions between two parameters are met at their ends or nowhere."""
    lowest = dict.fromkeys(ranges, "from")
    found = [lowest, *(lowest | {key: "to"} for key in ranges), dict.fromkeys(ranges, "to")]
    return [one for at, one in enumerate(found) if one not in found[:at]]


@dataclass(frozen=True)
class Drawn:
    """The operator ``name`` of one birth, ``of`` what it breeds, some of whose parameters were
    ``drawn`` for it alone.

    They are checked when it is called, so a fault costs that birth. The child's ``made`` tells
    them under "drawn".
    """

    name: str
    parents: tuple[int, int | None]
    parameters: Mapping[str, Any]
    drawn: Mapping[str, float]
    takes_founders: bool = False
    of: str = "fabric"

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        child = operators.make(self.name, **self.parameters, **self.drawn)(parents, rng)
        if not isinstance(getattr(child, "made", None), Mapping):  # the door of the run tells it
            return child
        return child.replace(made={**child.made, "drawn": dict(self.drawn)})


@dataclass(frozen=True)
class _Told:
    """What a recipe says of an operator, told apart by its text: 1 is not 1.0."""

    name: str
    kind: type
    text: str
    parameters: Mapping[str, Any] = field(compare=False)
    coding: Mapping | None = field(compare=False)


def _told(name: str, parameters: Mapping[str, Any], coding: Mapping | None) -> _Told | None:
    """None for an operator that there is not."""
    kind = operators.operators().get(name)
    return kind and _Told(name, kind, repr((parameters, coding)), parameters, coding)


@lru_cache(1024)  # asked for at every birth
def _parted(told: _Told) -> tuple[dict[str, Any], dict[str, Range]]:
    """The parameters that are fixed, as Python has them, and the ranges."""
    fixed, ranges = parted(told.kind, told.parameters)
    return _own(told.kind, fixed, told.coding), ranges


@lru_cache(1024)
def _lowest(told: _Told):
    """The operator without changes. One that cannot change is the same for all births."""
    fixed, ranges = _parted(told)
    return operators.make(told.name, **fixed, **{key: one.low for key, one in ranges.items()})


def operator_of(name: str, parameters: Mapping[str, Any], coding: Mapping | None, **changes):
    """The operator ``name`` with the ``parameters`` of its entry, of ranges their lower end.
    ``coding``: the keys of ``[genome]``, whose reach and domains it takes unless it has its own.
    Raises `OperatorError`."""
    told = _told(name, parameters, coding)
    if told is None:
        return operators.make(name, **(_own(None, parameters, coding) | changes))
    return _made(told, changes)


def drawing_of(
    name: str, parameters: Mapping[str, Any], coding: Mapping | None
) -> Callable[..., operators.Operator]:
    """What makes the operator ``name`` for one birth after the other, from a generator and what is
    to change: as `operator_of` without ranges among its ``parameters``; else `Drawn`, in their
    order, by that generator. What changes is not drawn. Raises `OperatorError`."""
    told = _told(name, parameters, coding)
    if told is None:
        return operators.make(name, **_own(None, parameters, coding))
    return partial(_drawn, told)


def _made(told: _Told, changes: Mapping[str, Any]):
    if not changes and is_dataclass(told.kind) and told.kind.__dataclass_params__.frozen:
        return _lowest(told)
    fixed, ranges = _parted(told)
    lowest = {key: one.low for key, one in ranges.items()}
    return operators.make(told.name, **(fixed | lowest | changes))


def _drawn(told: _Told, rng: np.random.Generator, **changes):
    fixed, ranges = _parted(told)
    if not set(ranges) - set(changes):
        return _made(told, changes)
    drawn = {key: one.draw(rng) for key, one in ranges.items() if key not in changes}
    takes = getattr(told.kind, "takes_founders", False)
    of = operators.bred_by(told.kind)
    return Drawn(told.name, told.kind.parents, fixed | changes, drawn, takes, of)


def _own(kind: type | None, fixed: Mapping[str, Any], coding: Mapping | None) -> dict[str, Any]:
    """The ``fixed`` parameters as Python has them, with those that ``coding`` gives."""
    told = {
        key: None if value == "none" or (key, value) == ("reach", "all") else value
        for key, value in fixed.items()
    }
    if kind is None or coding is None:
        return told
    accepted = operators.parameters_of(kind)
    return {key: coding[key] for key in ("reach", "domains") if key in accepted} | told


__all__ = [
    "Drawn",
    "OperatorEntry",
    "Range",
    "corners",
    "drawing_of",
    "entry_of",
    "is_range",
    "operator_of",
    "parted",
    "range_faults",
    "usual_operators",
]
