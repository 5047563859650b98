"""Files of scenes: the formats by suffix, and their options."""

import gc
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from evocity import formats
from evocity.errors import MapError
from evocity.formats import About, Group
from evocity.formats.printing import HEADER, stl_credit
from evocity.io.writers import TABLES, check_place, open_output

_WRITERS: dict[str, Callable[..., str | bytes]] = {
    ".city.json": formats.cityjson,
    ".glb": formats.glb,
    ".obj": formats.obj,
    ".wrl": formats.vrml97,
    ".x3d": formats.x3d,
    ".dxf": formats.dxf,
    ".3dm": formats.rhino,
    ".stl": formats.stl,
    ".3mf": formats.threemf,
}

#: Suffixes of scenes: CityJSON 2.0, binary glTF 2.0, Wavefront OBJ, VRML97, X3D, DXF, 3DM of Rhino,
#: STL and 3MF for printers; footprints in a GeoPackage, FlatGeobuf or GeoParquet; and a picture.
SUFFIXES = (*_WRITERS, *TABLES, ".png")

#: Suffixes of files without coordinates on Earth.
UNPLACED = (".png", ".stl", ".3mf")

# Formats of viewers, in which coarse levels of detail have no floors.
_VIEWERS = (".glb", ".obj", ".wrl", ".x3d")

#: Options of formats, by suffix.
_OPTIONS = {".glb": ("merge", "instances"), ".stl": ("side",), ".3mf": ("side",)}


def suffix_of(path: Path) -> str | None:
    """Return the suffix of a file name if it is a suffix of scene files, and otherwise None."""
    name = path.name.lower()
    return next((end for end in SUFFIXES if name.endswith(end) and name != end), None)


def check_suffix(path: Path) -> str:
    """Return the suffix of ``path``, if it is a suffix of scene files. Raises `MapError` for a
    ``path`` without a suffix of scene files."""
    suffix = suffix_of(path)
    if suffix is None:
        plain = "use .city.json, not .json; " if path.suffix.lower() == ".json" else ""
        raise MapError(
            f"{path.name}: scenes cannot be written to {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(SUFFIXES)}",
            f"{plain}choose .city.json for GIS, .glb for Blender and browsers, .3dm for Rhino",
        )
    return suffix


def write(groups: Sequence[Group], about: About, path: str | os.PathLike, **how: Any) -> None:
    """Write groups of solids, as `Scene.write`."""
    path = Path(path)
    suffix = check_suffix(path)
    check_place(path)
    check_options(path, how)
    if suffix not in _VIEWERS:
        groups = [replace(group, floors=True) for group in groups]
    with _collection_paused():
        _write(groups, about, path, suffix, how)


def _write(
    groups: Sequence[Group], about: About, path: Path, suffix: str, how: Mapping[str, Any]
) -> None:
    if suffix == ".obj":
        beside = path.with_suffix(".mtl")
        check_place(beside)
        with open_output(beside) as temporary:
            temporary.write_text(formats.mtl(groups, about), encoding="utf-8")
        content: str | bytes = formats.obj(groups, about, beside.name)
    else:
        content = _WRITERS[suffix](groups, about, **how)
    data = content if isinstance(content, bytes) else content.encode("utf-8")
    with open_output(path) as temporary:
        temporary.write_bytes(data)


@contextmanager
def _collection_paused() -> Iterator[None]:
    """Pause the search for cycles of objects. Writers make many small objects without cycles, and a
    search through all objects of a large program takes as long as a file."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def cuts_attribution(suffix: str, about: About) -> bool:
    """Whether a file with this suffix has no room for the whole attribution."""
    return suffix == ".stl" and len(stl_credit(about)) > HEADER


def check_options(path: Path, how: Mapping[str, Any]) -> None:
    """Raise `MapError` for options ``how`` that the format of ``path`` does not have."""
    known = _OPTIONS.get(suffix_of(path) or "", ())
    if wrong := [name for name in how if name not in known]:
        raise MapError(
            f"{path.name}: {suffix_of(path)} files have no option {', '.join(wrong)}",
            "merge and instances for .glb files, side for .stl and .3mf files, and the options of "
            "pictures for .png files",
            "leave the option out, or write a file of another format",
        )
