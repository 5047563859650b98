"""Objectives: a measure with a goal (max, min, target, like a city), as a loss to minimise."""

import math
from dataclasses import dataclass

from evocity.citymap import CityMap
from evocity.errors import FitnessError, is_number
from evocity.fitness.measure import Measure, shown

GOALS = ("max", "min", "target", "like")


@dataclass(frozen=True)
class Objective:
    """A measure with a goal; the objective turns values of the measure into losses for a search to
    minimise.

    Parameters
    ----------
    measure : the measure whose value the objective turns into a loss.
    goal : "max", "min", "target" or "like". If ``goal`` is None, the goal is "target" if a target
        is given, and otherwise the default goal of the measure.
    target : desired value in the measure's unit; only the goals "target" and "like" have a target.
        To make an objective with the goal "like", call `Objective.like`.

    Raises
    ------
    FitnessError : one of: no goal; a target that is missing or not finite; a target for the goal
        "max" or "min".

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
                f"{shown(self.measure)} cannot be an objective, because it is not a measure",
                "a measure, for example function.measures[0] of a declared function",
                'name a measure, for example evocity.fitness.get("gsi")',
            )
        name = self.measure.name
        goal = self.goal or (self.measure.goal if self.target is None else "target")
        if goal is None:
            raise FitnessError(
                f"the measure {name} has no default goal: neither high nor low values are better",
                "one of these keys: target = NUMBER; like = CITY; goal = 'max'; goal = 'min'",
                f'write for example target = 0.35, or like = "lyon-1er", under {name}',
            )
        if goal not in GOALS:
            raise FitnessError(
                f"goal = {goal!r} for {name} is not a goal",
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
        if not is_number(self.target) or not math.isfinite(self.target):
            raise FitnessError(
                f"target = {self.target!r} for {name} is not a finite number",
                "a finite number as the target value",
                f'write for example target = 0.35, or like = "lyon-1er", under {name}',
            )
        object.__setattr__(self, "target", float(self.target))

    @classmethod
    def like(cls, measure: Measure, city: CityMap) -> "Objective":
        """Make an objective that rewards likeness to the map ``city``; the target is the value of
        ``measure`` on this map.

        Raises `FitnessError` if the measure is undefined on the map ``city``.
        """
        value = measure(city)
        if math.isnan(value):
            reason = getattr(value, "reason", "NaN")
            raise FitnessError(
                f"the measure {measure.name} is undefined on {city.name}: {reason}",
                "a city for which the measure returns a number",
                "choose another city for the key 'like', or give the key 'target' a number",
            )
        return cls(measure, "like", value)

    def loss(self, value: float) -> float:
        """Compute the loss of ``value``; lower losses are better. The loss is −value for "max",
        value for "min", and \\|value − target\\| for the goals "target" and "like". NaN stays
        NaN."""
        if self.goal == "max":
            return -value
        return value if self.goal == "min" else abs(value - self.target)
