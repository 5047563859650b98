"""A scene becomes a file, by its suffix."""

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from evocity import formats
from evocity.errors import MapError
from evocity.files import whole_file
from evocity.formats import About, Group

_WRITERS: dict[str, Callable[[Sequence[Group], About], str | bytes]] = {
    ".city.json": formats.cityjson,
    ".glb": formats.glb,
    ".obj": formats.obj,
    ".wrl": formats.vrml97,
    ".x3d": formats.x3d,
}

#: What a scene is written as: CityJSON 2.0, binary glTF 2.0, Wavefront OBJ, VRML97 and X3D; its
#: footprints in a GeoPackage; and its picture.
SUFFIXES = (*_WRITERS, ".gpkg", ".png")


def suffix_of(path: Path) -> str | None:
    """The end of a file's name that tells how a scene is written, None if none does."""
    name = path.name.lower()
    return next((one for one in SUFFIXES if name.endswith(one) and name != one), None)


def check_suffix(path: Path) -> str:
    """As `suffix_of`; `MapError` where it is None."""
    suffix = suffix_of(path)
    if suffix is None:
        plain = ".json alone is none: " if path.suffix.lower() == ".json" else ""
        raise MapError(
            f"{path.name}: no scene is written as {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(SUFFIXES)}",
            f"{plain}choose .city.json for GIS, .glb for Blender and browsers, .obj for Rhino",
        )
    return suffix


def write(groups: Sequence[Group], about: About, path: str | os.PathLike) -> None:
    """As `Scene.write`."""
    path = Path(path)
    suffix = check_suffix(path)
    check_place(path)
    made = _WRITERS[suffix](groups, about)
    data = made if isinstance(made, bytes) else made.encode("utf-8")
    with whole(path) as temporary:
        temporary.write_bytes(data)


def check_place(path: Path) -> None:
    """`MapError` unless a file may be written at ``path``."""
    if not path.parent.is_dir() or path.is_dir():
        raise MapError(
            f"{str(path)!r}: " + ("it is a folder" if path.is_dir() else "there is no such folder"),
            "a file name in an existing folder",
            f"make the folder {str(path.parent)!r} first, or choose another name",
        )


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary path, which becomes ``path``; `MapError` where it cannot."""
    try:
        with whole_file(path) as temporary:
            yield temporary
    except OSError as error:
        raise MapError(
            f"{str(path)!r} cannot be written: {error}",
            "a folder this user may write to, with room left",
            "check permissions and free space, or choose another place",
        ) from error
