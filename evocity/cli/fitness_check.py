"""`evocity fitness check`: a measure is tried, and what is wrong with it is told."""

import math
from pathlib import Path

import click

from evocity.cli.common import (
    echo,
    json_option,
    near,
    note_compiling,
    print_json,
    print_table,
    progress_bar,
    quiet_stdout,
    told,
)
from evocity.cli.given import measures_of
from evocity.errors import EvocityError, FitnessError


@click.command(
    epilog="""\b
Examples:
  evocity fitness check my_measure.py
  evocity fitness check salingaros --json
  evocity fitness check my_measure.py --timeout 60

Exit codes: 0 it can be used; 1 something is wrong with it; 2 the command line is at fault."""
)
@click.argument("measures", metavar="FILE.py|NAME...", nargs=-1, required=True)
@click.option(
    "--timeout",
    type=click.FloatRange(min=0, min_open=True),
    default=10.0,
    show_default=True,
    help="Seconds after which a call is given up.",
)
@json_option
def check(measures: tuple[str, ...], timeout: float, as_json: bool) -> None:
    """Try measures on cities and on awkward maps, and tell what is wrong with them.

    They are run on the bundled districts, on towns drawn by a rule, on an empty map, a full one,
    an odd and a tiny one, and on children bred from two districts. Told are the values; errors
    with file, line and remedy; the time a call takes, and its memory; whether the same map gives
    the same bits; and how far the value moves when a map is turned or mirrored, or has half the
    resolution, which is no fault.

    JSON: each measure's name to usable, findings (kind, about, file, line, found, expected,
    remedy), values (map to number; null where undefined or failed), reasons (why), milliseconds
    (map to those of the first call), first_ms, median_ms, memory (bytes), turned and halved
    (before, after; null if not asked). A file that cannot be loaded stands there by its name,
    with usable and findings.
    """
    note_compiling()
    # click.Context.exit() raises: outside of all that tidies up
    if not _checked(measures, timeout, as_json):
        click.get_current_context().exit(1)


def _checked(words: tuple[str, ...], timeout: float, as_json: bool) -> bool:
    """Whether all are usable; tells it."""
    documents, usable = {}, True
    for number, word in enumerate(words):
        try:
            with quiet_stdout():
                found = measures_of(word)
        except FitnessError as error:
            if not Path(word).is_file():
                raise
            usable = False
            documents[word] = {"usable": False, "findings": [_fault(error, word)]}
            if not as_json:
                echo(_message("Error", error))
            continue
        hung = set()  # functions given up: those of several numbers are not tried for each
        for place, measure in enumerate(found):
            if measure.function in hung:
                continue
            report = _report(measure, timeout)
            usable &= report.usable
            if report.given_up:
                hung.add(measure.function)
            if as_json:
                documents[measure.name] = _document(report)
            else:
                if number or place:
                    echo()
                _tell(report, word)
    if as_json:
        print_json(documents)
    return usable


def _report(measure, timeout: float):
    from evocity.authoring import check as tried
    from evocity.cli.trials import trial_cases

    with progress_bar(f"trying {measure.name}") as progress, quiet_stdout():
        cases = trial_cases()
        return tried(measure, cases, timeout=timeout, progress=progress)


# -- in words ----------------------------------------------------------------------------------


def _tell(report, word: str) -> None:
    measure = report.measure
    unit = f" {measure.unit}" if measure.unit else ""
    echo(
        f"{measure.name}: goal {measure.goal or 'none'}, {measure.told_range}{unit}; "
        f"{near(measure.file)}, line {measure.line}"
    )
    echo()
    rows = [("map", "value", "ms", "")]
    for trial in report.trials:
        rows.append((trial.map, _value(trial), _milliseconds(trial.seconds), trial.reason))
    print_table(rows)
    echo()
    for line in _facts(report):
        echo(line)
    for one in report.findings:
        error = EvocityError(one.found, one.expected, one.remedy)
        echo()
        echo(_message(f"{one.kind.capitalize()}: {near(one.file)}, line {one.line}", error))
    echo()
    echo(_verdict(report, word))


def _facts(report) -> list[str]:
    facts = []
    if report.first is not None:
        side = math.isqrt(report.pixels)
        then = ""
        if report.median is not None:
            then = f", then {1e3 * report.median:.3g} ms ({side} × {side} px, views included)"
        facts.append(f"time: first call {1e3 * report.first:.3g} ms{then}")
    if report.memory is not None:
        facts.append(f"memory: {report.memory / 2**20:.1f} MiB a call")
    measured = any(trial.value is not None for trial in report.trials)
    if measured and not any(one.about in ("random", "time") for one in report.findings):
        facts.append("the same map again: the same bits")
    if report.turned:
        facts.append(f"turned and mirrored: {_moved(report.turned)}")
    if report.halved:
        facts.append(f"at half the resolution: {_moved(report.halved)}")
    return facts


def _moved(change) -> str:
    before, after = change.before, change.after
    if math.isnan(after):
        return f"undefined, in place of {before:.4g}"
    if after == before:
        return "no change"
    if math.isclose(after, before, rel_tol=1e-5):
        return "no change but by rounding"
    share = f" ({100 * (after - before) / abs(before):+.2g} %)" if before else ""
    return f"{before:.4g} becomes {after:.4g}{share}"


def _verdict(report, word: str) -> str:
    name = report.measure.name
    errors = sum(one.kind == "error" for one in report.findings)
    warnings = len(report.findings) - errors
    kinds = ((errors, "error"), (warnings, "warning"))
    counted = [f"{count} {kind}{'s' * (count > 1)}" for count, kind in kinds if count]
    if not report.usable:
        return f"{name} cannot be used yet: {', '.join(counted)}."
    with_what = f" ({', '.join(counted)})" if counted else ""
    key = f'name = "{name}"'
    if word.endswith((".py", ".toml")):
        lone = [one.name for one in measures_of(word)] == [name]
        key = f'file = "{word}"' + ("" if lone else f"\n  {key}")
    values = (trial.value for trial in report.trials if trial.value is not None)
    example = next(value for value in values if math.isfinite(value))
    wanted = "" if report.measure.goal else f"\n  target = {example:.4g}"
    return f"{name} can be used{with_what}. In a recipe:\n  [[fitness]]\n  {key}{wanted}"


def _value(trial) -> str:
    if trial.value is None:
        return "-"
    return "undefined" if math.isnan(trial.value) else f"{trial.value:.4g}"


def _milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1e3 * seconds:.3g}"


def _message(head: str, error: EvocityError) -> str:
    return f"{head}: {told(error, click.get_current_context().command)}"


# -- as a document -----------------------------------------------------------------------------


def _document(report) -> dict[str, object]:
    changes = {"turned": report.turned, "halved": report.halved}
    return {
        "usable": report.usable,
        "findings": [vars(one) for one in report.findings],
        "values": {one.map: one.value for one in report.trials},
        "reasons": {one.map: one.reason for one in report.trials if one.reason},
        "milliseconds": {one.map: _thousand(one.seconds) for one in report.trials},
        "first_ms": _thousand(report.first),
        "median_ms": _thousand(report.median),
        "memory": report.memory,
        **{key: None if one is None else vars(one) for key, one in changes.items()},
    }


def _thousand(seconds: float | None) -> float | None:
    return None if seconds is None else 1e3 * seconds


def _fault(error: FitnessError, word: str) -> dict[str, object]:
    """A file that could not be loaded, as a finding; its line stands in what was found."""
    return {
        "kind": "error",
        "about": "loading",
        "file": str(Path(word).resolve()),
        "line": None,
        "found": error.found,
        "expected": error.expected,
        "remedy": error.remedy,
    }
