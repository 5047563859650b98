"""Zip files with a map in them: the map and the files that belong to it are unpacked into a
temporary folder, within bounds."""

import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from evocity.errors import MapError, format_bytes, keyword, reason_of
from evocity.io.reader_types import Footprints, Grid, Request

#: A packed file may grow by this factor, and always up to so many bytes; a zip has at most so many
#: files.
DENSEST, LEAST, MOST_FILES = 100, 1 << 26, 10_000

_CHUNK = 1 << 20
_NESTED = (".zip", ".kmz", ".7z", ".rar", ".tar", ".tgz", ".tar.gz", ".gz", ".bz2", ".xz", ".zst")
_ERRORS = (
    *(zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, EOFError, OSError),
    *(NotImplementedError, RuntimeError, ValueError, UnicodeError, KeyError),
)


@dataclass
class Archive:
    """A zip file whose list of files was checked: ``names`` of files, without folders."""

    path: Path
    file: zipfile.ZipFile
    names: list[str]
    room: int


@contextmanager
def open_archive(path: Path) -> Iterator[tuple[Archive, Path]]:
    """Open the zip file at ``path``, and a temporary folder for what it holds. Raises `MapError`
    for a zip that is damaged, encrypted, names places outside it, or is a bomb."""
    with _zip_errors(path):
        file = zipfile.ZipFile(path)
    with file, tempfile.TemporaryDirectory(prefix="evocity-") as folder:
        entries = [entry for entry in file.infolist() if not _is_hidden(entry)]
        _check_entries(path, entries)
        names = [entry.filename for entry in entries if not entry.is_dir()]
        room = max(LEAST, DENSEST * path.stat().st_size)
        size = sum(entry.file_size for entry in entries)
        if size > room:
            raise _bomb(path, size)
        yield Archive(path, file, names, room), Path(folder)


def read_member(archive: Archive, name: str, folder: Path) -> Path:
    """Unpack the file ``name`` of an ``archive`` below ``folder``, and return its path."""
    target = folder / PurePosixPath(name)
    with _zip_errors(archive.path):
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.file.open(name) as source, open(target, "xb") as unpacked:
            while content := source.read(_CHUNK):
                archive.room -= len(content)
                if archive.room < 0:
                    raise _bomb(archive.path, None)
                unpacked.write(content)
    return target


def read_zip(path: Path, request: Request) -> Footprints | Grid:
    """Read the map in a zip file: the only one, or the one that the option ``layer`` names."""
    # the table of readers, which this function reads, has a row for this function
    from evocity.io.map_reader import data_of, options_of, suffixes

    with open_archive(path) as (archive, folder):
        maps = _maps(archive.names, suffixes())
        nested = [name for name in archive.names if name.lower().endswith(_NESTED)]
        if nested and not maps:
            raise MapError(
                f"{path.name} holds another archive: {nested[0][:80]}",
                "a zip with a map file in it",
                "unpack the zip once, and give the inner file",
            )
        chosen, request = _choose(path, maps, archive.names, request)
        free = shutil.disk_usage(folder).free
        family = _family(chosen, archive.names)
        size = sum(archive.file.getinfo(name).file_size for name in family)
        if size > free:
            raise MapError(
                f"{path.name}: its map needs {format_bytes(size)} to unpack, and the temporary "
                f"folder has {format_bytes(free)}",
                "room in the temporary folder",
                "set TMPDIR to a larger folder, or unpack the zip and name the map file",
            )
        for name in family:
            read_member(archive, name, folder)
        inner = folder / PurePosixPath(chosen)
        if request.layer is not None and "layer" not in options_of(inner):
            raise _layer_error(path, f"no layer {request.layer!r}", maps)
        return data_of(inner, request)[0]


def _check_entries(path: Path, entries: Sequence[zipfile.ZipInfo]) -> None:
    if len(entries) > MOST_FILES:
        raise MapError(
            f"{path.name} holds {len(entries)} files",
            f"a zip of at most {MOST_FILES} files",
            "unpack the zip, and name the map file",
        )
    names = set()
    for entry in entries:
        name = entry.filename
        place = PurePosixPath(name)
        leaves = place.is_absolute() or ".." in place.parts or "\\" in name or ":" in name
        if leaves or "\0" in name or len(name) > 500 or stat.S_ISLNK(entry.external_attr >> 16):
            raise MapError(
                f"{path.name} holds a file with a path that leaves the zip: {name[:80]!r}",
                "a zip whose files have plain relative paths, and no links",
                "unpack the zip with care, and pack the map again",
            )
        if entry.flag_bits & 0x1:
            raise MapError(
                f"{path.name} is encrypted ({name[:80]!r})",
                "a zip without a password",
                "unpack the zip with its password, and name the map file",
            )
        if str(place).lower() in names:
            raise MapError(
                f"{path.name} holds {name[:80]!r} twice",
                "a zip in which each file has its own name",
                "unpack the zip, and name the map file",
            )
        names.add(str(place).lower())


def _is_hidden(entry: zipfile.ZipInfo) -> bool:
    """Whether a file is a remark of the system that packed the zip, such as ``.DS_Store``."""
    parts = PurePosixPath(entry.filename).parts
    return any(part == "__MACOSX" or (part[:1] == "." and part != "..") for part in parts)


def _maps(names: Sequence[str], suffixes: Sequence[str]) -> list[str]:
    """The maps among the files ``names``; a File GDB is the folder of its files."""
    known = tuple(suffix for suffix in suffixes if suffix not in (".zip", ".kmz", ".gdb"))
    geodatabases = {str(parent) for name in names if (parent := _geodatabase(name))}
    others = [name for name in names if name.lower().endswith(known) and _geodatabase(name) is None]
    return sorted({*geodatabases, *others})


def _geodatabase(name: str) -> PurePosixPath | None:
    """The folder of a File GDB in which the file ``name`` lies."""
    parents = PurePosixPath(name).parents
    return next((one for one in parents if one.name.lower().endswith(".gdb")), None)


def _choose(
    path: Path, maps: list[str], names: Sequence[str], request: Request
) -> tuple[str, Request]:
    """Choose the map of a zip; a layer that names the map is not a layer of the map itself."""
    from dataclasses import replace

    if not maps:
        raise MapError(
            f"{path.name} holds no map: {', '.join(names[:5])[:120] or 'it is empty'}",
            "a zip with a map file in it",
            "unpack the zip, and convert its data to GeoPackage or GeoJSON",
        )
    if request.layer is not None:
        named = [
            one
            for one in maps
            if request.layer in (one, PurePosixPath(one).name, _stem(PurePosixPath(one).name))
        ]
        if len(named) == 1:
            return named[0], replace(request, layer=None)
    if len(maps) == 1:
        return maps[0], request
    problem = "several maps" if request.layer is None else f"no map {request.layer!r}"
    raise _layer_error(path, problem, maps)


def _family(chosen: str, names: Sequence[str]) -> list[str]:
    """The files of a map: those with its name before the first dot, in the same folder, or all
    files of a File GDB."""
    if chosen.lower().endswith(".gdb"):
        return [name for name in names if name.startswith(chosen + "/")]
    place = PurePosixPath(chosen)
    stem = place.stem.lower()
    return [
        name
        for name in names
        if PurePosixPath(name).parent == place.parent
        and (PurePosixPath(name).name.lower() + ".").startswith(stem + ".")
    ]


def _stem(name: str) -> str:
    return name.split(".")[0]


def _layer_error(path: Path, problem: str, maps: Sequence[str]) -> MapError:
    return MapError(
        f"{path.name} holds {problem}",
        f"one map; the zip holds {', '.join(maps)}",
        f"name the map with {keyword('layer')}, or unpack the zip",
    )


def _bomb(path: Path, size: int | None) -> MapError:
    grown = f"{format_bytes(size)} when unpacked" if size else "more when unpacked than it says"
    return MapError(
        f"{path.name} has {grown}, and {format_bytes(path.stat().st_size)} now",
        f"a zip that grows by at most {DENSEST} times",
        "unpack the zip, and name the map file",
    )


@contextmanager
def _zip_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except _ERRORS as error:
        raise MapError(
            f"{path.name} cannot be unpacked: {reason_of(error)[:200] or type(error).__name__}",
            "a complete zip file",
            "download the file again; it may be cut off or damaged",
        ) from error
