"""What a recipe may say of the run and of what it breeds: models of these sections, checked by
pydantic. `evocity.search.searching` has those of how it is searched.

Every model refuses unknown keys; `evocity.search.agreement` has the checks between sections.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    StringConstraints,
    model_validator,
)

from evocity.citymap import MAX_SIDE
from evocity.errors import GenomeError, shown, with_near_miss
from evocity.io.heights import TALLEST
from evocity.kinds import KINDS
from evocity.pavement import read_sides
from evocity.pavement.levels import USUAL
from evocity.search.values import (
    Finite,
    GenomeFile,
    Heights,
    LockFile,
    LonLat,
    MapName,
    Positive,
    RunFolder,
    Section,
    ShapeName,
    Title,
    fault,
    parent_place,
    parent_title,
)
from evocity.search.wanted import MeasureEntry, recorded_of


def _some_kind(name: str) -> str:
    if name not in KINDS:
        raise fault(with_near_miss(shown(name), name, KINDS), " or ".join(map(shown, KINDS)))
    return name


class RunSection(Section):
    """``[run]``. ``kind``: what is bred, see `evocity.kinds`. ``generations`` are bred
    after the first population, which is generation 0;
    ``record``: measures of every birth that nothing is wanted of."""

    name: Title = "run"
    kind: Annotated[str, AfterValidator(_some_kind)] = "fabric"
    seed: int = Field(0, ge=0, lt=2**63)
    population: int = Field(64, ge=2, le=1_000_000)
    generations: int = Field(100, ge=0, le=99_999_999)
    record: list[Annotated[MeasureEntry, BeforeValidator(recorded_of)]] = Field([])


class MapSection(Section):
    """``[map]``: the window every map is read at."""

    pixels: int = Field(256, ge=8, le=MAX_SIDE)
    metres_per_pixel: Positive = 2.0


#: The largest side of range blocks, px.
LARGEST_BLOCK = 64


class Parent(Section):
    """``[[parents]]``: a source city, of a ``map``, with the options of `evocity.read_map`; or one
    that was bred before, a ``genome`` in a file or individual ``id`` of a ``run``. In runs of
    other kinds a ``shape``, known by name or in a file, or the control points of a ``curve``,
    metres from the window's south-west corner."""

    map: MapName | None = None
    shape: ShapeName | None = None
    curve: (
        Annotated[
            list[Annotated[list[Finite], Field(min_length=2, max_length=2)]],
            Field(min_length=2, max_length=64),
        ]
        | None
    ) = None
    genome: GenomeFile | None = None
    run: RunFolder | None = None
    id: int | None = Field(None, ge=0, lt=2**63)
    name: str | None = None
    center: LonLat | None = None
    layer: str | None = None
    default_height: Positive = 6.0
    height_scale: Positive | None = None
    attribution: (
        Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=1000)]
        | None
    ) = None

    @model_validator(mode="after")
    def _of_one_place(self) -> "Parent":
        given = [key for key in PLACES if getattr(self, key) is not None]
        if len(given) != 1:
            allowed = "one of map, genome and run (with id); shape or curve in runs of these"
            raise fault(" and ".join(given) or "no map", allowed)
        if (self.id is None) == (self.run is not None):
            raise fault("run without id" if self.run else "id without run", "both, or none of them")
        own = self.model_fields_set.intersection(_OF_MAPS)
        strange = sorted(own) if self.map is None else []
        if strange:
            raise fault(f"{', '.join(strange)} beside {given[0]}", "these with a map alone")
        return self

    @property
    def bred(self) -> bool:
        """Whether it was bred before, and is no map."""
        return self.genome is not None or self.run is not None

    @property
    def given(self) -> str:
        """Which of `PLACES` it has."""
        return next(key for key in PLACES if getattr(self, key) is not None)

    @property
    def place(self) -> str:
        """Where it is from, in one text, which no other parent has."""
        return parent_place(self.map or formed_place(self), self.genome, self.run, self.id)

    @property
    def title(self) -> str | None:
        """What it is to be called; None for what its map is called."""
        title = parent_title(self.name, self.genome, self.run, self.id)
        if title is None and self.shape is not None:
            return Path(self.shape).stem
        return "curve" if title is None and self.curve is not None else title


def formed_place(parent: "Parent") -> str | None:
    """Where a shape or a curve is from, None for another parent."""
    if parent.curve is None:
        return parent.shape
    return "curve " + " ".join(f"{x:g},{y:g}" for x, y in parent.curve)


#: What a parent may be, as keys.
PLACES = ("map", "shape", "curve", "genome", "run")
#: Options of the reading of maps.
_OF_MAPS = ("center", "layer", "default_height", "height_scale", "attribution")


#: The most courses through one city.
MOST_COURSES = 16


class CourseSection(Section):
    """``[[curves]]``: a course through the cities of a run of sites: a strip of a ``width`` in
    metres, ``lay`` metres high (0: ground, or water), as a curve of so many control ``points``. It
    begins as the line in a file, ``from``, fitted; or straight from ``start`` to ``end``, metres
    from the window's south-west corner, east and north."""

    width: Positive
    lay: float = Field(0.0, ge=0, le=TALLEST, allow_inf_nan=False)
    file: LockFile | None = Field(None, alias="from")
    start: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = None
    end: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = None
    points: int = Field(4, ge=2, le=16)

    @model_validator(mode="after")
    def _from_one(self) -> "CourseSection":
        ends = [key for key in ("start", "end") if getattr(self, key) is not None]
        if (self.file is None) != (len(ends) == 2) or (self.file and ends):
            found = " and ".join((["from"] if self.file else []) + ends) or "neither"
            raise fault(found, "from, a file with a line; or start and end")
        return self


def _sides(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | str):
        raise fault(shown(value), 'a side of range blocks such as 4, or a range such as "2-16"')
    try:
        sides = read_sides(str(value))
    except GenomeError as error:
        raise fault(shown(value), error.expected) from None
    if not 2 <= (sides if isinstance(sides, int) else max(sides)) <= LARGEST_BLOCK:
        raise fault(shown(value), f"2 to {LARGEST_BLOCK} px")
    return sides


class GenomeSection(Section):
    """``[genome]``: how the sources are encoded, see `evocity.encode`.

    ``block`` is one side, or a range of sides such as "2-16" for leaves that follow the city, of
    which ``lifs`` or ``max_error`` decides. ``domains`` named twice count once; ``fit``: σ and β
    are then refined until the decoded map is closest; ``settle``: roofs are settled, of all that
    is measured, shown and exported.
    """

    block: Annotated[int | tuple[int, int], BeforeValidator(_sides)] = USUAL
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
    settle: bool = True

    @property
    def coding(self) -> dict[str, Any]:
        """These keys as `evocity.encode` takes them."""
        told = self.model_dump() | {"domains": tuple(self.domains)}
        return told | {"reach": None if self.reach == "all" else self.reach}

    @property
    def root(self) -> int:
        """The largest side of range blocks, px."""
        return self.block if isinstance(self.block, int) else self.block[1]


class LockedSection(Section):
    """``[locked]``: pixels that no birth changes, and the heights that stand there.

    ``footprints`` (polygons) or ``mask`` (a raster) tell which pixels. The heights are those of
    the source ``city``, the first unless named; or ``heights``, of a map file, or one in metres.
    """

    footprints: LockFile | None = None
    mask: LockFile | None = None
    city: str | None = None
    heights: Heights = None

    @model_validator(mode="after")
    def _one_place(self) -> "LockedSection":
        if (self.footprints is None) == (self.mask is None):
            both = "neither footprints nor mask" if self.mask is None else "footprints and mask"
            raise fault(both, "one of them")
        return self

    @property
    def place(self) -> str | None:
        """The file that tells which pixels; None if nothing is locked."""
        return self.footprints or self.mask

    @property
    def files(self) -> list[str]:
        """The files and bundled cities that tell what is locked."""
        return [name for name in (self.place, self.heights) if isinstance(name, str)]

    @property
    def asked(self) -> dict[str, float | str]:
        """The keys given, with their values."""
        return self.model_dump(exclude_none=True)
