"""Printing: lines, tables, JSON, notes and warnings, progress; standard output kept clean."""

import contextlib
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping

import click

from evocity.errors import plain_text

# -- standard output ---------------------------------------------------------------------------


def echo(text: str = "", err: bool = False) -> None:
    """Print lines without control characters: a name in a file must not steer the terminal."""
    click.echo(plain_text(text, "\n"), err=err)


def print_json(document: Mapping | list, indent: int | None = 2) -> None:
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
    """Describe a map in one line."""
    height, width = city.shape
    return (
        f"{city.name}: {height} × {width} px at {city.metres_per_pixel:g} m, "
        f"built on {city.built.mean():.2f}, highest {city.heights.max():.1f} m"
    )


def relative_path(path: str) -> str:
    """Return a ``path`` below the working folder as relative, any other as it is."""
    with contextlib.suppress(ValueError):  # on another drive
        relative = os.path.relpath(path)
        return path if relative.startswith("..") else relative
    return path


@contextlib.contextmanager
def quiet_stdout() -> Iterator[None]:
    """Send what measures and compiled code print to standard error, not to standard output."""
    sys.stdout.flush()
    with contextlib.redirect_stdout(sys.stderr), contextlib.ExitStack() as undo:
        with contextlib.suppress(OSError):  # there may be no such descriptors
            kept = os.dup(1)
            undo.callback(os.close, kept)
            os.dup2(2, 1)
            undo.callback(os.dup2, kept, 1)
        yield


# -- standard error ----------------------------------------------------------------------------


def say(text: str) -> None:
    """Print one line on standard error, above a line that changes, if there is one."""
    print(plain_text(text), file=sys.stderr)  # click.echo would write into that line


def note(text: str) -> None:
    """Print a note on what the command assumed."""
    say(f"Note: {text}")


def warn(text: str) -> None:
    """Print a warning."""
    echo(f"Warning: {text}", err=True)


def note_compiling() -> None:
    """From now on, say once if this command waits for the compilation of kernels."""
    from evocity.accelerate import watch_compiling

    noted = []

    def once() -> None:
        if not noted:
            noted.append(True)
            note("compiling kernels, once on this machine; that may take a minute")

    click.get_current_context().with_resource(watch_compiling(once))


def note_reading(city, reading: Mapping[str, object]) -> None:
    """Say what part of its file a map shows, and note default heights and empty windows."""
    from evocity.io import Request

    note(f"{city.name}: {city.taken}")
    height = reading.get("default_height")
    note_heights(city, height or Request.default_height, "" if height else "--default-height")
    note_window(city, "--center, --pixels and --metres-per-pixel choose")


def note_window(city, chosen_by: str) -> None:
    """Say if a window lies mostly beyond the buildings; ``chosen_by`` names what chooses it."""
    if not (city.height_rules and city.built.any()):
        return
    tall, wide = (_extent(city.built.any(axis=axis)) for axis in (1, 0))
    if 2 * tall * wide < city.built.size:
        height, width = city.shape
        note(
            f"{city.name}: its buildings take up {wide} × {tall} of {width} × {height} px; "
            f"{chosen_by} another window"
        )


def note_heights(city, height: float, changed_by: str) -> None:
    """Say how many buildings have the default ``height``; ``changed_by`` names its option."""
    invented, count = city.height_rules.get("default", 0), sum(city.height_rules.values())
    if invented:
        alike = "; those that touch become one building" if invented > 1 else ""
        change = f"; {changed_by} changes it" if changed_by else ""
        note(
            f"{city.name}: {invented} of {count} buildings have no height in the source and get "
            f"{height:g} m{alike}{change}"
        )


def _extent(filled) -> int:
    """From the first to the last true entry of a bool ``(n,)``, both included."""
    return int(len(filled) - filled[::-1].argmax() - filled.argmax())


@contextlib.contextmanager
def progress_bar(text: str) -> Iterator[Callable[[int, int], None] | None]:
    """On a terminal, yield a function of (done, total) that updates a bar; elsewhere None."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
