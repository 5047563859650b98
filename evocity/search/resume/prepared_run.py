"""The preparation of a logged run, from its folder: recipe, sources, references, masks."""

import tomllib
from collections.abc import Mapping

import numpy as np

from evocity import store
from evocity.citymap import CityMap
from evocity.errors import RunError, keyword
from evocity.recipe.reader import recipe_of
from evocity.recipe.recipe import Recipe
from evocity.search.preparation.changes import (
    changes_of,
    current_hash,
    noted_measures,
    recipe_folder,
)
from evocity.search.preparation.masks import part_names, parts_of
from evocity.search.preparation.preparation import (
    Prepared,
    aims_of,
    compared_names,
    map_of,
    named_cities,
    references_of,
)
from evocity.search.preparation.provenance import find_copies
from evocity.search.preparation.trust import NO_PERMISSION, Permission, refuse_untrusted
from evocity.search.record.aims import provenance_read
from evocity.search.resume.recipe_changes import (
    apply_overrides,
    population_of,
    refuse_revision,
    revised_header,
)
from evocity.store import Header, RunLog, Source

#: Defaults of releases before leaves.
_BEFORE_LEAVES = {"genome.block": 4, "genome.fit": False, "genome.settle": False}
#: The mixture of releases that did not note it, if a recipe has no operators.
_BEFORE_QUARTERS = {
    "pavement_fusion": 2,
    "region_fusion": 2,
    "lambda_crossover": 1,
    "relocation": 1,
    "mutation": 1,
}
#: How releases before algorithms selected.
_BEFORE_ALGORITHMS = {"algorithm": "nsga2", "distinct": 0}
#: How releases that did not note it credited operators.
_BEFORE_CREDIT = {"credit": "archive"}


def read_preparation(
    run: RunLog,
    overrides: Mapping[str, object] | None = None,
    permission: Permission = NO_PERMISSION,
    revised: Recipe | None = None,
) -> tuple[Prepared, list[str]]:
    """Read what a ``run`` was prepared with, and describe what changed since.

    Its own measures are executed, unless they changed or the run is not trusted; the ``permission``
    allows both. ``overrides`` replace values of its recipe, as {"run.generations": 400}. With
    another recipe, ``revised``, nothing of the run is executed. Raises as `Search.resume`.
    """
    header = run.header
    with provenance_read(run):
        copies = find_copies(run.path, recipe_folder(run), noted_measures(run.provenance))
        if revised is None:
            changes = changes_of(run, copies)
            if changes and not permission.accept_changes:
                raise RunError(
                    f"{run.path}: inputs have changed since the run began: {'; '.join(changes)}",
                    "the same recipe, maps and measures as at the start of the run",
                    "undo the change; or confirm the change with "
                    f"{keyword('accept_changes', True)}, which keeps the values of the living "
                    "individuals",
                )
            if not permission.trust:
                refuse_untrusted(run, bool(changes and copies))
            recipe = _recipe(run, overrides or {}, copies)
        else:
            changes, recipe = [], apply_overrides(revised, run, overrides or {})
            refuse_revision(run, recipe)
            header = revised_header(recipe, header)
        _refuse_another_run(run, header, recipe)
        likes = [one for one in run.provenance["fitness"] if one["goal"] == "like"]
        if revised is not None:  # its targets may be other cities
            now = {
                m.name: map_of(recipe, e.like) for e in recipe.fitness if e.like for m in e.measures
            }
            likes = [one for one in likes if now.get(one["name"]) == one["like"]]
        if changes or revised is not None:  # cities that are gone cannot be measured again
            likes = [one for one in likes if current_hash(recipe.folder, one["like"]) == "missing"]
        aims = aims_of(recipe, {one["name"]: one["target"] for one in likes})
        sources = _read_sources(run, recipe)
        named = _read_references(run, recipe, sources)
        cities = [source.city for source in sources]
        references = references_of(recipe, cities, named)
        within = parts_of(recipe, cities, _read_masks(run))
    layer = run.condensation
    prepared = Prepared(recipe, sources, aims, header, layer, (), references, named, within)
    return prepared, changes


def _recipe(run: RunLog, overrides: Mapping[str, object], copies: Mapping[str, str]) -> Recipe:
    """The run's recipe; its own measures are executed."""
    values = dict(run.provenance["recipe"]["overrides"])
    values |= {key: value for key, value in overrides.items() if value is not None}
    mixture = run.provenance["recipe"].get("operators", _BEFORE_QUARTERS)
    older = {"operators": mixture} | ({} if run.header.block is None else _BEFORE_LEAVES)
    selected = _BEFORE_CREDIT | run.provenance["recipe"].get("search", _BEFORE_ALGORITHMS)
    older |= {f"search.{key}": value for key, value in selected.items()}
    noted = run.provenance["recipe"].get("islands", [])
    older["islands"] = [
        {key: value for key, value in one["search"].items() if value is not None} for one in noted
    ]
    name = f"{run.path}/recipe.toml"
    return recipe_of(run.recipe_text, recipe_folder(run), values, name, copies, older)


def _refuse_another_run(run: RunLog, header: Header, recipe: Recipe) -> None:
    search = run.provenance["recipe"].get("search", _BEFORE_ALGORITHMS)
    fixed = {
        "run.seed": (header.seed, recipe.run.seed),
        "run.population": (population_of(run), recipe.run.population),
        "search.births": (search.get("births"), recipe.search.births),
        "run.kind": (header.kind, recipe.kind.name),
        "curves": [tomllib.loads(t).get("curves", []) for t in (run.recipe_text, recipe.text)],
        "genome.block": (header.block, recipe.genome.block if header.block else None),
        "genome.sigma_max": (header.sigma_max, recipe.genome.sigma_max),
        "genome.settle": (header.settle, recipe.genome.settle),
        "map.metres_per_pixel": (header.metres_per_pixel, recipe.map.metres_per_pixel),
        "map.pixels": (header.width, recipe.map.pixels),
        "parents": (
            [one["map"] for one in run.provenance["maps"]],
            [parent.place for parent in recipe.parents],
        ),
        "locked": (run.provenance.get("locked", {}).get("asked", {}), recipe.locked.given),
        "search.algorithm": (search["algorithm"], recipe.search.algorithm),
        "search.window": (search.get("window"), recipe.search.window),
        "islands": (_islands(run), _islands_of(recipe)),
        "log.genomes": (header.genomes, recipe.log.genomes),
        "fitness": (header.measures, tuple(measure.name for measure in recipe.measures)),
        "run.record": (header.recorded, tuple(measure.name for measure in recipe.recorded)),
    }
    parts = [one["name"] for one in run.provenance.get("within", [])]
    fixed["the parts that are measured"] = parts, part_names(recipe)
    if "references" in run.provenance:
        before = [one["name"] for one in run.provenance["references"]]
        fixed["the reference of measures"] = sorted(before), sorted(compared_names(recipe))
    for key, (before, now) in fixed.items():
        if before != now:
            raise RunError(
                f"{run.path}: {key} was {before} and is now {now}",
                f"{key} as at the start of the run, so that all births of the run stay comparable",
                "undo the change, or start a new run with the new recipe",
            )
    done = len(run.generations) - 1
    if recipe.run.generations < done:
        raise RunError(
            f"{run.path}: generations = {recipe.run.generations}, but the run already has {done} "
            "generations",
            f"{done} generations or more, because a run keeps all its generations",
            "give a larger number of generations, or leave 'generations' out to keep the number in "
            "the recipe",
        )


def _islands(run: RunLog) -> list[str]:
    noted = run.provenance["recipe"].get("islands", [])
    return [f"{one['name']}: {one['population']}, {one['search']['algorithm']}" for one in noted]


def _islands_of(recipe: Recipe) -> list[str]:
    pairs = zip(recipe.islands, recipe.local if recipe.islands else [], strict=True)
    return [f"{one.name}: {one.population}, {local.search.algorithm}" for one, local in pairs]


def _read_sources(run: RunLog, recipe: Recipe) -> list[Source]:
    sources, fault = run.sources(), ""
    if len(sources) != len(recipe.parents):
        fault = f"holds {len(sources)} cities of {len(recipe.parents)}"
    else:
        for source, noted in zip(sources, run.provenance["maps"], strict=True):
            now = store.hash_of_map(source.city), source.genome.digest
            if now != (noted["hash"], noted.get("genome", now[1])):
                fault = f"holds another map or genome of {source.name}"
    if fault:
        raise _altered_error(run, "sources", fault, "the source cities")
    return sources


def _read_references(run: RunLog, recipe: Recipe, sources: list[Source]) -> Mapping[str, CityMap]:
    """The cities by the recipe's names. Runs of older releases kept none: their files are read."""
    noted = run.provenance.get("references")
    if noted is None:
        cities = [source.city for source in sources]
        return named_cities(recipe, cities, lambda text: None, lambda text: None)
    others = run.references()
    left = [one["name"] for one in noted if one["source"] is None]
    named = dict(zip(left, others, strict=False))
    named |= {
        one["name"]: sources[one["source"]].city for one in noted if one["source"] is not None
    }
    hashes = {name: store.hash_of_map(city) for name, city in named.items()}
    if len(left) != len(others) or hashes != {one["name"]: one["hash"] for one in noted}:
        what = "the cities that measures compare with"
        raise _altered_error(run, "references", "holds other maps than the run began with", what)
    return named


def _read_masks(run: RunLog) -> Mapping[str, np.ndarray]:
    noted = run.provenance.get("within", [])
    masks = run.parts()
    hashes = [store.hash_of_mask(mask) for mask in masks]
    if hashes != [one["hash"] for one in noted]:
        what = "the parts of the map that are measured"
        raise _altered_error(run, "within", "holds other parts than the run began with", what)
    return dict(zip([one["name"] for one in noted], masks, strict=True))


def _altered_error(run: RunLog, folder: str, fault: str, what: str) -> RunError:
    return RunError(
        f"{run.path / folder} {fault}",
        f"{what}, as at the start of the run",
        "restore the folder from a backup, or start a new run with the same recipe",
    )
