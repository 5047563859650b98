"""Operators in a recipe: weights, parameters, and ranges that each birth draws from."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from evocity import operators
from evocity.errors import add_near_miss, is_number, is_whole, spell
from evocity.genome import MOST_PARENTS, Genome
from evocity.kinds import KINDS
from evocity.operators.parameters import number_of, wrong_types
from evocity.section import Fault, fault

#: The keys of a range.
ENDS = ("from", "to")

# The largest whole number up to which each one has a float of its own.
_LARGEST = 2**53


class OperatorEntry(BaseModel):
    """A weight, or a table of a weight, the number of parents and parameters of the operator."""

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    weight: float = Field(1.0, ge=0, le=1_000_000, allow_inf_nan=False)
    parents: int | None = Field(None, ge=1, le=MOST_PARENTS)

    @property
    def parameters(self) -> dict[str, Any]:
        """As in TOML: "none", and reach = "all", stand for None; ranges are tables."""
        return dict(self.model_extra or {})


def usual_operators(kind: str = "fabric") -> dict[str, OperatorEntry]:
    """Make the mixture of a recipe without ``[operators]``, for runs of this ``kind``."""
    return {
        name: OperatorEntry(**dict(entry)) for name, entry in KINDS[kind].default_operators.items()
    }


#: The mixture of new recipes with several parents: operators that keep the plan of a parent.
PLAN_OPERATORS: Mapping[str, Mapping[str, Any]] = {
    "plan_fusion": {"weight": 3, "area_min": 100.0, "share": {"from": 0.0, "to": 0.15}},
    "plan_crossing": {"weight": 5},
    "plan_spread": {"weight": 1},
    "plan_storeys": {"weight": 1},
    "plan_return": {"weight": 0.5},
    "plan_change": {"weight": 2},
    "plan_seam": {"weight": 0.5},
}


#: Operators of births that are steered, see `evocity.search.breeding.levers`.
STEERING_OPERATORS = (
    "height_scaling",
    "quarter_fusion",
    "quarter_refill",
    "relocation",
    "plan_change",
)

#: What the lever of each measure changes, see `evocity.search.breeding.levers`; other measures have
#: no lever.
LEVER_OF: Mapping[str, str] = {
    "fsi": "heights",
    "mean_height": "heights",
    "storeys": "heights",
    "gsi": "ground",
    "street_width": "widths",
}


def plan_operators() -> dict[str, OperatorEntry]:
    """Make the mixture of new recipes with several parents."""
    return {name: OperatorEntry(**entry) for name, entry in PLAN_OPERATORS.items()}


def entry_table(value: Any) -> Any:
    """Write the value under an operator's name as the table of an `OperatorEntry`."""
    if isinstance(value, dict | OperatorEntry):
        return value
    if is_number(value):
        return {"weight": value}
    raise fault(
        f"{value!r} is neither a number nor a table",
        "the operator's weight, or a table such as { weight = 4, fill = 0.5 }",
    )


@dataclass(frozen=True)
class Range:
    """An interval that a parameter is drawn from, uniformly; ``whole``: whole numbers only."""

    low: float
    high: float
    whole: bool

    def draw(self, rng: np.random.Generator) -> int | float:
        """Draw one value, both ends included."""
        if self.whole:
            return int(rng.integers(self.low, self.high, endpoint=True))
        return min(float(rng.uniform(self.low, self.high)), float(self.high))


def split_ranges(
    kind: type, parameters: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Range]]:
    """Split valid ``parameters`` of operators of a ``kind`` into those with one value, and those
    with a range."""
    ranges = {
        key: Range(value["from"], value["to"], number_of(kind, key) is int)
        for key, value in parameters.items()
        if is_range(kind, key, value)
    }
    return {key: value for key, value in parameters.items() if key not in ranges}, ranges


def is_range(kind: type, key: str, value: Any) -> bool:
    """Whether ``value`` is meant as a range: a table, for a number. If a parameter of another
    package's operator takes tables anyway, only a table with the keys of a range is one."""
    if not isinstance(value, Mapping) or number_of(kind, key) is None:
        return False
    takes_tables = not wrong_types(kind, {key: dict(value)})
    return not takes_tables or set(value) == set(ENDS)


def range_faults(kind: type, key: str, value: Mapping) -> list[Fault]:
    """List the faults of one range by itself."""
    faults = [
        (f"{key}.{other}", add_near_miss("unknown key", other, ENDS), ", ".join(ENDS))
        for other in value
        if other not in ENDS
    ]
    faults += [(f"{key}.{end}", "missing", "it is required") for end in ENDS if end not in value]
    whole = number_of(kind, key) is int
    for end in ENDS:
        if end in value and not _is_end(value[end], whole):
            allowed = "a whole number" if whole else "a finite number"
            faults.append((f"{key}.{end}", spell(value[end]), allowed))
    if not faults and value["from"] > value["to"]:
        found = f"from = {spell(value['from'])}, to = {spell(value['to'])}"
        faults.append((key, found, "a from that is not above the to"))
    return faults


def _is_end(value: Any, whole: bool) -> bool:
    bound = _LARGEST if isinstance(value, int) else 1e300
    return (is_whole if whole else is_number)(value) and -bound <= value <= bound  # not NaN


def corners(ranges: Mapping[str, Range]) -> list[dict[str, str]]:
    """List cases that set each of the ``ranges`` to an end (from or to), so that every pair of ends
    of two ranges occurs. A condition between two parameters that fails anywhere fails in one."""
    lowest = dict.fromkeys(ranges, "from")
    cases = [lowest, *(lowest | {key: "to"} for key in ranges), dict.fromkeys(ranges, "to")]
    return [case for at, case in enumerate(cases) if case not in cases[:at]]


@dataclass(frozen=True)
class Drawn:
    """The operator ``name`` of one birth, with the parameters ``drawn`` for it, which its child's
    ``made`` holds. They are checked when it is called, so a fault costs only that birth."""

    name: str
    parents: tuple[int, int | None]
    parameters: Mapping[str, Any]
    drawn: Mapping[str, float]
    takes_founders: bool = False
    of: str = "fabric"

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        child = operators.make(self.name, **self.parameters, **self.drawn)(parents, rng)
        if not isinstance(getattr(child, "made", None), Mapping):  # the run's admission reports it
            return child
        return child.replace(made={**child.made, "drawn": dict(self.drawn)})


@dataclass(frozen=True)
class _Spec:
    """An operator as a recipe describes it; two compare by their text, in which 1 is not 1.0."""

    name: str
    kind: type
    text: str
    parameters: Mapping[str, Any] = field(compare=False)
    coding: Mapping | None = field(compare=False)

    @classmethod
    def of(cls, name: str, parameters: Mapping[str, Any], coding: Mapping | None) -> "_Spec":
        """Raises `OperatorError` for an unknown operator."""
        kind = operators.operators().get(name)
        if kind is None:
            operators.make(name)  # raises
        return cls(name, kind, repr((parameters, coding)), parameters, coding)


@lru_cache(1024)  # called for every birth
def _split(spec: _Spec) -> tuple[dict[str, Any], dict[str, Range]]:
    """Split the parameters into those with one value, as Python has them, and ranges."""
    fixed, ranges = split_ranges(spec.kind, spec.parameters)
    fixed = {
        key: None if value == "none" or (key, value) == ("reach", "all") else value
        for key, value in fixed.items()
    }
    accepted = operators.parameters_of(spec.kind) if spec.coding is not None else ()
    own = getattr(spec.kind, "own_defaults", ())
    coding = {
        key: spec.coding[key] for key in ("reach", "domains") if key in accepted and key not in own
    }
    return coding | fixed, ranges


def _make(spec: _Spec, **changes):
    fixed, ranges = _split(spec)
    lowest = {key: one.low for key, one in ranges.items()}
    return operators.make(spec.name, **(fixed | lowest | changes))


_make_lowest = lru_cache(1024)(_make)  # an immutable operator without changes serves all births


def _make_shared(spec: _Spec, changes: Mapping[str, Any]):
    frozen = is_dataclass(spec.kind) and spec.kind.__dataclass_params__.frozen
    return _make_lowest(spec) if frozen and not changes else _make(spec, **changes)


def operator_of(name: str, parameters: Mapping[str, Any], coding: Mapping | None, **changes):
    """Make the operator ``name`` with the ``parameters`` of its entry; ranges give their lower end.
    ``coding``: the keys of ``[genome]``, for its reach and domains. Raises `OperatorError`."""
    return _make_shared(_Spec.of(name, parameters, coding), changes)


def drawing_of(
    name: str, parameters: Mapping[str, Any], coding: Mapping | None
) -> Callable[..., operators.Operator]:
    """Make the function that makes the operator ``name`` for each birth, from a generator and
    changes: as `operator_of`, or `Drawn` if ``parameters`` have ranges. Raises `OperatorError`."""
    return partial(_draw, _Spec.of(name, parameters, coding))


def _draw(spec: _Spec, rng: np.random.Generator, **changes):
    fixed, ranges = _split(spec)
    if not set(ranges) - set(changes):
        return _make_shared(spec, changes)
    drawn = {key: one.draw(rng) for key, one in ranges.items() if key not in changes}
    takes = getattr(spec.kind, "takes_founders", False)
    of = operators.bred_by(spec.kind)
    return Drawn(spec.name, spec.kind.parents, fixed | changes, drawn, takes, of)
