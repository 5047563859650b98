"""`evocity fitness check`: tries measures, and prints their faults."""

import math
from pathlib import Path

import click

from evocity.cli.shared.commands import message_of
from evocity.cli.shared.inputs import measures_of
from evocity.cli.shared.options import json_option, option
from evocity.cli.shared.terminal import (
    echo,
    note_compiling,
    print_json,
    print_table,
    progress_bar,
    quiet_stdout,
    relative_path,
)
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
@option(
    "--timeout", "Time limit of one call, seconds.", click.FloatRange(min=0, min_open=True), 10.0
)
@json_option
def check(measures: tuple[str, ...], timeout: float, as_json: bool) -> None:
    """Try measures on cities and on unusual maps, and print their faults.

    The maps are the bundled districts, towns drawn by a rule, children of two districts, an empty
    map, a full map, a map with odd sides and a tiny map. The command prints the values; errors with
    file, line and fix; the time and the memory of a call; and whether the same map gives the same
    bits. The command also prints how much a value changes when a map is turned, mirrored or halved
    in resolution. A changed value is not an error.

    JSON: for each measure, usable, findings (kind, about, file, line, found, expected, remedy),
    values (by map, a number; null where undefined or failed), reasons (why a value is null),
    milliseconds (by map, of the first call), first_ms, median_ms, memory (bytes), turned and halved
    (before and after; null if not needed). For a file that cannot be loaded, the JSON has usable
    and findings under the name of the file.
    """
    note_compiling()
    # click.Context.exit() raises: call it outside of all context managers
    if not _check_all(measures, timeout, as_json):
        click.get_current_context().exit(1)


def _check_all(words: tuple[str, ...], timeout: float, as_json: bool) -> bool:
    """Try all measures, and print the reports; returns whether all are usable."""
    documents, usable = {}, True
    for number, word in enumerate(words):
        try:
            with quiet_stdout():
                measures = measures_of(word)
        except FitnessError as error:
            if not Path(word).is_file():
                raise
            usable = False
            documents[word] = {"usable": False, "findings": [_fault(error, word)]}
            if not as_json:
                echo(_message("Error", error))
            continue
        hung = set()  # functions that ran out of time: their other numbers are not tried
        for place, measure in enumerate(measures):
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
                _print_report(report, word)
    if as_json:
        print_json(documents)
    return usable


def _report(measure, timeout: float):
    from evocity.cli.shared.trial_maps import trial_cases
    from evocity.fitness.check import check as try_measure

    with progress_bar(f"trying {measure.name}") as progress, quiet_stdout():
        return try_measure(measure, trial_cases(), timeout=timeout, progress=progress)


# -- in words ----------------------------------------------------------------------------------


def _print_report(report, word: str) -> None:
    measure = report.measure
    unit = f" {measure.unit}" if measure.unit else ""
    echo(
        f"{measure.name}: goal {measure.goal or 'none'}, {measure.range_text}{unit}; "
        f"{relative_path(measure.file)}, line {measure.line}"
    )
    echo()
    rows = [("map", "value", "ms", "")]
    for trial in report.trials:
        rows.append((trial.map, _value(trial), _milliseconds(trial.seconds), trial.reason))
    print_table(rows)
    echo()
    for line in _facts(report):
        echo(line)
    for finding in report.findings:
        error = EvocityError(finding.found, finding.expected, finding.remedy)
        place = f"{relative_path(finding.file)}, line {finding.line}"
        echo()
        echo(_message(f"{finding.kind.capitalize()}: {place}", error))
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
    if measured and not any(f.about in ("random", "time") for f in report.findings):
        facts.append("the same map again: the same bits")
    if report.turned:
        facts.append(f"turned and mirrored: {_describe_change(report.turned)}")
    if report.halved:
        facts.append(f"at half the resolution: {_describe_change(report.halved)}")
    return facts


def _describe_change(change) -> str:
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
    errors = sum(finding.kind == "error" for finding in report.findings)
    warnings = len(report.findings) - errors
    kinds = ((errors, "error"), (warnings, "warning"))
    counted = [f"{count} {kind}{'s' * (count > 1)}" for count, kind in kinds if count]
    if not report.usable:
        return f"{name} cannot be used yet: {', '.join(counted)}."
    with_what = f" ({', '.join(counted)})" if counted else ""
    key = f'name = "{name}"'
    if word.endswith((".py", ".toml")):
        is_only = [measure.name for measure in measures_of(word)] == [name]
        key = f'file = "{word}"' + ("" if is_only else f"\n  {key}")
    values = (trial.value for trial in report.trials if trial.value is not None)
    example = next(value for value in values if math.isfinite(value))
    target = "" if report.measure.goal else f"\n  target = {example:.4g}"
    return f"{name} can be used{with_what}. In a recipe:\n  [[fitness]]\n  {key}{target}"


def _value(trial) -> str:
    if trial.value is None:
        return "-"
    return "undefined" if math.isnan(trial.value) else f"{trial.value:.4g}"


def _milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1e3 * seconds:.3g}"


def _message(head: str, error: EvocityError) -> str:
    return f"{head}: {message_of(error, click.get_current_context().command)}"


# -- as a document -----------------------------------------------------------------------------


def _document(report) -> dict[str, object]:
    changes = {"turned": report.turned, "halved": report.halved}
    return {
        "usable": report.usable,
        "findings": [vars(finding) for finding in report.findings],
        "values": {trial.map: trial.value for trial in report.trials},
        "reasons": {trial.map: trial.reason for trial in report.trials if trial.reason},
        "milliseconds": {trial.map: _milliseconds_of(trial.seconds) for trial in report.trials},
        "first_ms": _milliseconds_of(report.first),
        "median_ms": _milliseconds_of(report.median),
        "memory": report.memory,
        **{key: change and vars(change) for key, change in changes.items()},
    }


def _milliseconds_of(seconds: float | None) -> float | None:
    return None if seconds is None else 1e3 * seconds


def _fault(error: FitnessError, word: str) -> dict[str, object]:
    """A file that could not be loaded, as a finding; its text names the line."""
    return {
        "kind": "error",
        "about": "loading",
        "file": str(Path(word).resolve()),
        "line": None,
        "found": error.found,
        "expected": error.expected,
        "remedy": error.remedy,
    }
