"""Which constraints do the parents' own codes keep? Told before the first birth.

Where no parent keeps a bound, births must come to it from outside. Of most measures they may: a
town denser than its parents is a fair thing to ask for, and the user is told how far away the
parents are. Not of a measure of what births have of their parents, bounded on the side of its own
goal, such as `integrity` at least .5 or a `fabric_distance` to the parents of at most .15: the
parents have most of that, so a bound that none of them keeps is a fault of the recipe.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

import numpy as np

from evocity.errors import RecipeError
from evocity.fitness import Constraint, Measure
from evocity.search.algorithms import First
from evocity.search.evaluation import Engine
from evocity.search.evaluator import Outcome
from evocity.search.preparation import Prepared
from evocity.search.values import PARENTS
from evocity.search.wanted import MeasureEntry

#: How a parent's evaluation may end so that its values, or that they are undefined, are known.
_KNOWN = ("ok", "invalid")
_DIGITS = 3


@dataclass(frozen=True)
class Bounded:
    """A constraint, and what the parents' codes have: ``values``, name -> number, NaN where it is
    undefined; ``inherited``: whether it is of a measure of what births have of their parents."""

    constraint: Constraint
    values: dict[str, float]
    inherited: bool

    @property
    def kept(self) -> set[str]:
        """The parents that keep it."""
        return {name for name, one in self.values.items() if not self.constraint.violation(one)}

    @property
    def told(self) -> str:
        """The bounds in words: fsi ≥ 3."""
        name, unit = self.constraint.measure.name, self.constraint.measure.unit
        bounds = ("≥", self.constraint.low), ("≤", self.constraint.high)
        limits = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
        return f"{name} {' and '.join(limits)} {unit}".rstrip()

    @property
    def had(self) -> str:
        """What the parents have, in words."""
        return ", ".join(
            f"{name} {'none, it is undefined there' if math.isnan(value) else f'{value:.4g}'}"
            for name, value in self.values.items()
        )

    @property
    def nearest(self) -> str:
        """The key of a recipe with the bound next to the one here that a parent keeps; "" if there
        is none."""
        defined = [one for one in self.values.values() if not math.isnan(one)]
        if not defined:
            return ""
        best = min(defined, key=self.constraint.violation)
        low = self.constraint.low
        if low is not None and best < low:
            return f"min = {rounded(best, up=False):g}"
        return f"max = {rounded(best, up=True):g}"

    @property
    def hopeless(self) -> bool:
        """Whether no parent keeps it, and none of what is bred is expected to do so."""
        goal, values = self.constraint.measure.goal, self.values.values()
        low, high = self.constraint.low, self.constraint.high
        if goal == "max" and low is not None:
            return self.inherited and not any(value >= low for value in values)
        if goal == "min" and high is not None:
            return self.inherited and not any(value <= high for value in values)
        return False


def told_of_parents(prepared: Prepared, pool: Engine) -> list[str]:
    """In words, which constraints no parent of a run keeps, and what they have; nothing if there is
    a parent that keeps them all.

    The parents' codes are measured in the ``pool``, as births are; those of which a measure fails
    say nothing. Raises `RecipeError` if no parent keeps a bound that none can keep better, or if
    an algorithm cannot begin with what they have.
    """
    recipe = prepared.recipe
    names = {one.measure.name for one in prepared.aims.wanted if one.constraint is not None}
    names.update(recipe.described)
    if not names:
        return []
    jobs = [(source.genome, (), names) for source in prepared.sources]
    outcomes = pool.run("evaluate", jobs)
    sources = [outcome.values for outcome in outcomes]
    for one in recipe.local:
        algorithm = one.search.algorithm_of(one.run.population)
        algorithm.begin(First(np.empty((0, 1)), sources, recipe.limits))
    return told_of(bounded(prepared, outcomes))


def bounded(prepared: Prepared, outcomes: Sequence[Outcome]) -> list[Bounded]:
    """The constraints of a run with what its parents have, by the ``outcomes`` of their
    evaluations."""
    known = [
        (source.name, outcome.values)
        for source, outcome in zip(prepared.sources, outcomes, strict=True)
        if outcome.status in _KNOWN
    ]
    entries = [entry for entry in prepared.recipe.fitness for _ in entry.measures]
    return [
        Bounded(
            wanted.constraint,
            {name: values.get(wanted.measure.name, math.nan) for name, values in known},
            inherited(entry, wanted.measure),
        )
        for entry, wanted in zip(entries, prepared.aims.wanted, strict=True)
        if wanted.constraint is not None
    ]


def inherited(entry: MeasureEntry, measure: Measure) -> bool:
    """Whether a ``measure`` of a recipe's ``entry`` is of what births have of the run's parents."""
    return "sources" in measure.takes or (
        "reference" in measure.takes and entry.compared == PARENTS
    )


def told_of(found: Sequence[Bounded]) -> list[str]:
    """What a user should know of the constraints ``found``. Raises as `told_of_parents`."""
    if not any(one.values for one in found):
        return []
    unkept = [one for one in found if not one.kept]
    hopeless = [one for one in unkept if one.hopeless]
    if hopeless:
        raise RecipeError(
            "; ".join(f"no parent's own code keeps {one.told}: {one.had}" for one in hopeless),
            "bounds that a parent keeps: what is bred of the parents has no more of them than they",
            "write " + ", ".join(_remedy(one) for one in hopeless),
        )
    if unkept:
        return [
            f"no parent's own code keeps {one.told}: {one.had}; "
            f"births must come to it from there{_or(one.nearest)}"
            for one in unkept
        ]
    if found and not set.intersection(*(one.kept for one in found)):
        told = "; ".join(f"{one.told}: {', '.join(sorted(one.kept))}" for one in found)
        return [f"no parent's own code keeps all constraints at once. Kept are {told}"]
    return []


def rounded(value: float, *, up: bool) -> float:
    """The next number of few digits, upwards or downwards: as a bound, ``value`` keeps it."""
    context = Context(prec=_DIGITS, rounding=ROUND_CEILING if up else ROUND_FLOOR)
    return float(context.create_decimal(repr(float(value))))


def _remedy(one: Bounded) -> str:
    name = one.constraint.measure.name
    return f"{one.nearest} for {name}" if one.nearest else f"no bound for {name}, or take others"


def _or(nearest: str) -> str:
    return f", or write {nearest}, which one keeps" if nearest else ""


__all__ = ["Bounded", "bounded", "inherited", "rounded", "told_of", "told_of_parents"]
