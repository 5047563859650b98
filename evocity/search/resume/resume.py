"""The resume of a run: its folder reopened, its changes noted, its last generation restored.

All changes are found before any file of the user's own is executed.
"""

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from evocity import store
from evocity.errors import RunError
from evocity.evaluation import Engine
from evocity.recipe.reader import read_recipe
from evocity.recipe.recipe import Recipe
from evocity.recipe.sections import RunSection
from evocity.search.breeding.archipelago import Archipelago
from evocity.search.breeding.credit import Credit, credit_of
from evocity.search.preparation.changes import (
    current_hash,
    noted_files,
    noted_measures,
    recipe_folder,
    reference_hashes,
)
from evocity.search.preparation.preparation import Prepared
from evocity.search.preparation.provenance import collect_own_files, provenance_of
from evocity.search.preparation.startup import Crew, compile_and_start
from evocity.search.preparation.trust import Permission, add_mark
from evocity.search.record.aims import (
    births_without_genomes,
    iterate_generations,
    provenance_read,
)
from evocity.search.record.commands import (
    ASIDE,
    REVISED,
    StandingOrders,
    later_commands,
    lines_read,
)
from evocity.search.record.complete_run import CompleteRun
from evocity.search.resume.prepared_run import read_preparation
from evocity.search.resume.recipe_changes import changed_keys, flatten_keys
from evocity.search.resume.rescore import describe_rescoring, rescore_run
from evocity.search.steering.execution import Births, Steering
from evocity.selection.algorithms import algorithms
from evocity.store import Birth, RunLog, RunWriter
from evocity.store.events import KILLED, was_killed

#: A change of these may change the births; it is noted, not refused.
_NOTED_VERSIONS = ("evocity", "numpy", "numba")
#: The keys of provenance with measures.
_MEASURE_KEYS = ("fitness", "recorded")


@dataclass(frozen=True)
class ResumedRun:
    """A ``run`` ready to go on. ``changes``: what differs from the start, in words;
    ``recipe_note``: how the recipe differs, or ""."""

    prepared: Prepared
    run: RunLog
    writer: RunWriter
    changes: list[str]
    recipe_note: str

    @property
    def next(self) -> int:
        """The generation to be bred."""
        return len(self.run.generations)

    @cached_property
    def living(self) -> dict[str | None, list[Birth]]:
        """The living: island -> births. Raises `RunError` if an island has nobody."""
        living = living_of(self.run, self.next - 1) if self.next else {}
        if not all(living.values()):
            raise no_parents_error(self.run.path, self.next - 1)
        return living

    @cached_property
    def credit(self) -> dict[str | None, Credit]:
        """The credit of operators, by island."""
        aims, islands = self.prepared.aims, self.prepared.recipe.islands
        by_island = {island.name: island.aims_of(aims) for island in islands} or {None: aims}
        events, by = self.run.events(), self.prepared.recipe.search.credit
        return {
            name: credit_of(self.run, aims, events, name, by) for name, aims in by_island.items()
        }

    def steering(self, births: Births) -> Steering:
        """Return the steering that goes on by the commands so far; ``births`` finds genomes."""
        orders, old = orders_of(self.run, self.next), self.writer.count_commands()
        later = later_commands(self.run.events(), self.next)
        return Steering(self.prepared.recipe, births, orders, old, later)

    def restore(self, population: Archipelago) -> None:
        """Restore the new ``population`` and its algorithms to the state of the run."""
        run, search = self.run, self.prepared.recipe.search
        population.begin_with(births_without_genomes(run, 0) if self.next else [])
        if self.next and algorithms()[search.algorithm].replays:
            for number, births in enumerate(iterate_generations(run)):
                population.single.replay_generation(births, number)
        population.restore(self.living)
        for island in population.islands if search.adapt else ():
            island.credit = self.credit[island.name]


def reopen_run(
    path: str | os.PathLike,
    overrides: Mapping[str, object],
    permission: Permission,
    revised: Recipe | str | os.PathLike | None,
    crew: tuple[int | None, str | None],
    tell: Callable[[str], None],
) -> ResumedRun:
    """Reopen the run in ``path``. ``overrides`` replace values of the recipe, ``revised`` the
    recipe; ``crew`` are workers and cluster in place of the recipe's, ``tell`` is called with
    progress. Raises as `Search.resume`."""
    undo_unfinished_revision(path)
    run = CompleteRun(path)
    if revised is not None and not isinstance(revised, Recipe):
        revised = read_recipe(revised)
    prepared, changes = read_preparation(run, overrides, permission, revised)
    recipe = prepared.recipe
    with provenance_read(run):
        notes = _changed_versions(run, recipe)
        recipe_note = "" if revised is not None else _edited_recipe(run)
    writer = RunWriter.reopen(path)
    try:
        whole = run.generations
        if was_killed(run.events()):
            writer.event("stop", generation=len(whole) - 1, reason=KILLED)
        if revised is not None:
            recipe_note = _revise(run, prepared, writer, crew, tell)
            notes.append(recipe_note)
        else:
            writer.drop_rewrites()
            _update_provenance(run, prepared, writer, changes)
        run = CompleteRun(path)  # its births may have other columns now
        _log_revisions(run, writer)
        _log_other_commands(run, writer)
        resumed = ResumedRun(prepared, run, writer, changes + notes, recipe_note)
        orders_of(run, 2**63), resumed.living  # refused before anything starts
    except BaseException:
        writer.close()
        raise
    return resumed


def living_of(run: RunLog, generation: int) -> dict[str | None, list[Birth]]:
    """Read the members of a ``generation``: island -> births, best first."""
    rows = run.members(generation).to_pylist()
    births = {birth.id: birth for birth in run.individuals(list({row["id"] for row in rows}))}
    return {
        name: [births[row["id"]] for row in rows if row.get("island") == name]
        for name in run.header.islands or [None]
    }


def orders_of(run: RunLog, generation: int) -> StandingOrders:
    """Read the orders of commands in force before the ``generation``. Raises `RunError` if the log
    has a damaged one."""
    try:
        return StandingOrders.of(run.events(), generation)
    except ValueError as error:
        raise RunError(
            f"{run.path / 'events.jsonl'} contains a damaged command: {error}",
            "commands as the run wrote them",
            "restore the file from a backup",
        ) from None


def _update_provenance(
    run: RunLog, prepared: Prepared, writer: RunWriter, changes: list[str]
) -> None:
    """Bring provenance, and the run's copies of measures, up to date."""
    noted = {name: before for name, before, _ in noted_files(run.provenance)}
    for one in noted_measures(run.provenance):
        noted |= reference_hashes(one)

    def hashed(folder: Path, name: str) -> str | None:
        now = current_hash(folder, name)
        return noted.get(name) if now == "missing" else now

    own = collect_own_files(prepared.recipe)
    fresh = provenance_of(prepared, run.path, own, hashed)
    given = {key: run.provenance["recipe"].get(key) for key in ("file", "before")}
    given = {key: value for key, value in given.items() if key == "file" or value is not None}
    provenance = {**run.provenance, "recipe": fresh["recipe"] | given}
    before = {one["name"]: one.get("kept") for one in noted_measures(run.provenance)}
    if changes or any(before[name] != place for name, place in own.places.items()):
        writer.keep(own.files)  # a run of an older release kept none
        provenance |= {key: fresh[key] for key in _MEASURE_KEYS if key in fresh}
        pairs = zip(noted_measures(provenance), noted_measures(run.provenance), strict=True)
        for one, older in pairs:
            if maps := reference_hashes(older):  # under the names they had when the run began
                one["reference"] = {name: hashed(prepared.recipe.folder, name) for name in maps}
    if changes:
        provenance |= {key: fresh[key] for key in ("maps", "locked", "within") if key in fresh}
    writer.update_provenance(add_mark(provenance, run.recipe_text, run.path))


def _revise(
    run: RunLog,
    prepared: Prepared,
    writer: RunWriter,
    crew: tuple[int | None, str | None],
    tell: Callable[[str], None],
) -> str:
    """Replace the recipe of the ``run``, and describe what changed. Provenance is written last: it
    decides which recipe and which log count."""
    recipe, before = prepared.recipe, run.provenance["recipe"]
    keys = changed_keys(run.recipe_text, recipe.text)
    earlier = before.get("before", [])
    name = f"recipe-{len(earlier) + 1}.toml"
    own = collect_own_files(recipe)
    fresh = provenance_of(prepared, run.path, own, current_hash)
    note = {key: before.get(key) for key in ("hash", "overrides", "operators", "search")}
    note |= {"file": name, "generations": len(run.generations)}
    writer.drop_rewrites(prepared.header.recipe_hash)
    scored = ""
    if prepared.header != run.header:

        def start(scoring: Prepared) -> Engine:
            retried = lambda text: writer.event("retry", reason=text)  # noqa: E731
            return compile_and_start(scoring, Crew.choose(recipe, *crew), tell, retried)

        about = {key: fresh[key] for key in (*_MEASURE_KEYS, "versions") if key in fresh}
        note["measures"] = {k: run.provenance[k] for k in _MEASURE_KEYS if k in run.provenance}
        note["scored"] = rescore_run(run, prepared, writer, about, start, tell)
        scored = describe_rescoring(note["scored"])
    provenance = {key: value for key, value in run.provenance.items() if key not in _MEASURE_KEYS}
    provenance |= {key: fresh[key] for key in _MEASURE_KEYS if key in fresh}
    provenance |= {"recipe": fresh["recipe"] | {"before": [*earlier, note]}}
    writer.keep(own.files)
    writer.replace_recipe(recipe.text, name)
    writer.update_provenance(add_mark(provenance, recipe.text, run.path), prepared.header)
    changed = f"goes on by another recipe, changed in {', '.join(keys) or 'comments only'}"
    return f"{changed}; {scored}" if scored else changed


def _log_revisions(run: RunLog, writer: RunWriter) -> None:
    """Log each replaced recipe that has no event yet: a kill may have prevented it."""
    logged = [event.get("before") for event in run.events() if event.get("event") == REVISED]
    with provenance_read(run):
        for number, note in enumerate(run.provenance["recipe"].get("before", []), 1):
            if note["file"] in logged:
                continue
            texts = run.earlier_recipe(number), run.earlier_recipe(number + 1) or run.recipe_text
            details = {"before": note["file"], "keys": changed_keys(*texts)}
            details |= {"scored": note["scored"]} if "scored" in note else {}
            writer.event(REVISED, generation=note["generations"], **details)


def _log_other_commands(run: RunLog, writer: RunWriter) -> None:
    """Log that ``commands.jsonl`` is another file if it has fewer lines than were read of it."""
    if writer.count_commands() < (read := lines_read(run.events())):
        writer.event(ASIDE, generation=len(run.generations), read=read, file=None)


def undo_unfinished_revision(path: str | os.PathLike) -> None:
    """Put the recipe of the run in ``path`` back if a kill interrupted its replacement."""
    run = CompleteRun(path)
    noted = run.provenance.get("recipe")
    if not isinstance(noted, dict) or store.hash_of_text(run.recipe_text) == noted.get("hash"):
        return
    text = run.earlier_recipe(len(noted.get("before", ())) + 1)
    if text is not None and store.hash_of_text(text) == noted.get("hash"):
        writer = RunWriter.reopen(path)
        try:
            writer.replace_recipe(text)
        finally:
            writer.close()


def no_parents_error(path: Path, generation: int) -> RunError:
    """Return the error of a run whose last ``generation`` left nobody to breed from."""
    return RunError(
        f"{path}: no individual is alive in generation {generation}",
        "at least one living individual to breed from",
        "correct the measure or operator that made all births fail, and start a new run",
    )


def _changed_versions(run: RunLog, recipe: Recipe) -> list[str]:
    """Changes that need no confirmation: the number of generations, and the versions in use."""
    provenance = run.provenance
    stated = tomllib.loads(run.recipe_text).get("run", {})
    stated = stated.get("generations", RunSection.model_fields["generations"].default)
    before = provenance["recipe"]["overrides"].get("run.generations", stated)
    noted, now = provenance.get("versions", {}), store.environment()["versions"]
    pairs = [("run.generations", before, recipe.run.generations)]
    pairs += [(name, noted.get(name), now[name]) for name in _NOTED_VERSIONS]
    return [f"{key} was {old} and is now {new}" for key, old, new in pairs if old != new]


def _edited_recipe(run: RunLog) -> str:
    """How the recipe's own file differs from the run's copy; "" if only in comments, or if gone."""
    name = run.provenance["recipe"].get("file")
    if not isinstance(name, str) or Path(name).name != name:
        return ""
    path = recipe_folder(run) / name
    try:
        text = path.read_text(encoding="utf-8") if path.is_file() else run.recipe_text
    except (OSError, ValueError):
        return ""
    if text == run.recipe_text:
        return ""
    try:
        theirs, own = (flatten_keys(tomllib.loads(t)) for t in (text, run.recipe_text))
    except (ValueError, RecursionError):
        keys = ["it is not valid TOML"]
    else:
        keys = [key for key in own | theirs if own.get(key) != theirs.get(key)]
    if not keys:
        return ""
    return (
        f"{path} differs from the run's own copy, {run.path / 'recipe.toml'}, by which it goes on "
        f"({', '.join(keys)}); to go on by it: --recipe {path}"
    )
