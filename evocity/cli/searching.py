"""A search carried out for `run` and `resume`: its progress, its end, its report."""

import contextlib
import sys
import time
from collections.abc import Callable, Mapping
from datetime import timedelta
from math import isnan
from pathlib import Path

import click

import evocity
from evocity.cli.common import RunFailed, echo, note, note_heights, note_window, told, warn
from evocity.errors import RecipeError, RunError, plain_text

#: In a log file, seconds between two lines.
_BETWEEN_LINES = 10.0

until_option = click.option(
    "--until",
    metavar="HH:MM",
    show_default="the recipe's",
    help="End after the generation in which it becomes that time of the day, or that date with a "
    'time ("2026-11-25T07:00"); none: never.',
)


def cluster_option(default: str) -> Callable:
    """``--cluster``, which is ``default`` unless given."""
    return click.option(
        "--cluster",
        metavar="ADDRESS",
        show_default=default,
        help='Dask cluster that evaluates: the scheduler\'s address, such as "tcp://host:8786", or '
        '"local:N" for N workers on this machine; --workers is then the processes that each of its '
        "workers hosts, one a thread unless given. none: no cluster. The result does not depend "
        "on it.",
    )


#: Makes a `Search`, given whom to tell what is prepared.
Start = Callable[[Callable[[str], None]], "evocity.Search"]


def carry_out(start: Start, folder: Path, made: str = "") -> None:
    """Go through all generations of a search, kept in ``folder``, then write the report.
    ``made`` is said once the folder is there.

    Raises `RunFailed` if the run fails on its way or the report cannot be written; Ctrl-C ends
    the program with exit code 130, SIGTERM with 143 and SIGHUP with 129.
    """
    from evocity.search.signals import signals_raise

    try:
        with signals_raise():
            _go_through(start, folder, made)
            _report(folder)
    except KeyboardInterrupt as error:
        if folder.is_dir():
            echo(f"Stopped. Go on with: evocity resume {folder}{_look(folder)}", err=True)
        else:
            echo("Stopped before the first generation; nothing was written.", err=True)
        click.get_current_context().exit(getattr(error, "exit_code", 130))


def _go_through(start: Start, folder: Path, made: str) -> None:
    show = LiveLine() if sys.stderr.isatty() else LogLines()
    started = False
    try:
        with show, start(show.prepared) as search:
            started = True
            search.observe(_commands_told())
            search.prepare()
            if made:
                _say(made)
                _tell_bound(folder, search.recipe)
            if search.finished:
                done = search.recipe.run.generations
                _say(f"finished already at {done}/{done}; --generations N goes on")
            signs, noted = goal_signs(search.recipe), _note(search, 0)
            for generation in search:
                noted = _note(search, noted)
                if generation.number == 0:
                    _note_parents(folder, search.recipe)
                _tell_estimate(folder, search, generation)
                show(progress_line(generation, search.recipe.run.generations, signs))
            if search.asked_to_stop:
                _say(f"stopped, as it was asked to; go on with: evocity resume {folder}")
            elif search.stopped_by is not None:
                _say(f"stopped: {search.stopped_by.words}; {_how_on(search.stopped_by, folder)}")
    except RunError as error:
        if not started:
            raise  # the folder cannot be used: the input is at fault
        raise RunFailed(told(error, click.get_current_context().command)) from error
    finally:
        if started:
            _tell_failures(folder)


def _how_on(reason, folder: Path) -> str:
    """How to go on after a stop of the recipe's."""
    go_on = f"go on with: evocity resume {folder}"
    return go_on if reason.by == "until" else f"{go_on}, and {reason.remedy}"


def _commands_told():
    """An observer that says which commands were carried out, which were refused, and what is done
    again."""
    from evocity.search import Observer
    from evocity.search.commands import DONE, REFUSED, command_of
    from evocity.search.differing import DIFFERS, in_words
    from evocity.search.notifying import NOTIFIED

    class Told(Observer):
        differed = False

        def event(self, event: str, details: dict) -> None:
            if event == DONE:
                _say(f"as asked, from generation {details['generation']} on: {_words(details)}")
            if event == REFUSED:
                note(f"a command was refused: {details['reason']}")
            if event == NOTIFIED and details["code"] != 0:
                how = details.get("reason") or f"exit code {details['code']}"
                note(f"notify.{details['on']} failed: {how}; {details['output']}".strip("; "))
            if event == DIFFERS and not self.differed:
                self.differed = True
                note(f"birth {details['id']} differs when replayed: {in_words(details['differs'])}")
            if event == "retry":
                note(details["reason"])

    def _words(details: dict) -> str:
        return command_of(details).words

    return Told()


def _say(text: str) -> None:
    print(plain_text(text), file=sys.stderr)  # click.echo would write into a live line


def _report(folder: Path) -> None:
    from evocity.report import write_report

    try:
        report = write_report(folder)
    except Exception as error:
        raise RunFailed(
            f"the report could not be written ({type(error).__name__}: {error})\n"
            f"  The run's data are safe in {folder}; to try again: evocity report {folder}"
        ) from error
    echo(f"run:    {folder}")
    echo(f"report: {report}")


def _look(folder: Path) -> str:
    """How to see a run that was stopped; nothing if no generation is whole."""
    with contextlib.suppress(RunError):
        if evocity.open_run(folder).generations:
            return f"; see what it has with: evocity report {folder}"
    return ""


def _note(search, already: int) -> int:
    """Say what the search notes but the first ``already``; how many notes it has now."""
    for text in search.notes[already:]:
        note(text)
    return len(search.notes)


def _note_parents(folder: Path, recipe) -> None:
    """Say which parents have invented heights, and whose windows are mostly empty."""
    with contextlib.suppress(RunError):
        sources = evocity.open_run(folder).sources()
        for source, parent in zip(sources, recipe.parents, strict=True):
            chosen = "default_height" in parent.model_fields_set
            otherwise = "" if chosen else "; default_height in its [[parents]] says otherwise"
            note_heights(source.city, parent.default_height, otherwise)
            note_window(source.city, "center in [[parents]], and [map], choose")


def _tell_bound(folder: Path, recipe) -> None:
    """Say what the run will take at most, before it begins."""
    from evocity.search.estimate import bound_of

    with contextlib.suppress(OSError):  # an estimate ends no run
        _say(f"planned: {bound_of(folder, recipe)}")


def _tell_estimate(folder: Path, search, generation) -> None:
    """Say once what the run will take of the disk, and how long."""
    from evocity.search.estimate import estimate_of, first_telling

    if generation.number != first_telling(search.recipe):
        return
    search.flush()
    with contextlib.suppress(OSError):  # an estimate ends no run
        found = estimate_of(folder, search.recipe, generation)
        if found is not None:
            _say(f"estimate: {found.words}")
        if found is not None and found.warning:
            warn(found.warning)


def _tell_failures(folder: Path) -> None:
    """One line on standard error for each way in which births failed, one for values that a
    recorded measure, or one that is a constraint, did not give, and one if most births are
    equal."""
    from evocity.report import failures, repeated, unrecorded

    with contextlib.suppress(RunError):  # no generation was whole
        run = evocity.open_run(folder)
        for kind in failures(run):
            echo(f"failed: {kind}", err=True)
        if text := unrecorded(run):
            echo(f"not recorded in {text}", err=True)
        if text := repeated(run):
            note(f"{text}: few street blocks can change. A window of more pixels has more of them")


def goal_signs(recipe) -> dict[str, str]:
    """Measure -> what a ``recipe`` wants of it: ↑ more, ↓ less, →0.35 a target, →CITY, and the
    bounds of constraints, ≥0.2 ≤0.4."""
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
    """Where a search is, in one line: ``generation`` as `Search` yields it, of 0…``last``.

    ``signs``: measure -> the direction that is wanted, see `goal_signs`.
    """
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
        *(f"{name} {_volume(told)}" for name, told in generation.islands.items()),
        *(f"{name.replace('_', ' ')} {value:.4g}" for name, value in generation.algorithm.items()),
        "best "
        + ", ".join(
            f"{name} {value:.4g} {signs.get(name, '')}".rstrip()
            for name, value in generation.best.items()
        ),
        f"{left} left",
    ]
    return " · ".join(parts)


def _volume(told: Mapping) -> str:
    """The hypervolume of an island, and which share of its grid is filled, if it fills one."""
    volume, coverage = told["hypervolume"], told["algorithm"].get("coverage")
    filled = "" if coverage is None else f" ({coverage:.0%} filled)"
    return ("–" if volume is None else f"{volume:.4g}") + filled


@contextlib.contextmanager
def blaming_options(**given: object):
    """Within, a fault of a recipe that an option put there is told as the option's.

    ``given``: options that replace a recipe's values, None where it keeps its own.
    """
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
            expected = "what is allowed stands behind each"
        raise RecipeError("\n  ".join([header, *named]), expected, remedy) from error


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

        self._spinner.update(text=Text(plain_text(line)))

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
        echo(f"{text} …", err=True)

    def __exit__(self, *_) -> None:
        if self._held is not None:
            self._print()

    def _print(self) -> None:
        echo(self._held, err=True)
        self._held, self._next = None, time.monotonic() + _BETWEEN_LINES
