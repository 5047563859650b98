"""Provenance of a run: hashes of its maps and measures, copies of the user's own measure files."""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from evocity import fitness, store
from evocity.errors import MapError, RunError, cut_short, reason_of
from evocity.fitness import Measure
from evocity.recipe.measures import FitnessEntry, MeasureEntry
from evocity.recipe.recipe import Recipe
from evocity.recipe.sections import Parent
from evocity.recipe.values import PARENTS, resolve_path
from evocity.search.preparation.preparation import Prepared, map_of
from evocity.store.sources import MEASURES_FOLDER, measure_file

_PACKAGE = Path(fitness.__file__).parent.parent

# Bytes that are kept of a measure's summary.
_MOST_SUMMARY = 500
#: Files of a Shapefile, beside the .shp, that change the map that is read.
_SHAPEFILE = (".dbf", ".shx", ".prj")
_RASTERS = (".tif", ".tiff", ".asc")


@dataclass(frozen=True)
class OwnFiles:
    """``files``: place in the run folder -> content, of the measure files that a recipe names and
    of what they import from their folder; ``places``: measure -> place of its file."""

    files: Mapping[str, bytes] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)


def provenance_of(
    prepared: Prepared,
    out: str | os.PathLike,
    own: OwnFiles,
    hashed: Callable[[Path, str], str | None] | None = None,
) -> dict:
    """Return the content of `provenance.json` in the run folder ``out``, without the header; paths
    are relative to it, or to the recipe. ``own``: the copies of the user's measure files;
    ``hashed``: `file_hash`, or another function that returns the hash of a map's file."""
    recipe, hashed = prepared.recipe, hashed or file_hash
    entries = [entry for entry in recipe.fitness for _ in entry.measures]
    numbers = {id(source.city): number for number, source in enumerate(prepared.sources)}
    optional: dict[str, Any] = {
        "recorded": [
            {"name": measure.name}
            | _source_of(entry, measure, own)
            | _reference_of(recipe, entry.compared, hashed)
            for entry in recipe.recording
            for measure in entry.measures
        ],
        "within": [
            {
                "name": name,
                "file": hashed(recipe.folder, name),
                "hash": store.hash_of_mask(part.mask),
            }
            for name, part in prepared.within.items()
        ],
        "descriptors": [_descriptor(name, *recipe.limits[name]) for name in recipe.described],
    }
    if recipe.locked.given:
        files = {name: hashed(recipe.folder, name) for name in recipe.locked.files}
        optional["locked"] = {"asked": recipe.locked.given, "files": files}
    return store.environment() | {
        "seed": recipe.run.seed,
        "recipe": {
            "folder": _relative(recipe.folder, out),
            "file": recipe.file,
            "hash": store.hash_of_text(recipe.text),
            "overrides": recipe.overrides,
            "operators": _mixture(recipe),
            "search": recipe.search.settings,
            **({} if recipe.search.births is None else {"population": recipe.run.population}),
            **_islands(recipe),
        },
        "maps": [
            {
                "name": source.name,
                "map": parent.place,
                "hash": store.hash_of_map(source.city),
                "genome": source.genome.digest,
                "file": hashed(recipe.folder, parent.place) if _is_file(recipe, parent) else None,
                **_terrain_of(recipe, parent, hashed),
            }
            for source, parent in zip(prepared.sources, recipe.parents, strict=True)
        ],
        "fitness": [
            _goal_of(recipe, entry, one, hashed)
            | _source_of(entry, one.measure, own)
            | _reference_of(recipe, entry.compared, hashed)
            for entry, one in zip(entries, prepared.aims.wanted, strict=True)
        ],
        "references": [
            {
                "name": name,
                "source": numbers.get(id(city)),
                "hash": store.hash_of_map(city),
            }
            for name, city in prepared.named.items()
        ],
        **{key: value for key, value in optional.items() if value},
    }


def _relative(folder: Path, out: str | os.PathLike) -> str:
    """``folder`` relative to the run folder ``out``; whole if it is on another drive."""
    try:
        return Path(os.path.relpath(folder, Path(out).resolve())).as_posix()
    except ValueError:
        return str(folder)


def _terrain_of(
    recipe: Recipe, parent: Parent, hashed: Callable[[Path, str], str | None]
) -> dict[str, str | None]:
    """The raster of the ground that was subtracted from a ``parent``'s map, and its hash."""
    if not isinstance(parent.terrain, str):
        return {}
    return {"terrain": parent.terrain, "terrain_file": hashed(recipe.folder, parent.terrain)}


def _is_file(recipe: Recipe, parent: Parent) -> bool:
    """Whether a ``parent`` has a file: control points and known shapes have none."""
    if parent.shape is not None:
        return Path(resolve_path(recipe.folder, parent.shape)).is_file()
    return parent.curve is None


def _islands(recipe: Recipe) -> dict:
    if not recipe.islands:
        return {}
    islands = [
        {
            "name": island.name,
            "population": island.population,
            "operators": _mixture(local),
            "search": {key: local.search.settings[key] for key in ("algorithm", *local.search.own)},
            "measures": island.measures,
            "weights": island.weights,
        }
        for island, local in zip(recipe.islands, recipe.local, strict=True)
    ]
    return {"islands": islands, "migration": recipe.migration.model_dump()}


def _mixture(recipe: Recipe) -> dict:
    return {name: one.model_dump(exclude_none=True) for name, one in recipe.operators.items()}


def _descriptor(name: str, *ends: float) -> dict:
    low, high = (end if math.isfinite(end) else None for end in ends)
    return {"name": name, "low": low, "high": high}


def _goal_of(recipe: Recipe, entry: FitnessEntry, wanted: fitness.Wanted, hashed) -> dict:
    """The keys of constraints and sums are there only if the measure has them."""
    objective, constraint = wanted.objective, wanted.constraint
    like = None if entry.like is None else map_of(recipe, entry.like)
    about = {
        "name": wanted.measure.name,
        "goal": None if objective is None else objective.goal,
        "target": None if objective is None else objective.target,
        "like": like,
        "like_file": None if like is None else hashed(recipe.folder, like),
    }
    if constraint is not None:
        about |= {"min": constraint.low, "max": constraint.high}
    if wanted.total is not None:
        about |= {"objective": wanted.total, "weight": wanted.weight}
    return about


def _source_of(entry: MeasureEntry, measure: Measure, own: OwnFiles) -> dict:
    """The origin of a measure: its file, what that imports from its folder, and the run's copy."""
    file = Path(measure.file)
    ours = measure.origin == "evocity"
    name = file.relative_to(_PACKAGE.parent).as_posix() if ours else file.name
    about = {"file": name, "hash": measure.source_hash}
    if entry.within is not None:
        about["within"] = entry.within
    if entry.file is not None or not ours:  # not every machine has it
        about |= {"unit": measure.unit, "summary": cut_short(measure.summary, _MOST_SUMMARY)}
    if entry.file is not None:
        about |= {"file": entry.file, "kept": own.places[measure.name]}
        if measure.beside:
            about["beside"] = imported_names(measure)
    return about


def _reference_of(recipe: Recipe, reference: str | tuple[str, ...] | None, hashed) -> dict:
    if reference is None:
        return {}
    if reference == PARENTS:
        return {"reference": PARENTS}
    maps = [map_of(recipe, name) for name in reference]
    return {"reference": {name: hashed(recipe.folder, name) for name in maps}}


def file_hash(folder: Path, name: str) -> str | None:
    """Return the hash of a map's file, with the other files of a Shapefile or raster. None for a
    bundled city, which only a release changes, and for an individual of a run, whose births never
    change.
    ``folder`` is the recipe's. Raises `MapError` if it cannot be read."""
    path = resolve_path(folder, name)
    run, of_run, _ = path.rpartition("#")
    if path == name or (of_run and Path(run).is_dir()):
        return None
    path, others = Path(path), []
    try:
        if path.is_dir():  # a File GDB
            first, *rest = sorted(part for part in path.iterdir() if part.is_file())
            return store.hash_of_file(first, *rest)
        if path.suffix.lower() == ".shp":
            others = [other for other in path.parent.iterdir() if other.stem == path.stem]
            others = sorted(other for other in others if other.suffix.lower() in _SHAPEFILE)
        elif path.suffix.lower() in _RASTERS:
            beside = [path.with_name(path.name + suffix) for suffix in (".aux.xml", ".msk")]
            others = [other for other in beside if other.is_file() and not other.is_symlink()]
        return store.hash_of_file(path, *others)
    except (OSError, ValueError) as error:
        found = f"{path} cannot be read: {reason_of(error)}"
        raise MapError(found, "a map file", "check the path and its permissions") from None


def collect_own_files(recipe: Recipe) -> OwnFiles:
    """Read the measure files that a run by ``recipe`` keeps, as ``fitness/<name>``; those of a
    second folder as ``fitness/from-2/<name>``. Raises `RunError` if a file differs from what was
    executed."""
    files: dict[str, bytes] = {}
    places: dict[str, str] = {}
    folders: list[Path] = []
    for entry in recipe.entries:
        if entry.file is None:
            continue
        named = Path(resolve_path(recipe.folder, entry.file))
        if named.parent not in folders:
            folders.append(named.parent)
        number = folders.index(named.parent) + 1
        room = PurePosixPath(MEASURES_FOLDER, *([f"from-{number}"] if number > 1 else []))
        for measure in entry.measures:
            paths = [measure.file, *measure.beside]
            try:
                unchanged = store.hash_of_file(*paths) == measure.source_hash
            except OSError:
                unchanged = False
            if not unchanged:
                raise RunError(
                    f"the measure file {measure.file} has changed since evocity executed it",
                    "measure files that do not change while a run starts",
                    "start the run again",
                )
            names = [named.name, *imported_names(measure)]
            files |= {
                str(room / name): Path(path).read_bytes()
                for name, path in zip(names, paths, strict=True)
            }
            places[measure.name] = str(room / named.name)
    return OwnFiles(files, places)


def imported_names(measure: Measure) -> list[str]:
    """Return the files that a measure's file imports, relative to its folder."""
    folder = Path(measure.file).parent
    return [Path(path).relative_to(folder).as_posix() for path in measure.beside]


def find_copies(root: Path, folder: Path, noted: list[dict]) -> dict[str, str]:
    """Map the measure files that are gone from the ``folder`` of the recipe to their copies in the
    run folder ``root``. Raises `RunError` for copies that are links, or lie outside."""
    copies = {}
    for one in noted:
        original = resolve_path(folder, one["file"])
        if "kept" in one and not os.path.isfile(original):
            try:
                copies[original] = str(measure_file(root, one["kept"]).resolve())
            except FileNotFoundError:
                continue
    return copies
