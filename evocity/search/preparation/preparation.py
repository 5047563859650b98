"""Preparation of a run: its maps read and encoded, its targets measured, its header."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from evocity import fitness, io, store
from evocity.citymap import CityMap, same_grid
from evocity.condensation import Condensation
from evocity.errors import FitnessError, RecipeError
from evocity.evaluation.evaluator import Setup
from evocity.fitness.fabric import left_out
from evocity.fitness.part import own_name
from evocity.fitness.registry import file_of
from evocity.genome import VOID, joined
from evocity.pictures.colours import scale_end
from evocity.recipe.recipe import Recipe
from evocity.recipe.sections import Parent
from evocity.recipe.values import PARENTS, free_name, resolve_path
from evocity.search.preparation.founders import read_founder
from evocity.search.preparation.masks import locked_layer, parts_of
from evocity.selection.algorithms import algorithms
from evocity.store import Header, Source, Thumbnails

# Thumbnails in the log show the heights of more towers than colours do.
_THUMBNAIL_SHARE = 0.995


@dataclass(frozen=True)
class Prepared:
    """Everything fixed for a run. ``notes`` describe what was read of the maps' files; ``named``
    are the cities that measures compare with, ``within`` the parts of the map that they are taken
    of, both by the recipe's names."""

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
        """The cities that measures compare with and that are not sources."""
        own = {id(source.city) for source in self.sources}
        return [city for city in self.named.values() if id(city) not in own]

    @property
    def setup(self) -> Setup:
        """The setup of a worker."""
        measures = tuple(
            (measure.name, entry.source or file_of(own_name(measure.name)))
            for entry in self.recipe.entries
            for measure in entry.measures
        )
        by_sources = any("sources" in m.takes for e in self.recipe.entries for m in e.measures)
        return Setup(
            self.header,
            measures,
            self.condensation,
            references=self.references,
            sources=tuple(source.city for source in self.sources) if by_sources else (),
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
    on_map: Callable[[CityMap, Parent], None] | None = None,
) -> Prepared:
    """Read and encode the parents, and measure the cities that births shall be like. ``progress``
    is called with steps, ``on_map`` with each parent's map. Raises `MapError`, `GenomeError` or
    `FitnessError` if a map cannot be used."""
    tell = progress or (lambda text: None)
    cities: list[CityMap] = []
    notes: list[str] = []
    founders: dict[int, Any] = {}
    for number, parent in enumerate(recipe.parents):
        tell(f"reading {parent.name or parent.place}")
        if parent.map is None:
            city, founders[number] = read_founder(recipe, parent)
        else:
            city = read_parent(recipe, parent.map, parent)
        name = free_name(city.name, [other.name for other in cities])
        cities.append(city if name == city.name else city.replace(city.heights, name=name))
        notes.append(f"{name}: {city.taken if parent.map else parent.place}")
        if on_map is not None:
            on_map(cities[-1], parent)
    same_grid(cities)
    named = named_cities(recipe, cities, tell, notes.append)
    references = references_of(recipe, cities, named, tell)
    within = parts_of(recipe, cities)
    condensation, attribution = locked_layer(recipe, cities)
    kind, genomes = recipe.kind, []
    for number, city in enumerate(cities):
        if number in founders:
            genomes.append(kind.rename(founders[number], city.name))
            continue
        tell(f"encoding {city.name}")
        coded = kind.prepare(city, recipe.genome.coding, condensation)
        genomes.append(kind.complete(coded, city, recipe))
    header = _header(recipe, cities, condensation, attribution)
    adopted = [kind.adopt(genome, header, condensation) for genome in genomes]
    sources = [Source(city, genome) for city, genome in zip(cities, adopted, strict=True)]
    aims = aims_of(recipe, note=notes.append)
    noted = tuple(dict.fromkeys(notes))
    return Prepared(recipe, sources, aims, header, condensation, noted, references, named, within)


def read_parent(recipe: Recipe, name: str, options=None) -> CityMap:
    """Read a map of the recipe in the recipe's window."""
    chosen = {} if options is None else options.model_dump(exclude={"map"}, exclude_none=True)
    if isinstance(chosen.get("terrain"), str):
        chosen["terrain"] = resolve_path(recipe.folder, chosen["terrain"])
    return io.read_map(
        resolve_path(recipe.folder, name),
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
    """Return the cities that measures of the ``recipe`` compare with, by its names: source
    ``cities``, or other maps. ``tell`` is called with each step, ``note`` with what was read."""
    named: dict[str, CityMap] = {}
    for name in compared_names(recipe):
        parent = recipe.parent_named(name)
        if parent is not None:
            named[name] = cities[next(k for k, p in enumerate(recipe.parents) if p is parent)]
            continue
        tell(f"reading {name}")
        named[name] = read_parent(recipe, name)
        note(f"{named[name].name}: {named[name].taken}")
    return named


def compared_names(recipe: Recipe) -> list[str]:
    """Return the cities that measures compare with, as the ``recipe`` names them, each once."""
    lists = [entry.compared for entry in recipe.entries if entry.compared not in (None, PARENTS)]
    return list(dict.fromkeys(name for names in lists for name in names))


def references_of(
    recipe: Recipe,
    cities: Sequence[CityMap],
    named: Mapping[str, CityMap],
    tell: Callable[[str], None] | None = None,
) -> dict[str, fitness.Reference]:
    """Return the references of the recipe's measures that compare cities, by the measure's name;
    ``named`` as in `named_cities`. ``tell`` is called with the features that are left out. Raises
    `FitnessError` if a reference has too few buildings."""
    references: dict[str, fitness.Reference] = {}
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
            references[measure.name] = made[compared]
            if own_name(measure.name).partition(".")[0] == fitness.fabric_distance.name:
                unused = _unused_features(measure.name, made[compared])
                if unused and tell is not None:
                    tell(unused)
    return references


def _unused_features(name: str, reference: fitness.Reference) -> str:
    names = ", ".join(city.name for city in reference.cities)
    try:
        features = left_out(reference)
    except FitnessError as error:
        raise FitnessError(
            f"{name} has no meaning beside {names}: {error.found}",
            error.expected,
            "name other cities as its reference",
        ) from None
    return (
        f"{name} leaves out {', '.join(features)}: the same in all of {names}" if features else ""
    )


def aims_of(
    recipe: Recipe, targets: dict | None = None, note: Callable[[str], None] | None = None
) -> fitness.Aims:
    """Return the goals and constraints of the ``recipe``. ``targets`` (measure -> number) replace
    measuring a city; ``note`` is called with what was read of a city's file."""
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
        return fitness.Objective.like(measure, read_founder(recipe, parent)[0])
    city = read_parent(recipe, map_of(recipe, entry.like), parent)
    note(f"{city.name}: {city.taken}")
    return fitness.Objective.like(measure, city)


def map_of(recipe: Recipe, like: str) -> str:
    """Return the map of a city that births shall be ``like``: a name of a parent means its map."""
    parent = recipe.parent_named(like)
    return parent.place if parent else like


def takes_void(recipe: Recipe) -> bool:
    """Whether an operator of a ``recipe`` lays open ground that no city has."""
    breeding = [one.operator(name) for one in recipe.local for name in one.breeding]
    return any(getattr(one, "void", False) or getattr(one, "lays_void", False) for one in breeding)


def _header(
    recipe: Recipe,
    cities: list[CityMap],
    condensation: Condensation | None,
    attribution: str,
) -> Header:
    names = [city.name for city in cities]
    if takes_void(recipe):
        names.append(VOID)  # open ground that no city has
    if len(names) > 255:
        raise RecipeError(
            f"the recipe has {len(names)} parents, which are too many",
            "255 parents or fewer",
            "remove some of the parents",
        )
    attributions = [*(city.attribution for city in cities), attribution]
    places = {(city.origin, city.crs) for city in cities}
    kinds = [algorithms()[one.search.algorithm] for one in recipe.local]
    origin, crs = places.pop() if len(places) == 1 else (None, None)
    return Header(
        height=cities[0].shape[0],
        width=cities[0].shape[1],
        metres_per_pixel=cities[0].metres_per_pixel,
        sigma_max=recipe.genome.sigma_max,
        cities=tuple(names),
        attribution=joined(attributions),
        origin=origin,
        crs=crs,
        seed=recipe.run.seed,
        population=recipe.generation_size,
        recipe_hash=store.hash_of_text(recipe.text),
        measures=tuple(measure.name for measure in recipe.measures),
        recorded=tuple(measure.name for measure in recipe.recorded),
        locked=None if condensation is None else condensation.digest,
        shares="all" if condensation is None else "free",
        settle=recipe.genome.settle,
        marks=tuple(dict.fromkeys(mark for kind in kinds for mark in kind.marks)),
        figures=() if recipe.islands else kinds[0].figures,
        islands=tuple(one.name for one in recipe.islands),
        genomes=recipe.log.genomes,
        kind=recipe.kind.name,
        thumbnails=Thumbnails.of(*cities[0].shape, scale_end(*cities, share=_THUMBNAIL_SHARE)),
    )
