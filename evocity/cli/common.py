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

from evocity.errors import EvocityError, RecipeError, plain_text, told_by

# The faults of a recipe are told all at once, as far as anyone reads them, bytes.
_LONGEST_LIST = 20_000


def echo(text: str = "", err: bool = False) -> None:
    """Print a line, or several: whatever a file called its city or its measure, a terminal obeys
    none of it, see `plain_text`. All that commands print goes through here."""
    click.echo(plain_text(text, "\n"), err=err)


class InputFault(click.ClickException):
    """The user's input is at fault: a message, no traceback, exit code 2."""

    exit_code = 2


class RunFailed(click.ClickException):
    """The run failed: a message, no traceback, exit code 1."""

    exit_code = 1


class Commands(click.Group):
    """Commands in the order of use; input at fault ends any of them with exit code 2."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def invoke(self, ctx: click.Context):
        # its threads look for work, on all cores, long after a product of a few numbers
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        try:
            return super().invoke(ctx)
        except EvocityError as error:
            command = self.commands[ctx.invoked_subcommand]
            raise InputFault(told(error, command)) from error
        except KeyboardInterrupt as error:  # or another signal, which knows its exit code
            echo("\nStopped.", err=True)
            ctx.exit(getattr(error, "exit_code", 130))


def told(error: EvocityError, command: click.Command) -> str:
    """The message of an ``error``, in the terms of the ``command``: its options in place of the
    library's parameters, and each part on one line, whatever a measure of the user's own raised."""
    parts = [_in_options(str(part), command) for part in error.args]
    if isinstance(error, RecipeError):  # its faults stand in lines of their own
        return RecipeError(*parts).listed(_LONGEST_LIST)
    return str(EvocityError(*(" ".join(part.split()) for part in parts)))


def _in_options(text: str, command: click.Command) -> str:
    """``text`` with the parameters marked in it as they are typed for the ``command``; nothing
    else of it changes."""
    options = {p.name: p for p in command.params if isinstance(p, click.Option)}
    by_recipe = any(p.name == "recipe" for p in command.params)  # there, maps are read by its keys

    def typed(name: str, joint: str, value: str) -> str:
        if name in options:
            return _as_typed(options[name], value) if joint else _none_of(options[name])
        if by_recipe and name in _MAP_OPTIONS:
            section = "[map]" if name in ("pixels", "metres_per_pixel") else "[[parents]]"
            return _as_key(name, value, section)
        return f"{name if joint else ''}{joint}{value}"

    return told_by(text, typed)


def _none_of(option: click.Option) -> str:
    """How an ``option`` says what None says in Python."""
    return "all" if option.name == "reach" else "nothing"


def _as_typed(option: click.Option, value: str) -> str:
    """``option`` and a ``value`` of Python's as they are typed: 4.8 45.7, or 16,20."""
    typed = max(option.opts, key=len)
    values = [part.strip() for part in value.strip("()[]").split(",") if part.strip()]
    if option.is_flag or not values:
        return typed
    joint = " " if option.nargs > 1 else "-" if option.type.name == "sides" else ","
    return f"{typed} {joint.join(values)}"


def _as_key(name: str, value: str, section: str) -> str:
    """A keyword and a ``value`` of Python's as a recipe has them."""
    value = value.replace("(", "[").replace(")", "]")
    return f"{name} = {value} in {section}" if value else f"{name} in {section}"


# Files of three dimensions, which `evocity scene` alone writes.
_SCENES = (".glb", ".obj", ".wrl", ".x3d")

_MAP_OPTIONS = {
    "pixels": click.option(
        "--pixels",
        type=int,
        show_default="256 for footprints, a raster's own size",
        help="Side of the square window, pixels.",
    ),
    "metres_per_pixel": click.option(
        "--metres-per-pixel",
        type=float,
        show_default="2.0 for footprints, a GeoTIFF's own; PNG and NPY need it",
        help="Side of a pixel, metres.",
    ),
    "center": click.option(
        "--center",
        type=float,
        nargs=2,
        metavar="LON LAT",
        show_default="the file's own window, or the middle of the buildings",
        help="Centre of the window, degrees, longitude first.",
    ),
    "layer": click.option(
        "--layer",
        show_default="the one of the buildings, if it can be told",
        help="Layer of a GeoPackage.",
    ),
    "default_height": click.option(
        "--default-height",
        type=float,
        show_default="6.0",
        help="Metres of a building whose height the file does not tell.",
    ),
    "height_scale": click.option(
        "--height-scale",
        type=float,
        show_default="1 for GeoTIFF and NPY; PNG needs it",
        help="Metres of one grey level or unit of a raster.",
    ),
    "attribution": click.option(
        "--attribution",
        metavar="TEXT",
        show_default="what the file says",
        help="The line that the licence of a file's source asks for; it goes with all that is made "
        "of the map. Bundled districts keep their own.",
    ),
}
#: Of these, the ones that several files may have in common.
FILE_OPTIONS = [_MAP_OPTIONS[key] for key in ("layer", "default_height", "height_scale")]


def map_options(command: Callable) -> Callable:
    """Add the options of `evocity.read_map`; those given arrive as the mapping ``reading``."""

    @functools.wraps(command)
    def gathered(**given):
        reading = {key: given.pop(key) for key in _MAP_OPTIONS}
        return command(reading={k: v for k, v in reading.items() if v is not None}, **given)

    for option in reversed(_MAP_OPTIONS.values()):
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


count_option = click.option(
    "--count",
    type=click.Choice(["pixels", "domains", "ranges"]),
    show_default="pixels",
    help="What is counted: calls of each pixel; of the most called domain block that holds it; "
    "of the domain block that its range block is made of.",
)


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
        first = "write a .tif, then: evocity scene FILE.tif -o " + path.name
        raise EvocityError(
            f"{path.name}: {path.suffix or 'a file without a suffix'} cannot be written here",
            f"a name that ends in {', '.join(sorted(suffixes))}",
            first if path.suffix.lower() in _SCENES else "choose another name after -o",
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


def print_json(document: Mapping, indent: int | None = 2) -> None:
    """Print one JSON document; NaN and infinities, which JSON lacks, become null."""
    echo(json.dumps(_finite(document), indent=indent, allow_nan=False))


def _finite(value):
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_table(rows: list[tuple[str, ...]]) -> None:
    """Print columns side by side, each as wide as its widest entry; the first row heads them."""
    rows = [tuple(map(plain_text, row)) for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        echo("  ".join(cells).rstrip())


def describe(city) -> str:
    """A map in one line."""
    height, width = city.shape
    return (
        f"{city.name}: {height} × {width} px at {city.metres_per_pixel:g} m, "
        f"built on {city.built.mean():.2f}, highest {city.heights.max():.1f} m"
    )


def near(path: str) -> str:
    """A ``path`` as it would be typed here, if it lies below."""
    with contextlib.suppress(ValueError):  # on another drive
        relative = os.path.relpath(path)
        return path if relative.startswith("..") else relative
    return path


def warn(text: str) -> None:
    echo(f"Warning: {text}", err=True)


def note(text: str) -> None:
    """One line on standard error about what was taken for granted."""
    print(f"Note: {plain_text(text)}", file=sys.stderr)  # click.echo would write into a live line


def note_compiling() -> None:
    """From now on, say once on standard error if this command waits for kernels to be compiled."""
    from evocity.accelerate import on_compiling

    said = []

    def once() -> None:
        if not said:
            said.append(True)
            note("kernels are compiled, once on this machine; that may take a minute")

    click.get_current_context().with_resource(on_compiling(once))


def note_reading(city, reading: Mapping[str, object]) -> None:
    """Say what of its file a map just read is, which heights were invented, and if its window is
    mostly empty."""
    from evocity.io import Request

    note(f"{city.name}: {city.taken}")
    height = reading.get("default_height")
    otherwise = "" if height else "; --default-height says otherwise"
    note_heights(city, height or Request.default_height, otherwise)
    note_window(city, "--center, --pixels and --metres-per-pixel choose")


def note_window(city, chosen_by: str) -> None:
    """Say if most of a map of footprints lies outside its buildings' extent; ``chosen_by`` tells
    what chooses the window."""
    if not (city.height_rules and city.built.any()):
        return
    tall, wide = (_extent(city.built.any(axis=axis)) for axis in (1, 0))
    if 2 * tall * wide < city.built.size:
        height, width = city.shape
        note(
            f"{city.name}: its buildings take up {wide} × {tall} of {width} × {height} px; "
            f"{chosen_by} another window"
        )


def note_heights(city, height: float, otherwise: str) -> None:
    """Say how many buildings of a map have an invented ``height``; ``otherwise`` ends the line."""
    invented, count = city.height_rules.get("default", 0), sum(city.height_rules.values())
    if invented:
        alike = ", by which those that touch are one building" if invented > 1 else ""
        note(
            f"{city.name}: {invented} of {count} buildings have no height in the source: "
            f"{height:g} m taken{alike}{otherwise}"
        )


def _extent(filled) -> int:
    """From the first to the last true entry of a bool ``(n,)``, both included."""
    return int(len(filled) - filled[::-1].argmax() - filled.argmax())


@contextlib.contextmanager
def quiet_stdout() -> Iterator[None]:
    """What measures of the user's own print, or compiled code beneath them writes, goes to
    standard error: standard output is ours."""
    sys.stdout.flush()
    with contextlib.redirect_stdout(sys.stderr), contextlib.ExitStack() as undone:
        with contextlib.suppress(OSError):  # there may be no such descriptors
            kept = os.dup(1)
            undone.callback(os.close, kept)
            os.dup2(2, 1)
            undone.callback(os.dup2, kept, 1)
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
