"""What several commands share: options of maps, checks of outputs, printing."""

import contextlib
import functools
import json
import math
import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path

import click

import evocity
from evocity.errors import EvocityError


class InputFault(click.ClickException):
    """The user's input is at fault: a message, no traceback, exit code 2."""

    exit_code = 2


class RunFailed(click.ClickException):
    """The run failed: a message, no traceback, exit code 1."""

    exit_code = 1


_MAP_OPTIONS = (
    click.option(
        "--pixels",
        type=int,
        show_default="256 for footprints, a raster's own size",
        help="Side of the square window, pixels.",
    ),
    click.option(
        "--metres-per-pixel",
        type=float,
        show_default="2.0 for footprints, a GeoTIFF's own; PNG and NPY need it",
        help="Side of a pixel, metres.",
    ),
    click.option(
        "--center",
        type=float,
        nargs=2,
        metavar="LON LAT",
        show_default="the file's own window, or the middle of the buildings",
        help="Centre of the window, degrees, longitude first.",
    ),
    click.option(
        "--layer",
        show_default="the one of the buildings, if it can be told",
        help="Layer of a GeoPackage.",
    ),
    click.option(
        "--default-height",
        type=float,
        show_default="6.0",
        help="Metres of a building whose height the file does not tell.",
    ),
    click.option(
        "--height-scale",
        type=float,
        show_default="1 for GeoTIFF and NPY; PNG needs it",
        help="Metres of one grey level or unit of a raster.",
    ),
)
_MAP_KEYS = ("pixels", "metres_per_pixel", "center", "layer", "default_height", "height_scale")


def map_options(command: Callable) -> Callable:
    """Add the options of `evocity.read_map`; those given arrive as the mapping ``reading``."""

    @functools.wraps(command)
    def gathered(**given):
        reading = {key: given.pop(key) for key in _MAP_KEYS}
        return command(reading={k: v for k, v in reading.items() if v is not None}, **given)

    for option in reversed(_MAP_OPTIONS):
        gathered = option(gathered)
    return gathered


def output_option(metavar: str, text: str) -> Callable:
    """``-o``: the file to write, required."""
    return click.option(
        "-o", "--output", required=True, type=click.Path(path_type=Path), metavar=metavar, help=text
    )


json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print one JSON document and nothing else; null where a number is not finite.",
)


def is_genome(source: str) -> bool:
    """Whether a file is meant to be a genome: Parquet by its name or by its first bytes."""
    path = Path(source)
    if path.suffix.lower() == ".parquet":
        return True
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():
            with open(path, "rb") as file:
                return file.read(4) == b"PAR1"
    return False


def city_of(source: str, reading: Mapping[str, object]):
    """The map in a map file, of a bundled name, or the one a genome file decodes to."""
    if not is_genome(source):
        return evocity.read_map(source, **reading)
    if reading:
        given = ", ".join("--" + key.replace("_", "-") for key in reading)
        raise EvocityError(
            f"{given} with the genome {source}",
            "no options of reading: a genome knows its own size and heights",
            f"leave {given} out, or encode the map again with it",
        )
    return converged(evocity.decode(evocity.read_genome(source)), source).city


def converged(decoding, source: str):
    """The ``decoding``; told on standard error if its last step still changed the map."""
    if not decoding.converged:
        warn(
            f"{source} did not converge in {decoding.iterations} steps: "
            f"the last one moved a pixel by {decoding.change:.3g} m"
        )
    return decoding


def check_output(path: Path, source: str, suffixes: Collection[str] = ()) -> None:
    """Raise, before any work is done, if the file ``path`` cannot be written.

    ``source`` is what the command reads, which is never overwritten; ``suffixes`` are those
    ``path`` may end in, any if there are none.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise EvocityError(
            f"{path.name}: {path.suffix or 'a file without a suffix'} cannot be written here",
            f"a name that ends in {', '.join(sorted(suffixes))}",
            "choose another name after -o",
        )
    if path.is_dir():
        raise EvocityError(
            f"{str(path)!r} is a folder", "a file name", "add the name of a file in that folder"
        )
    check_folder(path.parent)
    with contextlib.suppress(OSError):
        if path.samefile(source):
            raise EvocityError(
                f"{str(path)!r} is both read and written",
                "an output other than the input",
                "choose another name after -o",
            )


def check_folder(folder: Path) -> None:
    """Raise unless files can be made in ``folder``."""
    if not folder.is_dir():
        raise EvocityError(
            f"there is no folder {str(folder)!r}",
            "a file name in an existing folder",
            "make that folder first, or choose another name",
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise EvocityError(
            f"nothing may be written in the folder {str(folder)!r}",
            "a folder this user may write to",
            "change its permissions, or choose another one",
        )


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Explain what the operating system says while ``path`` is written."""
    try:
        yield
    except OSError as error:
        raise EvocityError(
            f"{str(path)!r} cannot be written: {error.strerror or error}",
            "a folder this user may write to, with room left",
            "check permissions and free space, or choose another place",
        ) from error


def print_json(document: Mapping) -> None:
    """Print one JSON document; NaN and infinities, which JSON lacks, become null."""
    click.echo(json.dumps(_finite(document), indent=2, allow_nan=False))


def _finite(value):
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_table(rows: list[tuple[str, ...]]) -> None:
    """Print columns side by side, each as wide as its widest entry; the first row heads them."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        click.echo("  ".join(cells).rstrip())


def describe(city) -> str:
    """A map in one line."""
    height, width = city.shape
    return (
        f"{city.name}: {height} × {width} px at {city.metres_per_pixel:g} m, "
        f"built on {city.built.mean():.2f}, highest {city.heights.max():.1f} m"
    )


def warn(text: str) -> None:
    click.echo(f"Warning: {text}", err=True)


@contextlib.contextmanager
def quiet_stdout() -> Iterator[None]:
    """What measures of the user's own print goes to standard error: standard output is ours."""
    with contextlib.redirect_stdout(sys.stderr):
        yield


@contextlib.contextmanager
def progress_bar(text: str) -> Iterator[Callable[[int, int], None] | None]:
    """On a terminal, a bar on standard error fed with (done, of how many); else None."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
