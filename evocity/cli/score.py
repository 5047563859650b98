"""`evocity score`: maps become numbers."""

import csv
import io
import math
from collections.abc import Sequence

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
from evocity.cli.given import case_of, is_genome, is_run, measures_of
from evocity.errors import EvocityError


@click.command(
    epilog="""\b
Examples:
  evocity score lyon-1er
  evocity score bred.parquet --fitness gsi --fitness my_measure.py --json
  evocity score lyon-1er cape-town-salt-river lyon.parquet --csv
  evocity score runs/lyon-x-montpellier --id 97 --id 12

`evocity fitness new` begins a measure of your own."""
)
@click.argument("maps", metavar="MAP|GENOME|RUN...", nargs=-1, required=True)
@click.option(
    "--id",
    "identifiers",
    type=int,
    multiple=True,
    metavar="N",
    show_default="none",
    help="Of a run folder: which individual, by the number its report and `status` give it. Of "
    "one run, several; among several maps, once for each run, in order.",
)
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
@click.option("--csv", "as_csv", is_flag=True, help="Print a row a map, and nothing else.")
def score(maps, identifiers, wanted, reading, as_json, as_csv) -> None:
    """Measure maps.

    Each MAP is a map file or the name of a bundled district. A genome, from a file or of the
    individual --id of a run folder, is decoded first. Measures that ask for the genome or the
    parents of a city measure individuals of runs.

    JSON: each measure's name to its number; null where the measure is undefined. Of several
    maps: each map to these. CSV: a column a measure, empty where it is undefined.
    """
    if as_json and as_csv:
        raise click.UsageError("--json and --csv: one document at a time, leave one out")
    sources = _individuals(maps, identifiers)
    with quiet_stdout():
        measures = _measures(wanted)
        read_any = any(not _is_code(source) for source, _ in sources)
        cases = {
            _title(source, number): case_of(
                source, {} if read_any and _is_code(source) else reading, number
            )
            for source, number in sources
        }
        table = {
            title: {m.name: _value(m, case, bool(wanted) and len(cases) == 1) for m in measures}
            for title, case in cases.items()
        }
    if as_csv:
        _print_csv(table, [measure.name for measure in measures])
    elif as_json:
        print_json(table if len(table) > 1 else next(iter(table.values())))
    else:
        for case in cases.values():
            click.echo(describe(case.city))
        if len(table) == 1:
            (values,) = table.values()
            print_table([_row(measure, values[measure.name]) for measure in measures])
        else:
            _print_columns(table, measures)


def _individuals(
    sources: Sequence[str], identifiers: Sequence[int]
) -> list[tuple[str, int | None]]:
    """Each source and the individual of it, None of what is no run."""
    runs = sum(is_run(source) for source in sources)
    if len(sources) == 1 and identifiers:
        return [(sources[0], number) for number in identifiers]
    if identifiers and len(identifiers) != runs:
        raise EvocityError(
            f"{len(identifiers)} × --id for {runs} run folders",
            "--id N once for each run folder, in their order, or one run folder alone",
            "give as many, or leave --id out where there is no run",
        )
    numbers = iter(identifiers)
    return [(source, next(numbers, None) if is_run(source) else None) for source in sources]


def _is_code(source: str) -> bool:
    """Whether it is decoded, not read."""
    return is_genome(source) or is_run(source)


def _title(source: str, number: int | None) -> str:
    return source if number is None else f"{source} --id {number}"


def _measures(wanted: tuple[str, ...]) -> list:
    """The measures asked for, each once, in that order; all of them if none is."""
    found = {measure.name: measure for word in wanted for measure in measures_of(word)}
    return list(found.values()) or evocity.fitness.measures()


def _value(measure, case, asked_for: bool) -> float:
    """What ``measure`` says. Of a map without the genome, or the parents, that it asks for it is
    undefined, unless it was ``asked_for`` by name of that map alone: then the error is told."""
    if asked_for or case.serves(measure):
        return case.measured(measure)
    if case.genome is None:
        reason = "it asks for the genome, and a map has none"
    else:
        reason = "it asks for the parents, which only runs know: RUN --id N"
    return evocity.fitness.Undefined(reason)


def _row(measure, value: float) -> tuple[str, str, str]:
    if math.isnan(value):
        return measure.name, "undefined", _reason(value)
    return measure.name, f"{value:.4g}", measure.unit


def _reason(value: float) -> str:
    return getattr(value, "reason", "NaN")


def _print_columns(table, measures) -> None:
    """A row a measure, a column a map; below, why what is undefined is so."""
    rows = [("measure", *table, "unit")]
    reasons = {}
    for measure in measures:
        values = [of_map[measure.name] for of_map in table.values()]
        cells = ["undefined" if math.isnan(value) else f"{value:.4g}" for value in values]
        rows.append((measure.name, *cells, measure.unit))
        for title, value in zip(table, values, strict=True):
            if math.isnan(value):
                reasons.setdefault((measure.name, _reason(value)), []).append(title)
    print_table(rows)
    for (name, reason), titles in reasons.items():
        click.echo(f"undefined: {name} of {', '.join(titles)}: {reason}")


def _print_csv(table, names: list[str]) -> None:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["map", *names])
    for title, values in table.items():
        numbers = [values[name] for name in names]
        rows.writerow([title, *("" if math.isnan(n) else repr(float(n)) for n in numbers)])
    click.echo(text.getvalue(), nl=False)
