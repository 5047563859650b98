"""Taking a run up again: what changed since, and who lived last.

What changed is found out before any file of the user's own is executed.
"""

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evocity import store
from evocity.citymap import CityMap
from evocity.errors import RunError, keyword
from evocity.search.algorithms import algorithms
from evocity.search.breeding import own_population, selecting
from evocity.search.changes import changes_of, compared_with, folder_of, hash_now, noted_of
from evocity.search.commands import Standing
from evocity.search.credit import Credit, credit_of
from evocity.search.judging import births_without_genomes
from evocity.search.keeping import kept_by, replaced
from evocity.search.noting import provenance_of
from evocity.search.parting import part_names, parts_of
from evocity.search.population import Population
from evocity.search.preparation import (
    Prepared,
    aims_of,
    compared_names,
    named_cities,
    references_of,
)
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe
from evocity.search.sections import RunSection
from evocity.store import Birth, Run, RunWriter, Source, open_run

#: A change of these may change the births; it is noted, not refused.
_NOTED_VERSIONS = ("evocity", "numpy", "numba")
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


@dataclass(frozen=True)
class TakenUp:
    """A run ready to go on at generation ``next``; ``births`` and ``failures`` so far;
    ``past``: births of each generation, without genomes, if the algorithm must go through them
    again; ``standing``: what commands have changed; ``credit``: what operators have earned, if the
    recipe adapts to it.

    ``changes``: in words, what differs from the start; ``edited``: how the recipe's
    own file differs from the run's copy, or "".
    """

    prepared: Prepared
    writer: RunWriter
    first_births: list[Birth]
    living: list[Birth]
    next: int
    births: int
    failures: int
    changes: list[str]
    edited: str
    past: list[list[Birth]]
    standing: Standing
    credit: Credit | None

    def restore(self, population: Population) -> None:
        """Make the new ``population`` what it was; its algorithm too."""
        population.begin_with(self.first_births)
        recipe = self.prepared.recipe
        sources = [source.genome for source in self.prepared.sources]
        for number, births in enumerate(self.past):
            own_population(recipe, population.algorithm, number, sources)
            population.select(births, selecting(recipe, number))
        population.restore(self.living)


def take_up(path: str | os.PathLike, generations: int | None, accept_changes: bool) -> TakenUp:
    """Reopen the run in ``path``. Raises `RunError` as `Search.resume` says."""
    run = open_run(path)
    try:
        noted = noted_of(run.provenance)
        copies = replaced(run.path, folder_of(run), noted)
        changes = changes_of(run, copies)
        if changes and not accept_changes:
            raise RunError(
                f"{run.path}: changed since the run began: {'; '.join(changes)}",
                "the recipe, maps and measures it began with",
                f"undo the change, or confirm it with {keyword('accept_changes', True)}: "
                "the living then keep the values they were given",
            )
        recipe = _recipe(run, generations, copies)
        _refuse_another_run(run, recipe)
        notes = _notes(run, recipe)
        likes = [one for one in run.provenance["fitness"] if one["goal"] == "like"]
        if changes:  # cities that are not there any more cannot be measured again
            likes = [one for one in likes if hash_now(recipe.folder, one["like"]) == "missing"]
        aims = aims_of(recipe, {one["name"]: one["target"] for one in likes})
        sources = _sources(run, recipe)
        named = _named(run, recipe, sources)
        cities = [source.city for source in sources]
        references = references_of(recipe, cities, named)
        within = parts_of(recipe, cities, _masks(run))
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise RunError(
            f"{run.path}: provenance.json lacks a part ({error!r})",
            "a provenance as `evocity run` writes it",
            "bring the file back from a copy",
        ) from None
    prepared = Prepared(
        recipe,
        sources,
        aims,
        run.header,
        run.condensation,
        references=references,
        named=named,
        within=within,
    )
    edited = _edited(run)
    writer = RunWriter.reopen(path)
    try:
        _record(run, prepared, writer, changes)
        whole = run.generations
        first, living, births, failures = [], [], 0, 0
        standing = _standing(run, len(whole))
        again = algorithms()[recipe.search.algorithm].replays
        past = [births_without_genomes(run, g) for g in whole] if again else []
        credit = credit_of(run, prepared.aims, run.events()) if recipe.search.adapt else None
        if whole:
            first = births_without_genomes(run, 0)
            living = run.individuals(run.members(whole[-1]).column("id").to_pylist())
            status = run.status()
            births, failures = status["births"], status["failures"]
            if not living:
                raise nobody_lives(run.path, whole[-1])
    except BaseException:
        writer.close()
        raise
    changes = changes + notes
    return TakenUp(
        prepared,
        writer,
        first,
        living,
        len(whole),
        births,
        failures,
        changes,
        edited,
        past,
        standing,
        credit,
    )


def _standing(run: Run, generation: int) -> Standing:
    """What commands have changed before the ``generation``."""
    try:
        return Standing.of(run.events(), generation)
    except ValueError as error:
        raise RunError(
            f"{run.path / 'events.jsonl'} tells of a command that is none: {error}",
            "commands as the run carried them out",
            "bring the file back from a copy",
        ) from None


def _record(run: Run, prepared: Prepared, writer: RunWriter, changes: list[str]) -> None:
    """Bring provenance, and the run's own copies of measures, to where it goes on from."""
    noted = {one["map"]: one["file"] for one in run.provenance["maps"]}
    noted |= {one["like"]: one["like_file"] for one in run.provenance["fitness"]}
    noted |= run.provenance.get("locked", {}).get("files", {})
    noted |= {one["name"]: one["file"] for one in run.provenance.get("within", [])}
    for one in noted_of(run.provenance):
        noted |= compared_with(one)

    def hashed(folder: Path, name: str) -> str | None:
        found = hash_now(folder, name)
        return noted.get(name) if found == "missing" else found

    kept = kept_by(prepared.recipe)
    fresh = provenance_of(prepared, run.path, kept, hashed)
    given = {"file": run.provenance["recipe"].get("file")}
    told = {**run.provenance, "recipe": fresh["recipe"] | given}
    before = {one["name"]: one.get("kept") for one in noted_of(run.provenance)}
    if changes or any(before[name] != place for name, place in kept.places.items()):
        writer.keep(kept.files)  # a run of an older release kept none
        told |= {key: fresh[key] for key in ("fitness", "recorded") if key in fresh}
        for one, older in zip(noted_of(told), noted_of(run.provenance), strict=True):
            if maps := compared_with(older):  # under the names they had when the run began
                one["reference"] = {name: hashed(prepared.recipe.folder, name) for name in maps}
    if changes:
        told |= {key: fresh[key] for key in ("maps", "locked", "within") if key in fresh}
    writer.update_provenance(told)


def nobody_lives(path: Path, generation: int) -> RunError:
    """Why no run can go on after a ``generation`` that left nobody to breed from."""
    return RunError(
        f"{path}: nobody lives in generation {generation}",
        "parents to breed from",
        "correct what made all births fail, and start a new run with the recipe",
    )


def _recipe(run: Run, generations: int | None, copies: Mapping[str, str]) -> Recipe:
    """The run's recipe; its own measures are executed."""
    overrides = dict(run.provenance["recipe"]["overrides"])
    if generations is not None:
        overrides["run.generations"] = generations
    mixture = run.provenance["recipe"].get("operators", _BEFORE_QUARTERS)
    older = {"operators": mixture} | ({} if run.header.block is None else _BEFORE_LEAVES)
    selected = run.provenance["recipe"].get("search", _BEFORE_ALGORITHMS)
    older |= {f"search.{key}": value for key, value in selected.items()}
    name = f"{run.path}/recipe.toml"
    return recipe_of(run.recipe_text, folder_of(run), overrides, name, copies, older)


def _refuse_another_run(run: Run, recipe: Recipe) -> None:
    """Raise `RunError` for what one run cannot have changed."""
    header = run.header
    fixed = {
        "run.seed": (header.seed, recipe.run.seed),
        "run.population": (header.population, recipe.run.population),
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
        "fitness": (header.measures, tuple(measure.name for measure in recipe.measures)),
        "run.record": (header.recorded, tuple(measure.name for measure in recipe.recorded)),
    }
    parts = [one["name"] for one in run.provenance.get("within", [])]
    fixed["the parts that are measured"] = parts, part_names(recipe)
    if "references" in run.provenance:
        before = [one["name"] for one in run.provenance["references"]]
        fixed["the reference of measures"] = before, compared_names(recipe)
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


def _algorithm(run: Run) -> str:
    """What the run selects by."""
    return run.provenance["recipe"].get("search", _BEFORE_ALGORITHMS)["algorithm"]


def _notes(run: Run, recipe: Recipe) -> list[str]:
    """Changes that need no confirmation: how many generations, and the versions in use."""
    provenance = run.provenance
    stated = tomllib.loads(run.recipe_text).get("run", {})
    stated = stated.get("generations", RunSection.model_fields["generations"].default)
    before = provenance["recipe"]["overrides"].get("run.generations", stated)
    noted, now = provenance.get("versions", {}), store.environment()["versions"]
    pairs = [("run.generations", before, recipe.run.generations)]
    pairs += [(name, noted.get(name), now[name]) for name in _NOTED_VERSIONS]
    return [f"{key} was {old} and is now {new}" for key, old, new in pairs if old != new]


def _edited(run: Run) -> str:
    """In words, how the recipe's own file differs from the run's copy, by which it goes on; "" if
    it does not, or is not there."""
    name = run.provenance["recipe"].get("file")
    if not isinstance(name, str) or Path(name).name != name:
        return ""
    path = folder_of(run) / name
    try:
        if not path.is_file():
            return ""
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""
    if text == run.recipe_text:
        return ""
    try:
        theirs, own = (_flat(tomllib.loads(one)) for one in (text, run.recipe_text))
    except (ValueError, RecursionError):
        keys = ["it is at fault"]
    else:
        keys = [key for key in own | theirs if own.get(key) != theirs.get(key)]
    if not keys:  # comments alone
        return ""
    more = (
        "more generations: --generations; for the rest" if "run.generations" in keys else "for it"
    )
    return (
        f"{path} differs from the run's own copy, {run.path / 'recipe.toml'}, by which it goes on "
        f"({', '.join(keys)}); {more} start a new run, with --out"
    )


def _flat(recipe: dict) -> dict:
    """``recipe`` with the keys of its tables as "run.seed"; lists of tables stay whole."""
    flat = {}
    for section, value in recipe.items():
        table = value if isinstance(value, dict) else {"": value}
        flat |= {f"{section}.{key}".rstrip("."): one for key, one in table.items()}
    return flat


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
