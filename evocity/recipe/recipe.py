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
    STEERING_OPERATORS,
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
    """Recipe of a search, checked for faults. The function `evocity.read_recipe` reads a recipe
    from a file; the constructor makes a recipe from mappings, one for each section.

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
    folder : folder at which relative paths in the recipe start; by default the working directory.
    sections : sections of the recipe (docs/recipe.md), each a mapping of keys to values. The
        sections ``parents``, ``fitness`` and ``islands`` are lists. A string in the section
        ``parents`` names a map. A string in the section ``fitness``, or in the key ``record`` of
        the section ``run``, names a measure. A recipe that is made from mappings may contain an
        `evocity.fitness.Measure` in place of a measure's name.

    The attribute ``text`` holds the recipe as TOML. The attribute ``overrides`` maps keys to the
    values that replaced the values in the file, as in ``{"run.seed": 8}``. The attribute ``file``
    is the name of the recipe's file in ``folder``, or None for a recipe that was not read from a
    file.

    If the recipe has faults, the constructor raises `RecipeError`, which lists each fault with its
    key.
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
        that algorithms need, if they are known; `evocity.recipe.consistency` reports the others.
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
        """Kind of chromosomes that the run breeds, for example "fabric"."""
        return KINDS[self.run.kind]

    @property
    def window(self) -> Window:
        """Square window that every map of the run covers."""
        return Window(self.map.pixels, self.map.metres_per_pixel)

    @property
    def default_out(self) -> Path:
        """Default run folder, runs/<name>, where <name> is the name of the run."""
        return Path("runs") / self.run.name

    @property
    def entries(self) -> list[MeasureEntry]:
        """Entries of all measures in the recipe: first the section ``fitness``, then the measures
        that the run only records."""
        return [*self.fitness, *self.recording]

    @property
    def recording(self) -> list[MeasureEntry]:
        """Entries of the measures that the run only records, because the key ``run.record`` names
        them or an algorithm needs them."""
        return [*self.run.record, *self._described]

    @property
    def measures(self) -> list[Measure]:
        """Measures that are goals or constraints, in the order of the entries in the recipe."""
        return [measure for entry in self.fitness for measure in entry.measures]

    @property
    def goals(self) -> tuple[str, ...]:
        """Names of the goals that the search optimises: single measures, and weighted sums of
        measures."""
        names = (
            entry.total or measure.name
            for entry in self.fitness
            if entry.is_objective
            for measure in entry.measures
        )
        return tuple(dict.fromkeys(names))

    @property
    def recorded(self) -> list[Measure]:
        """Measures that the run records, but that are neither goals nor constraints."""
        return [measure for entry in self.recording for measure in entry.measures]

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest possible value of each measure, by the name of the measure."""
        return {one.name: one.range for one in [*self.measures, *self.recorded]}

    @property
    def local(self) -> list["Recipe"]:
        """Recipe of each island, with the island's own operators and its own algorithm. If the
        recipe has no islands, the list `local` contains only the recipe itself."""
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
    def generation_size(self) -> int:
        """Number of births in each generation: the value of the key ``births`` in the section
        ``[search]``, or by default the population. The log numbers births by it."""
        return self.search.births or self.run.population

    @property
    def slots(self) -> list[range]:
        """Slots of each island: the range of numbers that the births of the island have within a
        generation. In a recipe without islands, a single range contains the numbers of all births
        of a generation."""
        ends = [0]
        for island in self.islands:
            ends.append(ends[-1] + island.population)
        return [range(*ends) for ends in pairwise(ends)] or [range(self.generation_size)]

    def at(self, slot: int) -> "Recipe":
        """Return the recipe of the island that breeds the birth with the number ``slot`` in a
        generation."""
        pairs = zip(self.local, self.slots, strict=True)
        return next(recipe for recipe, slots in pairs if slot in slots)

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the measures that an algorithm of the run needs for every birth, in addition to
        the goals."""
        return tuple(dict.fromkeys(name for one in self.local for name in one.search.described))

    @property
    def mixtures(self) -> list[dict[str, float]]:
        """Weights of the operators by name, one mapping for each island. The result leaves out
        islands whose search algorithm prescribes the operator."""
        return [
            {name: entry.weight for name, entry in one.operators.items()}
            for one in self.local
            if one.search.breeds_by is None
        ]

    @property
    def worker_count(self) -> int:
        """Number of worker processes: the value of the key ``workers``, or by default the number of
        cores that this process may use. With an embedded cluster, the number of workers is the
        number of all processes of the cluster."""
        workers, cluster = self.evaluation.workers, self.evaluation.cluster or ""
        if cluster.startswith("local:"):
            return int(cluster.removeprefix("local:")) * (workers or 1)
        return available_cores() if workers is None else workers

    @property
    def breeding(self) -> list[str]:
        """Names of the operators that may breed in the run, including those of refinement and of
        steering."""
        if self.islands:
            return list(dict.fromkeys(name for one in self.local for name in one.breeding))
        own = self.search.breeds_by
        names = list(self.operators) if own is None else [own]
        refining = [self.refine.operator] if self.refine.births else []
        steering = STEERING_OPERATORS if self.search.steer else ()
        return list(dict.fromkeys([*names, *refining, *steering]))

    def parent_named(self, name: str) -> Parent | None:
        """Return the parent that the recipe calls ``name``, or else the parent whose map has this
        name. Return None if no parent has this name, or if the argument ``name`` is a map."""
        given = next((parent for parent in self.parents if parent.title == name), None)
        if given is not None or is_map(self.folder, name):
            return given
        names = parent_names(self.folder, [(one.title, one.place) for one in self.parents])
        return self.parents[names.index(name)] if name in names else None

    def operator(self, name: str, **changes: Any) -> Operator:
        """Make the operator called ``name`` with the parameters of the recipe. The keyword
        arguments ``changes`` replace the recipe's values of the operator's parameters. If the
        recipe gives a range for a parameter, the parameter gets the lower end of the range.

        The section ``[genome]`` supplies ``reach`` and ``domains``, unless the recipe's entry of
        the operator sets these parameters. The section ``[genome]`` supplies no parameter that the
        operator's attribute ``own_defaults`` names.
        """
        return operator_of(name, self.parameters(name), self.genome.coding, **changes)

    def operator_drawn(self, name: str, rng: np.random.Generator, **changes: Any) -> Operator:
        """Make the operator called ``name`` for one birth, with random values of the parameters
        that have a range. The random generator ``rng`` draws the value of each parameter that has a
        range."""
        return self.drawing(name)(rng, **changes)

    def drawing(self, name: str) -> Callable[..., Operator]:
        """Make a function that makes the operator called `name` for each of many births, like the
        method `operator_drawn`. The returned function takes a random generator, and optionally new
        values of parameters."""
        return drawing_of(name, self.parameters(name), self.genome.coding)

    def takes(self, name: str, key: str) -> bool:
        """Tell whether the operator called ``name`` has a parameter called ``key``."""
        return key in operators.parameters_of(operators.operators()[name])

    def ranged(self, name: str, key: str) -> bool:
        """Tell whether the recipe gives a range for the parameter ``key`` of the operator called
        ``name``."""
        value = self.parameters(name).get(key)
        return is_range(operators.operators()[name], key, value)

    def parameters(self, name: str) -> dict[str, Any]:
        """Return the parameters of the operator called ``name`` in the notation of the recipe's
        TOML file. If the recipe has the operator, keys that older releases did not have get the
        values that keep old recipes breeding as before."""
        entry = self.operators.get(name)
        return {} if entry is None else operators.with_older_values(name, entry.parameters)
