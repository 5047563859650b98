"""`evocity fitness check` and `bench`: try measures on maps, and print faults and times."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import click

import evocity
from evocity.cli.shared.commands import command, message_of
from evocity.cli.shared.inputs import case_of, measures_of
from evocity.cli.shared.options import POSITIVE, json_option, map_options, option
from evocity.cli.shared.terminal import (
    describe,
    echo,
    note_compiling,
    print_json,
    print_table,
    progress_bar,
    quiet_stdout,
    relative_path,
)
from evocity.errors import EvocityError, FitnessError

#: Parents of the bred maps, as in the demonstration; the first is typical.
PARENTS = ("lyon-1er", "montpellier-pas-du-loup")
#: Operators of the bred maps: three that keep buildings whole, and two that cut them.
OPERATORS = (
    "quarter_fusion",
    "quarter_refill",
    "height_scaling",
    "pavement_fusion",
    "lambda_crossover",
)


@command("""
  evocity fitness check my_measure.py
  evocity fitness check salingaros --json
  evocity fitness check my_measure.py --timeout 60

Exit codes: 0 it can be used; 1 something is wrong with it; 2 the command line is at fault.""")
@click.argument("measures", metavar="FILE.py|NAME...", nargs=-1, required=True)
@option(
    "--timeout", "Time limit of one call, in seconds.", click.FloatRange(min=0, min_open=True), 10.0
)
@json_option
def check(measures: tuple[str, ...], timeout: float, as_json: bool) -> None:
    """Try measures on cities and on unusual maps, and print the faults of the measures.

    The trial maps are the bundled districts, towns drawn by a rule, children of two districts, an
    empty map, a full map, a map with odd sides and a tiny map. The command prints the values of
    each measure, and the time and memory of one call. For each error, the command prints the file,
    the line and a fix. The command checks whether two calls on the same map return identical
    values. For each value, the command prints the change when a map is turned, mirrored or halved
    in resolution. A value that changes with the direction or the resolution of the map is not an
    error.

    The JSON document has the keys "usable", "findings", "values", "reasons", "milliseconds",
    "first_ms", "median_ms", "memory", "turned" and "halved" for each measure. Each finding has the
    keys "kind", "about", "file", "line", "found", "expected" and "remedy". The key "values"
    contains a number for each map; null means that the measure is undefined or failed. The key
    "reasons" says why a value is null. The key "milliseconds" contains the time of the first call
    on each map. The key "memory" is the number of bytes of memory that one call needs. The keys
    "turned" and "halved" contain the values before and after the command turned or halved the map.
    The values are null if the command did not turn or halve the map. If a file cannot be loaded,
    the JSON document contains only the keys "usable" and "findings" for the file.
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
    place = {"kind": "error", "about": "loading", "file": str(Path(word).resolve()), "line": None}
    return place | {key: getattr(error, key) for key in ("found", "expected", "remedy")}


@cache
def trial_cases() -> tuple:
    """All `Case`, 256 × 256 px at 2 m: districts, towns, and bred children, with kernels loaded."""
    import numpy as np

    from evocity.evaluation import kernel_warmup
    from evocity.fitness.check import Case
    from evocity.operators import make
    from evocity.pavement.levels import USUAL
    from evocity.towns import PATTERNS

    kernel_warmup.warm_up(USUAL, kernel_warmup.every_part())
    names = [*PARENTS, *(name for name in evocity.cities() if name not in PARENTS)]
    districts = [evocity.read_map(name, pixels=256, metres_per_pixel=2.0) for name in names]
    towns = [
        draw(256, 2.0, rng=np.random.default_rng(seed))
        for seed, draw in enumerate(PATTERNS.values())
    ]
    cases = [Case(city) for city in (*districts, *towns)]
    genomes = [evocity.encode(district).genome for district in districts[: len(PARENTS)]]
    cases += [
        replace(bred_case(f"{name}, decoded", genome, [genome], districts), code_of=name)
        for name, genome in zip(PARENTS, genomes, strict=True)
    ]
    for seed, name in enumerate(OPERATORS):
        operator = make(name)
        parents = genomes[: operator.parents[0]]
        child = operator(parents, np.random.default_rng(seed))
        cases.append(bred_case(f"child by {name}", child, parents, districts))
    return tuple(cases)


def bred_case(name: str, genome, parents, sources):
    """The `Case` of a ``genome``, its ``parents``, and the maps of its ``sources``."""
    from evocity.fitness.check import Case

    city = evocity.decode(genome).city
    return Case(city.replace(city.heights, name=name), genome, tuple(parents), sources=sources)


@command("""
  evocity fitness bench
  evocity fitness bench my_measure.py gsi --map villeurbanne-gratte-ciel""")
@click.argument("words", metavar="[NAME|FILE.py]...", nargs=-1)
@option(
    "--map source MAP|GENOME",
    "Map or genome to measure. For measures that need a genome, the command encodes the map.",
    default="lyon-1er",
)
@option("--repeats", "Number of timed calls.", POSITIVE, 7)
@map_options
@json_option
def bench(words: tuple[str, ...], source: str, repeats: int, reading, as_json: bool) -> None:
    """Time the named measures, or all measures of `evocity fitness list`, on one map and one core.

    The column "alone" is the time of a call on a new map, including the derived data (views) that
    the measure needs. The column "shared" is the time of a call on a map whose derived data (views)
    already exist. The row "all together" is the total time of one call of every measure on one map.
    The times leave out the first call, because the first call loads compiled code. Each printed
    time is the shortest of all calls, followed by the median in brackets.

    The JSON document has the keys "measures" and "together" with times in milliseconds. For each
    measure, the key "measures" has the keys "alone" and "shared", each with the least and the
    median time. The key "together" contains the least and the median time of all measures together
    on one map.
    """
    from evocity.fitness.check.cost import cost, cost_together

    with quiet_stdout():
        measures = {m.name: m for word in words for m in measures_of(word)}
        measures = list(measures.values()) or evocity.fitness.measures()
        case = case_of(source, reading)
        measures = [m.bound(case.city) if "reference" in m.needs else m for m in measures]
        coded = case if all(map(case.serves, measures)) else _with_code(case)
        costs = {m.name: cost(m, case if case.serves(m) else coded, repeats) for m in measures}
        together = cost_together(measures, coded, repeats)
    costs = dict(sorted(costs.items(), key=lambda item: item[1].alone.least))
    if as_json:
        each = {k: {"alone": _ms(v.alone), "shared": _ms(v.shared)} for k, v in costs.items()}
        print_json({"measures": each, "together": _ms(together)})
        return
    echo(describe(case.city))
    rows = [("milliseconds", "alone", "(median)", "shared", "(median)")]
    rows += [(name, *_cells(time.alone), *_cells(time.shared)) for name, time in costs.items()]
    if len(costs) > 1:
        rows.append(("all together", "", "", *_cells(together)))
    print_table(rows)


def _with_code(case):
    """The ``case`` with the code of its map, which is its own parent and source if it has none."""
    import numpy as np

    from evocity.genome import packed

    genome, name = case.genome, f"{case.city.name}, decoded"
    if genome is None:
        genome = evocity.encode(case.city).genome
        return bred_case(name, genome, [genome], [case.city])
    own = genome.replace(
        cities=(case.city.name,),
        source=packed(*genome.pavement.corners),
        **dict.fromkeys(("parent", "turn"), np.zeros(len(genome), np.uint8)),
    )
    return bred_case(name, own, [own], [case.city])


def _ms(time) -> dict[str, float]:
    return {"least": 1e3 * time.least, "median": 1e3 * time.median}


def _cells(time) -> tuple[str, str]:
    return f"{1e3 * time.least:.3g}", f"({1e3 * time.median:.3g})"
