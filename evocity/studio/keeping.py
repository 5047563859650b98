"""Children that are kept: their genomes, and a recipe that goes on from them, in a new folder."""

import contextlib
import itertools
import os
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import tomli_w
from pydantic import Field

from evocity.errors import EvocityError, FitnessError, RunError
from evocity.files import whole_file
from evocity.fitness import Part
from evocity.fitness.part import part_of
from evocity.search.changes import folder_of
from evocity.search.reading import read_recipe
from evocity.search.recipe import Recipe
from evocity.search.trust import is_ours, state_folder
from evocity.search.wanted import MeasureEntry
from evocity.store import Run
from evocity.studio.asked import Body
from evocity.studio.breeding import MOST_CHILDREN, Breeding, Child
from evocity.studio.picks import Id

_MOST_FOLDERS = 10_000
#: Sections of a recipe of another's that may have a command or a machine run something.
_EXECUTING = ("notify", "evaluation")


class Keep(Body):
    """What is kept: ``children`` of a ``brood``, one of the ``board`` or another, and, for the
    recipe, ``picks`` of the run."""

    brood: Annotated[int, Field(ge=1, lt=2**31)]
    children: Annotated[tuple[Id, ...], Field(min_length=1, max_length=MOST_CHILDREN)]
    picks: Annotated[tuple[Id, ...], Field(max_length=16)] = ()
    board: bool = False


def keep(run: Run, breeding: Breeding, asked: Keep, is_own: bool) -> dict:
    """Write the genomes of children, and ``recipe.toml`` whose parents they and the picks are; into
    a new folder beside the ``run``, or with the user where the run ``is_own`` not. What it is
    called, and what was left out of the recipe.

    The recipe is that of the run but for its parents and its name. Of a run that was not begun here
    it has evocity's own measures alone, and nothing that would be executed. Raises `RunError` for
    what is no child, and where nothing can be written; then nothing is left.
    """
    kept = [breeding.child(asked.brood, one) for one in dict.fromkeys(asked.children)]
    folder = _made(run, is_own)
    try:
        parents: list[dict] = []
        for child in kept:
            name = f"child-{child.number}"
            _write(child, folder / f"{name}.parquet", run, breeding)
            parents.append({"genome": f"{name}.parquet", "name": name})
        place = os.path.relpath(run.path.resolve(), folder)
        parents += [{"run": place, "id": one} for one in dict.fromkeys(asked.picks)]
        recipe, left = _recipe(run, folder, parents, _locked(breeding, folder))
        path = folder / "recipe.toml"
        _written(recipe, path)
        told = read_recipe(path)  # that it can be run is known before it is told
        if breeding.part is not None:
            name = _free(told)
            np.save(folder / name, breeding.part.mask.astype(np.uint8))
            recipe, others = _within(recipe, told, breeding.part, name)
            left += others
            _written(recipe, path)
            read_recipe(path)
    except (EvocityError, OSError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, EvocityError):
            raise
        raise _unwritten(folder, error) from error
    files = sorted(path.name for path in folder.iterdir())
    return {
        "folder": str(folder),
        "files": files,
        "recipe": str(path),
        "left": left,
        "ours": is_ours(run),
    }


def _made(run: Run, is_own: bool) -> Path:
    name = f"{run.path.resolve().name}-children"
    above = run.path.resolve().parent if is_own else state_folder() / "children"
    try:
        above.mkdir(parents=True, exist_ok=True)
        for number in range(1, _MOST_FOLDERS):
            folder = above / (name if number == 1 else f"{name}-{number}")
            if not os.path.lexists(folder):
                folder.mkdir()
                return folder
    except OSError as error:
        raise _unwritten(above, error) from error
    raise RunError(f"{above} has {_MOST_FOLDERS} folders {name}", "room", "remove some")


def _unwritten(folder: Path, error: OSError) -> RunError:
    return RunError(
        f"{folder} cannot be written: {error.strerror or error}",
        "a folder that this user may write to, with room left",
        "check its owner, and the space left",
    )


def _write(child: Child, path: Path, run: Run, breeding: Breeding) -> None:
    """The genome says from whom it was bred, by which parameters, as which of a brood and by which
    seed: all that it takes to breed it again."""
    told = {
        "run": run.path.resolve().name,
        "parents": list(child.parents),
        "parameters": dict(child.parameters),
        "number": child.number,
        "seed": breeding.brood.seed,
    }
    child.genome.replace(made={**child.genome.made, "studio": told}).write(path)


def _locked(breeding: Breeding, folder: Path) -> dict:
    """The section that locks what a drawing did, its files in the ``folder``; none for none."""
    layer = breeding.locked
    if layer is None:
        return {}
    found = {"mask": "locked.npy", "heights": "locked-heights.npy"}
    np.save(folder / found["mask"], layer.mask.astype(np.uint8))
    np.save(folder / found["heights"], layer.heights)
    return {"locked": found}


# -- the recipe -----------------------------------------------------------------------------------


def _recipe(run: Run, folder: Path, parents: list[dict], locked: Mapping) -> tuple[str, list[str]]:
    """Its text; what of the run's own is left out, in words."""
    raw, left = tomllib.loads(run.recipe_text), []
    before = folder_of(run)
    if not is_ours(run):
        raw, left = _harmless(raw)
    moved = {key: _moved(value, before, folder) for key, value in raw.items() if key != "parents"}
    section = dict(moved.get("run") or {})
    moved |= {"run": section | {"name": folder.name}, **locked}
    head = f"# Goes on from children of {run.path.resolve().name} that were kept in evocity studio."
    text = tomli_w.dumps({**moved, "parents": parents})
    return f"{''.join(filter(str.isprintable, head))}\n\n{text}", left


def _written(recipe: str, path: Path) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(recipe, encoding="utf-8")


def _free(told: Recipe) -> str:
    """A file to mark a part by, after which no measure of a recipe is called yet."""
    taken = {part_of(one.name) for entry in told.entries for one in entry.measures}
    names = (f"marked-{number}" if number > 1 else "marked" for number in itertools.count(1))
    return next(f"{one}.npy" for one in names if one not in taken)


def _within(text: str, told: Recipe, part: Part, name: str) -> tuple[str, list[str]]:
    """The ``text`` of a recipe, ``told`` in it, that has its measures taken within a ``part``, by
    the file ``name``; which are not, in words: what else in a recipe names them, or they cannot be
    taken of it."""
    head, raw = text.partition("\n")[0], tomllib.loads(text)
    named = _names_in({key: value for key, value in raw.items() if key != "fitness"})
    left = []
    for table, entry in zip(raw.get("fitness", []), told.fitness, strict=True):
        if entry.within is not None:
            continue
        reason = _untaken(entry, named, part)
        if reason is None:
            table["within"] = name
        else:
            left.append(f"the marked part for {_called(entry)}: {reason}")
    return f"{head}\n\n{tomli_w.dumps(raw)}", left


def _called(entry: MeasureEntry) -> str:
    return ", ".join(one.name for one in entry.measures)


def _untaken(entry: MeasureEntry, named: set[str], part: Part) -> str | None:
    """Why measures are not taken of a ``part``; None where they are. ``named``: what other sections
    name, by names that measures of a part have not."""
    if named.intersection(one.name for one in entry.measures):
        return "another section of the recipe names it"
    try:
        for one in entry.measures:
            part.check(one)
    except FitnessError as error:
        return error.found
    return None


def _names_in(value: object) -> set[str]:
    """All texts in a ``value``, keys and values."""
    if isinstance(value, Mapping):
        return set(value) | set().union(*map(_names_in, value.values()))
    if isinstance(value, list):
        return set().union(*map(_names_in, value))
    return {value} if isinstance(value, str) else set()


def _harmless(raw: Mapping) -> tuple[dict, list[str]]:
    """A recipe without what it would execute, and without files of another machine."""
    kept = {key: value for key, value in raw.items() if key not in _EXECUTING}
    left = [f"[{key}]" for key in _EXECUTING if key in raw]
    for key in ("locked", "within"):
        if kept.pop(key, None) is not None:
            left.append(f"[{key}]")
    wanted = [one for one in kept.get("fitness", []) if isinstance(one, Mapping)]
    plain = [one for one in wanted if not {"file", "like", "reference", "within"} & set(one)]
    left += [str(one.get("name") or one.get("file")) for one in wanted if one not in plain]
    kept["fitness"] = plain
    section = dict(kept.get("run") or {})
    if section.pop("record", None) is not None:
        left.append("record")
    kept["run"] = section
    for name, entry in dict(kept.get("operators") or {}).items():
        if isinstance(entry, Mapping) and "within" in entry:
            del kept["operators"][name]
            left.append(name)
    return kept, left


def _moved(value: object, before: Path, folder: Path):
    """``value`` with paths of files from the folder ``before`` as they are from ``folder``."""
    if isinstance(value, Mapping):
        return {key: _moved(one, before, folder) for key, one in value.items()}
    if isinstance(value, list):
        return [_moved(one, before, folder) for one in value]
    if isinstance(value, str) and _is_file(value, before):
        return os.path.relpath(before / value, folder)
    return value


def _is_file(value: str, before: Path) -> bool:
    """Whether a text names a file there: one with a suffix, as all have that recipes name."""
    with contextlib.suppress(OSError, ValueError):
        return bool(Path(value).suffix) and (before / value).is_file()
    return False


__all__ = ["Keep", "keep"]
