"""Taking a run up again: what changed since, and who lived last."""

import os
from dataclasses import dataclass
from pathlib import Path

from evocity import store
from evocity.errors import EvocityError, RunError
from evocity.search.preparation import Prepared, file_hash, objectives_of, provenance_of
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe
from evocity.store import Birth, Run, RunWriter, open_run


@dataclass(frozen=True)
class TakenUp:
    """A run ready to go on at generation ``next``; ``births`` and ``failures`` so far."""

    prepared: Prepared
    writer: RunWriter
    first_births: list[Birth]
    living: list[Birth]
    next: int
    births: int
    failures: int
    changes: list[str]


def take_up(path: str | os.PathLike, generations: int | None, accept_changes: bool) -> TakenUp:
    """Reopen the run in ``path``. Raises `RunError` as `Search.resume` says."""
    run = open_run(path)
    recipe = _recipe(run, generations)
    try:
        changes = _changes(run, recipe)
        if changes and not accept_changes:
            raise RunError(
                f"{run.path}: changed since the run began: {'; '.join(changes)}",
                "the recipe, maps and measures it began with",
                "undo the change, or confirm it with --accept-changes (accept_changes=True): "
                "the living then keep the values they were given",
            )
        targets = None
        if not changes:
            noted = run.provenance["fitness"]
            targets = {one["name"]: one["target"] for one in noted if one["goal"] == "like"}
        objectives = objectives_of(recipe, targets)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise RunError(
            f"{run.path}: provenance.json lacks a part ({error!r})",
            "a provenance as `evocity run` writes it",
            "bring the file back from a copy",
        ) from None
    prepared = Prepared(recipe, run.sources(), objectives, run.header)
    writer = RunWriter.reopen(path)
    try:
        fresh = provenance_of(prepared)
        kept = {**run.provenance, "recipe": fresh["recipe"]}
        if changes:
            kept |= {key: fresh[key] for key in ("maps", "fitness")}
        writer.update_provenance(kept)
        whole = run.generations
        first, living, births, failures = [], [], 0, 0
        if whole:
            first = _values(run, 0)
            living = run.individuals(run.members(whole[-1]).column("id").to_pylist())
            status = run.status()
            births, failures = status["births"], status["failures"]
            if not living:
                raise RunError(
                    f"{run.path}: nobody lives in generation {whole[-1]}",
                    "parents to breed from",
                    "correct what made all births fail, and start a new run",
                )
    except BaseException:
        writer.close()
        raise
    return TakenUp(prepared, writer, first, living, len(whole), births, failures, changes)


def _recipe(run: Run, generations: int | None) -> Recipe:
    try:
        noted = run.provenance["recipe"]
        overrides = dict(noted["overrides"])
        folder = Path(noted["folder"])
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(
            f"{run.path}: provenance.json does not tell the recipe ({error!r})",
            "a provenance as `evocity run` writes it",
            "bring the file back from a copy",
        ) from None
    if generations is not None:
        overrides["run.generations"] = generations
    return recipe_of(run.recipe_text, folder, overrides, name=f"{run.path}/recipe.toml")


def _changes(run: Run, recipe: Recipe) -> list[str]:
    """What differs from the start. Raises `RunError` if one run cannot have it."""
    header, changes = run.header, []
    if store.hash_of_text(recipe.text) != run.provenance["recipe"]["hash"]:
        changes.append("the recipe")
    fixed = {
        "run.seed": (header.seed, recipe.run.seed),
        "run.population": (header.population, recipe.run.population),
        "genome.block": (header.block, recipe.genome.block),
        "genome.sigma_max": (header.sigma_max, recipe.genome.sigma_max),
        "map.metres_per_pixel": (header.metres_per_pixel, recipe.map.metres_per_pixel),
        "map.pixels": (header.width, recipe.map.pixels),
        "parents": (
            [one["map"] for one in run.provenance["maps"]],
            [parent.map for parent in recipe.parents],
        ),
        "fitness": (header.measures, tuple(measure.name for measure in recipe.measures)),
    }
    for key, (before, now) in fixed.items():
        if before != now:
            raise RunError(
                f"{run.path}: {key} was {before} and is now {now}",
                f"{key} as the run began: its births would not be comparable",
                "undo the change, or start a new run with the new recipe",
            )
    for parent, noted in zip(recipe.parents, run.provenance["maps"], strict=True):
        try:
            now = file_hash(recipe, parent.map)
        except EvocityError:
            now = "missing"
        if now != noted["file"]:
            changes.append(f"the map {parent.map} (the run keeps its own copy)")
    noted = {one["name"]: one for one in run.provenance["fitness"]}
    changes += [
        f"the source of the measure {measure.name}"
        for measure in recipe.measures
        if measure.source_hash != noted[measure.name]["hash"]
    ]
    return changes


def _values(run: Run, generation: int) -> list[Birth]:
    """Births of a generation without their genomes: what the hypervolume's unit needs."""
    names = run.header.measures
    columns = ["id", "status", *(f"fitness.{name}" for name in names)]
    return [
        Birth(
            generation,
            row["id"],
            (),
            "",
            row["status"],
            None,
            0.0,
            {name: row[f"fitness.{name}"] for name in names},
            None,
        )
        for row in run.births(generation, columns).to_pylist()
    ]
