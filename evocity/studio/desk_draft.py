"""The draft of a recipe: all choices at the desk, and the measures that the desk offers."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from evocity import fitness
from evocity.errors import FitnessError
from evocity.fitness.measure import Measure
from evocity.fitness.part import check_map_alone
from evocity.recipe.values import Title
from evocity.search.calibration.calibration import OF_PARENTS, USUAL_GOALS
from evocity.studio.desk_areas import Area
from evocity.studio.desk_maps import MapChoice, Window
from evocity.studio.request_fields import Body, typed_field, whole_field

#: Goals, at most; bytes of a name, so that a folder can have it.
MOST_GOALS, MOST_NAME = 12, 200
_YEAR = 60 * 24 * 365  # minutes
_NAME = (
    f'a name of at most 100 letters and {MOST_NAME} bytes, without any of / \\ : * ? " < > | '
    "and without a dot at its start"
)


def _check_name(name: str) -> str:
    if len(name.encode()) > MOST_NAME or not name.isprintable():
        raise ValueError(f"a printable name of at most {MOST_NAME} bytes")
    return name


class GoalChoice(Body):
    """A measure to search by: highest or lowest value, ``target``, value of the first parent, or
    mean of the parents' maps; or a constraint only: a ``band`` of ``target`` ± ``tolerance``, or
    the ``bounds``. ``min`` and ``max`` bound each of these. ``within``: only inside the boundary.
    """

    measure: Annotated[str, Field(max_length=200)]
    want: Literal["max", "min", "target", "first", "parents", "band", "bounds"]
    target: Annotated[float | None, typed_field("target", "a number")] = None
    tolerance: Annotated[float | None, typed_field("tolerance", "a number of 0 or more", ge=0)] = (
        None
    )
    min: Annotated[float | None, typed_field("lower bound", "a number")] = None
    max: Annotated[float | None, typed_field("upper bound", "a number")] = None
    within: bool = False

    @property
    def is_constraint(self) -> bool:
        """Whether it bounds a measure without improving it."""
        return self.want in ("band", "bounds")

    @property
    def bounds(self) -> dict[str, float]:
        """The bounds as a recipe has them."""
        low, high = self.min, self.max
        if self.want == "band" and self.target is not None and self.tolerance is not None:
            ends = (self.target - self.tolerance, self.target + self.tolerance)
            low, high = (float(f"{end:.10g}") for end in ends)
        return {key: end for key, end in (("min", low), ("max", high)) if end is not None}


#: The goals of a new desk: measure -> its `GoalChoice.want`.
_USUAL_WANTS = {
    name: "parents" if name in OF_PARENTS else fitness.get(name).goal or "first"
    for name in USUAL_GOALS
}


class Draft(Body):
    """All choices at the desk. An empty ``name`` stands for a name made of the parents' names."""

    name: Annotated[
        Annotated[Title, AfterValidator(_check_name)] | Literal[""],
        typed_field("name of the run", _NAME),
    ] = ""
    seed: Annotated[int, whole_field("seed", 0, 2**53 - 1)] = 7
    population: Annotated[int, whole_field("individuals alive", 2, 1_000_000)] = 48
    generations: Annotated[int, whole_field("generations", 1, 1_000_000)] = 100
    minutes: Annotated[
        float | None, typed_field("minutes", f"a number from 1 to {_YEAR}", ge=1, le=_YEAR)
    ] = None
    window: Window = Window()
    maps: Annotated[tuple[MapChoice, ...], Field(max_length=64)] = ()
    goals: Annotated[tuple[GoalChoice, ...], Field(max_length=MOST_GOALS)] = tuple(
        GoalChoice.model_validate({"measure": name, "want": want})
        for name, want in _USUAL_WANTS.items()
    )

    #: Locked pixels, and the boundary within which goals measure.
    lock: Area | None = None
    within: Area | None = None

    @property
    def parents(self) -> list[MapChoice]:
        return [choice for choice in self.maps if choice.chosen]


@dataclass(frozen=True)
class OfferedMeasure:
    """A measure of evocity, or of a ``file`` of the command line, which may have ``several``."""

    measure: Measure
    file: str | None = None
    several: bool = False

    def check(self, choice: GoalChoice) -> None:
        """Raise `FitnessError` for bounds that this measure cannot have."""
        name, (low, high), bounds = self.measure.name, self.measure.range, choice.bounds
        least, most = bounds.get("min", low), bounds.get("max", high)
        if least > most or (choice.want == "band" and least == most):
            raise FitnessError(
                f"the bounds of the measure {name} run from {least:g} to {most:g}",
                "a lower bound below the upper bound",
                "type another bound",
            )
        for end in bounds.values():
            if not low <= end <= high:
                raise FitnessError(
                    f"the bound {end:g} lies outside the values of the measure {name}",
                    f"a number from {low:g} to {high:g}",
                    "type another bound, or a narrower band",
                )

    def goal(self, choice: GoalChoice, site: str | None) -> dict:
        """Return a ``choice`` as a job has it; ``site``: the file of the boundary. Raises
        `FitnessError` for an incomplete choice."""
        name, bounds = self.measure.name, choice.bounds
        if choice.want == "band" and len(bounds) < 2:
            raise FitnessError(
                f"the band of the measure {name} is incomplete",
                "a target, and a tolerance above 0",
                "type both numbers, or choose another goal",
            )
        if choice.want == "bounds" and not bounds:
            raise FitnessError(
                f"the measure {name} has no bound",
                "a lower bound, an upper bound, or both",
                "type a bound, or choose another goal",
            )
        if choice.want == "target" and choice.target is None:
            raise FitnessError(
                f"the goal of the measure {name} is a target without a number",
                "a number as target",
                "type the target, or choose another goal",
            )
        if choice.want == "first" and self.measure.goal is not None:
            raise FitnessError(
                f"the measure {name} cannot have the goal “the value of the first parent”",
                "the goal of a high value, a low value, or a target",
                "choose one of these goals",
            )
        goal = choice.want if choice.want in ("max", "min") else None
        return {
            "measure": choice.measure,
            "file": self.file,
            "several": self.several,
            "goal": None if goal == self.measure.goal else goal,
            "target": choice.target if choice.want == "target" else None,
            "of_parents": choice.want == "parents",
            "bounds": choice.bounds,
            "is_constraint": choice.is_constraint,
            "within": site if choice.within else None,
        }

    @property
    def state(self) -> dict:
        measure = self.measure
        return {
            "name": measure.name,
            "goal": measure.goal,
            "unit": measure.unit,
            "range": [end if abs(end) < float("inf") else None for end in measure.range],
            "told": measure.summary,
            "own": self.file is not None,
            "usual": _USUAL_WANTS.get(measure.name, ""),
            "site": self._site,
        }

    @property
    def _site(self) -> str:
        """The parts of a map that it measures: "any", "rectangle", or "" for only the whole."""
        try:
            check_map_alone(self.measure)
        except FitnessError:
            return ""
        return "any" if self.measure.any_site else "rectangle"
