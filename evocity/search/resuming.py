"""Taking a run up again: what changed since, and who lived last.

What changed is found out before any file of the user's own is executed.
"""

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

from evocity import fitness, store
from evocity.errors import EvocityError, FitnessError, RunError
from evocity.search.preparation import Prepared, aims_of, file_hash, provenance_of
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe, RunSection
from evocity.search.values import resolved
from evocity.store import Birth, Run, RunWriter, Source, open_run

#: A change of these may change the births; it is noted, not refused.
_NOTED_VERSIONS = ("evocity", "numpy", "numba")


@dataclass(frozen=True)
class TakenUp:
    """A run ready to go on at generation ``next``; ``births`` and ``failures`` so far.

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


def take_up(path: str | os.PathLike, generations: int | None, accept_changes: bool) -> TakenUp:
    """Reopen the run in ``path``. Raises `RunError` as `Search.resume` says."""
    run = open_run(path)
    try:
        changes = _changes(run)
        if changes and not accept_changes:
            raise RunError(
                f"{run.path}: changed since the run began: {'; '.join(changes)}",
                "the recipe, maps and measures it began with",
                "undo the change, or confirm it with --accept-changes (accept_changes=True): "
                "the living then keep the values they were given",
            )
        recipe = _recipe(run, generations)
        _refuse_another_run(run, recipe)
        notes = _notes(run, recipe)
        targets = None
        if not changes:
            noted = run.provenance["fitness"]
            targets = {one["name"]: one["target"] for one in noted if one["goal"] == "like"}
        aims = aims_of(recipe, targets)
        sources = _sources(run, recipe)
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise RunError(
            f"{run.path}: provenance.json lacks a part ({error!r})",
            "a provenance as `evocity run` writes it",
            "bring the file back from a copy",
        ) from None
    prepared = Prepared(recipe, sources, aims, run.header, run.condensation)
    edited = _edited(run)
    writer = RunWriter.reopen(path)
    try:
        fresh = provenance_of(prepared)
        given = {"file": run.provenance["recipe"].get("file")}
        kept = {**run.provenance, "recipe": fresh["recipe"] | given}
        if changes:
            kept |= {key: fresh[key] for key in ("maps", "fitness", "locked") if key in fresh}
        writer.update_provenance(kept)
        whole = run.generations
        first, living, births, failures = [], [], 0, 0
        if whole:
            first = _values(run, 0)
            living = run.individuals(run.members(whole[-1]).column("id").to_pylist())
            status = run.status()
            births, failures = status["births"], status["failures"]
            if not living:
                raise nobody_lives(run.path, whole[-1])
    except BaseException:
        writer.close()
        raise
    return TakenUp(
        prepared, writer, first, living, len(whole), births, failures, changes + notes, edited
    )


def nobody_lives(path: Path, generation: int) -> RunError:
    """Why no run can go on after a ``generation`` that left nobody to breed from."""
    return RunError(
        f"{path}: nobody lives in generation {generation}",
        "parents to breed from",
        "correct what made all births fail, and start a new run with the recipe",
    )


def _recipe(run: Run, generations: int | None) -> Recipe:
    """The run's recipe; its own measures are executed."""
    overrides = dict(run.provenance["recipe"]["overrides"])
    if generations is not None:
        overrides["run.generations"] = generations
    return recipe_of(run.recipe_text, _folder(run), overrides, name=f"{run.path}/recipe.toml")


def _folder(run: Run) -> Path:
    return Path(run.provenance["recipe"]["folder"])


def _changes(run: Run) -> list[str]:
    """What differs from the start, by the hashes in the provenance; nothing is executed."""
    provenance, folder = run.provenance, _folder(run)
    changes = []
    if store.hash_of_text(run.recipe_text) != provenance["recipe"]["hash"]:
        changes.append("the recipe")
    for one in provenance["maps"]:
        if _file_hash(folder, one["map"]) != one["file"]:
            changes.append(f"the map {one['map']} (the run keeps its own copy)")
    for name, before in provenance.get("locked", {}).get("files", {}).items():
        if _file_hash(folder, name) != before:
            changes.append(f"{name}, which tells what is locked (the run keeps its own copy)")
    likes = {one["like"]: one["like_file"] for one in provenance["fitness"] if one.get("like")}
    changes += [
        f"the map {like}, which cities shall be like"
        for like, before in likes.items()
        if _file_hash(folder, like) != before
    ]
    own = {resolved(folder, one["file"]) for one in _entries(run) if "file" in one}
    changes += [
        f"the source of the measure {one['name']}{_which(one, own)}"
        for one in provenance["fitness"]
        if _source_hash(one, own) != one["hash"]
    ]
    strange = own - {one["file"] for one in provenance["fitness"]}
    changes += [f"the measures of {file}" for file in sorted(strange)]
    return list(dict.fromkeys(changes))


def _entries(run: Run) -> list[dict]:
    """The ``[[fitness]]`` of the recipe; none if its text is at fault, which reading it tells."""
    try:
        listed = tomllib.loads(run.recipe_text).get("fitness")
    except (ValueError, RecursionError):
        return []
    return [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []


def _file_hash(folder: Path, name: str) -> str | None:
    try:
        return file_hash(folder, name)
    except EvocityError:
        return "missing"


def _source_hash(noted: dict, own: set[str]) -> str:
    """Hash of a measure's source now; ``own`` are the files that the recipe loads."""
    try:
        if noted["file"] in own:
            return store.hash_of_file(noted["file"], *noted.get("beside", ()))
        return fitness.get(noted["name"]).source_hash
    except (OSError, FitnessError):
        return "missing"


def _which(noted: dict, own: set[str]) -> str:
    """What of a measure's source that changed is missing, or may have changed besides its file."""
    beside = noted.get("beside", [])
    if _source_hash(noted, own) == "missing":
        gone = [file for file in (noted["file"], *beside) if not Path(file).is_file()]
        return f", {', '.join(gone or [noted['file']])}, which is missing"
    names = ", ".join(Path(file).name for file in beside)
    return f" ({Path(noted['file']).name}, or what it imports: {names})" if beside else ""


def _refuse_another_run(run: Run, recipe: Recipe) -> None:
    """Raise `RunError` for what one run cannot have changed."""
    header = run.header
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
        "locked": (run.provenance.get("locked", {}).get("asked", {}), recipe.locked.asked),
        "fitness": (header.measures, tuple(measure.name for measure in recipe.measures)),
    }
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
    path = _folder(run) / name
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
