"""Checks of outputs, range blocks and zooms before the work of a command; writing of files."""

import contextlib
import os
from collections.abc import Collection, Iterator
from math import gcd
from pathlib import Path

from evocity.errors import EvocityError, keyword, reason_of, setting
from evocity.files import whole_file

# Suffixes of files of three dimensions, which only `evocity scene` writes.
_SCENES = (".glb", ".obj", ".wrl", ".x3d")


def check_output(path: Path, source: str, suffixes: Collection[str] = ()) -> None:
    """Raise `EvocityError`, before any work, if ``path`` cannot be written, or is the
    ``source``."""
    if suffixes and path.suffix.lower() not in suffixes:
        first = "write a .tif, then: evocity scene FILE.tif -o " + path.name
        raise EvocityError(
            f"{path.name}: {path.suffix or 'a file without a suffix'} cannot be written here",
            f"a name that ends in {', '.join(sorted(suffixes))}",
            first if path.suffix.lower() in _SCENES else "choose another name after -o",
        )
    with report_write_errors(path), contextlib.suppress(FileNotFoundError, NotADirectoryError):
        os.stat(path)  # a loop of links, or a name that is too long
    if path.is_dir():
        raise EvocityError(
            f"{str(path)!r} is a folder",
            "the name of a file",
            "add the name of a file in this folder",
        )
    check_folder(path.parent)
    with contextlib.suppress(OSError):
        if path.samefile(source):
            raise EvocityError(
                f"the file {str(path)!r} is both the input and the output",
                "an output file that the command does not read",
                "choose another name after -o",
            )


def check_crs(crs: str | None, path: Path, suffixes: Collection[str]) -> None:
    """Raise `EvocityError` for a reference system ``crs`` if ``path`` has none of the ``suffixes``
    of files with coordinates, or if PROJ does not know it."""
    if crs is None:
        return
    if not path.name.lower().endswith(tuple(suffixes)):
        raise EvocityError(
            f"{path.name}: a {path.suffix} file has no coordinates for {setting('crs', crs)}",
            f"a file with the suffix {', '.join(suffixes)}",
            f"choose another suffix, or leave {keyword('crs')} out",
        )
    from evocity.io.export.reference_systems import parse_requested

    parse_requested(crs)


def check_needs(name: str, needed: str, missing: bool) -> None:
    """Raise `EvocityError` if the option ``needed`` by the option ``name`` is ``missing``."""
    if missing:
        raise EvocityError(
            f"{name} is given without {needed}",
            f"{name} only together with {needed}",
            f"add {needed}, or leave {name} out",
        )


def check_genome_output(path: Path, *sources: str) -> None:
    """`check_output` of a genome file. Raises `EvocityError` for the name of a map, too."""
    from evocity.io import suffixes

    for source in sources:
        check_output(path, source)
    maps = set(suffixes()) - {".parquet"}  # GeoParquet has the suffix of genomes
    if any(path.name.lower().endswith(suffix) for suffix in maps):
        raise EvocityError(
            f"{path.name} is the name of a map, not of a genome",
            "the name of a genome file, such as genome.parquet",
            "choose a name that ends in .parquet, or write a map with evocity decode",
        )


def check_folder(folder: Path) -> None:
    """Raise `EvocityError` unless this user can create files in ``folder``."""
    if not folder.is_dir():
        raise EvocityError(
            f"there is no folder {str(folder)!r}",
            "the name of a file in an existing folder",
            "create this folder first, or choose a file in another folder",
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise EvocityError(
            f"this user may not write in the folder {str(folder)!r}",
            "a folder in which this user may create files",
            "change the permissions of the folder, or choose another folder",
        )


@contextlib.contextmanager
def report_write_errors(path: Path) -> Iterator[None]:
    """Turn errors of the operating system, while ``path`` is written, into `EvocityError`."""
    try:
        yield
    except OSError as error:
        raise EvocityError(
            f"{str(path)!r} cannot be written: {reason_of(error)}",
            "enough free space, and a folder in which this user may create files",
            "check permissions and free space, or write to another folder",
        ) from error


@contextlib.contextmanager
def replace_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path that becomes ``path``, as in `whole_file`; raise `EvocityError`."""
    with report_write_errors(path), whole_file(path) as temporary:
        yield temporary


def check_block(city, block: int | tuple[int, int] | None) -> None:
    """Raise `EvocityError` if range blocks do not cover a map; it names options that do."""
    height, width = city.shape
    if block is None:
        return
    finest, block = (None, block) if isinstance(block, int) else block
    if block < 2 or not (height % block or width % block):
        return
    side = min(height, width) // block * block
    if finest is None:
        largest = min(height, width) // 2  # a domain block is at least twice as large
        fitting = [size for size in range(2, largest + 1) if gcd(height, width) % size == 0]
        near = min(fitting, key=lambda size: abs(size - block), default=None)
    else:
        from evocity.pavement.levels import halved_sides

        roots = [side for side in halved_sides(finest, block) if side > finest]
        root = next((side for side in roots if gcd(height, width) % side == 0), None)
        near = None if root is None else f"{finest}-{root}"
    options = [f"--pixels {side}"] * (side > 0) + [f"--block {near}"] * (near is not None)
    raise EvocityError(
        f"{city.name}: {height} × {width} px cannot be divided into range blocks of {block} px",
        f"a map whose sides are multiples of {block} px",
        f"give {' or '.join(options) or 'another window'}",
    )


def check_zoom(pavement, zoom: float) -> None:
    """Raise `EvocityError` if a genome of this ``pavement`` is too large at ``zoom``."""
    from evocity.citymap import MAX_PIXELS

    pixels = pavement.height * pavement.width * zoom**2
    if pixels > MAX_PIXELS:
        most = (MAX_PIXELS / (pavement.height * pavement.width)) ** 0.5
        raise EvocityError(
            f"{setting('zoom', zoom)} makes a map of {pixels / 1e6:.0f} million pixels",
            f"a map of at most {MAX_PIXELS // 10**6} million pixels",
            f"choose a zoom below {most:.0f}",
        )
