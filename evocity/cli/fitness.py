"""`evocity fitness`: measures of maps; `list` prints them."""

import os.path

import click

import evocity
from evocity.cli.fitness_bench import bench
from evocity.cli.fitness_check import check
from evocity.cli.fitness_new import new
from evocity.cli.shared.commands import Commands
from evocity.cli.shared.options import json_option, option
from evocity.cli.shared.terminal import print_json, print_table, quiet_stdout, relative_path, warn

#: Time limits of the costs in a list, seconds: of one measure, and of all.
_EACH, _ALL = 2.0, 10.0


@click.group(cls=Commands)
def fitness() -> None:
    """Measures of maps, also your own."""


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
@option("--cost/--no-cost", "Measure the cost of one call of each measure.", show_default=True)
@json_option
def list_measures(files: tuple[str, ...], cost: bool, as_json: bool) -> None:
    """List the measures: name, goal, unit, range, origin and meaning.

    A measure without a goal needs a target in the recipe (target = 0.35), or a city to be like
    (like = "lyon-1er"). Your own measures are in Python files: the command executes the files that
    you name, and lists their measures too. To write your first file, use `evocity fitness new`.

    --cost adds the milliseconds of one call on lyon-1er, 256 × 256 px. "-" marks measures that
    fail, or that need a genome, parents or sources. "?" marks measures without a result within 2 s
    for one measure or 10 s for all. The command `evocity fitness bench` times every measure more
    exactly.

    JSON: for each name, goal, unit, range (null: no bound), milliseconds (null without --cost),
    origin, doc.
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
    """Seconds of one call of each measure; None for those without a result in time. Measures that
    need more than a map, or fail, are missing."""
    import time

    from evocity.fitness.check import Case
    from evocity.fitness.check.observed_call import observe

    case = Case(evocity.read_map("lyon-1er"))
    end = time.perf_counter() + _ALL
    costs = {}
    for measure in measures:
        seconds, late = [], False
        if "reference" in measure.needs:
            measure = measure.bound(case.city)
        while case.serves(measure) and len(seconds) < 3 and time.perf_counter() < end:
            call = observe(measure, case.fresh(), _EACH)
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
        measure.range_text,
        "-" if measure.name not in costs else "?" if seconds is None else f"{1e3 * seconds:.2g}",
        relative_path(measure.origin) if os.path.isabs(measure.origin) else measure.origin,
        measure.summary or "-",
    )
