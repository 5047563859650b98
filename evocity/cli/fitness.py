"""`evocity fitness`: measures of maps; `list` prints them."""

import os.path

import click

import evocity
from evocity.cli.fitness_check import bench, check
from evocity.cli.fitness_new import new
from evocity.cli.shared.commands import Commands, command
from evocity.cli.shared.options import json_option, option
from evocity.cli.shared.terminal import print_json, print_table, quiet_stdout, relative_path, warn

#: Time limits of the costs in a list, seconds: of one measure, and of all.
_EACH, _ALL = 2.0, 10.0


@click.group(cls=Commands)
def fitness() -> None:
    """List, write, check and time measures of maps, including your own measures."""


fitness.add_command(new)
fitness.add_command(check)
fitness.add_command(bench)


@command("""
  evocity fitness list
  evocity fitness list --cost my_measure.py
  evocity score lyon-1er --fitness gsi --fitness my_measure.py""")
@click.argument("files", metavar="[FILE.py]...", nargs=-1)
@option("--cost/--no-cost", "Print the time of one call of each measure.", show_default=True)
@json_option
def list_measures(files: tuple[str, ...], cost: bool, as_json: bool) -> None:
    """List all measures with their name, goal, unit, range, origin and meaning.

    A measure without a goal needs a target in the recipe (target = 0.35), or a reference city (like
    = "lyon-1er"). You write your own measures in Python files. If you name Python files, the
    command executes the files and adds their measures to the list. To write your first measure, use
    `evocity fitness new`.

    The option --cost adds a column with the milliseconds of one call on lyon-1er, 256 × 256 px.
    With --cost, the sign "-" marks measures that fail, and measures that need a genome, parents or
    source cities. With --cost, the sign "?" marks measures that exceeded a time limit: 2 s for one
    measure, or 10 s for all measures together. For exact times from repeated calls, use `evocity
    fitness bench`.

    For each measure, the JSON document has the keys "goal", "unit", "range", "milliseconds",
    "origin" and "doc". The key "range" contains the lower and the upper bound; null means that a
    bound is missing. Without --cost, the key "milliseconds" is null.
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
    """Seconds of one call by measure, None if too slow; failing measures are missing."""
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


fitness.add_command(list_measures, "list")
