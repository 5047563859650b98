"""What a recipe may say: the models of its sections, checked by pydantic.

Every model refuses unknown keys; `evocity.search.agreement` has the checks between sections.
`evocity.search.reading` turns a TOML file into a `Recipe`.
"""

import contextlib
import os
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from evocity import operators
from evocity.citymap import MAX_SIDE
from evocity.coding.matching import available_cores
from evocity.errors import GenomeError, shown, with_near_miss
from evocity.fitness import Measure
from evocity.kinds import KINDS, Kind
from evocity.pavement import read_sides
from evocity.pavement.levels import USUAL
from evocity.search.algorithms import DEFAULT, Algorithm, algorithms
from evocity.search.mixture import (
    MOST_PARENTS,
    OperatorEntry,
    drawn_of,
    entry_of,
    is_range,
    operator_of,
)
from evocity.search.values import (
    GenomeFile,
    Heights,
    LockFile,
    LonLat,
    MapName,
    Positive,
    RunFolder,
    Section,
    Title,
    called,
    fault,
    is_map,
    parent_place,
    parent_title,
)
from evocity.search.wanted import FitnessEntry, MeasureEntry, recorded_of


class RunSection(Section):
    """``[run]``. ``generations`` are bred after the first population, which is generation 0;
    ``record``: measures of every birth that nothing is wanted of."""

    name: Title = "run"
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
    that was bred before, a ``genome`` in a file or individual ``id`` of a ``run``."""

    map: MapName | None = None
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
        given = [key for key in ("map", "genome", "run") if getattr(self, key) is not None]
        if len(given) != 1:
            raise fault(" and ".join(given) or "no map", "one of map, genome and run (with id)")
        if (self.id is None) == (self.run is not None):
            raise fault("run without id" if self.run else "id without run", "both, or none of them")
        strange = sorted(self.model_fields_set.intersection(_OF_MAPS)) if self.bred else []
        if strange:
            raise fault(f"{', '.join(strange)} beside {given[0]}", "these with a map alone")
        return self

    @property
    def bred(self) -> bool:
        """Whether it was bred before, and is no map."""
        return self.map is None

    @property
    def place(self) -> str:
        """Where it is from, in one text, which no other parent has."""
        return parent_place(self.map, self.genome, self.run, self.id)

    @property
    def title(self) -> str | None:
        """What it is to be called; None for what its map is called."""
        return parent_title(self.name, self.genome, self.run, self.id)


#: Options of the reading of maps.
_OF_MAPS = ("center", "layer", "default_height", "height_scale")


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
    def kind(self) -> Kind:
        """What chromosomes the run breeds."""
        return KINDS["fabric"]

    @property
    def coding(self) -> dict[str, Any]:
        """These keys as `evocity.encode` takes them."""
        told = self.model_dump() | {"domains": tuple(self.domains)}
        return told | {"reach": None if self.reach == "all" else self.reach}

    @property
    def root(self) -> int:
        """The largest side of range blocks, px."""
        return self.block if isinstance(self.block, int) else self.block[1]


def _some_algorithm(name: str) -> str:
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


class EvaluationSection(Section):
    """``[evaluation]``. ``workers`` 0: in the calling process, without deadlines.

    ``timeout``: seconds, one individual. ``max_failures``: the share of a generation's births
    that may fail before the run stops.
    """

    workers: int | None = Field(None, ge=0, le=4096)
    timeout: Positive = 60.0
    max_failures: float = Field(0.5, ge=0, le=1)


class SearchSection(BaseModel):
    """``[search]``: an ``algorithm``, see `evocity.search.algorithms`, and the keys it has.
    ``picks``: the share of births that have a pick for their first parent, while there are picks.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    algorithm: Annotated[str, AfterValidator(_some_algorithm)] = DEFAULT
    picks: float = Field(0.5, gt=0, le=1)

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
    def described(self) -> tuple[str, ...]:
        """Names of the measures that the algorithm needs of every birth besides the goals."""
        return algorithms()[self.algorithm].described(self.keys)

    def faults(self, goals: int, population: int) -> list[tuple[str, str, str]]:
        """Faults (key, found, allowed) of the algorithm for so many goals, and so many who live."""
        return algorithms()[self.algorithm].faults(self.keys, goals, population)

    def algorithm_of(self, size: int) -> Algorithm:
        """The algorithm, for so many who live at most."""
        return algorithms()[self.algorithm](size, self.keys)


class Recipe(Section):
    """A whole recipe, without faults. Read from a file by `evocity.read_recipe`, or made here.

    >>> import evocity
    >>> recipe = evocity.Recipe(
    ...     parents=["lyon-1er", "montpellier-pas-du-loup"],
    ...     fitness=["alignment", {"name": "gsi", "min": 0.3, "max": 0.5}],
    ...     run={"name": "by hand", "population": 32, "generations": 20},
    ... )
    >>> recipe.goals, recipe.run.population
    (('alignment',), 32)

    Parameters
    ----------
    folder : what paths are relative to; the working directory unless told.
    sections : those of a TOML file (docs/recipe.md), as mappings of its keys, ``parents`` and
        ``fitness`` as lists. There, and in ``record`` of ``run``, a text stands for a map, or a
        measure, by its name alone; a `evocity.fitness.Measure` stands for itself.

    Raises `RecipeError`, which lists every fault with its key.

    Besides the sections: ``text``, the TOML; ``overrides``, what replaced it, as
    {"run.seed": 8}; ``folder``; ``file``, its name there, None if it was not read from a file.
    """

    run: RunSection = RunSection()
    map: MapSection = MapSection()
    parents: list[Parent] = Field(min_length=1, max_length=MOST_PARENTS)
    genome: GenomeSection = GenomeSection()
    operators: dict[
        str,
        Annotated[OperatorEntry, BeforeValidator(entry_of)],
    ] = Field(
        default_factory=lambda: {
            "quarter_fusion": OperatorEntry(weight=4, fill={"from": 0.1, "to": 0.6}),
            "quarter_refill": OperatorEntry(weight=3, street_blocks={"from": 2, "to": 8}),
            "height_scaling": OperatorEntry(weight=1),
        },
        min_length=1,
    )
    fitness: list[FitnessEntry] = Field(min_length=1)
    locked: LockedSection = LockedSection.model_construct()
    evaluation: EvaluationSection = EvaluationSection()
    search: SearchSection = SearchSection()

    _text: str = PrivateAttr("")
    _overrides: dict = PrivateAttr(default_factory=dict)
    _folder: Path = PrivateAttr(Path())
    _file: str | None = PrivateAttr(None)
    _described: list[MeasureEntry] = PrivateAttr(default_factory=list)

    def __init__(self, *, folder: str | os.PathLike = ".", **sections: Any):
        from evocity.search.reading import fill  # which needs the models here

        fill(self, sections, Path(folder).resolve())

    @model_validator(mode="after")
    def _record_the_rest(self, info: ValidationInfo) -> "Recipe":
        """Of a whole file nothing is recorded that `fitness` logs already. What the algorithm needs
        is recorded, as far as its name is known; `reading` tells of the others."""
        logged = {measure.name for measure in self.measures}
        for entry in self.run.record:
            entry.leave_out(logged)
        try:
            names = self.search.described
        except ValidationError:  # its keys are at fault, which is told
            return self
        for name in dict.fromkeys(names):
            if name not in logged | {measure.name for measure in self.recorded}:
                with contextlib.suppress(ValidationError):
                    entry = MeasureEntry.model_validate({"name": name}, context=info.context)
                    if [measure.name for measure in entry.measures] == [name]:
                        self._described.append(entry)
        return self

    @property
    def text(self) -> str:
        return self._text

    @property
    def overrides(self) -> dict:
        return self._overrides

    @property
    def folder(self) -> Path:
        return self._folder

    @property
    def file(self) -> str | None:
        return self._file

    @property
    def default_out(self) -> Path:
        """Where the run is written unless the user says otherwise: ``runs/<name>``."""
        return Path("runs") / self.run.name

    @property
    def entries(self) -> list[MeasureEntry]:
        """What is measured: `fitness`, then what is recorded besides."""
        return [*self.fitness, *self.recording]

    @property
    def recording(self) -> list[MeasureEntry]:
        """What is recorded besides: as ``run.record`` says, and what the algorithm needs."""
        return [*self.run.record, *self._described]

    @property
    def measures(self) -> list[Measure]:
        """Measures that something is wanted of, in the order of the recipe."""
        return [measure for entry in self.fitness for measure in entry.measures]

    @property
    def goals(self) -> tuple[str, ...]:
        """What is searched by: names of measures, and of sums of several."""
        sought = [(one, each) for one in self.fitness if one.is_objective for each in one.measures]
        return tuple(dict.fromkeys(one.total or measure.name for one, measure in sought))

    @property
    def recorded(self) -> list[Measure]:
        """Measures that are recorded besides."""
        return [measure for entry in self.recording for measure in entry.measures]

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value that each measure declares."""
        return {one.name: one.range for one in [*self.measures, *self.recorded]}

    @property
    def worker_count(self) -> int:
        """``workers``, or the cores this process may use."""
        if self.evaluation.workers is not None:
            return self.evaluation.workers
        return available_cores()

    def parent_named(self, name: str) -> Parent | None:
        """The parent whose ``name`` the recipe gives, or the one that is called so after its map
        if ``name`` is no map itself; None if there is none."""
        given = next((parent for parent in self.parents if parent.title == name), None)
        if given is not None or is_map(self.folder, name):
            return given
        names = called(self.folder, [(one.title, one.place) for one in self.parents])
        return self.parents[names.index(name)] if name in names else None

    def operator(self, name: str, **changes):
        """The operator ``name`` with the recipe's parameters, other than ``changes``; of ranges
        the lower end.

        Its ``reach`` and ``domains`` are those of ``[genome]`` unless it has its own.
        """
        return operator_of(name, self.parameters(name), self.genome.coding, **changes)

    def operator_drawn(self, name: str, rng: np.random.Generator, **changes):
        """The operator ``name`` for one birth: as `operator`, but what the recipe gives ranges of
        is drawn by ``rng``, which is not drawn from without a range."""
        return drawn_of(name, self.parameters(name), self.genome.coding, rng, **changes)

    def ranged(self, name: str, key: str) -> bool:
        """Whether the recipe gives a range for a parameter of the operator ``name``."""
        value = self.parameters(name).get(key)
        return is_range(operators.operators()[name], key, value)

    def parameters(self, name: str) -> dict[str, Any]:
        """The parameters that the recipe gives the operator ``name``, as TOML has them."""
        return self.operators.get(name, OperatorEntry()).parameters
