"""All that is wanted of an individual: objectives, sums of weighted ones, and constraints."""

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real

from evocity.errors import FitnessError
from evocity.fitness.goals import Objective
from evocity.fitness.measure import Measure

_MOST = sys.float_info.max

#: The objective that weighted measures make together unless another is named.
WEIGHTED = "weighted sum"


@dataclass(frozen=True)
class Constraint:
    """Bounds on a measure: ``low`` ≤ value ≤ ``high``, either of them None for no bound.

    Raises `FitnessError` unless at least one is a finite number, the lower first.

    >>> from evocity.fitness import gsi
    >>> Constraint(gsi, 0.2, 0.4).violation(0.5)
    0.5
    """

    measure: Measure
    low: float | None = None
    high: float | None = None

    def __post_init__(self):
        bounds = [bound for bound in (self.low, self.high) if bound is not None]
        numbers = all(
            isinstance(b, Real) and not isinstance(b, bool) and math.isfinite(b) for b in bounds
        )
        if not bounds or not numbers or (len(bounds) == 2 and bounds[0] >= bounds[1]):
            raise FitnessError(
                f"{self.measure.name} between {self.low} and {self.high}",
                "one finite bound or two, the lower first",
                "write for example min = 0.2, max = 0.4",
            )

    def violation(self, value: float) -> float:
        """How far ``value`` lies beyond the bounds, in units of the distance between them, or of
        the one there is (1 if that is 0); 0 within them."""
        if math.isnan(value):
            return _MOST
        beyond = max(
            0.0,
            -math.inf if self.low is None else self.low - value,
            -math.inf if self.high is None else value - self.high,
        )
        if self.low is None or self.high is None:
            size = abs(self.high if self.low is None else self.low)
        else:
            size = self.high - self.low
        return _finite(beyond / (size or 1.0))


@dataclass(frozen=True)
class Wanted:
    """What is wanted of one measure: an objective, a constraint, or both.

    weight, total : its loss counts ``weight`` times in the sum called ``total``; None for an
        objective by itself.
    """

    measure: Measure
    objective: Objective | None = None
    constraint: Constraint | None = None
    weight: float = 1.0
    total: str | None = None

    def loss(self, value: float) -> float:
        """Lower is better: the objective's loss, or without one how far a bound is missed."""
        one = self.constraint.violation if self.objective is None else self.objective.loss
        return _finite(one(value))


@dataclass(frozen=True)
class Aims:
    """What is wanted of all measures, in the recipe's order.

    >>> from evocity.fitness import crumbs, fsi, gsi
    >>> aims = Aims((
    ...     Wanted(crumbs, Objective(crumbs)),
    ...     Wanted(gsi, constraint=Constraint(gsi, high=0.4)),
    ...     Wanted(fsi, Objective(fsi, target=2.0), weight=10, total="form"),
    ... ))
    >>> aims.names
    ('crumbs', 'form')
    >>> values = {"crumbs": 3.0, "gsi": 0.3, "fsi": 1.5}
    >>> aims.losses(values), aims.violation(values)
    ((3.0, 5.0), 0.0)
    """

    wanted: Sequence[Wanted]

    @cached_property
    def _terms(self) -> dict[str, list[Wanted]]:
        terms: dict[str, list[Wanted]] = {}
        for one in self.wanted:
            if one.objective is not None:
                terms.setdefault(one.total or one.measure.name, []).append(one)
        return terms

    @cached_property
    def _constrained(self) -> list[Wanted]:
        return [one for one in self.wanted if one.constraint is not None]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives: a measure's, or that of a sum."""
        return tuple(self._terms)

    @property
    def bounds(self) -> frozenset[str]:
        """Names of the measures that are constraints and nothing else."""
        return frozenset(one.measure.name for one in self.wanted if one.objective is None)

    def reweighted(self, weights: Mapping[str, float]) -> "Aims":
        """The same with other ``weights``, of measures by name that count in sums; other names
        are left out."""
        return Aims(
            tuple(
                replace(one, weight=weights[one.measure.name])
                if one.total is not None and one.measure.name in weights
                else one
                for one in self.wanted
            )
        )

    def losses(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """One loss an objective, lower is better and always finite, of raw ``values``."""
        return tuple(
            _finite(_sum(_finite(w.weight * w.loss(values[w.measure.name])) for w in terms))
            for terms in self._terms.values()
        )

    def violation(self, values: Mapping[str, float]) -> float:
        """Sum of the constraints' violations; 0 where all are kept (feasible). A measure that
        ``values`` lack is undefined, and breaks its bound."""
        violations = (
            one.constraint.violation(values.get(one.measure.name, math.nan))
            for one in self._constrained
        )
        return _finite(_sum(violations))


def _sum(numbers: Iterable[float]) -> float:
    """Added one after the other: what Python calls sum has other last bits from 3.12 on."""
    total = 0.0
    for one in numbers:
        total += one
    return total


def _finite(value: float) -> float:
    """Within what selection can compare; NaN is the worst of all."""
    if -_MOST <= value <= _MOST:  # nearly always
        return value
    return _MOST if math.isnan(value) else max(-_MOST, min(value, _MOST))
