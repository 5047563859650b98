"""A search carried out for `run` and `resume`: its progress, its end, its report."""

import sys
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import click

import evocity
from evocity.cli.common import RunFailed
from evocity.errors import RunError

#: In a log file, seconds between two lines.
_BETWEEN_LINES = 10.0

#: Makes a `Search`, given whom to tell what is prepared.
Start = Callable[[Callable[[str], None]], "evocity.Search"]


def carry_out(start: Start, folder: Path) -> None:
    """Go through all generations of a search, kept in ``folder``, then write the report.

    Raises `RunFailed` if the run fails on its way or the report cannot be written; Ctrl-C ends
    the program with exit code 130.
    """
    try:
        _go_through(start)
        _report(folder)
    except KeyboardInterrupt:
        if folder.is_dir():
            click.echo(f"Stopped. Go on with: evocity resume {folder}", err=True)
        else:
            click.echo("Stopped before the first generation; nothing was written.", err=True)
        click.get_current_context().exit(130)


def _go_through(start: Start) -> None:
    show = LiveLine() if sys.stderr.isatty() else LogLines()
    started = False
    try:
        with show, start(show.prepared) as search:
            started = True
            for generation in search:
                show(progress_line(generation, search.recipe.run.generations))
    except RunError as error:
        if not started:
            raise  # the folder cannot be used: the input is at fault
        raise RunFailed(str(error)) from error


def _report(folder: Path) -> None:
    from evocity.report import write_report

    try:
        report = write_report(folder)
    except Exception as error:
        raise RunFailed(
            f"the report could not be written ({type(error).__name__}: {error})\n"
            f"  The run's data are safe in {folder}; to try again: evocity resume {folder}"
        ) from error
    click.echo(f"run:    {folder}")
    click.echo(f"report: {report}")


def progress_line(generation, last: int) -> str:
    """Where a search is, in one line: ``generation`` as `Search` yields it, of 0…``last``."""
    left = timedelta(seconds=round(generation.seconds_left))
    parts = [
        f"generation {generation.number}/{last}",
        f"{generation.births} births",
        f"{generation.failures} failed",
        f"{generation.evaluations_per_second:.1f} evaluations/s",
        f"hypervolume {generation.hypervolume:.4g}",
        "best " + ", ".join(f"{name} {value:.4g}" for name, value in generation.best.items()),
        f"{left} left",
    ]
    return " · ".join(parts)


class LiveLine:
    """On a terminal: one line that changes."""

    def __enter__(self) -> "LiveLine":
        from rich.console import Console
        from rich.live import Live
        from rich.spinner import Spinner

        self._spinner = Spinner("dots", text="starting …")
        self._live = Live(self._spinner, console=Console(stderr=True), refresh_per_second=8)
        self._live.start()
        return self

    def __call__(self, line: str) -> None:
        from rich.text import Text

        self._spinner.update(text=Text(line))

    prepared = __call__

    def __exit__(self, *_) -> None:
        self._live.stop()


class LogLines:
    """In a log file: plain lines, the first and the last and one every few seconds between."""

    def __enter__(self) -> "LogLines":
        self._held: str | None = None
        self._next = 0.0
        return self

    def __call__(self, line: str) -> None:
        self._held = line
        if time.monotonic() >= self._next:
            self._print()

    def prepared(self, text: str) -> None:
        click.echo(f"{text} …", err=True)

    def __exit__(self, *_) -> None:
        if self._held is not None:
            self._print()

    def _print(self) -> None:
        click.echo(self._held, err=True)
        self._held, self._next = None, time.monotonic() + _BETWEEN_LINES
