"""`evocity fitness`: what maps can be measured by; and `list`, the measures there are."""

import os.path

import click

import evocity
from evocity.cli.common import (
    Commands,
    json_option,
    near,
    print_json,
    print_table,
    quiet_stdout,
    warn,
)
from evocity.cli.fitness_bench import bench
from evocity.cli.fitness_check import check
from evocity.cli.fitness_new import new

#: Seconds a listing spends on one measure, and on all.
_EACH, _ALL = 2.0, 10.0


@click.group(cls=Commands)
def fitness() -> None:
    """What maps can be measured by, and measures of your own."""


fitness.add_command(new)
fitness.add_command(check)
fitness.add_command(bench)


@fitness.command(
    "list",
    epilog="""\b
Examples:
  evocity fitness list
  evocity fitness list --cost my_measure.py
  evocity score lyon-1er --fitness gsi --fitness my_measure.py""",
)
@click.argument("files", metavar="[FILE.py]...", nargs=-1)
@click.option("--cost/--no-cost", help="Measure what a call of each costs.", show_default=True)
@json_option
def list_measures(files: tuple[str, ...], cost: bool, as_json: bool) -> None:
    """List the measures: name, goal, unit, range, where from, and what each says.

    A measure without a goal of its own takes a target (target = 0.35) or a city to be like
    (like = "lyon-1er") in the recipe. Measures of your own live in Python files: those named
    are executed, and their measures listed too. `evocity fitness new` begins one.

    With --cost, what one call costs on lyon-1er, 256 × 256 px, is told too, in milliseconds; "-" of
    those that ask for genome, parents or sources, and of those that fail; "?" where the time was
    up, 2 s of one measure or 10 s of all. `evocity fitness bench` times every measure, and more
    exactly.

    JSON: each name to goal, unit, range (null: no bound), milliseconds (null without
    --cost), origin, doc.
    """
    with quiet_stdout():
        for file in files:
            evocity.fitness.load_file(file)
        measures = evocity.fitness.measures()
        costs = _costs(measures) if cost else {}
    if as_json:
        print_json({measure.name: _about(measure, costs) for measure in measures})
    else:
        head = ("name", "goal", "unit", "range", "ms", "from", "what it says")
        rows = [head, *(_row(measure, costs) for measure in measures)]
        print_table(rows if cost else [(*row[:4], *row[5:]) for row in rows])
    for text in evocity.fitness.plugin_warnings():
        warn(text)


def _costs(measures) -> dict[str, float | None]:
    """Seconds of one call of each measure; None of those for which there was too little time. Those
    that ask for more than a map, or fail, are left out."""
    import time

    from evocity.authoring import Case
    from evocity.authoring.watching import watched

    case = Case(evocity.read_map("lyon-1er"))
    end = time.perf_counter() + _ALL
    costs = {}
    for measure in measures:
        seconds, late = [], False
        if "reference" in measure.needs:
            measure = measure.bound(case.city)
        while case.serves(measure) and len(seconds) < 3 and time.perf_counter() < end:
            call = watched(measure, case.fresh(), _EACH)
            if call.error:
                late |= isinstance(call.error, TimeoutError)
                break
            seconds.append(call.seconds)
        else:
            late = case.serves(measure)  # the time was up, or there are three calls
        if seconds or late:
            costs[measure.name] = min(seconds, default=None)
    return costs


def _about(measure, costs) -> dict[str, object]:
    seconds = costs.get(measure.name)
    return {
        "goal": measure.goal,
        "unit": measure.unit,
        "range": list(measure.range),
        "milliseconds": None if seconds is None else 1e3 * seconds,
        "origin": measure.origin,
        "doc": measure.summary,
    }


def _row(measure, costs) -> tuple[str, ...]:
    seconds = costs.get(measure.name)
    return (
        measure.name,
        measure.goal or "-",
        measure.unit or "-",
        measure.told_range,
        "-" if measure.name not in costs else "?" if seconds is None else f"{1e3 * seconds:.2g}",
        near(measure.origin) if os.path.isabs(measure.origin) else measure.origin,
        measure.summary or "-",
    )
