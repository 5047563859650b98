"""What changed since a run began: its recipe, its maps, the sources of its measures.

Found out by the hashes in its provenance, before any file of the user's own is executed.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path

from evocity import fitness, store
from evocity.errors import EvocityError, FitnessError
from evocity.fitness.part import own_name
from evocity.search.noting import file_hash
from evocity.search.values import PARENTS, resolved
from evocity.search.wanted import recorded_of
from evocity.store import Run


def folder_of(run: Run) -> Path:
    """Where the recipe lies, or lay: noted as seen from the run folder, of old as it was."""
    return (run.path.resolve() / run.provenance["recipe"]["folder"]).resolve()


def changes_of(run: Run, copies: Mapping[str, str]) -> list[str]:
    """What differs from the start, by the hashes in the provenance; nothing is executed.

    A map that is not there any more is no change, for the run has its own copy, or what was
    measured of it; nor is a measure's file of which the run has one of ``copies``.
    """
    provenance, folder = run.provenance, folder_of(run)
    changes = []
    if store.hash_of_text(run.recipe_text) != provenance["recipe"]["hash"]:
        changes.append("the recipe")
    for one in provenance["maps"]:
        if hash_now(folder, one["map"]) not in (one["file"], "missing"):
            changes.append(f"the map {one['map']} (the run keeps its own copy)")
    for name, before in provenance.get("locked", {}).get("files", {}).items():
        if hash_now(folder, name) not in (before, "missing"):
            changes.append(f"{name}, which tells what is locked (the run keeps its own copy)")
    for one in provenance.get("within", []):
        if hash_now(folder, one["name"]) not in (one["file"], "missing"):
            changes.append(f"{one['name']}, a part that is measured (the run keeps its own copy)")
    likes = {one["like"]: one["like_file"] for one in provenance["fitness"] if one.get("like")}
    changes += [
        f"the map {like}, which cities shall be like"
        for like, before in likes.items()
        if hash_now(folder, like) not in (before, "missing")
    ]
    told, kept = {one["map"] for one in provenance["maps"]}, "references" in provenance
    noted = noted_of(provenance)
    for one in noted:
        for name, before in compared_with(one).items():
            there = hash_now(folder, name)
            if name not in told and there != before and not (kept and there == "missing"):
                copy = " (the run keeps its own copy)" if kept else ""
                changes.append(f"the map {name}, which cities are compared with{copy}")
    own = {resolved(folder, one["file"]) for one in _entries(run) if "file" in one}
    for one in noted:
        paths = _sources_of(one, folder, own, copies)
        if _source_hash(one, paths) != one["hash"]:
            changes.append(f"the source of the measure {one['name']}{_which(one, paths)}")
    strange = own - {_named_file(one, folder) for one in noted}
    changes += [f"the measures of {file}" for file in sorted(strange)]
    return list(dict.fromkeys(changes))


def compared_with(noted: dict) -> dict:
    """The maps that a measure compares with, and the hashes of their files."""
    maps = noted.get("reference")
    if maps is None or maps == PARENTS:
        return {}
    if not isinstance(maps, dict):
        raise TypeError(f"reference = {maps!r}")
    return maps


def noted_of(provenance: Mapping) -> list[dict]:
    """What ``provenance`` tells of each measure: of those wanted, then of those recorded."""
    return [*provenance["fitness"], *provenance.get("recorded", [])]


def _entries(run: Run) -> list[dict]:
    """The measures of the recipe as it names them, in [[fitness]] and ``run.record``; none if its
    text is at fault, which reading it tells."""
    try:
        recipe = tomllib.loads(run.recipe_text)
        section = recipe.get("run", {})
        recorded = section.get("record", []) if isinstance(section, dict) else []
        listed = [*recipe.get("fitness", []), *map(recorded_of, recorded)]
    except (ValueError, RecursionError, TypeError):
        return []
    return [one for one in listed if isinstance(one, dict)]


def hash_now(folder: Path, name: str) -> str | None:
    try:
        return file_hash(folder, name)
    except EvocityError:
        return "missing"


def _named_file(noted: dict, folder: Path) -> str | None:
    """The file that a measure of the user's own was loaded from; None for others, and what is noted
    of them names no file here. Runs of old, which kept no copies, noted whole paths of all."""
    if "kept" in noted or Path(noted["file"]).is_absolute():
        return resolved(folder, noted["file"])
    return None


def _sources_of(noted: dict, folder: Path, own: set[str], copies: Mapping[str, str]) -> list[Path]:
    """The files that a measure of the user's own would be loaded from now, first the one that
    declares it; none for those that the recipe does not load from a file."""
    named = _named_file(noted, folder)
    if named not in own:
        return []
    path = Path(copies.get(named, named))
    return [path, *(path.parent / name for name in noted.get("beside", ()))]


def _source_hash(noted: dict, paths: list[Path]) -> str:
    """Hash of a measure's source now."""
    try:
        if paths:
            return store.hash_of_file(*paths)
        return fitness.get(own_name(noted["name"])).source_hash
    except (OSError, FitnessError):
        return "missing"


def _which(noted: dict, paths: list[Path]) -> str:
    """What of a measure's source that changed is missing, or may have changed besides its file."""
    if _source_hash(noted, paths) == "missing":
        gone = [str(path) for path in paths if not path.is_file()]
        return f", {', '.join(gone or [noted['file']])}, which is missing"
    names = ", ".join(path.name for path in paths[1:])
    return f" ({paths[0].name}, or what it imports: {names})" if names else ""


__all__ = ["changes_of", "compared_with", "folder_of", "hash_now", "noted_of"]
