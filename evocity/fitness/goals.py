"""What is wanted of a measure: more of it, less of it, a number, or what a city has."""

import math
from dataclasses import dataclass
from numbers import Real

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Measure, shown

GOALS = ("max", "min", "target", "like")


@dataclass(frozen=True)
class Objective:
    """A measure and a goal, as a loss to be made small.

    Parameters
    ----------
    measure : what is measured.
    goal : "max", "min", "target" or "like"; None takes "target" if one is given, else the
        measure's own goal.
    target : the number wanted, in the measure's unit; for "target" and "like" only. For
        "like", build the objective with `Objective.like`.

    Raises
    ------
    FitnessError : no goal can be told, or the target is missing, not finite, or superfluous.

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
                f"an objective of {shown(self.measure)}",
                "a measure; of a function of several numbers one of its .measures",
                'name one, for example evocity.fitness.get("gsi")',
            )
        name = self.measure.name
        goal = self.goal or (self.measure.goal if self.target is None else "target")
        if goal is None:
            raise FitnessError(
                f"{name} without a goal; more of it is neither better nor worse",
                "a target, a city to be like, or goal = max or min",
                f'write for example target = 0.35, or like = "lyon-1er", under {name}',
            )
        if goal not in GOALS:
            raise FitnessError(
                f"goal = {goal!r} for {name}", f"one of {', '.join(GOALS)}", "choose one of these"
            )
        object.__setattr__(self, "goal", goal)
        if goal in ("max", "min"):
            if self.target is not None:
                raise FitnessError(
                    f"goal = {goal} and target = {self.target} for {name}",
                    "a goal or a target",
                    "leave one of the two out",
                )
            return
        if not isinstance(self.target, Real) or isinstance(self.target, bool):
            raise FitnessError(
                f"target = {self.target!r} for {name}",
                "a number",
                f'write for example target = 0.35, or like = "lyon-1er", under {name}',
            )
        if not math.isfinite(self.target):
            raise FitnessError(
                f"target = {self.target} for {name}", "a finite number", "give a finite target"
            )
        object.__setattr__(self, "target", float(self.target))

    @classmethod
    def like(cls, measure: Measure, city: CityMap) -> "Objective":
        """Be like ``city``: the target is what ``measure`` says of it.

        Raises `FitnessError` if the measure is undefined there.
        """
        value = measure(city)
        if math.isnan(value):
            reason = getattr(value, "reason", "NaN")
            raise FitnessError(
                f"{measure.name} is undefined on {city.name}: {reason}",
                "a city on which the measure is a number",
                "choose another city to be like, or give target = a number",
            )
        return cls(measure, "like", value)

    def loss(self, value: float) -> float:
        """How far ``value`` is from what is wanted, lower is better: −value for "max", value
        for "min", \\|value − target\\| otherwise. NaN stays NaN."""
        if self.goal == "max":
            return -value
        return value if self.goal == "min" else abs(value - self.target)
