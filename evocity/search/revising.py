"""Another recipe for a run that goes on: what of it may change, and what may not, and why."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace

from evocity import store
from evocity.errors import RecipeError, shown
from evocity.search.algorithms import algorithms
from evocity.search.changes import noted_of
from evocity.search.keeping import kept_by
from evocity.search.parting import part_names
from evocity.search.preparation import map_of
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe
from evocity.search.sections import GenomeSection
from evocity.search.values import PARENTS
from evocity.store import Header, Run

#: Why a run keeps what it began with.
_WHY = {
    "run.seed": "all births are drawn from it",
    "run.population": "births are numbered by it",
    "run.kind": "births are of it",
    "curves": "every birth has so many, of these widths",
    "map": "parents and births are maps of this window",
    "parents": "all births descend from them",
    "genome": "parents and births are coded so",
    "locked": "every genome has it",
    "islands": "births are numbered by them",
    "search.algorithm": "what it tells of the living has columns of its own",
    "search": "its cells, or what it learns, are of all births so far",
    "within": "the values of its births are of these parts of the map",
    "log.genomes": "births have columns for how those left out are bred again",
}
#: Why the measures of some runs stay what they are.
_BOUND = {
    "window": "with a window births are under way that were planned by the goals of before",
    "algorithm": "the algorithm learns from all births once more, by the goals of then",
}
#: Keys of ``[search]`` that only tell how births to come are bred and chosen.
_FREE = ("picks", "adapt", "distinct", "apart")
#: What replaced the first recipe's value replaces this one's too.
_STAY = ("run.seed", "run.population")


def with_values(recipe: Recipe, run: Run, asked: Mapping[str, object]) -> Recipe:
    """The new ``recipe`` with what is ``asked`` for, and what replaced those values of the first
    one that cannot change."""
    before = run.provenance["recipe"].get("overrides", {})
    stay = {key: before[key] for key in _STAY if key in before}
    told = {key: value for key, value in asked.items() if value is not None}
    values = stay | dict(recipe.overrides) | told
    found = recipe_of(recipe.text, recipe.folder, values, recipe.file or "the new recipe")
    found._file = recipe.file
    return found


def refuse_revision(run: Run, recipe: Recipe) -> None:
    """Raise `RecipeError`, which lists all that is so, if a ``run`` cannot go on by another
    ``recipe``."""
    faults = [
        f"{key}: was {shown(before)}, is {shown(now)}; it cannot change: {_WHY[key]}"
        for key, before, now in _fixed(run, recipe)
        if before != now
    ]
    faults += _measure_faults(run, recipe)
    done = len(run.generations) - 1
    if recipe.run.generations < done:
        faults.append(
            f"run.generations: {recipe.run.generations}; {done} are done, and none is lost"
        )
    if not faults:
        return
    listed = "\n  ".join(faults)
    raise RecipeError(
        f"{run.path} cannot go on by {recipe.file or 'this recipe'}:\n  {listed}",
        "weights and parameters of operators; targets, bounds and weights of measures; more "
        "measures, and all of those so far, as goals, bounds or in run.record; generations, "
        "[stop], [notify], [evaluation], [refine]",
        "undo these; or begin a run of its own, whose [[parents]] may be individuals of this one "
        "(run and id)",
    )


def _fixed(run: Run, recipe: Recipe) -> list[tuple[str, object, object]]:
    """Key, what the run has, and what the new recipe says, of all that cannot change."""
    header, old = run.header, tomllib.loads(run.recipe_text)
    new = tomllib.loads(recipe.text)
    window = {"pixels": header.width, "metres_per_pixel": header.metres_per_pixel}
    pairs = [
        ("run.seed", header.seed, recipe.run.seed),
        ("run.population", header.population, recipe.run.population),
        ("run.kind", header.kind, recipe.kind.name),
        ("curves", old.get("curves"), new.get("curves")),
        ("map", window, recipe.map.model_dump()),
        ("parents", old.get("parents"), new.get("parents")),
        ("locked", run.provenance.get("locked", {}).get("asked", {}), recipe.locked.asked),
        ("islands", old.get("islands"), new.get("islands")),
        ("within", [o["name"] for o in run.provenance.get("within", [])], part_names(recipe)),
        ("log.genomes", header.genomes, recipe.log.genomes),
    ]
    if header.block is None:
        before = GenomeSection.model_validate(old.get("genome", {})).model_dump()
        pairs.append(("genome", before, recipe.genome.model_dump()))
    else:  # releases before leaves took other defaults
        pairs.append(("genome", old.get("genome"), new.get("genome")))
    return pairs + _search(run, recipe)


def columns_of(provenance: Mapping) -> dict[str, tuple[str, ...]]:
    """Which measures a header has by what ``provenance`` tells of them."""
    recorded = provenance.get("recorded", [])
    return {
        "measures": tuple(one["name"] for one in provenance["fitness"]),
        "recorded": tuple(one["name"] for one in recorded),
    }


def header_by(recipe: Recipe, header: Header) -> Header:
    """The ``header`` of a run that goes on by a ``recipe``: the same, unless its births have other
    columns then, or the same in another order."""
    measures = tuple(one.name for one in recipe.measures)
    recorded = tuple(one.name for one in recipe.recorded)
    if (measures, recorded) == (header.measures, header.recorded):
        return header
    known = store.hash_of_text(recipe.text)
    return replace(header, measures=measures, recorded=recorded, recipe_hash=known)


def _measure_faults(run: Run, recipe: Recipe) -> list[str]:
    """What a ``run`` cannot have of the measures of a ``recipe``."""
    header, fresh = run.header, header_by(recipe, run.header)
    noted = {one["name"]: one for one in noted_of(run.provenance)}
    now = {one.name: (entry, one) for entry in recipe.entries for one in entry.measures}
    faults = [
        f"{'run.record' if name in header.recorded else 'fitness'}: {name} is left out; births "
        f"have values of it, and none is lost: seek it, bound it, or record it"
        for name in header.columns
        if name not in now
    ]
    others = header.measures != fresh.measures
    if others and recipe.search.window is not None:
        faults.append(f"fitness: other measures; they cannot change: {_BOUND['window']}")
    if fresh != header and algorithms()[recipe.search.algorithm].replays:
        faults.append(f"fitness: other measures; they cannot change: {_BOUND['algorithm']}")
    if fresh.recorded and fresh.schema_version < 3:
        faults.append("run.record: runs of releases before leaves record nothing; seek or bound it")
    if fresh != header and fresh.recipe_hash == header.recipe_hash:
        faults.append("fitness: the same text as before names other measures now; change it too")
    known = [one["name"] for one in run.provenance.get("references", [])]
    for name, (entry, measure) in now.items():
        if name in noted and measure.source_hash != noted[name]["hash"]:
            faults.append(
                f"{name}: its source has changed; births so far were measured by the old one; "
                "write new measures into a file of their own"
            )
        if "reference" not in measure.takes:
            continue
        own = PARENTS if entry.compared == PARENTS else list(entry.compared)
        before = noted.get(name, {}).get("reference") or PARENTS
        if name in noted and _named(recipe, own) != _named(recipe, before):
            faults.append(
                f"reference of {name}: was {shown(_named(recipe, before))}, is {shown(own)}; it "
                "cannot change: the values of its births are by these cities"
            )
        strange = [] if own == PARENTS else [city for city in own if city not in known]
        if name not in noted and strange:
            faults.append(
                f"reference of {name}: {', '.join(strange)}; the run keeps no map of it: compare "
                f"with {' or '.join(map(shown, [PARENTS, *known]))}"
            )
    places = kept_by(recipe).places
    kept = {one["kept"]: name for name, one in noted.items() if "kept" in one}
    faults += [
        f"{place}: the run keeps another file so; list that one's measures first, or call the new "
        "one otherwise"
        for name, place in places.items()
        if kept.get(place, name) != name and places.get(kept[place]) != place
    ]
    return list(dict.fromkeys(faults))


def _named(recipe: Recipe, cities: object) -> object:
    """The maps that a measure compares with, in order."""
    return cities if cities == PARENTS else sorted(map_of(recipe, one) for one in cities)


def _search(run: Run, recipe: Recipe) -> list[tuple[str, object, object]]:
    """The algorithm; of those that know all births so far their keys, and what is wanted."""
    noted = dict(run.provenance["recipe"].get("search", {"algorithm": "nsga2"}))
    name, now = noted["algorithm"], recipe.search.asked
    pairs = [("search.algorithm", name, recipe.search.algorithm)]
    if name != recipe.search.algorithm:
        return pairs
    bound = {key for key in {*noted, *now} if key not in _FREE}
    pairs.append(("search", {k: noted.get(k) for k in bound}, {k: now.get(k) for k in bound}))
    if algorithms()[name].replays:
        old, new = tomllib.loads(run.recipe_text), tomllib.loads(recipe.text)
        pairs.append(("search", old.get("fitness"), new.get("fitness")))
    return pairs


def changed_keys(old: str, new: str) -> list[str]:
    """The keys in which two texts of recipes differ."""
    theirs, own = flat(tomllib.loads(old)), flat(tomllib.loads(new))
    return [key for key in theirs | own if theirs.get(key) != own.get(key)]


def flat(recipe: Mapping) -> dict:
    """``recipe`` with the keys of its tables as "run.seed"; lists of tables stay whole."""
    found = {}
    for section, value in recipe.items():
        table = value if isinstance(value, dict) else {"": value}
        found |= {f"{section}.{key}".rstrip("."): one for key, one in table.items()}
    return found


__all__ = ["changed_keys", "columns_of", "flat", "header_by", "refuse_revision", "with_values"]
