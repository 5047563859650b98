"""Constraints that the parents' own codes keep, checked before the first birth.

If no parent keeps a bound, births must reach it from outside. With most measures they can, and a
note tells the user how far away the parents are. Births have no more of their parents than these
have themselves (`integrity`, `fabric_distance`): such a bound is then a fault of the recipe.
Founders have one city each, so they always break a bound on `smallest_share`; only children must
keep it. No child keeps it if a parent has no building outside the locked pixels.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

import numpy as np

from evocity.errors import RecipeError
from evocity.evaluation import Engine
from evocity.evaluation.evaluator import Outcome
from evocity.fitness import Constraint, smallest_share
from evocity.fitness.part import own_name
from evocity.recipe.values import PARENTS
from evocity.search.preparation.preparation import Prepared
from evocity.selection.algorithms import First

#: Statuses of a parent's evaluation after which its values are known, or known to be undefined.
_KNOWN = ("ok", "invalid")
_DIGITS = 3


@dataclass(frozen=True)
class ParentConstraint:
    """A constraint, and the ``values`` that the parents' codes have, name -> number, NaN if
    undefined; ``inherited``: whether its measure is of what births have of their parents;
    ``crossed``: whether only children of several parents can keep it."""

    constraint: Constraint
    values: dict[str, float]
    inherited: bool
    crossed: bool = False

    @property
    def keepers(self) -> set[str]:
        """The parents that keep it."""
        violation = self.constraint.violation
        return {name for name, value in self.values.items() if not violation(value)}

    @property
    def bounds_text(self) -> str:
        """The bounds in words, such as "fsi ≥ 3"."""
        name, unit = self.constraint.measure.name, self.constraint.measure.unit
        bounds = ("≥", self.constraint.low), ("≤", self.constraint.high)
        limits = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
        return f"{name} {' and '.join(limits)} {unit}".rstrip()

    @property
    def values_text(self) -> str:
        """The parents' values in words."""
        return ", ".join(
            f"{name} {'none, it is undefined there' if math.isnan(value) else f'{value:.4g}'}"
            for name, value in self.values.items()
        )

    @property
    def nearest(self) -> str:
        """The recipe's key with the nearest bound that a parent keeps; "" if no parent has a
        value."""
        defined = [value for value in self.values.values() if not math.isnan(value)]
        if not defined:
            return ""
        best = min(defined, key=self.constraint.violation)
        low = self.constraint.low
        if low is not None and best < low:
            return f"min = {round_bound(best, up=False):g}"
        return f"max = {round_bound(best, up=True):g}"

    @property
    def hopeless(self) -> bool:
        """Whether no parent keeps it, and no birth is expected to."""
        goal, values = self.constraint.measure.goal, self.values.values()
        low, high = self.constraint.low, self.constraint.high
        if goal == "max" and low is not None:
            return self.inherited and not any(value >= low for value in values)
        if goal == "min" and high is not None:
            return self.inherited and not any(value <= high for value in values)
        return False


def describe_unkept_bounds(prepared: Prepared, engine: Engine) -> list[str]:
    """Describe the constraints that no parent keeps, and the parents' values.

    The ``engine`` measures the parents' codes. Raises `RecipeError` if no parent keeps a bound that
    no birth can keep better, or if an algorithm cannot begin with the parents' values.
    """
    _check_free_buildings(prepared)
    recipe = prepared.recipe
    names = {one.measure.name for one in prepared.aims.wanted if one.constraint is not None}
    names.update(recipe.described)
    if not names:
        return []
    outcomes = engine.run("evaluate", [(one.genome, (), names) for one in prepared.sources])
    values = [outcome.values for outcome in outcomes]
    for local in recipe.local:
        algorithm = local.search.algorithm_of(local.run.population)
        algorithm.begin(First(np.empty((0, 1)), values, recipe.limits))
    return describe_unkept(parent_constraints(prepared, outcomes))


def parent_constraints(prepared: Prepared, outcomes: Sequence[Outcome]) -> list[ParentConstraint]:
    """Return the constraints of a run with its parents' values, from the ``outcomes`` of their
    evaluations."""
    known = [
        (source.name, outcome.values)
        for source, outcome in zip(prepared.sources, outcomes, strict=True)
        if outcome.status in _KNOWN
    ]
    entries = [entry for entry in prepared.recipe.fitness for _ in entry.measures]
    return [
        ParentConstraint(
            wanted.constraint,
            {name: values.get(wanted.measure.name, math.nan) for name, values in known},
            "sources" in wanted.measure.takes
            or ("reference" in wanted.measure.takes and entry.compared == PARENTS),
            own_name(wanted.measure.name) == smallest_share.name,
        )
        for entry, wanted in zip(entries, prepared.aims.wanted, strict=True)
        if wanted.constraint is not None
    ]


def describe_unkept(constraints: Sequence[ParentConstraint]) -> list[str]:
    """Describe what is wrong with ``constraints``. Raises as `describe_unkept_bounds`."""
    constraints = [one for one in constraints if not one.crossed]
    if not any(one.values for one in constraints):
        return []
    unkept = [one for one in constraints if not one.keepers]
    texts = [f"no parent's own code keeps {one.bounds_text}: {one.values_text}" for one in unkept]
    if any(one.hopeless for one in unkept):
        pairs = list(zip(unkept, texts, strict=True))
        raise RecipeError(
            "; ".join(text for one, text in pairs if one.hopeless),
            "bounds that a parent keeps: what is bred of the parents has no more of them than they",
            "write " + ", ".join(_remedy(one) for one in unkept if one.hopeless),
        )
    if unkept:
        return [
            f"{text}; births must come to it from there"
            + (f", or write {one.nearest}, which one keeps" if one.nearest else "")
            for one, text in zip(unkept, texts, strict=True)
        ]
    if constraints and not set.intersection(*(one.keepers for one in constraints)):
        kept = "; ".join(
            f"{one.bounds_text}: {', '.join(sorted(one.keepers))}" for one in constraints
        )
        return [f"no parent's own code keeps all constraints at once. Kept are {kept}"]
    return _describe_broken(constraints)


def _describe_broken(constraints: Sequence[ParentConstraint]) -> list[str]:
    """Name the parents whose codes break ``constraints`` that another parent keeps."""
    broken = [
        f"{name} breaks {one.bounds_text} ({value:.4g})"
        for one in constraints
        for name, value in one.values.items()
        if name not in one.keepers and not math.isnan(value)
    ]
    if not broken:
        return []
    return [
        f"the code of a parent breaks a bound: {'; '.join(broken)}. Children that are like this "
        "parent lose to all that keep the bound. If you changed the maps since `evocity recipe "
        "new`, measure the bounds again with it"
    ]


def _check_free_buildings(prepared: Prepared) -> None:
    """Raise `RecipeError` if children need a share of each parent, and all buildings of a parent
    stand in locked pixels."""
    if prepared.condensation is None or prepared.header.shares == "all":
        return
    locked = prepared.condensation.mask
    bare = [one.name for one in prepared.sources if not (one.city.built & ~locked).any()]
    for wanted in prepared.aims.wanted if bare else ():
        bound = wanted.constraint
        if wanted.measure.name == smallest_share.name and bound is not None and bound.low:
            raise RecipeError(
                f"no child keeps {ParentConstraint(bound, {}, True).bounds_text}: all buildings of "
                f"{' and of '.join(bare)} stand in locked pixels, which do not count",
                "parents with buildings outside the locked pixels",
                "lock less, choose other parents or windows, or remove the bound on "
                f"{smallest_share.name}",
            )


def round_bound(value: float, *, up: bool) -> float:
    """Return the next number of three digits, upwards or downwards: ``value`` keeps it as a
    bound."""
    context = Context(prec=_DIGITS, rounding=ROUND_CEILING if up else ROUND_FLOOR)
    return float(context.create_decimal(repr(float(value))))


def _remedy(one: ParentConstraint) -> str:
    name = one.constraint.measure.name
    return f"{one.nearest} for {name}" if one.nearest else f"no bound for {name}, or take others"
