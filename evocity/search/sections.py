"""What a recipe may say: the models of its sections, checked by pydantic.

Every model refuses unknown keys; `evocity.search.agreement` has the checks between sections.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails

from evocity.citymap import MAX_SIDE
from evocity.errors import GenomeError, shown, with_near_miss
from evocity.io.heights import TALLEST
from evocity.kinds import KINDS
from evocity.pavement import read_sides
from evocity.pavement.levels import USUAL
from evocity.search.algorithms import DEFAULT, Algorithm, algorithms
from evocity.search.values import (
    ClusterAddress,
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
_OF_MAPS = ("center", "layer", "default_height", "height_scale")


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


def some_algorithm(name: str) -> str:
    """The ``name``, if it is an algorithm's; else a fault."""
    known = algorithms()
    if name not in known:
        raise fault(with_near_miss(shown(name), name, known), " or ".join(map(shown, known)))
    return name


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


#: Bytes of the units of memory: decimal, or binary with an i.
_UNITS = {
    f"{letter}{i}B".lower(): base**power
    for i, base in (("", 1000), ("i", 1024))
    for power, letter in enumerate("kMGT", 1)
}


def bytes_of(text: str) -> int | None:
    """Bytes of memory in words: "512 MB", "4 GB", "1.5 GiB"; None for "none". Raises ValueError
    for anything else."""
    if text == "none":
        return None
    found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?) ?([kmgt]i?b)", text.strip().lower(), re.ASCII)
    if found is None or not (size := int(float(found[1]) * _UNITS[found[2]])):
        raise ValueError(text)
    return size


def _some_memory(text: str) -> str:
    try:
        bytes_of(text)
    except ValueError:
        raise fault(shown(text), 'memory such as "512 MB", "4 GB" or "4 GiB", or "none"') from None
    return text


class EvaluationSection(Section):
    """``[evaluation]``. ``workers`` 0: in the calling process, without deadlines. ``cluster``: the
    address of a Dask scheduler, or "local:N"; ``workers`` is then what each of its workers hosts.

    ``timeout``: seconds, one individual. ``memory``: what one individual may take besides what its
    worker has before, such as "4 GB", or "none". ``max_failures``: the share of a generation's
    births that may fail before the run stops.
    """

    workers: int | None = Field(None, ge=0, le=4096)
    cluster: ClusterAddress | None = None
    timeout: Positive = 60.0
    memory: Annotated[str, AfterValidator(_some_memory)] = "4 GB"
    max_failures: float = Field(0.5, ge=0, le=1)

    @model_validator(mode="after")
    def _somebody_there(self) -> "EvaluationSection":
        if self.workers == 0 and self.cluster not in (None, "none"):
            raise fault("workers = 0 beside a cluster", "1 or more, or a key less")
        return self

    @property
    def memory_bytes(self) -> int | None:
        """``memory`` in bytes, None for "none"."""
        return bytes_of(self.memory)


class RefineSection(Section):
    """``[refine]``: in every so many generations, that many ``births`` are what an optimiser makes
    of one of the living in ``budget`` evaluations, see `evocity.search.refinement`; 0 births, the
    default, refine nobody. ``way``: what it tunes; ``side``: numbers along each side of its field;
    ``others``: so many others offer their fabric.
    """

    births: int = Field(0, ge=0, le=1_000_000)
    every: int = Field(5, ge=1, le=99_999_999)
    budget: int = Field(40, ge=1, le=100_000)
    way: Literal["lambda_field", "heights"] = "lambda_field"
    algorithm: Literal["sbplx", "cobyla", "bobyqa"] = "sbplx"
    side: int = Field(4, ge=1, le=16)
    others: int = Field(2, ge=1, le=8)

    @property
    def operator(self) -> str:
        """The operator whose numbers are tuned."""
        return "height_field" if self.way == "heights" else "lambda_field"


def sound_keys(
    algorithm: type[Algorithm], given: Mapping[str, Any]
) -> tuple[Section | None, list[ErrorDetails]]:
    """What ``[search]`` gives of the ``algorithm``'s own keys, and pydantic's errors of them. Keys
    at fault are left as if they were not given; None where it cannot do without."""
    try:
        return algorithm.Keys.model_validate(given), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    bad = {part for one in errors for part in one["loc"][:1]}
    try:
        return algorithm.Keys.model_validate(
            {k: v for k, v in given.items() if k not in bad}
        ), errors
    except ValidationError:
        return None, errors


class SearchSection(BaseModel):
    """``[search]``: an ``algorithm``, see `evocity.search.algorithms`, and the keys it has.
    ``picks``: the share of births that have a pick for their first parent, while there are picks.
    ``adapt``: weights of operators follow what their births earn, see `evocity.search.credit`.
    ``window``: births have their parents among those at least so many before them, see
    `evocity.search.steady`; None for one generation after the other.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    algorithm: Annotated[str, AfterValidator(some_algorithm)] = DEFAULT
    picks: float = Field(0.5, gt=0, le=1)
    adapt: bool = False
    window: int | None = Field(None, ge=1, le=100_000)

    @property
    def keys(self) -> Section:
        """The algorithm's own keys."""
        return algorithms()[self.algorithm].Keys(**(self.model_extra or {}))

    @property
    def asked(self) -> dict[str, Any]:
        """All keys with their values, those left out too."""
        common = {name: getattr(self, name) for name in SearchSection.model_fields}
        return common | self.keys.model_dump()

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the algorithm's own keys."""
        return tuple(algorithms()[self.algorithm].Keys.model_fields)

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the measures that the algorithm needs of every birth besides the goals, as far
        as its keys are sound."""
        return () if self._sound is None else algorithms()[self.algorithm].described(self._sound)

    def faults(self, goals: int, population: int, parents: int) -> list[tuple[str, str, str]]:
        """Faults (key, found, allowed) of the algorithm for so many goals, so many who live, and so
        many parents, as far as its keys are sound."""
        faults = []
        if self._sound is not None:
            faults += algorithms()[self.algorithm].faults(self._sound, goals, population, parents)
        if self.window is not None and self.breeds_by is not None:
            found = f"{self.window}, with the algorithm {self.algorithm!r}"
            faults.append(("search.window", found, "no window, as it breeds by itself"))
        return faults

    @property
    def _sound(self) -> Section | None:
        return sound_keys(algorithms()[self.algorithm], self.model_extra or {})[0]

    @property
    def breeds_by(self) -> str | None:
        """The operator that the algorithm breeds with by itself, None where the mixture does."""
        return algorithms()[self.algorithm].breeds_by

    def algorithm_of(self, size: int) -> Algorithm:
        """The algorithm, for so many who live at most."""
        return algorithms()[self.algorithm](size, self.keys)
