"""Kept children: a new folder with their genomes and a recipe that goes on from them."""

import contextlib
import itertools
import os
import shutil
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import tomli_w
from pydantic import Field

from evocity.analysis import Run
from evocity.condensation import Condensation
from evocity.errors import EvocityError, FitnessError
from evocity.fitness import Part
from evocity.fitness.part import part_name
from evocity.recipe.measures import MeasureEntry
from evocity.recipe.recipe import Recipe
from evocity.search.preparation.changes import recipe_folder
from evocity.search.preparation.trust import is_trusted, state_folder
from evocity.store import RunLog
from evocity.studio.children import MOST_CHILDREN, Breeding, Child
from evocity.studio.output_files import free_path, make_folder, write_error, write_recipe
from evocity.studio.request_fields import Body, Id

# Sections of a stranger's recipe that could execute something.
_EXECUTING = ("notify", "evaluation")


class KeepRequest(Body):
    """A request to keep ``children`` of a ``brood``; the ``picks`` join the recipe as parents."""

    brood: Annotated[int, Field(ge=1, lt=2**31)]
    children: Annotated[tuple[Id, ...], Field(min_length=1, max_length=MOST_CHILDREN)]
    picks: Annotated[tuple[Id, ...], Field(max_length=16)] = ()
    board: bool = False


def keep_children(run: Run, breeding: Breeding, request: KeepRequest, is_own: bool) -> dict:
    """Write children of a brood as `write_children` does."""
    kept = [breeding.child(request.brood, number) for number in dict.fromkeys(request.children)]
    seed, locked, part = breeding.brood.seed, breeding.locked, breeding.part
    return write_children(run, kept, request.picks, is_own, seed, locked, part)


def write_children(
    run: Run,
    children: Sequence[Child],
    picks: Sequence[int],
    is_own: bool,
    seed: int,
    locked: Condensation | None = None,
    part: Part | None = None,
) -> dict:
    """Write the genomes of ``children`` and a ``recipe.toml``, with the ``picks`` as parents, into
    a new folder beside the ``run``, or in the user's state folder unless the run ``is_own``. Return
    its name and the parts that the recipe leaves out: for a run that began elsewhere, all that
    could execute something. After an error no file remains."""
    run.columns.rows([*picks])  # raises for an unknown id
    folder = _new_folder(run, is_own)
    try:
        parents: list[dict] = []
        for child in children:
            name = f"child-{child.number}"
            _write_genome(child, folder / f"{name}.parquet", run, seed)
            parents.append({"genome": f"{name}.parquet", "name": name})
        place = os.path.relpath(run.path.resolve(), folder)
        parents += [{"run": place, "id": n} for n in dict.fromkeys(picks)]
        text, left = _recipe_text(run, folder, parents, _write_lock(locked, folder))
        path = folder / "recipe.toml"
        recipe = write_recipe(path, text)
        if part is not None:
            name = _free_file(recipe)
            np.save(folder / name, part.mask.astype(np.uint8))
            text, others = _within(text, recipe, part, name)
            left += others
            write_recipe(path, text)
    except (EvocityError, OSError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        raise write_error(folder, error) from error
    return {
        "folder": str(folder),
        "files": sorted(path.name for path in folder.iterdir()),
        "recipe": str(path),
        "left": left,
        "ours": is_trusted(run),
    }


def _new_folder(run: RunLog, is_own: bool) -> Path:
    path = run.path.resolve()
    above = path.parent if is_own else state_folder() / "children"
    folder = free_path(above, f"{path.name}-children", lambda one: not os.path.lexists(one))
    return make_folder(folder)


def _write_genome(child: Child, path: Path, run: RunLog, seed: int) -> None:
    """Write a genome with all values by which it can be bred again."""
    origin = {
        "run": run.path.resolve().name,
        "parents": list(child.parents),
        "parameters": dict(child.parameters),
        "number": child.number,
        "seed": seed,
    }
    child.genome.replace(made={**child.genome.made, "studio": origin}).write(path)


def _write_lock(layer: Condensation | None, folder: Path) -> dict:
    """Write the lock of a drawing into the ``folder``; return its section of the recipe."""
    if layer is None:
        return {}
    names = {"mask": "locked.npy", "heights": "locked-heights.npy"}
    np.save(folder / names["mask"], layer.mask.astype(np.uint8))
    np.save(folder / names["heights"], layer.heights)
    return {"locked": names}


# -- the recipe -----------------------------------------------------------------------------------


def _recipe_text(
    run: RunLog, folder: Path, parents: list[dict], locked: Mapping
) -> tuple[str, list[str]]:
    """Return the recipe, and the parts of the run's recipe that it leaves out."""
    raw, left = tomllib.loads(run.recipe_text), []
    if not is_trusted(run):
        raw, left = _harmless_recipe(raw)
    before = recipe_folder(run)
    kept = {
        key: _move_paths(value, before, folder) for key, value in raw.items() if key != "parents"
    }
    section = dict(kept.get("run") or {}) | {"name": folder.name}
    text = tomli_w.dumps({**kept, "run": section, **locked, "parents": parents})
    head = f"# Goes on from children of {run.path.resolve().name} that were kept in evocity studio."
    return f"{''.join(filter(str.isprintable, head))}\n\n{text}", left


def _free_file(recipe: Recipe) -> str:
    """Return the name of a file for a mask, which no measure of the ``recipe`` has in its name."""
    taken = {part_name(measure.name) for entry in recipe.entries for measure in entry.measures}
    names = (f"marked-{number}" if number > 1 else "marked" for number in itertools.count(1))
    return next(f"{name}.npy" for name in names if name not in taken)


def _within(text: str, recipe: Recipe, part: Part, name: str) -> tuple[str, list[str]]:
    """Return the ``text`` of a ``recipe`` with its measures taken within a ``part``, the file
    ``name``; and the other measures, each with the reason."""
    head, raw = text.partition("\n")[0], tomllib.loads(text)
    named = _texts_in({key: value for key, value in raw.items() if key != "fitness"})
    left = []
    for table, entry in zip(raw.get("fitness", []), recipe.fitness, strict=True):
        if entry.within is not None:
            continue
        reason = _reason_against(entry, named, part)
        if reason is None:
            table["within"] = name
        else:
            names = ", ".join(measure.name for measure in entry.measures)
            left.append(f"the marked part for {names}: {reason}")
    return f"{head}\n\n{tomli_w.dumps(raw)}", left


def _reason_against(entry: MeasureEntry, named: set[str], part: Part) -> str | None:
    """Return why measures cannot be taken of a ``part``; ``named``: names in other sections."""
    if named.intersection(measure.name for measure in entry.measures):
        return "another section of the recipe names it"
    try:
        for measure in entry.measures:
            part.check(measure)
    except FitnessError as error:
        return error.found
    return None


def _texts_in(value: object) -> set[str]:
    """Return all texts in a ``value``, keys and values."""
    if isinstance(value, Mapping):
        return set(value) | set().union(*map(_texts_in, value.values()))
    if isinstance(value, list):
        return set().union(*map(_texts_in, value))
    return {value} if isinstance(value, str) else set()


def _harmless_recipe(raw: Mapping) -> tuple[dict, list[str]]:
    """Return a recipe without parts that execute something or read files, and these parts."""
    left = [f"[{key}]" for key in (*_EXECUTING, "locked", "within") if raw.get(key) is not None]
    kept = {k: v for k, v in raw.items() if k not in (*_EXECUTING, "locked", "within")}
    entries = [entry for entry in kept.get("fitness", []) if isinstance(entry, Mapping)]
    plain = [one for one in entries if not {"file", "like", "reference", "within"} & set(one)]
    left += [str(one.get("name") or one.get("file")) for one in entries if one not in plain]
    section = dict(kept.get("run") or {})
    if section.pop("record", None) is not None:
        left.append("record")
    kept |= {"fitness": plain, "run": section}
    for name, entry in dict(kept.get("operators") or {}).items():
        if isinstance(entry, Mapping) and "within" in entry:
            del kept["operators"][name]
            left.append(name)
    return kept, left


def _move_paths(value: object, before: Path, folder: Path):
    """Return ``value`` with paths relative to ``before`` as they are from ``folder``."""
    if isinstance(value, Mapping):
        return {key: _move_paths(entry, before, folder) for key, entry in value.items()}
    if isinstance(value, list):
        return [_move_paths(entry, before, folder) for entry in value]
    if isinstance(value, str) and _is_file(value, before):
        return os.path.relpath(before / value, folder)
    return value


def _is_file(value: str, before: Path) -> bool:
    """Whether a text names a file there; files that recipes name have a suffix."""
    with contextlib.suppress(OSError, ValueError):
        return bool(Path(value).suffix) and (before / value).is_file()
    return False
