"""`evocity fitness list`: the measures there are."""

import math

import click

import evocity
from evocity.cli.common import print_table, quiet_stdout, warn


@click.group()
def fitness() -> None:
    """What maps can be measured by."""


@fitness.command(
    "list",
    epilog="""\b
Examples:
  evocity fitness list
  evocity fitness list my_measure.py
  evocity score lyon-1er --fitness gsi --fitness my_measure.py""",
)
@click.argument("files", metavar="[FILE.py]...", nargs=-1)
def list_measures(files: tuple[str, ...]) -> None:
    """List the measures: name, goal, unit, range, and what each says.

    A measure without a goal of its own takes a target (target = 0.35) or a city to be like
    (like = "lyon-1er") in the recipe. Measures of your own live in Python files: those named
    are executed, and their measures listed too. How to write one: `evocity score --help`.
    """
    with quiet_stdout():
        for file in files:
            evocity.fitness.load_file(file)
    rows = [("name", "goal", "unit", "range", "what it says")]
    for measure in evocity.fitness.measures():
        low, high = (_bound(bound) for bound in measure.range)
        says = measure.doc.partition("\n\n")[0].replace("\n", " ")
        rows.append((measure.name, measure.goal or "-", measure.unit or "-", f"{low}…{high}", says))
    print_table(rows)
    for text in evocity.fitness.plugin_warnings():
        warn(text)


def _bound(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else "∞" if value > 0 else "-∞"
