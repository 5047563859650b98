"""Changes of the recipe of a resumed run: which are allowed, and why others are not."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace

from evocity import store
from evocity.errors import RecipeError, spell
from evocity.genome import VOID
from evocity.recipe.reader import recipe_of
from evocity.recipe.recipe import Recipe
from evocity.recipe.sections import GenomeSection
from evocity.recipe.values import PARENTS
from evocity.search.preparation.changes import noted_measures
from evocity.search.preparation.masks import part_names
from evocity.search.preparation.preparation import map_of, takes_void
from evocity.search.preparation.provenance import collect_own_files
from evocity.selection.algorithms import algorithms
from evocity.store import Header, RunLog

#: Why a run keeps what it began with.
_WHY = {
    "run.seed": "all births are drawn from it",
    "run.population": "births are numbered by it",
    "search.births": "births are numbered by it",
    "run.kind": "births are of it",
    "curves": "every birth has these curves, of these widths",
    "map": "parents and births are maps of this window",
    "parents": "all births descend from them",
    "genome": "parents and births are coded by it",
    "locked": "every genome has it",
    "islands": "births are numbered by them",
    "search.algorithm": "what it reports of the living has its own columns",
    "search": "its cells, or what it learns, depend on all births so far",
    "within": "the births were measured on these parts of the map",
    "log.genomes": "births have columns for the genomes that the log omits",
}
#: Why some runs cannot change their measures.
_BOUND = {
    "window": "with a window, births are under way that were planned by the earlier goals",
    "algorithm": "the algorithm learns from all births again, by the goals of their time",
}
#: Keys of ``[search]`` that only change how later births are bred and chosen.
_FREE = (
    "picks",
    "adapt",
    "credit",
    "steer",
    "tournament",
    "mates",
    "redraws",
    "distinct",
    "apart",
    "per_plan",
    "source_plans",
    "twins",
)
#: Overrides of the first recipe that count for another one too.
_LASTING = ("run.seed", "run.population")


def apply_overrides(recipe: Recipe, run: RunLog, overrides: Mapping[str, object]) -> Recipe:
    """Return the new ``recipe`` with ``overrides``, and with those of the first recipe that a run
    cannot change."""
    before = run.provenance["recipe"].get("overrides", {})
    lasting = {key: before[key] for key in _LASTING if key in before}
    given = {key: value for key, value in overrides.items() if value is not None}
    values = lasting | dict(recipe.overrides) | given
    credit = run.provenance["recipe"].get("search", {}).get("credit", "archive")
    name, older = recipe.file or "the new recipe", {"search.credit": credit}
    changed = recipe_of(recipe.text, recipe.folder, values, name, defaults=older)
    changed._file = recipe.file
    return changed


def refuse_revision(run: RunLog, recipe: Recipe) -> None:
    """Raise `RecipeError`, which lists all reasons, if a ``run`` cannot go on by another
    ``recipe``."""
    faults = [
        f"{key}: was {spell(before)}, is {spell(now)}; it cannot change: {_WHY[key]}"
        for key, before, now in _fixed_values(run, recipe)
        if before != now
    ]
    faults += _measure_faults(run, recipe)
    if VOID not in run.header.cities and takes_void(recipe):
        faults.append("an operator lays open ground of its own, which the run's cities lack")
    done = len(run.generations) - 1
    if recipe.run.generations < done:
        faults.append(f"run.generations: {recipe.run.generations}, but {done} are done")
    if not faults:
        return
    listed = "\n  ".join(faults)
    raise RecipeError(
        f"{run.path} cannot continue with {recipe.file or 'this recipe'}:\n  {listed}",
        "changes only in these parts: weights and parameters of operators; targets, bounds and "
        "weights of measures; generations; [stop], [notify], [evaluation] and [refine]. Each "
        "measure stays a goal, a bound or an entry of run.record; run.record may get new measures",
        "undo all other changes; or start a new run, whose [[parents]] may be individuals of this "
        "run (keys 'run' and 'id')",
    )


def _fixed_values(run: RunLog, recipe: Recipe) -> list[tuple[str, object, object]]:
    """Key, value of the run and value of the new recipe, of all that cannot change."""
    header, old = run.header, tomllib.loads(run.recipe_text)
    new = tomllib.loads(recipe.text)
    window = {"pixels": header.width, "metres_per_pixel": header.metres_per_pixel}
    pairs = [
        ("run.seed", header.seed, recipe.run.seed),
        ("run.population", population_of(run), recipe.run.population),
        ("run.kind", header.kind, recipe.kind.name),
        ("curves", old.get("curves"), new.get("curves")),
        ("map", window, recipe.map.model_dump()),
        ("parents", old.get("parents"), new.get("parents")),
        ("locked", run.provenance.get("locked", {}).get("asked", {}), recipe.locked.given),
        ("islands", old.get("islands"), new.get("islands")),
        ("within", [o["name"] for o in run.provenance.get("within", [])], part_names(recipe)),
        ("log.genomes", header.genomes, recipe.log.genomes),
    ]
    if header.block is None:
        before = GenomeSection.model_validate(old.get("genome", {})).model_dump()
        pairs.append(("genome", before, recipe.genome.model_dump()))
    else:  # releases before leaves had other defaults
        pairs.append(("genome", old.get("genome"), new.get("genome")))
    return pairs + _search(run, recipe)


def population_of(run: RunLog) -> int:
    """Return how many live at most in a ``run``: as many as a generation has births, unless the
    recipe has the key ``births``."""
    return run.provenance["recipe"].get("population", run.header.population)


def columns_of(provenance: Mapping) -> dict[str, tuple[str, ...]]:
    """Return the measures of a header from its ``provenance``."""
    recorded = provenance.get("recorded", [])
    return {
        "measures": tuple(one["name"] for one in provenance["fitness"]),
        "recorded": tuple(one["name"] for one in recorded),
    }


def revised_header(recipe: Recipe, header: Header) -> Header:
    """Return the ``header`` of a run that goes on by ``recipe``: the same, unless its births get
    other columns, or the same in another order."""
    measures = tuple(measure.name for measure in recipe.measures)
    recorded = tuple(measure.name for measure in recipe.recorded)
    if (measures, recorded) == (header.measures, header.recorded):
        return header
    known = store.hash_of_text(recipe.text)
    return replace(header, measures=measures, recorded=recorded, recipe_hash=known)


def _measure_faults(run: RunLog, recipe: Recipe) -> list[str]:
    header, fresh = run.header, revised_header(recipe, run.header)
    noted = {one["name"]: one for one in noted_measures(run.provenance)}
    now = {one.name: (entry, one) for entry in recipe.entries for one in entry.measures}
    faults = [
        f"{'run.record' if name in header.recorded else 'fitness'}: {name} is missing; births have "
        "values of it, which the run keeps: make it a goal or a bound, or record it"
        for name in header.columns
        if name not in now
    ]
    others = header.measures != fresh.measures
    if others and recipe.search.window is not None:
        faults.append(f"fitness: other measures; they cannot change: {_BOUND['window']}")
    if fresh != header and algorithms()[recipe.search.algorithm].replays:
        faults.append(f"fitness: other measures; they cannot change: {_BOUND['algorithm']}")
    if fresh.recorded and fresh.schema_version < 3:
        faults.append(
            "run.record: runs of releases before leaves record nothing; make it a goal or a bound"
        )
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
        maps = _sorted_maps(recipe, before)
        if name in noted and _sorted_maps(recipe, own) != maps:
            faults.append(
                f"reference of {name}: was {spell(maps)}, is {spell(own)}; it cannot change: its "
                "births were compared with these cities"
            )
        unknown = [] if own == PARENTS else [city for city in own if city not in known]
        if name not in noted and unknown:
            faults.append(
                f"reference of {name}: {', '.join(unknown)}; the run keeps no map of it: compare "
                f"with {' or '.join(map(spell, [PARENTS, *known]))}"
            )
    places = collect_own_files(recipe).places
    kept = {one["kept"]: name for name, one in noted.items() if "kept" in one}
    faults += [
        f"{place}: the run keeps another file of this name; list its measures first, or rename the "
        "new file"
        for name, place in places.items()
        if kept.get(place, name) != name and places.get(kept[place]) != place
    ]
    return list(dict.fromkeys(faults))


def _sorted_maps(recipe: Recipe, cities: object) -> object:
    return cities if cities == PARENTS else sorted(map_of(recipe, one) for one in cities)


def _search(run: RunLog, recipe: Recipe) -> list[tuple[str, object, object]]:
    """The algorithm and its keys; of one that learns from all births its goals too."""
    noted = dict(run.provenance["recipe"].get("search", {"algorithm": "nsga2"}))
    name, now = noted["algorithm"], recipe.search.settings
    pairs = [("search.algorithm", name, recipe.search.algorithm)]
    if name != recipe.search.algorithm:
        return pairs
    pairs.append(("search.births", noted.get("births"), now["births"]))
    bound = {key for key in {*noted, *now} if key not in (*_FREE, "births")}
    pairs.append(("search", {k: noted.get(k) for k in bound}, {k: now.get(k) for k in bound}))
    if algorithms()[name].replays:
        old, new = tomllib.loads(run.recipe_text), tomllib.loads(recipe.text)
        pairs.append(("search", old.get("fitness"), new.get("fitness")))
    return pairs


def changed_keys(old: str, new: str) -> list[str]:
    """Return the keys in which two texts of recipes differ."""
    theirs, own = flatten_keys(tomllib.loads(old)), flatten_keys(tomllib.loads(new))
    return [key for key in theirs | own if theirs.get(key) != own.get(key)]


def flatten_keys(recipe: Mapping) -> dict:
    """Return ``recipe`` with keys such as "run.seed"; lists of tables stay whole."""
    keys = {}
    for section, value in recipe.items():
        table = value if isinstance(value, dict) else {"": value}
        keys |= {f"{section}.{key}".rstrip("."): inner for key, inner in table.items()}
    return keys
