"""What `provenance.json` records of a run: where its maps and measures come from, by hashes."""

import math
import os
from collections.abc import Callable
from pathlib import Path

from evocity import fitness, store
from evocity.citymap import CityMap
from evocity.errors import MapError, cut_short
from evocity.search.keeping import Kept, beside_of, kept_by, relative
from evocity.search.preparation import Prepared, map_of
from evocity.search.recipe import Recipe
from evocity.search.sections import Parent
from evocity.search.values import PARENTS, resolved
from evocity.search.wanted import FitnessEntry, MeasureEntry

_PACKAGE = Path(fitness.__file__).parent.parent

# Bytes that are kept of what a measure says of itself.
_MOST_SAID = 500
#: Besides the .shp itself, what of a Shapefile decides the map that is read.
_SHAPEFILE = (".dbf", ".shx", ".prj")


def provenance_of(
    prepared: Prepared,
    out: str | os.PathLike,
    kept: Kept | None = None,
    hashed: Callable[[Path, str], str | None] | None = None,
) -> dict:
    """What `provenance.json` of the run folder ``out`` records, besides the header; paths as seen
    from there, or from the recipe. ``kept``: what the run keeps of the user's own measures;
    ``hashed``: `file_hash`, or what else tells the hash of a map's file."""
    recipe = prepared.recipe
    kept, hashed = kept or kept_by(recipe), hashed or file_hash
    entries = [entry for entry in recipe.fitness for _ in entry.measures]
    locked = {}
    if recipe.locked.asked:
        files = {name: hashed(recipe.folder, name) for name in recipe.locked.files}
        locked["locked"] = {"asked": recipe.locked.asked, "files": files}
    return store.environment() | {
        "seed": recipe.run.seed,
        "recipe": {
            "folder": relative(recipe.folder, out),
            "file": recipe.file,
            "hash": store.hash_of_text(recipe.text),
            "overrides": recipe.overrides,
            "operators": _mixture(recipe),
            "search": recipe.search.asked,
            **_islands(recipe),
        },
        "maps": [
            {
                "name": source.name,
                "map": parent.place,
                "hash": store.hash_of_map(source.city),
                "genome": source.genome.digest,
                "file": hashed(recipe.folder, parent.place) if _is_file(recipe, parent) else None,
            }
            for source, parent in zip(prepared.sources, recipe.parents, strict=True)
        ],
        "fitness": [
            _wanted(recipe, entry, one, hashed)
            | _source_of(entry, one.measure, kept)
            | _compared(recipe, entry.compared, hashed)
            for entry, one in zip(entries, prepared.aims.wanted, strict=True)
        ],
        "references": [
            {"name": name, "source": _number(city, prepared), "hash": store.hash_of_map(city)}
            for name, city in prepared.named.items()
        ],
        **_recorded(recipe, kept, hashed),
        **_within(prepared, hashed),
        **_descriptors(recipe),
        **locked,
    }


def _is_file(recipe: Recipe, parent: Parent) -> bool:
    """Whether a ``parent`` has a file of its own: control points and known shapes have none."""
    if parent.shape is not None:
        return Path(resolved(recipe.folder, parent.shape)).is_file()
    return parent.curve is None


def _islands(recipe: Recipe) -> dict:
    """What `provenance.json` tells of the recipe's islands, each whole; nothing without any."""
    if not recipe.islands:
        return {}
    told = [
        {
            "name": island.name,
            "population": island.population,
            "operators": _mixture(local),
            "search": {key: local.search.asked[key] for key in ("algorithm", *local.search.own)},
            "measures": island.measures,
            "weights": island.weights,
        }
        for island, local in zip(recipe.islands, recipe.local, strict=True)
    ]
    return {"islands": told, "migration": recipe.migration.model_dump()}


def _mixture(recipe: Recipe) -> dict:
    return {name: one.model_dump(exclude_none=True) for name, one in recipe.operators.items()}


def _recorded(recipe: Recipe, kept: Kept, hashed) -> dict:
    """What `provenance.json` tells of measures that are recorded besides; nothing without any."""
    told = [
        {"name": measure.name}
        | _source_of(entry, measure, kept)
        | _compared(recipe, entry.compared, hashed)
        for entry in recipe.recording
        for measure in entry.measures
    ]
    return {"recorded": told} if told else {}


def _within(prepared: Prepared, hashed) -> dict:
    """What `provenance.json` tells of the parts that measures are taken of; nothing without any."""
    folder = prepared.recipe.folder
    told = [
        {"name": name, "file": hashed(folder, name), "hash": store.hash_of_mask(part.mask)}
        for name, part in prepared.within.items()
    ]
    return {"within": told} if told else {}


def _descriptors(recipe: Recipe) -> dict:
    """What `provenance.json` tells of measures that algorithms need: the lowest and the highest
    value they declare, null for no bound. Nothing if they need none."""
    told = []
    for name in recipe.described:
        low, high = (one if math.isfinite(one) else None for one in recipe.limits[name])
        told.append({"name": name, "low": low, "high": high})
    return {"descriptors": told} if told else {}


def _number(city: CityMap, prepared: Prepared) -> int | None:
    """Which source a ``city`` is, or None."""
    return next((k for k, one in enumerate(prepared.sources) if one.city is city), None)


def _wanted(recipe: Recipe, entry: FitnessEntry, wanted: fitness.Wanted, hashed) -> dict:
    """What `provenance.json` tells of what is wanted of a measure; keys of constraints and sums
    only if it has them."""
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


def _source_of(entry: MeasureEntry, measure: fitness.Measure, kept: Kept) -> dict:
    """What `provenance.json` tells of where a measure comes from: the file as the recipe names it,
    what that imports from its folder, and the run's own copy; of others the file's name."""
    file = Path(measure.file)
    ours = measure.origin == "evocity"
    told = file.relative_to(_PACKAGE.parent).as_posix() if ours else file.name
    about = {"file": told, "hash": measure.source_hash}
    if entry.within is not None:
        about["within"] = entry.within
    if entry.file is not None or not ours:  # who opens the run may not have it
        about |= {"unit": measure.unit, "summary": cut_short(measure.summary, _MOST_SAID)}
    if entry.file is not None:
        about |= {"file": entry.file, "kept": kept.places[measure.name]}
        if measure.beside:
            about["beside"] = beside_of(measure)
    return about


def _compared(recipe: Recipe, reference: str | tuple[str, ...] | None, hashed) -> dict:
    """What `provenance.json` tells of what a measure compares with; nothing if it does not."""
    if reference is None:
        return {}
    if reference == PARENTS:
        return {"reference": PARENTS}
    maps = [map_of(recipe, name) for name in reference]
    return {"reference": {name: hashed(recipe.folder, name) for name in maps}}


def file_hash(folder: Path, name: str) -> str | None:
    """Hash of a map's file, with those that make a Shapefile whole; None for a bundled city,
    which changes only with a release, and for an individual of a run, whose births never change.
    ``folder`` is the recipe's."""
    path = resolved(folder, name)
    run, of_run, _ = path.rpartition("#")
    if path == name or (of_run and Path(run).is_dir()):
        return None
    path = Path(path)
    try:
        return store.hash_of_file(path, *_companions(path))
    except OSError as error:
        raise MapError(f"{path} cannot be read: {error.strerror}", "a map", "check it") from None


def _companions(path: Path) -> list[Path]:
    if path.suffix.lower() != ".shp":
        return []
    beside = (one for one in path.parent.iterdir() if one.stem == path.stem)
    return sorted(one for one in beside if one.suffix.lower() in _SHAPEFILE)


__all__ = ["file_hash", "provenance_of"]
