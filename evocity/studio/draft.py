"""What is chosen at the recipe desk, and what its page asks for, in JSON of known form."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from evocity import fitness
from evocity.search.calibration import USUAL_GOALS
from evocity.search.values import Title
from evocity.studio.asked import Body, typed, whole
from evocity.studio.maps import Placed, Window

#: Goals, at most; bytes of a name, so that a folder can have it.
MOST_GOALS, MOST_NAME = 12, 200
_YEAR = 60 * 24 * 365  # minutes
_NAME = (
    f'a name of 100 letters and {MOST_NAME} bytes at most, without any of / \\ : * ? " < > | '
    "and without a dot before it"
)


def _short(name: str) -> str:
    if len(name.encode()) > MOST_NAME or not name.isprintable():
        raise ValueError(f"a name of {MOST_NAME} bytes at most that can be printed")
    return name


class Wanted(Body):
    """A measure to search by: the lowest or highest value, a ``target``, or what the first parent
    has of it."""

    measure: Annotated[str, Field(max_length=200)]
    want: Literal["max", "min", "target", "first"]
    target: Annotated[float | None, typed("target", "a number")] = None


class Draft(Body):
    """All that is chosen at the desk. ``name``: of the run, "" for one made of its parents'.
    ``minutes`` count in place of ``generations`` where they are told."""

    name: Annotated[
        Annotated[Title, AfterValidator(_short)] | Literal[""], typed("name of the run", _NAME)
    ] = ""
    seed: Annotated[int, whole("seed", 0, 2**53 - 1)] = 7
    population: Annotated[int, whole("individuals alive", 2, 1_000_000)] = 48
    generations: Annotated[int, whole("generations", 1, 1_000_000)] = 100
    minutes: Annotated[
        float | None, typed("minutes", f"a number from 1 to {_YEAR}", ge=1, le=_YEAR)
    ] = None
    window: Window = Window()
    maps: Annotated[tuple[Placed, ...], Field(max_length=64)] = ()
    goals: Annotated[tuple[Wanted, ...], Field(max_length=MOST_GOALS)] = tuple(
        Wanted(measure=name, want=fitness.get(name).goal or "first") for name in USUAL_GOALS
    )

    @property
    def parents(self) -> list[Placed]:
        """In their order."""
        return [one for one in self.maps if one.chosen]


class Which(Body):
    """One map on the desk."""

    map: Annotated[int, Field(ge=0, lt=2**31)]


class Begin(Body):
    """Which recipe a run is begun by: that of the desk, or the one ``given`` at the terminal."""

    given: bool = False


__all__ = ["MOST_NAME", "Begin", "Draft", "Wanted", "Which"]
