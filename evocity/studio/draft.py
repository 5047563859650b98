"""What is chosen at the recipe desk, and what its page asks for, in JSON of known form."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from evocity import fitness
from evocity.search.calibration import USUAL_GOALS
from evocity.search.values import Title
from evocity.studio.asked import Body
from evocity.studio.maps import Placed, Window

#: Goals, at most; bytes of a name, so that a folder can have it.
MOST_GOALS, MOST_NAME = 12, 200


def _short(name: str) -> str:
    if len(name.encode()) > MOST_NAME or not name.isprintable():
        raise ValueError(f"a name of {MOST_NAME} bytes at most that can be printed")
    return name


class Wanted(Body):
    """A measure to search by: the lowest or highest value, a ``target``, or what the first parent
    has of it."""

    measure: Annotated[str, Field(max_length=200)]
    want: Literal["max", "min", "target", "first"]
    target: float | None = None


class Draft(Body):
    """All that is chosen at the desk. ``name``: of the run, "" for one made of its parents'.
    ``minutes`` count in place of ``generations`` where they are told."""

    name: Annotated[Title, AfterValidator(_short)] | Literal[""] = ""
    seed: Annotated[int, Field(ge=0, lt=2**53)] = 7
    population: Annotated[int, Field(ge=2, le=1_000_000)] = 48
    generations: Annotated[int, Field(ge=1, le=1_000_000)] = 100
    minutes: Annotated[float, Field(ge=1, le=60 * 24 * 365)] | None = None
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
