"""Changes since a run began: its recipe, its maps, the sources of its measures.

The hashes in its provenance reveal them before any file of the user's own is executed.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path

from evocity import fitness, store
from evocity.errors import EvocityError, FitnessError
from evocity.fitness.part import own_name
from evocity.recipe.measures import record_entry
from evocity.recipe.values import PARENTS, resolve_path
from evocity.search.preparation.provenance import file_hash
from evocity.store import RunLog

_OWN_COPY = "the run keeps its own copy"


def recipe_folder(run: RunLog) -> Path:
    """Return the folder where the recipe lies, or lay. Provenance has it relative to the run
    folder; that of older releases has it whole."""
    return (run.path.resolve() / run.provenance["recipe"]["folder"]).resolve()


def changes_of(run: RunLog, copies: Mapping[str, str]) -> list[str]:
    """Describe what differs from the start of a ``run``; nothing is executed. A missing map is not
    a change, nor is a missing measure file of which the run has one of ``copies``."""
    provenance, folder = run.provenance, recipe_folder(run)
    changes = []
    if store.hash_of_text(run.recipe_text) != provenance["recipe"]["hash"]:
        changes.append("the recipe")
    changes += [
        text.format(name=name, own_copy=_OWN_COPY)
        for name, before, text in noted_files(provenance)
        if current_hash(folder, name) not in (before, "missing")
    ]
    maps, kept = {one["map"] for one in provenance["maps"]}, "references" in provenance
    noted = noted_measures(provenance)
    for one in noted:
        for name, before in reference_hashes(one).items():
            now = current_hash(folder, name)
            if name not in maps and now != before and not (kept and now == "missing"):
                copy = f" ({_OWN_COPY})" if kept else ""
                changes.append(f"the map {name}, which cities are compared with{copy}")
    own = {resolve_path(folder, one["file"]) for one in _recipe_measures(run) if "file" in one}
    for one in noted:
        paths = _source_files(one, folder, own, copies)
        if _source_hash(one, paths) != one["hash"]:
            changes.append(f"the source of the measure {one['name']}{_details(one, paths)}")
    unknown = own - {_named_file(one, folder) for one in noted}
    changes += [f"the measures of {file}" for file in sorted(unknown)]
    return list(dict.fromkeys(changes))


def noted_files(provenance: Mapping) -> list[tuple[str, str | None, str]]:
    """Return the files of a run that are not measures: name, hash, and a text on a change."""
    files = [(one["map"], one["file"], "the map {name} ({own_copy})") for one in provenance["maps"]]
    for one in provenance["maps"]:
        if "terrain" in one:
            files.append((one["terrain"], one["terrain_file"], "the terrain {name} ({own_copy})"))
    for name, before in provenance.get("locked", {}).get("files", {}).items():
        files.append((name, before, "{name}, which says what is locked ({own_copy})"))
    for one in provenance.get("within", []):
        files.append((one["name"], one["file"], "{name}, a part that is measured ({own_copy})"))
    for one in provenance["fitness"]:
        if one.get("like"):
            text = "the map {name}, which cities shall be like"
            files.append((one["like"], one["like_file"], text))
    return files


def reference_hashes(noted: dict) -> dict:
    """Return the maps that a measure compares with, and the hashes of their files, by what
    provenance has ``noted`` of it."""
    maps = noted.get("reference")
    if maps is None or maps == PARENTS:
        return {}
    if not isinstance(maps, dict):
        raise TypeError(f"reference = {maps!r}")
    return maps


def noted_measures(provenance: Mapping) -> list[dict]:
    """Return what ``provenance`` has of each measure: of the goals and constraints, then of those
    recorded."""
    return [*provenance["fitness"], *provenance.get("recorded", [])]


def _recipe_measures(run: RunLog) -> list[dict]:
    """The measures that the recipe names; none if its text is at fault."""
    try:
        recipe = tomllib.loads(run.recipe_text)
        section = recipe.get("run", {})
        recorded = section.get("record", []) if isinstance(section, dict) else []
        listed = [*recipe.get("fitness", []), *map(record_entry, recorded)]
    except (ValueError, RecursionError, TypeError):
        return []
    return [one for one in listed if isinstance(one, dict)]


def current_hash(folder: Path, name: str) -> str | None:
    """Return the hash of a map's file as it is now, as `file_hash`; "missing" without a file."""
    try:
        return file_hash(folder, name)
    except EvocityError:
        return "missing"


def _named_file(noted: dict, folder: Path) -> str | None:
    """The file that one of the user's measures was loaded from; None for others, and where
    provenance names no file here. Older releases kept no copies, and noted whole paths of all."""
    if "kept" in noted or Path(noted["file"]).is_absolute():
        return resolve_path(folder, noted["file"])
    return None


def _source_files(
    noted: dict, folder: Path, own: set[str], copies: Mapping[str, str]
) -> list[Path]:
    """The files that one of the user's measures would be loaded from now, its own file first."""
    named = _named_file(noted, folder)
    if named not in own:
        return []
    path = Path(copies.get(named, named))
    return [path, *(path.parent / name for name in noted.get("beside", ()))]


def _source_hash(noted: dict, paths: list[Path]) -> str:
    try:
        if paths:
            return store.hash_of_file(*paths)
        return fitness.get(own_name(noted["name"])).source_hash
    except (OSError, FitnessError):
        return "missing"


def _details(noted: dict, paths: list[Path]) -> str:
    """Which file of a changed measure is missing, or may have changed besides its own."""
    if _source_hash(noted, paths) == "missing":
        gone = [str(path) for path in paths if not path.is_file()]
        return f", {', '.join(gone or [noted['file']])}, which is missing"
    names = ", ".join(path.name for path in paths[1:])
    return f" ({paths[0].name}, or what it imports: {names})" if names else ""
