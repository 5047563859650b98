"""Objectives: a measure with a goal (max, min, target, like a city), as a loss to minimise."""

import math
from dataclasses import dataclass
from numbers import Real

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Measure, shown

GOALS = ("max", "min", "target", "like")


@dataclass(frozen=True)
class Objective:
    """A measure and a goal, as a loss to minimise.

    Parameters
    ----------
    measure : the measure.
    goal : "max", "min", "target" or "like"; None takes "target" if there is a target, else the
        measure's own goal.
    target : the desired number, in the measure's unit, for "target" and "like" only. For "like",
        build the objective with `Objective.like`.

    Raises
    ------
    FitnessError : there is no goal, or the target is missing, not finite, or superfluous.

    >>> from evocity.fitness import gsi
    >>> wanted = Objective(gsi, target=0.35)
    >>> wanted.goal, round(wanted.loss(0.5), 2)
    ('target', 0.15)
    """

    measure: Measure
    goal: str | None = None
    target: float | None = None

    def __post_init__(self):
        if not isinstance(self.measure, Measure):
            raise FitnessError(
                f"an objective cannot be made of {shown(self.measure)}",
                "a measure; if a function returns several numbers, one of its .measures",
                'name a measure, for example evocity.fitness.get("gsi")',
            )
        name = self.measure.name
        goal = self.goal or (self.measure.goal if self.target is None else "target")
        if goal is None:
            raise FitnessError(
                f"{name} has no goal, since more of it is neither better nor worse",
                "a target value, a city to be like, or goal = 'max' or 'min'",
                f'write for example target = 0.35, or like = "lyon-1er", under {name}',
            )
        if goal not in GOALS:
            raise FitnessError(
                f"goal = {goal!r} for {name}",
                f"one of {', '.join(GOALS)}",
                "choose a goal from this list",
            )
        object.__setattr__(self, "goal", goal)
        if goal in ("max", "min"):
            if self.target is not None:
                raise FitnessError(
                    f"{name} has both goal = {goal} and target = {self.target}",
                    "either a goal or a target",
                    "leave out the goal or the target",
                )
            return
        if not isinstance(self.target, Real) or isinstance(self.target, bool):
            raise FitnessError(
                f"target = {self.target!r} for {name} is not a number",
                "a number",
                f'write for example target = 0.35, or like = "lyon-1er", under {name}',
            )
        if not math.isfinite(self.target):
            raise FitnessError(
                f"target = {self.target} for {name} is not finite",
                "a finite number",
                "give a finite target",
            )
        object.__setattr__(self, "target", float(self.target))

    @classmethod
    def like(cls, measure: Measure, city: CityMap) -> "Objective":
        """Make an objective to be like ``city``: its value of ``measure`` is the target.

        Raises `FitnessError` if the measure is undefined there.
        """
        value = measure(city)
        if math.isnan(value):
            reason = getattr(value, "reason", "NaN")
            raise FitnessError(
                f"{measure.name} is undefined on {city.name}: {reason}",
                "a city for which the measure returns a number",
                "choose another city for like, or give a number as target",
            )
        return cls(measure, "like", value)

    def loss(self, value: float) -> float:
        """Compute the loss of ``value``, lower is better: −value for "max", value
        for "min", \\|value − target\\| otherwise. NaN stays NaN."""
        if self.goal == "max":
            return -value
        return value if self.goal == "min" else abs(value - self.target)
