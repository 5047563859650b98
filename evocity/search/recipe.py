"""`Recipe`: what to breed and what to reward.

`evocity.search.sections` has its sections, `evocity.search.checking` finds its faults, and
`evocity.search.reading` reads one from a file.
"""

import contextlib
import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from evocity import operators
from evocity.coding.matching import available_cores
from evocity.displayed import Displayed
from evocity.fitness import Measure
from evocity.genome import MOST_PARENTS
from evocity.kinds import KINDS, Kind, Window
from evocity.operators import Operator
from evocity.search.checking import fill
from evocity.search.islands import MOST_ISLANDS, IslandSection, MigrationSection
from evocity.search.mixture import (
    OperatorEntry,
    drawing_of,
    entry_of,
    is_range,
    operator_of,
    usual_operators,
)
from evocity.search.overnight import LogSection, NotifySection, StopSection
from evocity.search.searching import EvaluationSection, RefineSection, SearchSection
from evocity.search.sections import (
    MOST_COURSES,
    CourseSection,
    GenomeSection,
    LockedSection,
    MapSection,
    Parent,
    RunSection,
)
from evocity.search.values import (
    Section,
    called,
    is_map,
)
from evocity.search.wanted import FitnessEntry, MeasureEntry


class Recipe(Section, Displayed):
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
    sections : those of a TOML file (docs/recipe.md), as mappings of its keys, ``parents``,
        ``fitness`` and ``islands`` as lists. In the first two, and in ``record`` of ``run``, a text
        stands for a map, or a measure, by its name alone; a `evocity.fitness.Measure` stands for
        itself.

    Raises `RecipeError`, which lists every fault with its key.

    Besides the sections: ``text``, the TOML; ``overrides``, what replaced it, as
    {"run.seed": 8}; ``folder``; ``file``, its name there, None if it was not read from a file.
    """

    run: RunSection = RunSection()
    map: MapSection = MapSection()
    parents: list[Parent] = Field(min_length=1, max_length=MOST_PARENTS)
    curves: list[CourseSection] = Field([], max_length=MOST_COURSES)
    genome: GenomeSection = GenomeSection()
    operators: dict[
        str,
        Annotated[OperatorEntry, BeforeValidator(entry_of)],
    ] = Field(default_factory=usual_operators, min_length=1)
    fitness: list[FitnessEntry] = Field(min_length=1)
    locked: LockedSection = LockedSection.model_construct()
    evaluation: EvaluationSection = EvaluationSection()
    search: SearchSection = SearchSection()
    refine: RefineSection = RefineSection()
    stop: StopSection = StopSection()
    notify: NotifySection = NotifySection()
    log: LogSection = LogSection()
    islands: list[IslandSection] = Field([], max_length=MOST_ISLANDS)
    migration: MigrationSection = MigrationSection()

    _text: str = PrivateAttr("")
    _overrides: dict = PrivateAttr(default_factory=dict)
    _folder: Path = PrivateAttr(Path())
    _file: str | None = PrivateAttr(None)
    _described: list[MeasureEntry] = PrivateAttr(default_factory=list)

    def __init__(self, *, folder: str | os.PathLike = ".", **sections: Any):
        fill(self, sections, Path(folder).resolve())

    @model_validator(mode="after")
    def _record_the_rest(self, info: ValidationInfo) -> "Recipe":
        """Of a whole file nothing is recorded that `fitness` logs already. What algorithms need is
        recorded, as far as its name is known; `checking` tells of the others."""
        logged = {measure.name for measure in self.measures}
        for entry in self.run.record:
            entry.leave_out(logged)
        for name in self.described:
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
    def kind(self) -> Kind:
        """What chromosomes the run breeds."""
        return KINDS[self.run.kind]

    @property
    def window(self) -> Window:
        """The square that every genome is laid in."""
        return Window(self.map.pixels, self.map.metres_per_pixel)

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
        """What is recorded besides: as ``run.record`` says, and what algorithms need."""
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
    def local(self) -> list["Recipe"]:
        """The recipe as each island has it, with its own operators and search; without islands
        itself alone."""
        return [
            self.model_copy(
                update={
                    "operators": island.operators_of(self.operators),
                    "search": island.search_of(self.search),
                    "islands": [],
                }
            )
            for island in self.islands
        ] or [self]

    @property
    def slots(self) -> list[range]:
        """The slots in each generation of the births of each island; without islands all."""
        ends = [0]
        for island in self.islands:
            ends.append(ends[-1] + island.population)
        return [range(*ends) for ends in pairwise(ends)] or [range(self.run.population)]

    def at(self, slot: int) -> "Recipe":
        """The recipe as the island has it whose births have a ``slot``."""
        pairs = zip(self.local, self.slots, strict=True)
        return next(recipe for recipe, slots in pairs if slot in slots)

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the measures that algorithms need of every birth besides the goals."""
        return tuple(dict.fromkeys(name for one in self.local for name in one.search.described))

    @property
    def mixtures(self) -> list[dict[str, float]]:
        """The weights of operators, by name, on each island; none where an algorithm breeds by
        itself."""
        return [
            {name: entry.weight for name, entry in one.operators.items()}
            for one in self.local
            if one.search.breeds_by is None
        ]

    @property
    def worker_count(self) -> int:
        """``workers``, or the cores this process may use; of an embedded cluster those of all its
        workers."""
        asked = self.evaluation
        if (asked.cluster or "").startswith("local:"):
            return int(asked.cluster.removeprefix("local:")) * (asked.workers or 1)
        if asked.workers is not None:
            return asked.workers
        return available_cores()

    @property
    def breeding(self) -> list[str]:
        """The operators that may breed: those of the mixture, or the algorithm's own, and that of
        refinement."""
        if self.islands:
            return list(dict.fromkeys(name for one in self.local for name in one.breeding))
        own = self.search.breeds_by
        names = list(self.operators) if own is None else [own]
        refining = [self.refine.operator] if self.refine.births else []
        return list(dict.fromkeys(names + refining))

    def parent_named(self, name: str) -> Parent | None:
        """The parent whose ``name`` the recipe gives, or the one that is called so after its map
        if ``name`` is no map itself; None if there is none."""
        given = next((parent for parent in self.parents if parent.title == name), None)
        if given is not None or is_map(self.folder, name):
            return given
        names = called(self.folder, [(one.title, one.place) for one in self.parents])
        return self.parents[names.index(name)] if name in names else None

    def operator(self, name: str, **changes: Any) -> Operator:
        """The operator ``name`` with the recipe's parameters, other than ``changes``; of ranges
        the lower end.

        Its ``reach`` and ``domains`` are those of ``[genome]`` unless it has its own.
        """
        return operator_of(name, self.parameters(name), self.genome.coding, **changes)

    def operator_drawn(self, name: str, rng: np.random.Generator, **changes: Any) -> Operator:
        """The operator ``name`` for one birth: as `operator`, but what the recipe gives ranges of
        is drawn by ``rng``, which is not drawn from without a range."""
        return self.drawing(name)(rng, **changes)

    def drawing(self, name: str) -> Callable[..., Operator]:
        """`operator_drawn` of one ``name``, for many births: takes a generator, and ``changes``."""
        return drawing_of(name, self.parameters(name), self.genome.coding)

    def takes(self, name: str, key: str) -> bool:
        """Whether the operator ``name`` has a parameter ``key``."""
        return key in operators.parameters_of(operators.operators()[name])

    def ranged(self, name: str, key: str) -> bool:
        """Whether the recipe gives a range for a parameter of the operator ``name``."""
        value = self.parameters(name).get(key)
        return is_range(operators.operators()[name], key, value)

    def parameters(self, name: str) -> dict[str, Any]:
        """The parameters that the recipe gives the operator ``name``, as TOML has them."""
        return self.operators.get(name, OperatorEntry()).parameters
