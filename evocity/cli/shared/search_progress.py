"""A search for `run` and `resume`: its progress, its end, its report."""

import contextlib
import sys
import time
from collections.abc import Callable, Mapping
from datetime import timedelta
from math import isnan
from pathlib import Path

import click

import evocity
from evocity.cli.shared.commands import RunFailed, message_of
from evocity.cli.shared.terminal import echo, note, note_heights, note_window, say, warn
from evocity.errors import RecipeError, RunError, plain_text

#: Seconds between two lines in a log file.
_BETWEEN_LINES = 10.0

#: Makes a `Search`; takes a function that shows what the search prepares.
Start = Callable[[Callable[[str], None]], "evocity.Search"]


def carry_out(start: Start, folder: Path, made: str = "") -> None:
    """Run a search in ``folder`` and write its report; print ``made`` once the folder exists.

    Raises `RunFailed`. Ctrl-C ends the program with exit code 130, SIGTERM with 143, SIGHUP with
    129.
    """
    from evocity.search.steering.stop_rules import signals_raise

    try:
        with signals_raise():
            _go_through(start, folder, made)
            _report(folder)
    except KeyboardInterrupt as error:
        if folder.is_dir():
            echo(f"Stopped. Go on with: evocity resume {folder}{_report_hint(folder)}", err=True)
        else:
            echo("Stopped before the first generation; no files were written.", err=True)
        click.get_current_context().exit(getattr(error, "exit_code", 130))


def _go_through(start: Start, folder: Path, made: str) -> None:
    show = LiveLine() if sys.stderr.isatty() else LogLines()
    started = False
    try:
        with show, start(show.prepared) as search:
            started = True
            search.observe(_command_printer())
            search.prepare()
            if made:
                say(made)
                _print_bound(folder, search.recipe)
            if search.finished:
                done = search.recipe.run.generations
                say(f"finished already at {done}/{done}; --generations N goes on")
            signs, noted = goal_signs(search.recipe), _print_notes(search, 0)
            for generation in search:
                noted = _print_notes(search, noted)
                if generation.number == 0:
                    _note_parents(folder, search.recipe)
                _print_estimate(folder, search, generation)
                show(progress_line(generation, search.recipe.run.generations, signs))
            if search.asked_to_stop:
                say(f"stopped on request; go on with: evocity resume {folder}")
            elif search.stopped_by is not None:
                reason = search.stopped_by
                say(f"stopped: {reason.words}; {_continuation(reason, folder)}")
    except RunError as error:
        if not started:
            raise  # the folder is unusable: the input is at fault
        raise RunFailed(message_of(error, click.get_current_context().command)) from error
    finally:
        if started:
            _print_failures(folder)


def _continuation(reason, folder: Path) -> str:
    """How to go on after a stop of the recipe's."""
    resume = f"go on with: evocity resume {folder}"
    return resume if reason.by == "until" else f"{resume}, and {reason.remedy}"


def _command_printer():
    """An observer that prints commands, failed notifications, differing births, retries, and that
    a run has no workers."""
    from evocity.search import Observer
    from evocity.search.record.commands import ASIDE, DONE, REFUSED, command_of
    from evocity.search.record.complete_run import DIFFERS, describe_differences
    from evocity.search.steering.notification import NOTIFIED

    class CommandPrinter(Observer):
        differed = False

        def event(self, event: str, details: dict) -> None:
            if event == DONE:
                words = command_of(details).words
                say(f"as requested, from generation {details['generation']} on: {words}")
            if event == REFUSED:
                note(f"a command was refused: {details['reason']}")
            if event == ASIDE:
                note(f"commands.jsonl has too many commands; it was moved to {details['file']}")
            if event == NOTIFIED and details["code"] != 0:
                how = details.get("reason") or f"exit code {details['code']}"
                note(f"notify.{details['on']} failed: {how}; {details['output']}".strip("; "))
            if event == DIFFERS and not self.differed:
                self.differed = True
                differs = describe_differences(details["differs"])
                note(f"birth {details['id']} differs when replayed: {differs}")
            if event == "retry":
                note(details["reason"])
            if details.get("protected") is False:  # at the start, and when the run goes on
                note(
                    "workers = 0: a measure that hangs, crashes or changes the process harms all "
                    "births"
                )

    return CommandPrinter()


def _report(folder: Path) -> None:
    from evocity.report import write_report

    try:
        report = write_report(folder)
    except Exception as error:
        raise RunFailed(
            f"the report could not be written ({type(error).__name__}: {error})\n"
            f"  The run's data are safe in {folder}; try again with: evocity report {folder}"
        ) from error
    echo(f"run:    {folder}")
    echo(f"report: {report}")


def _report_hint(folder: Path) -> str:
    """How to see a stopped run; empty if no generation is whole."""
    with contextlib.suppress(RunError):
        if evocity.open_run(folder).generations:
            return f"; see its results with: evocity report {folder}"
    return ""


def _print_notes(search, already: int) -> int:
    """Print the search's notes but the first ``already``; return how many it has now."""
    for text in search.notes[already:]:
        note(text)
    return len(search.notes)


def _note_parents(folder: Path, recipe) -> None:
    """Say which parents have default heights, and whose windows are mostly empty."""
    with contextlib.suppress(RunError):
        sources = evocity.open_run(folder).sources()
        for source, parent in zip(sources, recipe.parents, strict=True):
            chosen = "default_height" in parent.model_fields_set
            key = "" if chosen else "default_height in its [[parents]]"
            note_heights(source.city, parent.default_height, key)
            note_window(source.city, "center in [[parents]], and [map], choose")


def _print_bound(folder: Path, recipe) -> None:
    """Print the most that the run will take, before it begins."""
    from evocity.search.steering.estimate import describe_bound

    with contextlib.suppress(OSError):  # an estimate ends no run
        say(f"planned: {describe_bound(folder, recipe)}")


def _print_estimate(folder: Path, search, generation) -> None:
    """Print once how much of the disk the run will take, and how long."""
    from evocity.search.steering.estimate import estimate_of, first_representative

    if generation.number != first_representative(search.recipe):
        return
    search.flush()
    with contextlib.suppress(OSError):  # an estimate ends no run
        estimate = estimate_of(folder, search.recipe, generation)
        if estimate is not None:
            say(f"estimate: {estimate.words}")
            if estimate.warning:
                warn(estimate.warning)


def _print_failures(folder: Path) -> None:
    """Print the kinds of failures, measures without values, and whether births repeat."""
    from evocity.analysis.failed_births import failures, repeated, unrecorded

    with contextlib.suppress(RunError):  # no generation was whole
        run = evocity.open_run(folder)
        for kind in failures(run):
            echo(f"failed: {kind}", err=True)
        if text := unrecorded(run):
            echo(f"not recorded in {text}", err=True)
        if text := repeated(run):
            note(f"{text}: few street blocks can change. A window of more pixels has more")


def goal_signs(recipe) -> dict[str, str]:
    """The goal by measure: ↑ more, ↓ less, →0.35 a target, →CITY, and bounds, ≥0.2 ≤0.4."""
    signs = {}
    for entry in recipe.fitness:
        bounds = ("≥", entry.min), ("≤", entry.max)
        limits = [f"{sign}{bound:.4g}" for sign, bound in bounds if bound is not None]
        for measure in entry.measures:
            goal = {"max": "↑", "min": "↓"}.get(entry.goal or measure.goal, "")
            target = entry.like if entry.target is None else f"{entry.target:.4g}"
            aim = goal if target is None else f"→{target}"
            signs[measure.name] = " ".join([aim] * entry.is_objective + limits).strip()
    return signs


def progress_line(generation, last: int, signs: Mapping[str, str]) -> str:
    """Describe a ``generation`` of 0…``last`` in one line, with `goal_signs`."""
    left = timedelta(seconds=round(generation.seconds_left))
    living, feasible = len(generation.population), generation.feasible
    kept = [f"{feasible} of {living} living keep the constraints"] if feasible < living else []
    parts = [
        f"generation {generation.number}/{last}",
        f"{generation.births} births",
        f"{generation.failures} failed",
        f"{generation.evaluations_per_second:.1f} evaluations/s",
        *kept,
        *([] if isnan(generation.hypervolume) else [f"hypervolume {generation.hypervolume:.4g}"]),
        *(f"{name} {_volume(island)}" for name, island in generation.islands.items()),
        *(f"{name.replace('_', ' ')} {value:.4g}" for name, value in generation.algorithm.items()),
        "best "
        + ", ".join(
            f"{name} {value:.4g} {signs.get(name, '')}".rstrip()
            for name, value in generation.best.items()
        ),
        f"{left} left",
    ]
    return " · ".join(parts)


def _volume(island: Mapping) -> str:
    """The hypervolume of an ``island``, and the share of its grid that is filled, if it has one."""
    volume, coverage = island["hypervolume"], island["algorithm"].get("coverage")
    filled = "" if coverage is None else f" ({100 * coverage:.0f} % filled)"
    return ("–" if volume is None else f"{volume:.4g}") + filled


@contextlib.contextmanager
def blame_options(**given: object):
    """Attribute a recipe's faults, within, to the ``given`` options that caused them."""
    try:
        yield
    except RecipeError as error:
        header, *faults = error.found.split("\n  ")
        keys = {
            f"{section}.{name}: ": f"--{name.replace('_', '-')} "
            for name in given
            if given[name] is not None
            for section in ("run", "evaluation", "map", "stop")
        }
        named = [
            next((o + fault[len(key) :] for key, o in keys.items() if fault.startswith(key)), fault)
            for fault in faults
        ]
        blamed = sum(fault.startswith("--") for fault in named)
        if not blamed:
            raise
        if blamed < len(named):
            expected, remedy = error.expected, "correct these options and keys"
        else:
            header, remedy = "the command line is at fault:", "correct these options"
            expected = "the values named after each option"
        raise RecipeError("\n  ".join([header, *named]), expected, remedy) from error


class LiveLine:
    """One line that changes, on a terminal."""

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

        self._spinner.update(text=Text(plain_text(line)))

    prepared = __call__

    def __exit__(self, *_) -> None:
        self._live.stop()


class LogLines:
    """Plain lines in a log file: the first, the last, and one every few seconds between."""

    def __enter__(self) -> "LogLines":
        self._held: str | None = None
        self._next = 0.0
        return self

    def __call__(self, line: str) -> None:
        self._held = line
        if time.monotonic() >= self._next:
            self._print()

    def prepared(self, text: str) -> None:
        echo(f"{text} …", err=True)

    def __exit__(self, *_) -> None:
        if self._held is not None:
            self._print()

    def _print(self) -> None:
        echo(self._held, err=True)
        self._held, self._next = None, time.monotonic() + _BETWEEN_LINES
