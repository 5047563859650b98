"""What a value of a recipe may be, beyond its type: files, maps, cities, names, places.

The paths are relative to the recipe's folder, which stands with the parents, (name or None, map)
each, in the context of the validation; of a run taken up again also what it kept.
"""

import re
from collections.abc import Collection, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
)
from pydantic_core import PydanticCustomError

from evocity import io
from evocity.errors import MapError, shown, with_near_miss
from evocity.genome import VOID
from evocity.io.heights import TALLEST


class Section(BaseModel):
    """A part of a recipe: unknown keys and wrong types are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def disagreements(self) -> list[tuple[str, str, str]]:
        """Faults (key, found, allowed) of keys that are sound each by itself."""
        return []


#: Workers of an embedded cluster at most.
_MOST_EMBEDDED = 256


def cluster_of(text: str) -> str | None:
    """The address of a Dask cluster, as `evocity.search.evaluation.cluster` takes it; None for
    "none". Raises ValueError for anything else."""
    if text == "none":
        return None
    embedded = re.fullmatch(r"local:([1-9]\d{0,2})", text, re.ASCII)
    remote = re.fullmatch(r"(tcp|tls)://[^\s/]+:\d{1,5}", text, re.ASCII)
    if remote is None and (embedded is None or int(embedded[1]) > _MOST_EMBEDDED):
        raise ValueError(text)
    return text


def _some_cluster(text: str) -> str:
    try:
        cluster_of(text)
    except ValueError:
        raise fault(shown(text), CLUSTERS) from None
    return text


#: What addresses of clusters look like.
CLUSTERS = (
    '"tcp://HOST:PORT" or "tls://HOST:PORT" of a Dask scheduler, "local:N" for N workers here '
    f'(1 to {_MOST_EMBEDDED}), or "none"'
)
#: The address of a cluster in a recipe.
ClusterAddress = Annotated[str, AfterValidator(_some_cluster)]


def fault(found: str, allowed: str) -> PydanticCustomError:
    """A fault of a key that pydantic gathers with the others."""
    return PydanticCustomError("evocity", "{found}; allowed: {allowed}", _pair(found, allowed))


def _pair(found: str, allowed: str) -> dict:
    return {"found": found, "allowed": allowed}


def resolved(folder: Path, name: str) -> str:
    """A bundled city's name as it is; a path relative to the recipe's ``folder`` made whole."""
    return name if name in io.cities() else str((folder / Path(name).expanduser()).resolve())


def free_name(name: str, taken: Collection[str]) -> str:
    """``name``, or the first of ``name-2``, ``name-3``, … that no other city has."""
    others = (f"{name}-{number}" for number in count(2))
    return next(free for free in chain([name], others) if free not in taken and free != VOID)


def is_map(folder: Path, name: str) -> bool:
    """Whether ``name`` is a bundled city, or a file for a recipe in ``folder``."""
    return name in io.cities() or Path(resolved(folder, name)).is_file()


def called(folder: Path, parents: Sequence[tuple[str | None, str]]) -> list[str]:
    """What a run calls its source cities: the ``parents``, (name or None, map) as the recipe in
    ``folder`` has them."""
    names: list[str] = []
    for name, place in parents:
        names.append(free_name(name or _own_name(folder, place), names))
    return names


def parent_place(
    place: str | None, genome: str | None, run: str | None, identifier: int | None
) -> str:
    """Where a parent is from, in one text: its map, its genome's file, or a run and a number."""
    return place or genome or f"{run}#{identifier}"


def parent_title(
    name: str | None, genome: str | None, run: str | None, identifier: int | None
) -> str | None:
    """What a parent is to be called: its ``name``; else a genome after its file, an individual
    after its run; None, after its map."""
    if name or not (genome or run):
        return name
    return Path(genome).stem if genome else f"{Path(run).name}-{identifier}"


def _own_name(folder: Path, place: str) -> str:
    try:
        return io.name_of(resolved(folder, place))
    except (MapError, OSError, RuntimeError, ValueError):  # told where the map is read
        return Path(place).stem


def _some_path(name: str, info: ValidationInfo) -> str:
    """``name``, if this machine can look whether there is such a file."""
    try:
        Path(resolved(info.context["folder"], name)).is_file()
    except (OSError, RuntimeError, ValueError):  # too long, of an unknown user, with a NUL
        raise fault(f"{shown(name)} can be no path", "a file, relative to the recipe") from None
    return name


def _some_city(name: str, info: ValidationInfo) -> str:
    """A map, or what one of the recipe's parents is called: the ``name`` that it is given, which
    no other map may have, or else its map's own."""
    folder, parents = info.context["folder"], info.context["parents"]
    named = [place for other, place in parents if other == name]
    if len(named) > 1:
        raise fault(f"{shown(name)}, as {len(named)} parents are named", "a name of one alone")
    if _taken_up(info):
        return name
    try:
        found = _existing_map(_some_path(name, info), info)
    except PydanticCustomError as error:
        names = called(folder, parents)
        if named or name in names:
            return name
        if not names:
            raise
        told = error.context["allowed"]
        found = f"{shown(name)} is no file, no bundled city and no parent's name"
        found = with_near_miss(found, name, [*names, *io.cities()])
        raise fault(found, f"{told}, or a parent's name: {', '.join(names)}") from None
    if named and named[0] != name:
        raise fault(
            f"{shown(name)}, which is a parent's name and another map",
            "another name for the parent, or another path of the map",
        )
    return found


def _taken_up(info: ValidationInfo) -> bool:
    """Whether the recipe is that of a run taken up again, which has maps of its own."""
    return info.context.get("kept") is not None


def _existing_map(name: str, info: ValidationInfo) -> str:
    if not (_taken_up(info) or is_map(info.context["folder"], name)):
        raise fault(
            with_near_miss(f"{shown(name)} is no file and no bundled city", name, io.cities()),
            f"a map file, relative to the recipe, or one of {', '.join(io.cities())}",
        )
    return name


def _some_text(text: str) -> str:
    if not text.strip() or any(c in '/\\:*?"<>|' or ord(c) < 32 for c in text) or text[0] == ".":
        raise fault(f"{text!r}", "a name that can be a folder's")
    return text


def _lon_lat(center: list[float]) -> list[float]:
    if len(center) != 2 or abs(center[0]) > 180 or abs(center[1]) >= 90:
        raise fault(
            f"{center}", "exactly 2 numbers: longitude within ±180°, then latitude within ±90°"
        )
    return center


def _existing_file(name: str, info: ValidationInfo) -> str:
    if not (_taken_up(info) or Path(resolved(info.context["folder"], name)).is_file()):
        raise fault(f"{shown(name)} is no file", "a file, relative to the recipe")
    return name


def _existing_shape(name: str, info: ValidationInfo) -> str:
    from evocity.shapes import KNOWN

    if name in KNOWN or _taken_up(info) or Path(resolved(info.context["folder"], name)).is_file():
        return name
    found = with_near_miss(f"{shown(name)} is no file and no known shape", name, KNOWN)
    raise fault(found, f"a file of a shape, relative to the recipe, or one of {', '.join(KNOWN)}")


def _existing_run(name: str, info: ValidationInfo) -> str:
    if not (_taken_up(info) or Path(resolved(info.context["folder"], name), _IN_RUNS).is_file()):
        raise fault(f"{shown(name)} is no run", "a run folder, relative to the recipe")
    return name


def _some_heights(value: Any, info: ValidationInfo) -> float | str:
    """Metres, or a map's name."""
    if isinstance(value, str):
        return _existing_map(_some_path(value, info), info)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not 0 <= value <= TALLEST:
        raise fault(shown(value), f"a map file, a bundled city, or 0 to {TALLEST:g} m")
    return float(value)


def _some_reference(value: Any, info: ValidationInfo) -> str | tuple[str, ...]:
    """ "parents", or cities: one or a list."""
    if value == PARENTS:
        return PARENTS
    listed = [value] if isinstance(value, str) else value
    if not isinstance(listed, list) or not listed or not all(isinstance(v, str) for v in listed):
        raise fault(shown(value), f'"{PARENTS}", or a list of cities')
    return tuple(_some_city(name, info) for name in listed)


#: What every run folder holds.
_IN_RUNS = "provenance.json"

#: What ``reference`` is unless cities are named: the source cities of the run.
PARENTS = "parents"

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FileName = Annotated[str, AfterValidator(_some_path)]
MapName = Annotated[FileName, AfterValidator(_existing_map)]
CityName = Annotated[str, AfterValidator(_some_city)]
Cities = Annotated[Any, BeforeValidator(_some_reference)]
GenomeFile = Annotated[FileName, AfterValidator(_existing_file)]
ShapeName = Annotated[FileName, AfterValidator(_existing_shape)]
RunFolder = Annotated[FileName, AfterValidator(_existing_run)]
LockFile = Annotated[FileName, AfterValidator(_existing_file)]
Heights = Annotated[float | str | None, BeforeValidator(_some_heights)]
LonLat = Annotated[list[Finite], AfterValidator(_lon_lat)]
Title = Annotated[str, Field(max_length=100), AfterValidator(_some_text)]
