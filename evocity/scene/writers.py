"""Writers of scenes, chosen by suffix."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from evocity import formats
from evocity.errors import MapError
from evocity.formats import About, Group
from evocity.io.writers import check_place, open_output

_WRITERS: dict[str, Callable[[Sequence[Group], About], str | bytes]] = {
    ".city.json": formats.cityjson,
    ".glb": formats.glb,
    ".obj": formats.obj,
    ".wrl": formats.vrml97,
    ".x3d": formats.x3d,
}

#: Suffixes of scenes: CityJSON 2.0, binary glTF 2.0, Wavefront OBJ, VRML97 and X3D; footprints in a
#: GeoPackage; and a picture.
SUFFIXES = (*_WRITERS, ".gpkg", ".png")


def suffix_of(path: Path) -> str | None:
    """Find which suffix of scene files ends the name of a file; None for other names."""
    name = path.name.lower()
    return next((end for end in SUFFIXES if name.endswith(end) and name != end), None)


def check_suffix(path: Path) -> str:
    """Return the suffix of ``path`` as `suffix_of` finds it. Raises `MapError` for other names."""
    suffix = suffix_of(path)
    if suffix is None:
        plain = "use .city.json, not .json; " if path.suffix.lower() == ".json" else ""
        raise MapError(
            f"{path.name}: scenes cannot be written to {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(SUFFIXES)}",
            f"{plain}choose .city.json for GIS, .glb for Blender and browsers, .obj for Rhino",
        )
    return suffix


def write(groups: Sequence[Group], about: About, path: str | os.PathLike) -> None:
    """Write groups of solids, as `Scene.write`."""
    path = Path(path)
    suffix = check_suffix(path)
    check_place(path)
    content = _WRITERS[suffix](groups, about)
    data = content if isinstance(content, bytes) else content.encode("utf-8")
    with open_output(path) as temporary:
        temporary.write_bytes(data)
