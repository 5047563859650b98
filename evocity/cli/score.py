"""`evocity score`: a map becomes numbers."""

import math

import click

import evocity
from evocity.cli.common import (
    describe,
    json_option,
    map_options,
    print_json,
    print_table,
    quiet_stdout,
)
from evocity.cli.given import city_of, id_option


@click.command(
    epilog="""\b
Examples:
  evocity score lyon-1er
  evocity score bred.parquet --fitness gsi --fitness my_measure.py --json
  evocity score runs/lyon-x-montpellier --id 97

\b
A measure of your own, my_measure.py:
  import evocity
\b
  @evocity.fitness(goal="max", unit="m")
  def highest_roof(city):
      return city.heights.max()"""
)
@click.argument("map", metavar="MAP|GENOME|RUN")
@id_option
@click.option(
    "--fitness",
    "wanted",
    multiple=True,
    metavar="NAME|FILE.py",
    show_default="all of `evocity fitness list`",
    help="A measure by name, or the measures in a Python file, which is executed. "
    "Give it once for each.",
)
@map_options
@json_option
def score(map, identifier, wanted, reading, as_json) -> None:
    """Measure a map.

    MAP is a map file or the name of a bundled district. A genome, from a file or of the
    individual --id of a run folder, is decoded first.

    JSON: each measure's name to its number; null where the measure is undefined.
    """
    with quiet_stdout():
        measures = _measures(wanted)
        city = city_of(map, reading, identifier)
        values = {measure.name: measure(city) for measure in measures}
    if as_json:
        print_json(values)
        return
    click.echo(describe(city))
    print_table([_row(measure, values[measure.name]) for measure in measures])


def _measures(wanted: tuple[str, ...]) -> list:
    """The measures asked for, each once, in that order; all of them if none is."""
    fitness = evocity.fitness
    if not wanted:
        return fitness.measures()
    found = {}
    for name in wanted:
        for measure in fitness.load_file(name) if name.endswith(".py") else [fitness.get(name)]:
            found[measure.name] = measure
    return list(found.values())


def _row(measure, value: float) -> tuple[str, str, str]:
    if math.isnan(value):
        return measure.name, "undefined", getattr(value, "reason", "NaN")
    return measure.name, f"{value:.4g}", measure.unit
