"""The choice of one map at the desk with its options of reading, and the state of its reading."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import Field

from evocity.citymap import MAX_SIDE, PIXEL_SIDES
from evocity.io.map_reader import READERS
from evocity.studio.desk_areas import Place
from evocity.studio.request_fields import Body, typed_field, whole_field

_LONGEST = 1000  # letters of an attribution, as a recipe takes them

Number = Annotated[int, Field(ge=0, lt=2**31)]
_METRES = "a number of metres from {:f} to {:.0f}".format(*PIXEL_SIDES)


def _metres(name: str) -> Any:
    return typed_field(name, _METRES, ge=PIXEL_SIDES[0], le=PIXEL_SIDES[1])


class Window(Body):
    """The window at which all maps are read."""

    pixels: Annotated[int, whole_field("width of the square map in pixels", 8, MAX_SIDE)] = 256
    metres_per_pixel: Annotated[float, _metres("metres per pixel")] = 2.0


class MapChoice(Body):
    """One map, whether it is a parent, and options of `evocity.read_map`."""

    map: Number
    chosen: bool = False
    at: Annotated[
        Place | None, typed_field("place of the window", "metres east and north on the map")
    ] = None
    attribution: Annotated[
        str | None,
        typed_field(
            "attribution", f"1 to {_LONGEST} printable letters", min_length=1, max_length=_LONGEST
        ),
    ] = None
    layer: Annotated[
        str | None,
        typed_field(
            "layer that contains the buildings", "1 to 100 letters", min_length=1, max_length=100
        ),
    ] = None
    height_column: Annotated[
        str | None,
        typed_field("column of heights", "1 to 100 letters", min_length=1, max_length=100),
    ] = None
    levels_column: Annotated[
        str | None,
        typed_field("column of storeys", "1 to 100 letters", min_length=1, max_length=100),
    ] = None
    default_height: Annotated[float | None, _metres("default height")] = None
    height_scale: Annotated[float | None, _metres("metres of a grey level or unit")] = None
    nodata: Annotated[float | None, typed_field("value of missing pixels", "a number")] = None
    terrain: Annotated[
        float | None,
        typed_field("elevation of the ground", "a number of metres", ge=-1000, le=10_000),
    ] = None
    terrain_map: Number | None = None

    @property
    def options(self) -> dict[str, Any]:
        hidden = {"map", "chosen", "terrain_map", "at"}
        return self.model_dump(exclude=hidden, exclude_none=True, mode="json")


def without_map(choices: Iterable[MapChoice], number: int) -> tuple[MapChoice, ...]:
    """Return ``choices`` without the map ``number``, which is the ground of no other map either."""
    return tuple(
        choice.model_copy(update={"terrain_map": None}) if choice.terrain_map == number else choice
        for choice in choices
        if choice.map != number
    )


@dataclass
class MapEntry:
    """One map: the facts ``about`` it or the ``fault``, and its overview (``over``); ``turn``, how
    often it was read; the options ``requested`` and those of the last reading (``read``). A
    ``child`` is a genome that a user kept."""

    number: int
    title: str
    source: str
    suffix: str = ""
    child: bool = False
    about: dict | None = None
    fault: dict | None = None
    over: dict | None = None
    turn: int = 0
    requested: dict = field(default_factory=dict)
    read: dict | None = None

    @property
    def is_own(self) -> bool:
        return bool(self.suffix)

    @property
    def state(self) -> dict:
        """Plain values for the page: no paths, and no reference systems."""
        about, over = self.about, self.over
        if about is not None:
            areas = about.get("areas") or {}
            bare = {use: {k: v for k, v in a.items() if k != "path"} for use, a in areas.items()}
            about = {k: v for k, v in about.items() if k != "lock_files"} | {"areas": bare}
        if over is not None:
            is_fixed = over["frame"]["crs"] is None
            hidden = ("frame", "key", "start")
            over = {k: v for k, v in over.items() if k not in hidden} | {"fixed": is_fixed}
        return {
            "map": self.number,
            "title": self.title,
            "own": self.is_own,
            "child": self.child,
            "takes": sorted(READERS[self.suffix].takes) if self.is_own else [],
            "about": about,
            "over": over,
            "fault": self.fault,
            "turn": self.turn,
            "reading": self.read != self.requested,
        }
