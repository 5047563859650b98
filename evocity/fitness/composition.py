"""The aims of a search: objectives, weighted sums of them, and constraints, as losses."""

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from evocity.errors import FitnessError, is_number
from evocity.fitness.goals import Objective
from evocity.fitness.measure import Measure

_MOST = sys.float_info.max

#: Default name of the objective that weighted measures form together.
WEIGHTED = "weighted sum"


@dataclass(frozen=True)
class Constraint:
    """Bounds on the value of a measure: ``low`` ≤ value ≤ ``high``; None means no bound.

    Raises `FitnessError` if both bounds are None, if a bound is not finite, or if ``low`` is not
    below ``high``.

    >>> from evocity.fitness import gsi
    >>> Constraint(gsi, 0.2, 0.4).violation(0.5)
    0.5
    """

    measure: Measure
    low: float | None = None
    high: float | None = None

    def __post_init__(self):
        bounds = [bound for bound in (self.low, self.high) if bound is not None]
        numbers = all(is_number(bound) and math.isfinite(bound) for bound in bounds)
        if not bounds or not numbers or (len(bounds) == 2 and bounds[0] >= bounds[1]):
            raise FitnessError(
                f"the bounds {self.low} and {self.high} of {self.measure.name} are invalid",
                "one or two finite bounds, the lower bound first",
                "write for example min = 0.2, max = 0.4",
            )

    def violation(self, value: float) -> float:
        """Compute how far ``value`` lies outside the bounds; the result is 0 for a value within the
        bounds.

        The unit of a violation is the distance between the two bounds. With a single bound, the
        unit is the bound's absolute value, or 1 if the bound is 0.
        """
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
    """The aim of one measure: an objective, a constraint, or both.

    weight : factor of the measure's loss in a weighted sum.
    total : name of the weighted sum; None makes the measure a separate objective.
    """

    measure: Measure
    objective: Objective | None = None
    constraint: Constraint | None = None
    weight: float = 1.0
    total: str | None = None

    def loss(self, value: float) -> float:
        """Compute the loss of the objective, or the violation of the constraint if there is no
        objective."""
        loss = self.constraint.violation if self.objective is None else self.objective.loss
        return _finite(loss(value))


@dataclass(frozen=True)
class Aims:
    """The aims of all measures of a search, in the order of the recipe's entries.

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
        for aim in self.wanted:
            if aim.objective is not None:
                terms.setdefault(aim.total or aim.measure.name, []).append(aim)
        return terms

    @cached_property
    def _objectives(self) -> tuple[str, ...]:
        return tuple(aim.measure.name for aim in self.wanted if aim.objective is not None)

    @cached_property
    def _constrained(self) -> list[Wanted]:
        return [aim for aim in self.wanted if aim.constraint is not None]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives; each is the name of a measure or of a weighted sum."""
        return tuple(self._terms)

    @property
    def bounds(self) -> frozenset[str]:
        """Names of the measures that have a constraint and no objective."""
        return frozenset(aim.measure.name for aim in self.wanted if aim.objective is None)

    def reweighted(self, weights: Mapping[str, float]) -> "Aims":
        """Return a copy of the aims with new ``weights``, a mapping from names of measures to
        weights. The method ignores measures that do not belong to a weighted sum."""
        return Aims(
            tuple(
                replace(aim, weight=weights[aim.measure.name])
                if aim.total is not None and aim.measure.name in weights
                else aim
                for aim in self.wanted
            )
        )

    def complete(self, values: Mapping[str, float]) -> bool:
        """Check whether the ``values`` of a birth include a number for each objective. A successful
        birth lacks a number for an objective only if the objective is newer than the birth."""
        return not any(math.isnan(values.get(name, math.nan)) for name in self._objectives)

    def losses(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Compute one loss for each objective from raw ``values``. All losses are finite, and lower
        losses are better than higher losses.

        A measure without a value has the worst loss.
        """

        def weighted(aim: Wanted) -> float:
            return _finite(aim.weight * aim.loss(values.get(aim.measure.name, math.nan)))

        return tuple(_finite(_sum(map(weighted, terms))) for terms in self._terms.values())

    def violation(self, values: Mapping[str, float]) -> float:
        """Sum the violations of all constraints; the sum is 0 if all constraints hold.

        A measure without a value counts as undefined and violates its constraint. If the values
        lack a number for an objective (see `complete`), the violation is the greatest possible,
        because the birth cannot be compared.
        """
        if not self.complete(values):
            return _MOST
        violations = (
            aim.constraint.violation(values.get(aim.measure.name, math.nan))
            for aim in self._constrained
        )
        return _finite(_sum(violations))


def _sum(numbers: Iterable[float]) -> float:
    """Add one number after the other: from Python 3.12 on, sum gives other last bits."""
    total = 0.0
    for number in numbers:
        total += number
    return total


def _finite(value: float) -> float:
    """Limit a number to those that selection can compare; NaN becomes the worst."""
    if -_MOST <= value <= _MOST:  # nearly always
        return value
    return _MOST if math.isnan(value) else max(-_MOST, min(value, _MOST))
