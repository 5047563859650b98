"""`evocity score`: maps become numbers."""

import contextlib
import csv
import io
import math
from collections.abc import Sequence
from dataclasses import replace

import click

import evocity
from evocity.cli.common import (
    describe,
    echo,
    json_option,
    map_options,
    note_compiling,
    print_json,
    print_table,
    quiet_stdout,
    warn,
)
from evocity.cli.given import case_of, city_of, ids_option, is_genome, is_run, measures_of
from evocity.errors import EvocityError, FitnessError, plain_text

# What begins a formula, wide forms too.
_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠")


@click.command(
    epilog="""\b
Examples:
  evocity score lyon-1er
  evocity score bred.parquet --fitness gsi --fitness my_measure.py --json
  evocity score lyon-1er cape-town-salt-river lyon.parquet --csv
  evocity score runs/lyon-x-montpellier --id 97 --id 12
  evocity score bred.parquet --fitness fabric_distance --reference lyon-1er

`evocity fitness new` begins a measure of your own."""
)
@click.argument("maps", metavar="MAP|GENOME|RUN...", nargs=-1, required=True)
@ids_option(
    "Which individual of a run folder, by the number its report and `status` give it. One run "
    "takes several; among several maps, give it once for each run, in order."
)
@click.option(
    "--fitness",
    "wanted",
    multiple=True,
    metavar="NAME|FILE.py|FILE.toml",
    show_default="all of `evocity fitness list`",
    help="A measure by name, the measures in a Python file, which is executed, or those by a "
    "table of building types in TOML. Give it once for each.",
)
@click.option(
    "--reference",
    "references",
    multiple=True,
    metavar="MAP|GENOME",
    show_default="of an individual of a run, its source cities",
    help="A city that measures such as fabric_distance compare with, read as the maps are. Give "
    "it once for each; they are weighted alike.",
)
@click.option(
    "--within",
    metavar="FILE",
    show_default="the whole map",
    help="Footprints, or a raster above 0 there: measure this part of each map. Measures that ask "
    "for the genome, the parents or the sources are of whole maps alone.",
)
@map_options
@json_option
@click.option("--csv", "as_csv", is_flag=True, help="Print a row a map, and nothing else.")
def score(maps, identifiers, wanted, references, within, reading, as_json, as_csv) -> None:
    """Measure maps.

    Each MAP is a map file or the name of a bundled district. A genome, from a file or of the
    individual --id of a run folder, is decoded first. Measures that ask for the genome, the
    parents or the sources of a city measure individuals of runs; those that compare cities
    compare with what --reference names.

    JSON: each measure's name to its number; null where the measure is undefined. Several maps
    give each map's name to these. CSV: a column a measure, empty where it is undefined; a map's
    name that a spreadsheet would take for a formula (=, +, -, @ first) gets an apostrophe before.
    """
    if as_json and as_csv:
        raise click.UsageError("--json and --csv: one document at a time, leave one out")
    note_compiling()
    sources = _individuals(maps, identifiers)
    with quiet_stdout():
        measures = _measures(wanted)
        if references and not any("reference" in one.takes for one in measures):
            names = ", ".join(one.name for one in measures)
            raise EvocityError(
                f"--reference with {names}, which compare with no city",
                "a measure that compares cities, such as fabric_distance",
                "leave --reference out",
            )
        read_any = any(not _is_code(source) for source, _ in sources)
        cases = {
            _title(source, number): case_of(
                source, {} if read_any and _is_code(source) else reading, number
            )
            for source, number in sources
        }
        if references:
            cases = _compared(cases, references, reading)
        parts = {} if within is None else {t: _part(within, case) for t, case in cases.items()}
        alone = bool(wanted) and len(cases) == 1
        table = {
            title: {m.name: _value(m, case, alone, parts.get(title)) for m in measures}
            for title, case in cases.items()
        }
    _warn_of_left_out(cases, measures)
    if as_csv:
        _print_csv(table, [measure.name for measure in measures])
    elif as_json:
        print_json(table if len(table) > 1 else next(iter(table.values())))
    else:
        for case in cases.values():
            echo(describe(case.city))
        for title, part in parts.items():
            echo(_described(part, title if len(parts) > 1 else "", cases[title].city))
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


def _compared(cases: dict, references: Sequence[str], reading) -> dict:
    """The ``cases`` with the cities that ``references`` name to compare with."""
    named = [city_of(name, {} if is_genome(name) else reading) for name in references]
    reference = evocity.fitness.Reference.of(named)
    return {title: replace(case, reference=reference) for title, case in cases.items()}


def _warn_of_left_out(cases: dict, measures) -> None:
    """Tell which features of buildings `fabric_distance` leaves out."""
    from evocity.fitness.fabric import left_out

    if not any(one.name.startswith("fabric_distance") for one in measures):
        return
    for reference in {case.reference for case in cases.values()} - {None}:
        with contextlib.suppress(EvocityError):  # of too few buildings: the value says so
            if gone := left_out(reference):
                names = ", ".join(city.name for city in reference.cities)
                warn(f"fabric_distance leaves out {', '.join(gone)}: the same in all of {names}")


def _part(place: str, case):
    """The part of a map that the file ``place`` marks."""
    from evocity.io import read_mask

    # what a run bred of several cities has no place on Earth: its sources have
    return evocity.fitness.Part(place, read_mask(place, case.sources or [case.city]))


def _described(part, title: str, city) -> str:
    """In words, what of a map is measured."""
    cut = part.of(city)
    height, width = cut.shape
    shape = "" if part.is_rectangle else f" within {height} × {width} px"
    of = f" of {title}" if title else ""
    pixels = f"{height} × {width} px" if part.is_rectangle else f"{cut.pixels} px"
    return f"measured{of}: {part.name}, {pixels}{shape}, {cut.area / 1e4:.3g} ha"


def _value(measure, case, asked_for: bool, part=None) -> float:
    """What ``measure`` says, of the ``part`` if there is one. Of a map without the genome, the
    parents or the sources that it asks for it is undefined, unless it was ``asked_for`` by name of
    that map alone: then the error is told."""
    if part is not None:
        return _value_within(part, measure, case, asked_for)
    if asked_for or case.serves(measure):
        return case.measured(measure)
    if "reference" in measure.needs and case.reference is None:
        reason = "it asks for a city to compare with: --reference CITY"
    elif "genome" in measure.needs and case.genome is None:
        reason = "it asks for the genome, and a map has none"
    else:
        lacking = [need for need in measure.needs if getattr(case, need) is None]
        reason = f"it asks for the {' and the '.join(lacking)}, which only runs know: RUN --id N"
    return evocity.fitness.Undefined(reason)


def _value_within(part, measure, case, asked_for: bool) -> float:
    try:
        part.check(measure)
        if not asked_for and "reference" in measure.needs and case.reference is None:
            reason = "it asks for a city to compare with: --reference CITY"
            return evocity.fitness.Undefined(reason)
    except FitnessError as error:
        if asked_for:
            raise
        return evocity.fitness.Undefined(error.found.removeprefix(f"{measure.name} "))
    return part.measured(measure, case.city, case.reference, case.genome)


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
        echo(f"undefined: {name} of {', '.join(titles)}: {reason}")


def _print_csv(table, names: list[str]) -> None:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["map", *map(_cell, names)])
    for title, values in table.items():
        numbers = [values[name] for name in names]
        rows.writerow([_cell(title), *("" if math.isnan(n) else repr(float(n)) for n in numbers)])
    echo(text.getvalue().removesuffix("\n"))


def _cell(text: str) -> str:
    """``text`` as a cell of CSV: an apostrophe goes before what a spreadsheet takes for a formula,
    as OWASP advises."""
    text = plain_text(text)
    return f"'{text}" if text.startswith(_FORMULA) else text
