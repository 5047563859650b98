"""Taking a run up again: what changed since, and who lived last.

What changed is found out before any file of the user's own is executed.
"""

import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evocity import store
from evocity.errors import RunError
from evocity.search.algorithms import algorithms
from evocity.search.archipelago import Archipelago
from evocity.search.beginning import engine_of
from evocity.search.changes import compared_with, folder_of, hash_now, noted_of
from evocity.search.commands import REVISED, Standing
from evocity.search.credit import Credit, credit_of
from evocity.search.evaluation import Engine
from evocity.search.judging import births_without_genomes, every_generation
from evocity.search.keeping import kept_by
from evocity.search.noting import provenance_of
from evocity.search.opening import open_run
from evocity.search.preparation import Prepared
from evocity.search.reading import read_recipe
from evocity.search.recipe import Recipe
from evocity.search.rereading import lacking, read_again
from evocity.search.rescoring import in_words, write_anew
from evocity.search.revising import changed_keys, flat
from evocity.search.sections import RunSection
from evocity.search.trust import marked
from evocity.store import Birth, Run, RunWriter
from evocity.store.events import UNTOLD, ended_untold

#: A change of these may change the births; it is noted, not refused.
_NOTED_VERSIONS = ("evocity", "numpy", "numba")
#: What provenance tells of measures.
_MEASURED = ("fitness", "recorded")


@dataclass(frozen=True)
class TakenUp:
    """A run ready to go on at generation ``next``; ``births`` and ``failures`` so far;
    ``again``: the run, if the algorithm must go through all its births again; ``living``: by the
    island; ``standing``: what commands have changed; ``credit``: what operators have earned on each
    island, if the recipe adapts to it.

    ``changes``: in words, what differs from the start; ``edited``: how the recipe's
    own file differs from the run's copy, or "".
    """

    prepared: Prepared
    writer: RunWriter
    first_births: list[Birth]
    living: Mapping[str | None, Sequence[Birth]]
    next: int
    births: int
    failures: int
    changes: list[str]
    edited: str
    again: Run | None
    standing: Standing
    credit: Mapping[str | None, Credit]

    def restore(self, population: Archipelago) -> None:
        """Make the new ``population`` what it was; its algorithms too."""
        population.begin_with(self.first_births)
        past = () if self.again is None else every_generation(self.again)
        for number, births in enumerate(past):
            population.relive(births, number)
        population.restore(self.living)
        for island in population.islands:
            island.credit = self.credit.get(island.name, island.credit)


def take_up(
    path: str | os.PathLike,
    asked: Mapping[str, object],
    accept_changes: bool,
    trust: bool = False,
    revised: Recipe | str | os.PathLike | None = None,
    crew: tuple[int | None, str | None] = (None, None),
    tell: Callable[[str], None] = lambda text: None,
) -> TakenUp:
    """Reopen the run in ``path``; ``asked``: what replaces the recipe's values, None where nothing
    does; ``revised``: another recipe to go on by; ``crew``: workers and cluster, if not the
    recipe's, that score old births by its new measures; ``tell`` is told how far that is. Raises
    `RunError` as `Search.resume` says."""
    undo_unfinished(path)
    run = open_run(path)
    if revised is not None and not isinstance(revised, Recipe):
        revised = read_recipe(revised)
    prepared, changes = read_again(run, asked, accept_changes, trust, revised)
    recipe = prepared.recipe
    try:
        notes, edited = _notes(run, recipe), "" if revised is not None else _edited(run)
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise lacking(run, error) from None
    writer = RunWriter.reopen(path)
    try:
        whole = run.generations
        if ended_untold(run.events()):
            writer.event("stop", generation=len(whole) - 1, reason=UNTOLD)
        if revised is not None:
            edited = _revise(run, prepared, writer, crew, tell)
            notes.append(edited)
        else:
            writer.drop_anew()
            _record(run, prepared, writer, changes)
        run = open_run(path)  # its births may have other columns now
        _tell_of_revisions(run, writer)
        first, living, births, failures = [], {}, 0, 0
        standing = standing_of(run, len(whole))
        again = run if whole and algorithms()[recipe.search.algorithm].replays else None
        credit = _credit(run, prepared) if recipe.search.adapt else {}
        if whole:
            first = births_without_genomes(run, 0)
            living = living_of(run, whole[-1])
            status = run.status()
            births, failures = status["births"], status["failures"]
            if not all(living.values()):
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
        again,
        standing,
        credit,
    )


def living_of(run: Run, generation: int) -> dict[str | None, list[Birth]]:
    """Who lived in a ``generation``, by the island, best first."""
    rows = run.members(generation).to_pylist()
    births = {one.id: one for one in run.individuals(list({row["id"] for row in rows}))}
    return {
        name: [births[row["id"]] for row in rows if row.get("island") == name]
        for name in run.header.islands or [None]
    }


def standing_of(run: Run, generation: int) -> Standing:
    """What commands have changed before the ``generation``. Raises `RunError` if the log tells of
    one that is none."""
    try:
        return Standing.of(run.events(), generation)
    except ValueError as error:
        raise RunError(
            f"{run.path / 'events.jsonl'} tells of a command that is none: {error}",
            "commands as the run carried them out",
            "bring the file back from a copy",
        ) from None


def _credit(run: Run, prepared: Prepared) -> dict[str | None, Credit]:
    """What operators have earned on each island."""
    events, islands = run.events(), prepared.recipe.islands
    own = {one.name: one.aims_of(prepared.aims) for one in islands} or {None: prepared.aims}
    return {name: credit_of(run, aims, events, name) for name, aims in own.items()}


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
    given = {key: run.provenance["recipe"].get(key) for key in ("file", "before")}
    given = {key: value for key, value in given.items() if key == "file" or value is not None}
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
    writer.update_provenance(marked(told, run.recipe_text, run.path))


def _revise(
    run: Run,
    prepared: Prepared,
    writer: RunWriter,
    crew: tuple[int | None, str | None],
    tell: Callable[[str], None],
) -> str:
    """Have the ``run`` go on by another recipe: its own goes to recipe-1.toml, the next to
    recipe-2.toml, …; provenance, which is written last, tells of both, and decides which log counts
    where measures are others. Returns in words what changed."""
    recipe, before = prepared.recipe, run.provenance["recipe"]
    keys = changed_keys(run.recipe_text, recipe.text)
    earlier = before.get("before", [])
    name = f"recipe-{len(earlier) + 1}.toml"
    kept = kept_by(recipe)
    fresh = provenance_of(prepared, run.path, kept, hash_now)
    note = {key: before.get(key) for key in ("hash", "overrides", "operators", "search")}
    note |= {"file": name, "generations": len(run.generations)}
    writer.drop_anew(prepared.header.recipe_hash)
    scored = ""
    if prepared.header != run.header:

        def engine(asked: Prepared) -> Engine:
            return engine_of(asked, *crew, tell, lambda text: writer.event("retry", reason=text))

        about = {key: fresh[key] for key in (*_MEASURED, "versions") if key in fresh}
        note["measures"] = {k: run.provenance[k] for k in _MEASURED if k in run.provenance}
        note["scored"] = write_anew(run, prepared, writer, about, engine, tell)
        scored = in_words(note["scored"])
    told = {key: value for key, value in run.provenance.items() if key not in _MEASURED}
    told |= {key: fresh[key] for key in _MEASURED if key in fresh}
    told |= {"recipe": fresh["recipe"] | {"before": [*earlier, note]}}
    writer.keep(kept.files)
    writer.replace_recipe(recipe.text, name)
    writer.update_provenance(marked(told, recipe.text, run.path), prepared.header)
    changed = f"goes on by another recipe, changed in {', '.join(keys) or 'comments alone'}"
    return f"{changed}; {scored}" if scored else changed


def _tell_of_revisions(run: Run, writer: RunWriter) -> None:
    """Have the log tell of each recipe that took another's place; a kill may have come between that
    and the event."""
    told = [one.get("before") for one in run.events() if one.get("event") == REVISED]
    try:
        for number, note in enumerate(run.provenance["recipe"].get("before", []), 1):
            if note["file"] in told:
                continue
            texts = run.earlier_recipe(number), run.earlier_recipe(number + 1) or run.recipe_text
            details = {"before": note["file"], "keys": changed_keys(*texts)}
            details |= {"scored": note["scored"]} if "scored" in note else {}
            writer.event(REVISED, generation=note["generations"], **details)
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise lacking(run, error) from None


def undo_unfinished(path: str | os.PathLike) -> None:
    """Put the recipe of the run in ``path`` back, if it was being replaced when the process was
    killed."""
    run = open_run(path)
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


def nobody_lives(path: Path, generation: int) -> RunError:
    """Why no run can go on after a ``generation`` that left nobody to breed from."""
    return RunError(
        f"{path}: nobody lives in generation {generation}",
        "parents to breed from",
        "correct what made all births fail, and start a new run with the recipe",
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
        theirs, own = (flat(tomllib.loads(one)) for one in (text, run.recipe_text))
    except (ValueError, RecursionError):
        keys = ["it is at fault"]
    else:
        keys = [key for key in own | theirs if own.get(key) != theirs.get(key)]
    if not keys:  # comments alone
        return ""
    return (
        f"{path} differs from the run's own copy, {run.path / 'recipe.toml'}, by which it goes on "
        f"({', '.join(keys)}); to go on by it: --recipe {path}"
    )
