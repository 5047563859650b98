"""Another recipe for a run that goes on: what of it may change, and what may not, and why."""

import tomllib
from collections.abc import Mapping

from evocity.errors import RecipeError, shown
from evocity.search.algorithms import algorithms
from evocity.search.changes import noted_of
from evocity.search.parting import part_names
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe
from evocity.search.sections import GenomeSection
from evocity.store import Run

#: Why a run keeps what it began with.
_WHY = {
    "run.seed": "all births are drawn from it",
    "run.population": "births are numbered by it",
    "map": "parents and births are maps of this window",
    "parents": "all births descend from them",
    "genome": "parents and births are coded so",
    "locked": "every genome has it",
    "islands": "births are numbered by them",
    "search.algorithm": "what it tells of the living has columns of its own",
    "search": "its cells, or what it learns, are of all births so far",
    "fitness": "births have a column for each measure, in this order",
    "run.record": "births have a column for each measure, in this order",
    "within": "the values of its births are of these parts of the map",
    "reference": "the values of its births are by these cities",
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
    noted = {one["name"]: one["hash"] for one in noted_of(run.provenance)}
    faults += [
        f"{measure.name}: its source has changed; births so far were measured by the old one"
        for measure in [*recipe.measures, *recipe.recorded]
        if measure.name in noted and measure.source_hash != noted[measure.name]
    ]
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
        "weights and parameters of operators; targets, bounds and weights of the same measures; "
        "generations, [stop], [notify], [evaluation], [refine]",
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
        ("map", window, recipe.map.model_dump()),
        ("parents", old.get("parents"), new.get("parents")),
        ("locked", run.provenance.get("locked", {}).get("asked", {}), recipe.locked.asked),
        ("islands", old.get("islands"), new.get("islands")),
        ("fitness", list(header.measures), [one.name for one in recipe.measures]),
        ("run.record", list(header.recorded), [one.name for one in recipe.recorded]),
        ("within", [o["name"] for o in run.provenance.get("within", [])], part_names(recipe)),
        ("reference", _references(old), _references(new)),
    ]
    if header.block is None:
        before = GenomeSection.model_validate(old.get("genome", {})).model_dump()
        pairs.append(("genome", before, recipe.genome.model_dump()))
    else:  # releases before leaves took other defaults
        pairs.append(("genome", old.get("genome"), new.get("genome")))
    return pairs + _search(run, recipe)


def _references(raw: Mapping) -> list:
    entries = raw.get("fitness", [])
    return [one.get("reference") for one in entries if "reference" in one]


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


__all__ = ["changed_keys", "flat", "refuse_revision", "with_values"]
