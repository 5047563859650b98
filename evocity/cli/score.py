"""`evocity score`: measures maps."""

import contextlib
import csv
import io
import math
from collections.abc import Sequence
from dataclasses import replace

import click

import evocity
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import (
    case_of,
    city_of,
    individuals_of,
    is_code,
    is_genome,
    measures_of,
)
from evocity.cli.shared.options import flag, ids_option, json_option, map_options, option
from evocity.cli.shared.terminal import (
    describe,
    echo,
    note_compiling,
    print_json,
    print_table,
    quiet_stdout,
    warn,
)
from evocity.errors import EvocityError, FitnessError, plain_text

# Characters that begin a formula, wide forms too.
_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠")


@command("""
  evocity score lyon-1er
  evocity score bred.parquet --fitness gsi --fitness my_measure.py --json
  evocity score lyon-1er cape-town-salt-river lyon.parquet --csv
  evocity score runs/lyon-x-montpellier --id 97 --id 12
  evocity score bred.parquet --fitness fabric_distance --reference lyon-1er

`evocity fitness new` begins a measure of your own.""")
@click.argument("maps", metavar="MAP|GENOME|RUN...", nargs=-1, required=True)
@ids_option(
    "Give several --id for one run folder, or one --id for each run folder, in the order of the "
    "folders"
)
@option(
    "--fitness words NAME|FILE.py|FILE.toml...",
    "Measure to compute: the name of a measure, a Python file that the command executes, or a "
    "table of building types. [all of `evocity fitness list`]",
)
@option(
    "--reference references MAP|GENOME...",
    "Reference city with which the measures compare each map. [the source cities of an individual"
    " of a run]",
)
@option(
    "--within FILE",
    "File that marks the part of the map to measure, with footprints or with raster values above "
    "0. [the whole map]",
)
@map_options
@json_option
@flag("--csv as_csv", "Print only CSV, with a row for each map.")
def score(maps, identifiers, words, references, within, reading, as_json, as_csv) -> None:
    """Measure maps, and print the values.

    Each MAP is a map file or the name of a bundled district. A MAP can be a genome file, or a run
    folder with --id: the command first decodes the genome. A measure of genomes, parents or source
    cities needs a whole map that belongs to an individual of a run. Measures that compare two
    cities use the reference city from --reference. If you give several reference cities, all of
    them have equal weight. The options for map files apply to the maps and to the reference cities.

    The JSON document contains the value of each measure; null means that the measure is undefined.
    For several maps, the JSON document contains an object for each map, with the map's name as key
    and the values of the measures. The CSV document has a column for each measure; the cell of an
    undefined value is empty. A map name that begins with =, +, - or @ gets an apostrophe, so that
    spreadsheets do not read a formula.
    """
    if as_json and as_csv:
        raise click.UsageError("--json and --csv: leave one out, only one document fits")
    note_compiling()
    sources = _individuals(maps, identifiers)
    with quiet_stdout():
        measures = _measures(words)
        if references and not any("reference" in measure.takes for measure in measures):
            names = ", ".join(measure.name for measure in measures)
            raise EvocityError(
                f"--reference is given, but no measure compares cities: {names}",
                "at least one measure that compares cities, such as fabric_distance",
                "leave out --reference, or add such a measure with --fitness",
            )
        read_any = any(not is_code(source) for source, _ in sources)
        cases = {
            source if number is None else f"{source} --id {number}": case_of(
                source, {} if read_any and is_code(source) else reading, number
            )
            for source, number in sources
        }
        if references:
            cases = _add_reference(cases, references, reading)
        parts = {} if within is None else {t: _part(within, case) for t, case in cases.items()}
        by_name = bool(words) and len(cases) == 1
        table = {
            title: {m.name: _value(m, case, by_name, parts.get(title)) for m in measures}
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
            echo(_describe_part(part, title if len(parts) > 1 else "", cases[title].city))
        if len(table) == 1:
            (values,) = table.values()
            print_table([_row(measure, values[measure.name]) for measure in measures])
        else:
            _print_columns(table, measures)


def _individuals(
    sources: Sequence[str], identifiers: Sequence[int]
) -> list[tuple[str, int | None]]:
    """Each source with its individual; None unless it is a run. One run takes several."""
    if len(sources) == 1 and identifiers:
        return [(sources[0], number) for number in identifiers]
    return list(zip(sources, individuals_of(sources, identifiers), strict=True))


def _measures(words: tuple[str, ...]) -> list:
    """The measures that ``words`` name, each once, in that order; all without words."""
    measures = {measure.name: measure for word in words for measure in measures_of(word)}
    return list(measures.values()) or evocity.fitness.measures()


def _add_reference(cases: dict, references: Sequence[str], reading) -> dict:
    """The ``cases`` with the cities that ``references`` name, to compare with."""
    cities = [city_of(name, {} if is_genome(name) else reading) for name in references]
    reference = evocity.fitness.Reference.of(cities)
    return {title: replace(case, reference=reference) for title, case in cases.items()}


def _warn_of_left_out(cases: dict, measures) -> None:
    """Name the features of buildings that `fabric_distance` leaves out."""
    from evocity.fitness.fabric import left_out

    if not any(measure.name.startswith("fabric_distance") for measure in measures):
        return
    for reference in {case.reference for case in cases.values()} - {None}:
        with contextlib.suppress(EvocityError):  # too few buildings: the value says so
            if gone := left_out(reference):
                names = ", ".join(city.name for city in reference.cities)
                warn(f"fabric_distance leaves out {', '.join(gone)}: the same in all of {names}")


def _part(place: str, case):
    """The part of a map that the file ``place`` marks."""
    from evocity.io import read_mask

    # what a run bred of several cities has no place on Earth: its sources have
    return evocity.fitness.Part(place, read_mask(place, case.sources or [case.city]))


def _describe_part(part, title: str, city) -> str:
    """Describe the measured part of a map in one line."""
    cut = part.of(city)
    height, width = cut.shape
    shape = "" if part.is_rectangle else f" within {height} × {width} px"
    of = f" of {title}" if title else ""
    pixels = f"{height} × {width} px" if part.is_rectangle else f"{cut.pixels} px"
    return f"measured{of}: {part.name}, {pixels}{shape}, {cut.area / 1e4:.3g} ha"


_NO_REFERENCE = "it needs a city to compare with: --reference CITY"


def _value(measure, case, by_name: bool, part=None) -> float:
    """The value of ``measure``, undefined if the case lacks what it needs, unless ``by_name``."""
    if part is not None:
        return _value_within(part, measure, case, by_name)
    if by_name or case.serves(measure):
        return case.measured(measure)
    if "reference" in measure.needs and case.reference is None:
        reason = _NO_REFERENCE
    elif "genome" in measure.needs and case.genome is None:
        reason = "it needs the genome, and a map has none"
    else:
        lacking = [need for need in measure.needs if getattr(case, need) is None]
        reason = f"it needs the {' and the '.join(lacking)}, which only runs have: RUN --id N"
    return evocity.fitness.Undefined(reason)


def _value_within(part, measure, case, by_name: bool) -> float:
    try:
        part.check(measure)
        if not by_name and "reference" in measure.needs and case.reference is None:
            return evocity.fitness.Undefined(_NO_REFERENCE)
    except FitnessError as error:
        if by_name:
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
    """Print a row per measure, a column per map; then the reasons of undefined values."""
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
    """``text`` as a cell of CSV, with an apostrophe before a formula, as OWASP advises."""
    text = plain_text(text)
    return f"'{text}" if text.startswith(_FORMULA) else text
