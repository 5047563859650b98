"""What a run needs before its first birth: maps read and encoded, targets, provenance."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from evocity import fitness, io, store
from evocity.citymap import CityMap, same_grid
from evocity.condensation import Condensation
from evocity.errors import FitnessError, RecipeError
from evocity.fitness.fabric import left_out
from evocity.fitness.part import own_name
from evocity.fitness.registry import file_of
from evocity.genome import VOID, joined
from evocity.pictures.colours import scale_end
from evocity.search.algorithms import algorithms
from evocity.search.evaluator import Setup
from evocity.search.founding import founder_of
from evocity.search.locking import locked_layer
from evocity.search.parting import parts_of
from evocity.search.recipe import Recipe
from evocity.search.sections import Parent
from evocity.search.values import PARENTS, free_name, resolved
from evocity.store import Header, Source, Thumbnails

# Small maps in the log tell the heights of more towers than colours do.
_TOLD = 0.995


@dataclass(frozen=True)
class Prepared:
    """Everything fixed for a run; ``notes`` say in words what of the maps' files was taken;
    ``named`` are the cities that measures compare with, ``within`` the parts that they are taken
    of, both by the recipe's names for them."""

    recipe: Recipe
    sources: list[Source]
    aims: fitness.Aims
    header: Header
    condensation: Condensation | None = None
    notes: tuple[str, ...] = ()
    references: Mapping[str, fitness.Reference] = field(default_factory=dict)
    named: Mapping[str, CityMap] = field(default_factory=dict)
    within: Mapping[str, fitness.Part] = field(default_factory=dict)

    @property
    def others(self) -> list[CityMap]:
        """The cities that measures compare with which are no sources."""
        own = [source.city for source in self.sources]
        return [city for city in self.named.values() if not any(city is one for one in own)]

    @property
    def setup(self) -> Setup:
        """What a worker must know."""
        measures = tuple(
            (measure.name, entry.source or file_of(own_name(measure.name)))
            for entry in self.recipe.entries
            for measure in entry.measures
        )
        asked = any("sources" in m.takes for one in self.recipe.entries for m in one.measures)
        return Setup(
            self.header,
            measures,
            self.condensation,
            references=self.references,
            sources=tuple(source.city for source in self.sources) if asked else (),
            within={
                measure.name: self.within[entry.within]
                for entry in self.recipe.entries
                if entry.within is not None
                for measure in entry.measures
            },
            bounds=self.aims.bounds,
        )


def prepare(
    recipe: Recipe,
    progress: Callable[[str], None] | None = None,
    met: Callable[[CityMap, Parent], None] | None = None,
) -> Prepared:
    """Read and encode the parents, measure the cities to be like.

    ``progress`` is told in a few words what comes next, ``met`` each parent's map as soon as it is
    read. Raises `MapError`, `GenomeError` or
    `FitnessError` where a map does not serve.
    """
    tell = progress or (lambda text: None)
    cities: list[CityMap] = []
    notes: list[str] = []
    founders: dict[int, Any] = {}
    for number, parent in enumerate(recipe.parents):
        tell(f"reading {parent.name or parent.place}")
        if parent.map is None:
            city, founders[number] = founder_of(recipe, parent)
        else:
            city = read_parent(recipe, parent.map, parent)
        name = free_name(city.name, [other.name for other in cities])
        cities.append(city if name == city.name else city.replace(city.heights, name=name))
        notes.append(f"{name}: {city.taken if parent.map else parent.place}")
        if met is not None:
            met(cities[-1], parent)
    same_grid(cities)
    named = named_cities(recipe, cities, tell, notes.append)
    references = references_of(recipe, cities, named, tell)
    within = parts_of(recipe, cities)
    condensation, attribution = locked_layer(recipe, cities)
    kind, genomes = recipe.kind, []
    for number, city in enumerate(cities):
        if number in founders:
            genomes.append(kind.called(founders[number], city.name))
            continue
        tell(f"encoding {city.name}")
        coded = kind.prepare(city, recipe.genome.coding, condensation)
        genomes.append(kind.completed(coded, city, recipe))
    header = _header(recipe, cities, condensation, attribution)
    adopted = [kind.adopt(one, header, condensation) for one in genomes]
    sources = [Source(city, genome) for city, genome in zip(cities, adopted, strict=True)]
    aims = aims_of(recipe, note=notes.append)
    noted = tuple(dict.fromkeys(notes))
    return Prepared(recipe, sources, aims, header, condensation, noted, references, named, within)


def read_parent(recipe: Recipe, name: str, options=None) -> CityMap:
    """A map of the recipe at the recipe's window."""
    chosen = {} if options is None else options.model_dump(exclude={"map"}, exclude_none=True)
    return io.read_map(
        resolved(recipe.folder, name),
        pixels=recipe.map.pixels,
        metres_per_pixel=recipe.map.metres_per_pixel,
        **chosen,
    )


def named_cities(
    recipe: Recipe,
    cities: Sequence[CityMap],
    tell: Callable[[str], None],
    note: Callable[[str], None],
) -> dict[str, CityMap]:
    """The cities that measures of the ``recipe`` compare with, by the names it gives them: of the
    run's source ``cities``, or other maps. ``tell`` is told in a few words what is read, ``note``
    what was taken of it."""
    found: dict[str, CityMap] = {}
    for name in compared_names(recipe):
        parent = recipe.parent_named(name)
        if parent is not None:
            found[name] = cities[next(k for k, p in enumerate(recipe.parents) if p is parent)]
            continue
        tell(f"reading {name}")
        found[name] = read_parent(recipe, name)
        note(f"{found[name].name}: {found[name].taken}")
    return found


def compared_names(recipe: Recipe) -> list[str]:
    """The cities that measures compare with, as the ``recipe`` names them, each once."""
    told = [one.compared for one in recipe.entries if one.compared not in (None, PARENTS)]
    return list(dict.fromkeys(name for names in told for name in names))


def references_of(
    recipe: Recipe,
    cities: Sequence[CityMap],
    named: Mapping[str, CityMap],
    tell: Callable[[str], None] | None = None,
) -> dict[str, fitness.Reference]:
    """What the recipe's measures that compare cities compare with, by their names; ``cities``
    are the run's sources, ``named`` as in `named_cities`. ``tell`` is told which features are
    left out.

    Raises `FitnessError` if a reference has too few buildings.
    """
    tell = tell or (lambda text: None)
    found: dict[str, fitness.Reference] = {}
    made: dict[str | tuple[str, ...], fitness.Reference] = {}
    for entry in recipe.entries:
        compared = entry.compared
        if compared is None:
            continue
        if compared not in made:
            made[compared] = (
                fitness.Reference.sources(cities)
                if compared == PARENTS
                else fitness.Reference.of([named[name] for name in compared])
            )
        for measure in entry.measures:
            if "reference" not in measure.takes:
                continue
            found[measure.name] = made[compared]
            if own_name(measure.name).partition(".")[0] == fitness.fabric_distance.name:
                _tell_of_fabric(measure.name, made[compared], tell)
    return found


def _tell_of_fabric(name: str, reference: fitness.Reference, tell: Callable[[str], None]) -> None:
    try:
        gone = left_out(reference)
    except FitnessError as error:
        raise FitnessError(
            f"{name} has no meaning beside {_names(reference)}: {error.found}",
            error.expected,
            "name other cities as its reference",
        ) from None
    if gone:
        tell(f"{name} leaves out {', '.join(gone)}: the same in all of {_names(reference)}")


def _names(reference: fitness.Reference) -> str:
    return ", ".join(city.name for city in reference.cities)


def aims_of(
    recipe: Recipe, targets: dict | None = None, note: Callable[[str], None] | None = None
) -> fitness.Aims:
    """What the recipe wants; ``targets`` (measure -> number) spare measuring the cities. ``note``
    is told what was taken of their files."""
    return fitness.Aims(
        tuple(
            fitness.Wanted(
                measure,
                _objective(recipe, entry, measure, targets or {}, note or (lambda text: None)),
                entry.constraint(measure),
                1.0 if entry.weight is None else entry.weight,
                entry.total,
            )
            for entry in recipe.fitness
            for measure in entry.measures
        )
    )


def _objective(
    recipe: Recipe, entry, measure, targets: dict, note: Callable[[str], None]
) -> fitness.Objective | None:
    if not entry.is_objective:
        return None
    if entry.like is None:
        return fitness.Objective(measure, entry.goal, entry.target)
    if measure.name in targets:
        return fitness.Objective(measure, "like", targets[measure.name])
    parent = recipe.parent_named(entry.like)
    if parent is not None and parent.bred:
        return fitness.Objective.like(measure, founder_of(recipe, parent)[0])
    city = read_parent(recipe, map_of(recipe, entry.like), parent)
    note(f"{city.name}: {city.taken}")
    return fitness.Objective.like(measure, city)


def map_of(recipe: Recipe, like: str) -> str:
    """The map of the city to be like: a parent's, where that is named."""
    parent = recipe.parent_named(like)
    return parent.place if parent else like


def _lays_void(operator) -> bool:
    """Whether an ``operator`` lays ground that no city has."""
    return bool(getattr(operator, "void", False) or getattr(operator, "lays_void", False))


def _header(
    recipe: Recipe,
    cities: list[CityMap],
    condensation: Condensation | None,
    attribution: str,
) -> Header:
    names = [city.name for city in cities]
    if any(_lays_void(one.operator(name)) for one in recipe.local for name in one.breeding):
        names.append(VOID)
    if len(names) > 255:
        raise RecipeError(f"{len(names)} parents", "255 or fewer", "leave some out")
    told = [*(city.attribution for city in cities), attribution]  # of a layer's files last
    places = {(city.origin, city.crs) for city in cities}
    kinds = [algorithms()[one.search.algorithm] for one in recipe.local]
    origin, crs = places.pop() if len(places) == 1 else (None, None)
    return Header(
        height=cities[0].shape[0],
        width=cities[0].shape[1],
        metres_per_pixel=cities[0].metres_per_pixel,
        sigma_max=recipe.genome.sigma_max,
        cities=tuple(names),
        attribution=joined(told),
        origin=origin,
        crs=crs,
        seed=recipe.run.seed,
        population=recipe.run.population,
        recipe_hash=store.hash_of_text(recipe.text),
        measures=tuple(measure.name for measure in recipe.measures),
        recorded=tuple(measure.name for measure in recipe.recorded),
        locked=None if condensation is None else condensation.digest,
        settle=recipe.genome.settle,
        marks=tuple(dict.fromkeys(mark for kind in kinds for mark in kind.marks)),
        figures=() if recipe.islands else kinds[0].figures,
        islands=tuple(one.name for one in recipe.islands),
        genomes=recipe.log.genomes,
        kind=recipe.kind.name,
        thumbnails=Thumbnails.of(*cities[0].shape, scale_end(*cities, share=_TOLD)),
    )
