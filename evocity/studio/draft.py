"""The draft of a run: all choices of the recipe desk, and the requests of its page, as JSON."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from evocity import fitness
from evocity.recipe.values import Title
from evocity.search.calibration.calibration import USUAL_GOALS
from evocity.studio.desk_maps import MapChoice, Number, Window
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
    """A measure to search by: its highest or lowest value, a ``target``, or the value of the first
    parent."""

    measure: Annotated[str, Field(max_length=200)]
    want: Literal["max", "min", "target", "first"]
    target: Annotated[float | None, typed_field("target", "a number")] = None


class Draft(Body):
    """All choices at the desk. An empty ``name`` stands for a name made of the names of the
    parents. ``minutes`` replace ``generations`` where they are given."""

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
        GoalChoice(measure=name, want=fitness.get(name).goal or "first") for name in USUAL_GOALS
    )

    @property
    def parents(self) -> list[MapChoice]:
        """The chosen maps, in their order."""
        return [choice for choice in self.maps if choice.chosen]


class MapNumber(Body):
    """A request about one map of the desk, or one run that began there."""

    map: Number


class BeginRequest(Body):
    """A request to begin a run by the recipe of the desk, or by the ``given`` one."""

    given: bool = False
