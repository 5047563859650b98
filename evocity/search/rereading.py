"""What a run was prepared with, from its folder: the recipe, the sources, what is measured."""

import tomllib
from collections.abc import Mapping

import numpy as np

from evocity import store
from evocity.citymap import CityMap
from evocity.errors import RunError, keyword
from evocity.search.changes import changes_of, folder_of, hash_now, noted_of
from evocity.search.keeping import replaced
from evocity.search.parting import part_names, parts_of
from evocity.search.preparation import (
    Prepared,
    aims_of,
    compared_names,
    map_of,
    named_cities,
    references_of,
)
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe
from evocity.search.revising import header_by, refuse_revision, with_values
from evocity.search.trust import refuse_untrusted
from evocity.store import Header, Run, Source

#: What releases before leaves took where a recipe says nothing of it.
_BEFORE_LEAVES = {"genome.block": 4, "genome.fit": False, "genome.settle": False}
#: The mixture of releases that did not note it, where a recipe says nothing of operators.
_BEFORE_QUARTERS = {
    "pavement_fusion": 2,
    "region_fusion": 2,
    "lambda_crossover": 1,
    "relocation": 1,
    "mutation": 1,
}


#: How releases before algorithms selected.
_BEFORE_ALGORITHMS = {"algorithm": "nsga2", "distinct": 0}


def read_again(
    run: Run,
    asked: Mapping[str, object] | None = None,
    accept_changes: bool = False,
    trust: bool = False,
    revised: Recipe | None = None,
) -> tuple[Prepared, list[str]]:
    """What the ``run`` was prepared with, and in words what changed since. Its own measures are
    executed, unless they changed and that is not accepted, or the run was not begun on this machine
    and nobody says to ``trust`` it. ``asked``: what replaces values of its
    recipe, as {"run.generations": 400}; None leaves one as it is. ``revised``: another recipe to go
    on by, whose measures may be others; then nothing of the run's own is executed.

    Raises `RunError` as `Search.resume` says.
    """
    header = run.header
    try:
        noted = noted_of(run.provenance)
        copies = replaced(run.path, folder_of(run), noted)
        if revised is None:
            changes = changes_of(run, copies)
            if changes and not accept_changes:
                raise RunError(
                    f"{run.path}: changed since the run began: {'; '.join(changes)}",
                    "the recipe, maps and measures it began with",
                    f"undo the change, or confirm it with {keyword('accept_changes', True)}: "
                    "the living then keep the values they were given",
                )
            if not trust:
                refuse_untrusted(run, bool(changes and copies))
            recipe = _recipe(run, asked or {}, copies)
        else:
            changes, recipe = [], with_values(revised, run, asked or {})
            refuse_revision(run, recipe)
            header = header_by(recipe, header)
        _refuse_another_run(run, header, recipe)
        likes = [one for one in run.provenance["fitness"] if one["goal"] == "like"]
        if revised is not None:  # another city may be wanted
            now = {
                m.name: map_of(recipe, e.like) for e in recipe.fitness if e.like for m in e.measures
            }
            likes = [one for one in likes if now.get(one["name"]) == one["like"]]
        if changes or revised is not None:  # cities that are gone cannot be measured again
            likes = [one for one in likes if hash_now(recipe.folder, one["like"]) == "missing"]
        aims = aims_of(recipe, {one["name"]: one["target"] for one in likes})
        sources = _sources(run, recipe)
        named = _named(run, recipe, sources)
        cities = [source.city for source in sources]
        references = references_of(recipe, cities, named)
        within = parts_of(recipe, cities, _masks(run))
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise lacking(run, error) from None
    prepared = Prepared(
        recipe,
        sources,
        aims,
        header,
        run.condensation,
        references=references,
        named=named,
        within=within,
    )
    return prepared, changes


def lacking(run: Run, error: Exception) -> RunError:
    """What is told of a provenance that lacks a part."""
    return RunError(
        f"{run.path}: provenance.json lacks a part ({error!r})",
        "a provenance as `evocity run` writes it",
        "bring the file back from a copy",
    )


def _recipe(run: Run, asked: Mapping[str, object], copies: Mapping[str, str]) -> Recipe:
    """The run's recipe; its own measures are executed."""
    overrides = dict(run.provenance["recipe"]["overrides"])
    overrides |= {key: value for key, value in asked.items() if value is not None}
    mixture = run.provenance["recipe"].get("operators", _BEFORE_QUARTERS)
    older = {"operators": mixture} | ({} if run.header.block is None else _BEFORE_LEAVES)
    selected = run.provenance["recipe"].get("search", _BEFORE_ALGORITHMS)
    older |= {f"search.{key}": value for key, value in selected.items()}
    noted = run.provenance["recipe"].get("islands", [])
    older["islands"] = [
        {key: value for key, value in one["search"].items() if value is not None} for one in noted
    ]
    name = f"{run.path}/recipe.toml"
    return recipe_of(run.recipe_text, folder_of(run), overrides, name, copies, older)


def _refuse_another_run(run: Run, header: Header, recipe: Recipe) -> None:
    """Raise `RunError` for what one run, with this ``header``, cannot have changed."""
    fixed = {
        "run.seed": (header.seed, recipe.run.seed),
        "run.population": (header.population, recipe.run.population),
        "run.kind": (header.kind, recipe.kind.name),
        "curves": (_curves(run.recipe_text), _curves(recipe.text)),
        "genome.block": (header.block, recipe.genome.block if header.block else None),
        "genome.sigma_max": (header.sigma_max, recipe.genome.sigma_max),
        "genome.settle": (header.settle, recipe.genome.settle),
        "map.metres_per_pixel": (header.metres_per_pixel, recipe.map.metres_per_pixel),
        "map.pixels": (header.width, recipe.map.pixels),
        "parents": (
            [one["map"] for one in run.provenance["maps"]],
            [parent.place for parent in recipe.parents],
        ),
        "locked": (run.provenance.get("locked", {}).get("asked", {}), recipe.locked.asked),
        "search.algorithm": (_algorithm(run), recipe.search.algorithm),
        "search.window": (_window(run), recipe.search.window),
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
                f"{key} as the run began: its births would not be comparable",
                "undo the change, or start a new run with the new recipe",
            )
    done = len(run.generations) - 1
    if recipe.run.generations < done:
        raise RunError(
            f"{run.path}: generations = {recipe.run.generations}, but {done} are done",
            f"{done} or more: a run loses none of its generations",
            "ask for more, or leave the number out to keep what the run was started with",
        )


def _curves(text: str) -> object:
    """What a recipe's text tells of courses."""
    return tomllib.loads(text).get("curves", [])


def _islands(run: Run) -> list[str]:
    """The run's islands, in words."""
    noted = run.provenance["recipe"].get("islands", [])
    return [f"{one['name']}: {one['population']}, {one['search']['algorithm']}" for one in noted]


def _islands_of(recipe: Recipe) -> list[str]:
    told = zip(recipe.islands, recipe.local if recipe.islands else [], strict=True)
    return [f"{one.name}: {one.population}, {local.search.algorithm}" for one, local in told]


def _algorithm(run: Run) -> str:
    """What the run selects by."""
    return run.provenance["recipe"].get("search", _BEFORE_ALGORITHMS)["algorithm"]


def _window(run: Run) -> int | None:
    """How far before a birth its parents are at least; None where generations follow each other."""
    return run.provenance["recipe"].get("search", {}).get("window")


def _sources(run: Run, recipe: Recipe) -> list[Source]:
    """The source cities, if they are those the run began with; `RunError` if not."""
    sources = run.sources()
    found = ""
    if len(sources) != len(recipe.parents):
        found = f"holds {len(sources)} cities of {len(recipe.parents)}"
    else:
        for source, noted in zip(sources, run.provenance["maps"], strict=True):
            now = store.hash_of_map(source.city), source.genome.digest
            if now != (noted["hash"], noted.get("genome", now[1])):
                found = f"holds another map or genome of {source.name}"
    if found:
        raise RunError(
            f"{run.path / 'sources'} {found}",
            "the source cities as the run began with them",
            "bring the folder back from a copy, or start a new run with the same recipe",
        )
    return sources


def _named(run: Run, recipe: Recipe, sources: list[Source]) -> Mapping[str, CityMap]:
    """The cities that measures compare with, by the recipe's names, as the run keeps them;
    `RunError` if these are not those it began with. Runs of older releases kept none, and read
    their files again."""
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
        raise RunError(
            f"{run.path / 'references'} holds other maps than the run began with",
            "the cities that measures compare with, as the run began with them",
            "bring the folder back from a copy, or start a new run with the same recipe",
        )
    return named


def _masks(run: Run) -> Mapping[str, np.ndarray]:
    """The parts that measures are taken of, by the recipe's names, as the run keeps them;
    `RunError` if these are not those it began with."""
    noted = run.provenance.get("within", [])
    masks = run.parts()
    hashes = [store.hash_of_mask(mask) for mask in masks]
    if hashes != [one["hash"] for one in noted]:
        raise RunError(
            f"{run.path / 'within'} holds other parts than the run began with",
            "the parts of the map that are measured, as the run began with them",
            "bring the folder back from a copy, or start a new run with the same recipe",
        )
    return dict(zip([one["name"] for one in noted], masks, strict=True))
