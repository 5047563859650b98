"""The class `Recipe`: all that defines a search, without faults.

`evocity.recipe.sections` has its sections, `evocity.recipe.validation` finds its faults, and
`evocity.recipe.reader` reads one from a file.
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
from evocity.fitness import Measure
from evocity.genome import MOST_PARENTS
from evocity.html_display import Displayed
from evocity.kinds import KINDS, Kind, Window
from evocity.operators import Operator
from evocity.recipe.islands import MOST_ISLANDS, IslandSection, MigrationSection
from evocity.recipe.measures import FitnessEntry, MeasureEntry
from evocity.recipe.mixture import (
    OperatorEntry,
    drawing_of,
    entry_table,
    is_range,
    operator_of,
    usual_operators,
)
from evocity.recipe.search_section import EvaluationSection, RefineSection, SearchSection
from evocity.recipe.sections import (
    MOST_COURSES,
    CourseSection,
    GenomeSection,
    LockedSection,
    MapSection,
    Parent,
    RunSection,
)
from evocity.recipe.stop_and_notify import LogSection, NotifySection, StopSection
from evocity.recipe.validation import fill_from_sections
from evocity.recipe.values import is_map, parent_names
from evocity.section import Section


class Recipe(Section, Displayed):
    """Checked recipe without faults. `evocity.read_recipe` reads a recipe from a file; the
    constructor takes its sections.

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
    folder : folder that relative paths in the recipe start from; by default the working directory.
    sections : sections of a recipe (docs/recipe.md), as mappings of keys. The sections ``parents``,
        ``fitness`` and ``islands`` are lists. A text in ``parents`` names a map; a text in
        ``fitness``, or in ``record`` of ``run``, names a measure. An `evocity.fitness.Measure` may
        replace the name of a measure.

    Raises `RecipeError`, which lists every fault with its key.

    A recipe also has the attributes below. The attribute ``text`` holds the TOML. The attribute
    ``overrides`` maps keys to the values that replaced those of the file, as in ``{"run.seed":
    8}``. The attribute ``file`` is the recipe's name in ``folder``; it is None if the recipe was
    not read from a file.
    """

    run: RunSection = RunSection()
    map: MapSection = MapSection()
    parents: list[Parent] = Field(min_length=1, max_length=MOST_PARENTS)
    curves: list[CourseSection] = Field([], max_length=MOST_COURSES)
    genome: GenomeSection = GenomeSection()
    operators: dict[
        str,
        Annotated[OperatorEntry, BeforeValidator(entry_table)],
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
        fill_from_sections(self, sections, Path(folder).resolve())

    @model_validator(mode="after")
    def _complete_records(self, info: ValidationInfo) -> "Recipe":
        """Drop from recorded files the measures that `fitness` logs already. Record the measures
        that algorithms need, if they are known; `evocity.recipe.cross_checks` reports the others.
        """
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
        """The kind of chromosomes that the run breeds."""
        return KINDS[self.run.kind]

    @property
    def window(self) -> Window:
        """Square window that contains every genome."""
        return Window(self.map.pixels, self.map.metres_per_pixel)

    @property
    def default_out(self) -> Path:
        """Run folder unless the user names another: runs/<name>."""
        return Path("runs") / self.run.name

    @property
    def entries(self) -> list[MeasureEntry]:
        """All entries that are measured: first those of ``fitness``, then those that are only
        recorded."""
        return [*self.fitness, *self.recording]

    @property
    def recording(self) -> list[MeasureEntry]:
        """Entries that are only recorded: those of ``run.record``, and those that algorithms
        need."""
        return [*self.run.record, *self._described]

    @property
    def measures(self) -> list[Measure]:
        """Measures that are goals or constraints, in the order of the recipe."""
        return [measure for entry in self.fitness for measure in entry.measures]

    @property
    def goals(self) -> tuple[str, ...]:
        """Names of the measures that the search optimises, and of the sums of measures that it
        optimises."""
        names = (
            entry.total or measure.name
            for entry in self.fitness
            if entry.is_objective
            for measure in entry.measures
        )
        return tuple(dict.fromkeys(names))

    @property
    def recorded(self) -> list[Measure]:
        """Measures that are only recorded."""
        return [measure for entry in self.recording for measure in entry.measures]

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value that each measure can take, as the measure declares."""
        return {one.name: one.range for one in [*self.measures, *self.recorded]}

    @property
    def local(self) -> list["Recipe"]:
        """Recipe of each island, with the island's own operators and search. Without islands, the
        list has only this recipe."""
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
        """Births of a generation that each island breeds, as ranges of their numbers (slots).
        Without islands, one range of all births."""
        ends = [0]
        for island in self.islands:
            ends.append(ends[-1] + island.population)
        return [range(*ends) for ends in pairwise(ends)] or [range(self.run.population)]

    def at(self, slot: int) -> "Recipe":
        """Return the recipe of the island that breeds the birth at ``slot``."""
        pairs = zip(self.local, self.slots, strict=True)
        return next(recipe for recipe, slots in pairs if slot in slots)

    @property
    def described(self) -> tuple[str, ...]:
        """Names of measures that algorithms need of every birth, besides the goals."""
        return tuple(dict.fromkeys(name for one in self.local for name in one.search.described))

    @property
    def mixtures(self) -> list[dict[str, float]]:
        """Weights of the operators, by name, on each island. The weights are empty for an island
        whose algorithm breeds by itself."""
        return [
            {name: entry.weight for name, entry in one.operators.items()}
            for one in self.local
            if one.search.breeds_by is None
        ]

    @property
    def worker_count(self) -> int:
        """Number of workers: ``workers``, or else the number of cores that this process may use.
        For an embedded cluster, the number of processes of all its workers."""
        workers, cluster = self.evaluation.workers, self.evaluation.cluster or ""
        if cluster.startswith("local:"):
            return int(cluster.removeprefix("local:")) * (workers or 1)
        return available_cores() if workers is None else workers

    @property
    def breeding(self) -> list[str]:
        """Operators that may breed: those of the mixture or of the algorithm, and the operator of
        refinement."""
        if self.islands:
            return list(dict.fromkeys(name for one in self.local for name in one.breeding))
        own = self.search.breeds_by
        names = list(self.operators) if own is None else [own]
        refining = [self.refine.operator] if self.refine.births else []
        return list(dict.fromkeys(names + refining))

    def parent_named(self, name: str) -> Parent | None:
        """Return the parent that the recipe calls ``name``, or else the parent whose map has this
        name. Return None for an unknown name, and for a text that is itself the name of a map."""
        given = next((parent for parent in self.parents if parent.title == name), None)
        if given is not None or is_map(self.folder, name):
            return given
        names = parent_names(self.folder, [(one.title, one.place) for one in self.parents])
        return self.parents[names.index(name)] if name in names else None

    def operator(self, name: str, **changes: Any) -> Operator:
        """Make the operator called ``name`` with the parameters of the recipe; ``changes`` replace
        some of them. A range gives its lower end.

        Its ``reach`` and ``domains`` are those of ``[genome]``, unless the recipe gives the
        operator its own.
        """
        return operator_of(name, self.parameters(name), self.genome.coding, **changes)

    def operator_drawn(self, name: str, rng: np.random.Generator, **changes: Any) -> Operator:
        """Make the operator called ``name`` for one birth, as `operator` does. The generator
        ``rng`` draws each parameter that has a range. If no parameter has a range, nothing is
        drawn."""
        return self.drawing(name)(rng, **changes)

    def drawing(self, name: str) -> Callable[..., Operator]:
        """Make a function that calls `operator_drawn` for the same ``name`` in many births. The
        function takes a generator, and changes of parameters."""
        return drawing_of(name, self.parameters(name), self.genome.coding)

    def takes(self, name: str, key: str) -> bool:
        """Tell whether the operator called ``name`` has a parameter ``key``."""
        return key in operators.parameters_of(operators.operators()[name])

    def ranged(self, name: str, key: str) -> bool:
        """Tell whether the recipe gives a range for a parameter of the operator called ``name``."""
        value = self.parameters(name).get(key)
        return is_range(operators.operators()[name], key, value)

    def parameters(self, name: str) -> dict[str, Any]:
        """Return the parameters that the recipe gives to the operator called ``name``, as in
        TOML."""
        return self.operators.get(name, OperatorEntry()).parameters
