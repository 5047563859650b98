"""Sections of a recipe on the run and on what it breeds: run, map, parents, curves, genome, locked.

`evocity.recipe.search_section` has the sections on the search, `evocity.recipe.consistency` the
checks between sections.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, StringConstraints, model_validator

from evocity.citymap import MAX_SIDE
from evocity.errors import GenomeError, spell
from evocity.io.heights import TALLEST
from evocity.kinds import KINDS
from evocity.pavement import read_sides
from evocity.pavement.levels import USUAL
from evocity.recipe.measures import MeasureEntry, record_entry
from evocity.recipe.values import (
    ExistingFile,
    Heights,
    LonLat,
    MapName,
    RunFolder,
    ShapeName,
    Terrain,
    Title,
    parent_place,
    parent_title,
)
from evocity.section import Finite, Positive, Section, fault, name_in

#: A point in metres from the window's south-west corner, east and north.
Point = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class RunSection(Section):
    """``[run]``. ``kind``: the kind of chromosome, see `evocity.kinds`. ``generations``: how many
    follow the first population, which is generation 0. ``record``: measures of every birth that are
    neither goals nor constraints."""

    name: Title = "run"
    kind: Annotated[str, name_in(lambda: KINDS)] = "fabric"
    seed: int = Field(0, ge=0, lt=2**63)
    population: int = Field(64, ge=2, le=1_000_000)
    generations: int = Field(100, ge=0, le=99_999_999)
    record: list[Annotated[MeasureEntry, BeforeValidator(record_entry)]] = Field([])


class MapSection(Section):
    """``[map]``: the window that every map is read in."""

    pixels: int = Field(256, ge=8, le=MAX_SIDE)
    metres_per_pixel: Positive = 2.0


#: The largest side of range blocks, px.
LARGEST_BLOCK = 64


#: The keys that give a parent, exactly one of them.
PLACES = ("map", "shape", "curve", "genome", "run")
# Options of reading maps.
_MAP_KEYS = (
    *("center", "layer", "default_height", "height_scale"),
    *("height_column", "levels_column", "nodata", "terrain", "attribution"),
)


class Parent(Section):
    """``[[parents]]``: a source city. It is a ``map`` with the options of `evocity.read_map`, or an
    individual bred before: a ``genome`` in a file, or ``id`` of a ``run``. Runs of other kinds take
    a ``shape``, a known name or a file, or the control points of a ``curve``, metres from the
    window's south-west corner."""

    map: MapName | None = None
    shape: ShapeName | None = None
    curve: Annotated[list[Point], Field(min_length=2, max_length=64)] | None = None
    genome: ExistingFile | None = None
    run: RunFolder | None = None
    id: int | None = Field(None, ge=0, lt=2**63)
    name: str | None = None
    center: LonLat | None = None
    layer: str | None = None
    default_height: Positive = 6.0
    height_scale: Positive | None = None
    height_column: str | None = Field(None, min_length=1)
    levels_column: str | None = Field(None, min_length=1)
    nodata: Finite | None = None
    terrain: Terrain = None
    attribution: (
        Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=1000)]
        | None
    ) = None

    @model_validator(mode="after")
    def _check_place(self) -> "Parent":
        given = [key for key in PLACES if getattr(self, key) is not None]
        if len(given) != 1:
            allowed = "one of map, genome and run (with id); shape or curve in runs of these kinds"
            raise fault(" and ".join(given) or "no map", allowed)
        if (self.id is None) == (self.run is not None):
            raise fault("run without id" if self.run else "id without run", "both, or neither")
        if self.map is None and (map_keys := self.model_fields_set.intersection(_MAP_KEYS)):
            keys = ", ".join(sorted(map_keys))
            raise fault(
                f"the key '{given[0]}' is given together with {keys}",
                f"the key 'map' in place of '{given[0]}', or a parent without {keys}",
            )
        return self

    @property
    def bred(self) -> bool:
        """Whether it is an individual bred before, and not a map."""
        return self.genome is not None or self.run is not None

    @property
    def given(self) -> str:
        """The key of `PLACES` that gives it."""
        return next(key for key in PLACES if getattr(self, key) is not None)

    @property
    def place(self) -> str:
        """Its origin as one text, which no other parent has."""
        place = self.map or self.shape
        if self.curve is not None:
            place = "curve " + " ".join(f"{x:g},{y:g}" for x, y in self.curve)
        return parent_place(place, self.genome, self.run, self.id)

    @property
    def title(self) -> str | None:
        """Its name in the run; None if it is named by its map."""
        title = parent_title(self.name, self.genome, self.run, self.id)
        if title is None and self.shape is not None:
            return Path(self.shape).stem
        return "curve" if title is None and self.curve is not None else title


#: The most courses through one city.
MOST_COURSES = 16


class CourseSection(Section):
    """``[[curves]]``: a course through the cities of a run of sites: a strip of a ``width`` in
    metres, ``lay`` metres high (0: ground, or water), as a curve of so many control ``points``. It
    begins as the line in a file, ``from``, fitted; or straight from ``start`` to ``end``, metres
    from the window's south-west corner, east and north."""

    width: Positive
    lay: float = Field(0.0, ge=0, le=TALLEST, allow_inf_nan=False)
    file: ExistingFile | None = Field(None, alias="from")
    start: Point | None = None
    end: Point | None = None
    points: int = Field(4, ge=2, le=16)

    @model_validator(mode="after")
    def _check_begin(self) -> "CourseSection":
        ends = [key for key in ("start", "end") if getattr(self, key) is not None]
        if (self.file is None) != (len(ends) == 2) or (self.file and ends):
            found = " and ".join((["from"] if self.file else []) + ends) or "neither from nor start"
            raise fault(found, "from, a file with a line; or start and end")
        return self


def read_block(value: Any) -> Any:
    """Read the sides of range blocks, px: one, or the finest and the largest."""
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise fault(spell(value), 'a side of range blocks such as 4, or a range such as "2-16"')
    try:
        sides = read_sides(str(value))
    except GenomeError as error:
        raise fault(spell(value), error.expected) from None
    if not 2 <= (sides if isinstance(sides, int) else max(sides)) <= LARGEST_BLOCK:
        raise fault(spell(value), f"2 to {LARGEST_BLOCK} px")
    return sides


def _read_settling(value):
    if isinstance(value, bool) or value == "roofs":
        return value
    raise fault(spell(value), 'true, false or "roofs"')


class GenomeSection(Section):
    """``[genome]``: how the sources are encoded, see `evocity.encode`.

    ``block``: one side, or a range of sides such as "2-16" for leaves that follow the city;
    ``lifs`` or ``max_error`` decides how many leaves there are. ``domains`` named twice count once.
    ``fit`` refines σ and β until the decoded map is closest. ``settle`` settles
    buildings, or only roofs, in all measures, pictures and exports.
    """

    block: Annotated[int | tuple[int, int], BeforeValidator(read_block)] = USUAL
    lifs: int | None = Field(None, ge=1)
    max_error: float | None = Field(None, ge=0, allow_inf_nan=False)
    domains: Annotated[
        list[Annotated[int, Field(ge=2)]],
        Field(min_length=1),
        AfterValidator(lambda domains: list(dict.fromkeys(domains))),
    ] = Field([2])
    reach: Annotated[int, Field(ge=0, le=MAX_SIDE)] | Literal["all"] = 24
    sigma_max: float = Field(0.9, gt=0, le=1000, allow_inf_nan=False)
    topological: float | None = Field(None, ge=0, le=1)
    fit: bool = True
    settle: Annotated[bool | str, BeforeValidator(_read_settling)] = True

    @property
    def coding(self) -> dict[str, Any]:
        """These keys as `evocity.encode` takes them."""
        reach = None if self.reach == "all" else self.reach
        return self.model_dump() | {"domains": tuple(self.domains), "reach": reach}

    @property
    def root(self) -> int:
        """The largest side of range blocks, px."""
        return self.block if isinstance(self.block, int) else self.block[1]


class LockedSection(Section):
    """``[locked]``: pixels that no birth changes, and their heights.

    ``footprints`` (polygons) or ``mask`` (a raster) marks the pixels. Their heights are those of
    the source ``city``, by default the first; or ``heights``, a map file or one height in metres.
    """

    footprints: ExistingFile | None = None
    mask: ExistingFile | None = None
    city: str | None = None
    heights: Heights = None

    @model_validator(mode="after")
    def _check_place(self) -> "LockedSection":
        if (self.footprints is None) == (self.mask is None):
            found = "neither footprints nor mask" if self.mask is None else "footprints and mask"
            raise fault(found, "one of footprints and mask")
        return self

    @property
    def place(self) -> str | None:
        """The file that marks the pixels; None if nothing is locked."""
        return self.footprints or self.mask

    @property
    def files(self) -> list[str]:
        """The files and bundled cities that define what is locked."""
        return [name for name in (self.place, self.heights) if isinstance(name, str)]

    @property
    def given(self) -> dict[str, float | str]:
        """The given keys, with their values."""
        return self.model_dump(exclude_none=True)
