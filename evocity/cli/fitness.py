"""`evocity fitness list`: the measures there are."""

import math

import click

import evocity
from evocity.cli.common import print_table, warn


@click.group()
def fitness() -> None:
    """What maps can be measured by."""


@fitness.command(
    "list",
    epilog="""\b
Example:
  evocity score lyon-1er --fitness gsi --fitness my_measure.py""",
)
def list_measures() -> None:
    """List the measures: name, goal, unit, range, and what each says.

    A measure without a goal of its own takes a target (target = 0.35) or a city to be like
    (like = "lyon-1er") in the recipe. Measures of your own live in a Python file: see
    `evocity score --help`.
    """
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
