"""Which files of the user's own a run keeps, and which of them a moved run is taken up with."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from evocity import store
from evocity.errors import RunError
from evocity.fitness import Measure
from evocity.search.recipe import Recipe
from evocity.search.values import resolved
from evocity.store.own import OWN, own_file


@dataclass(frozen=True)
class Kept:
    """``files``: place in the run folder -> content, of the files of measures that a recipe names
    and of what they import from beside; ``places``: measure -> place of its file."""

    files: Mapping[str, bytes] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)


def kept_by(recipe: Recipe) -> Kept:
    """What a run by ``recipe`` keeps: ``fitness/<name>``; of a second folder that measures come
    from ``fitness/from-2/<name>``, and so on.

    Raises `RunError` if a file is not any more what was executed.
    """
    files: dict[str, bytes] = {}
    places: dict[str, str] = {}
    folders: list[Path] = []
    for entry in recipe.entries:
        if entry.file is None:
            continue
        named = Path(resolved(recipe.folder, entry.file))
        if named.parent not in folders:
            folders.append(named.parent)
        number = folders.index(named.parent) + 1
        room = PurePosixPath(OWN) if number == 1 else PurePosixPath(OWN, f"from-{number}")
        for measure in entry.measures:
            paths = [measure.file, *measure.beside]
            try:
                unchanged = store.hash_of_file(*paths) == measure.source_hash
            except OSError:
                unchanged = False
            if not unchanged:
                raise RunError(
                    f"{measure.file} has changed since it was executed",
                    "files of measures that stay as they are while a run begins",
                    "start again",
                )
            names = [named.name, *beside_of(measure)]
            files |= {
                str(room / name): Path(path).read_bytes()
                for name, path in zip(names, paths, strict=True)
            }
            places[measure.name] = str(room / named.name)
    return Kept(files, places)


def beside_of(measure: Measure) -> list[str]:
    """What a measure's file imports, relative to its folder."""
    folder = Path(measure.file).parent
    return [Path(one).relative_to(folder).as_posix() for one in measure.beside]


def replaced(root: Path, folder: Path, noted: list[dict]) -> dict[str, str]:
    """Files of measures that are not where the recipe in ``folder`` has them -> the copies in the
    run folder ``root``, as far as there are; by what provenance has ``noted`` of the measures.

    Raises `RunError` for copies that are links, or lie outside.
    """
    found = {}
    for one in noted:
        original = resolved(folder, one["file"])
        if "kept" in one and not os.path.isfile(original):
            try:
                found[original] = str(own_file(root, one["kept"]).resolve())
            except FileNotFoundError:
                continue
    return found


def relative(folder: Path, out: str | os.PathLike) -> str:
    """``folder`` as seen from the run folder ``out``; as it is where no way leads there."""
    try:
        return Path(os.path.relpath(folder, Path(out).resolve())).as_posix()
    except ValueError:  # on another drive
        return str(folder)
