"""Values of a recipe beyond their types: files, maps, cities, names, places, cluster addresses.

Paths are relative to the recipe's folder. The context of the validation holds that folder, and the
parents as pairs (name or None, map). For a resumed run it also holds the files that the run kept.
"""

import math
import re
from collections.abc import Callable, Collection, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from evocity import io
from evocity.errors import MapError, add_near_miss, is_number, spell
from evocity.genome import VOID
from evocity.io.heights import TALLEST
from evocity.io.map_paths import is_map_path, network_address
from evocity.section import Finite, fault, text_for

#: The most workers of an embedded cluster.
_MOST_EMBEDDED = 256
#: The file that every run folder holds.
_RUN_FILE = "provenance.json"
#: The default of ``reference``: the source cities of the run.
PARENTS = "parents"
#: The forms of a cluster's address, in words.
CLUSTERS = (
    '"tcp://HOST:PORT" or "tls://HOST:PORT" of a Dask scheduler, "local:N" for N workers on this '
    f'machine (1 to {_MOST_EMBEDDED}), or "none"'
)


def cluster_of(text: str) -> str | None:
    """Read the address of a Dask cluster, as `evocity.evaluation.cluster.engine` takes it; None
    for "none". Raises ValueError for anything else."""
    if text == "none":
        return None
    embedded = re.fullmatch(r"local:([1-9]\d{0,2})", text, re.ASCII)
    remote = re.fullmatch(r"(tcp|tls)://[^\s/]+:\d{1,5}", text, re.ASCII)
    if remote is None and (embedded is None or int(embedded[1]) > _MOST_EMBEDDED):
        raise ValueError(text)
    return text


def describe_reach(address: str | None) -> list[str]:
    """Say who can reach a cluster at an ``address`` without TLS; nothing for any other cluster."""
    if address is None or not address.startswith("tcp://"):
        return []
    return [
        f"the cluster at {address} uses no TLS: anyone who reaches this address or its workers can "
        "execute any program as their user, and anyone on the network between can read and change "
        "what is sent; use it only in a network that you trust, or use tls://"
    ]


def resolve_path(folder: Path, name: str) -> str:
    """Return a bundled city's name as it is, and make a path relative to ``folder`` absolute."""
    return name if name in io.cities() else str((folder / Path(name).expanduser()).resolve())


def free_name(name: str, taken: Collection[str]) -> str:
    """Return ``name``, or the first of ``name-2``, ``name-3``, … that no other city has."""
    others = (f"{name}-{number}" for number in count(2))
    return next(free for free in chain([name], others) if free not in taken and free != VOID)


def is_map(folder: Path, name: str) -> bool:
    """Whether ``name`` is a bundled city, or a file for a recipe in ``folder``."""
    return name in io.cities() or is_map_path(resolve_path(folder, name))


def parent_names(folder: Path, parents: Sequence[tuple[str | None, str]]) -> list[str]:
    """Name the source cities of a run. ``parents``: (name or None, map) of each, as the recipe in
    ``folder`` writes them."""
    names: list[str] = []
    for name, place in parents:
        names.append(free_name(name or _map_name(folder, place), names))
    return names


def parent_place(
    place: str | None, genome: str | None, run: str | None, identifier: int | None
) -> str:
    """Write the origin of a parent as one text: its map, its genome's file, or a run and an id."""
    return place or genome or f"{run}#{identifier}"


def parent_title(
    name: str | None, genome: str | None, run: str | None, identifier: int | None
) -> str | None:
    """Title a parent by its ``name``, else a genome by its file and an individual by its run; None
    for a parent that is titled by its map."""
    if name or not (genome or run):
        return name
    return Path(genome).stem if genome else f"{Path(run).name}-{identifier}"


def _map_name(folder: Path, place: str) -> str:
    try:
        return io.name_of(resolve_path(folder, place))
    except (MapError, OSError, RuntimeError, ValueError):  # reading the map reports it
        return Path(place).stem


# -- checks of one value -------------------------------------------------------------------------


def _check_path(name: str, info: ValidationInfo) -> str:
    """Refuse a text that this machine cannot look up as a path."""
    try:
        Path(resolve_path(info.context["folder"], name)).is_file()
    except (OSError, RuntimeError, ValueError):  # too long, of an unknown user, with a NUL
        raise fault(
            f"{spell(name)} cannot be used as a path",
            "the path of a file, relative to the recipe's folder",
        ) from None
    return name


def _is_resumed(info: ValidationInfo) -> bool:
    """Whether the recipe is that of a resumed run, which has maps of its own."""
    return info.context.get("kept") is not None


def _is_there(name: str, info: ValidationInfo, inside: str = "") -> bool:
    path = Path(resolve_path(info.context["folder"], name), inside)
    return _is_resumed(info) or path.is_file()


def _is_map_there(name: str, info: ValidationInfo) -> bool:
    return _is_resumed(info) or is_map_path(resolve_path(info.context["folder"], name))


def _refuse_address(name: str, info: ValidationInfo) -> None:
    """Refuse an address on the network, in the place of a map file."""
    if (address := network_address(name)) and not _is_map_there(name, info):
        raise fault(
            f"{spell(name)} is an address on the network",
            "a file on this computer; download it first, for example with curl -L -O "
            f"{address}, and write its path here",
        )


def _file(noun: str, inside: str = "") -> AfterValidator:
    def check(name: str, info: ValidationInfo) -> str:
        if not _is_there(name, info, inside):
            raise fault(
                f"{spell(name)} is not {noun}",
                f"the path of {noun}, relative to the recipe's folder",
            )
        return name

    return AfterValidator(check)


def _file_or_name(
    file: str,
    named: str,
    known: Callable[[], Collection[str]],
    is_there: Callable[[str, ValidationInfo], bool] = _is_there,
) -> Callable[[str, ValidationInfo], str]:
    def check(name: str, info: ValidationInfo) -> str:
        if name in known() or is_there(name, info):
            return name
        found = f"{spell(name)} is neither a file nor a {named}"
        allowed = f"{file}, relative to the recipe, or one of {', '.join(known())}"
        raise fault(add_near_miss(found, name, known()), allowed)

    return check


def _known_shapes() -> Collection[str]:
    from evocity.shapes import KNOWN

    return KNOWN


_is_map_or_city = _file_or_name("a map file", "bundled city", io.cities, _is_map_there)


def _check_map(name: str, info: ValidationInfo) -> str:
    """Refuse a ``name`` that is neither a map nor a bundled city."""
    _refuse_address(name, info)
    return _is_map_or_city(name, info)


def _check_city(name: str, info: ValidationInfo) -> str:
    """Refuse a ``name`` that is neither a map nor the name of exactly one parent."""
    folder, parents = info.context["folder"], info.context["parents"]
    named = [place for other, place in parents if other == name]
    if len(named) > 1:
        raise fault(
            f"{spell(name)} is the name of {len(named)} parents",
            "a name that only one parent has",
        )
    if _is_resumed(info):
        return name
    try:
        city = _check_map(_check_path(name, info), info)
    except PydanticCustomError as error:
        names = parent_names(folder, parents)
        if named or name in names:
            return name
        if not names:
            raise
        found = f"{spell(name)} is neither a file, a bundled city nor a parent's name"
        found = add_near_miss(found, name, [*names, *io.cities()])
        allowed = f"{error.context['allowed']}, or a parent's name: {', '.join(names)}"
        raise fault(found, allowed) from None
    if named and named[0] != name:
        raise fault(
            f"{spell(name)} is the name of a parent, but another map has the same name",
            "another name for the parent, or another path for the map",
        )
    return city


def _check_title(text: str) -> str:
    if not text.strip() or any(c in '/\\:*?"<>|' or ord(c) < 32 for c in text) or text[0] == ".":
        raise fault(
            f"{text!r} cannot be the name of a folder",
            'a name without / \\ : * ? " < > | and without a dot at its beginning',
        )
    return text


def _check_lon_lat(center: list[float]) -> list[float]:
    if len(center) != 2 or abs(center[0]) > 180 or abs(center[1]) >= 90:
        raise fault(
            f"{center} is not a position in degrees",
            "a list of 2 numbers: the longitude within ±180°, then the latitude within ±90°",
        )
    return center


def _read_heights(value: Any, info: ValidationInfo) -> float | str:
    if isinstance(value, str):
        return _check_map(_check_path(value, info), info)
    if not is_number(value) or not 0 <= value <= TALLEST:
        raise fault(spell(value), f"a map file, a bundled city, or 0 to {TALLEST:g} m")
    return float(value)


def _read_terrain(value: Any, info: ValidationInfo) -> float | str:
    if isinstance(value, str):
        if _is_map_there(_check_path(value, info), info):
            return value
        _refuse_address(value, info)
    elif is_number(value) and math.isfinite(value):
        return float(value)
    raise fault(spell(value), "a raster of the ground, or its elevation in metres")


def _read_reference(value: Any, info: ValidationInfo) -> str | tuple[str, ...]:
    """Read "parents", one city or a list of cities."""
    if value == PARENTS:
        return PARENTS
    listed = [value] if isinstance(value, str) else value
    if not isinstance(listed, list) or not listed or not all(isinstance(v, str) for v in listed):
        raise fault(spell(value), f'"{PARENTS}", or a list of cities')
    return tuple(_check_city(name, info) for name in listed)


ClusterAddress = Annotated[str, text_for(cluster_of, CLUSTERS)]
FileName = Annotated[str, AfterValidator(_check_path)]
MapName = Annotated[FileName, AfterValidator(_check_map)]
CityName = Annotated[str, AfterValidator(_check_city)]
Cities = Annotated[Any, BeforeValidator(_read_reference)]
ExistingFile = Annotated[FileName, _file("a file")]
ShapeName = Annotated[
    FileName, AfterValidator(_file_or_name("a shape file", "known shape", _known_shapes))
]
RunFolder = Annotated[FileName, _file("a run folder", _RUN_FILE)]
Heights = Annotated[float | str | None, BeforeValidator(_read_heights)]
Terrain = Annotated[float | str | None, BeforeValidator(_read_terrain)]
LonLat = Annotated[list[Finite], AfterValidator(_check_lon_lat)]
Title = Annotated[str, Field(max_length=100), AfterValidator(_check_title)]
