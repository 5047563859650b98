"""`evocity decode`: the map of a genome."""

import shlex
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, check_zoom
from evocity.cli.shared.inputs import (
    decode_genome,
    fabric_in,
    genome_of,
    is_run,
    name_decoded,
    place_at,
    warn_unconverged,
)
from evocity.cli.shared.options import (
    at_option,
    count_option,
    flag,
    id_option,
    option,
    output_option,
)
from evocity.cli.shared.terminal import describe, echo, note, note_compiling
from evocity.errors import EvocityError

# Suffixes of files that have a place on Earth.
_PLACED = (".gpkg", ".tif", ".tiff")


@click.command(
    epilog="""\b
Examples:
  evocity decode lyon.parquet -o lyon.tif
  evocity decode lyon.parquet -o detailed.png --zoom 2
  evocity decode lyon.parquet -o simpler.png --low-pass 10
  evocity decode lyon.parquet -o called.png --high-pass 2
  evocity decode lyon.parquet -o lyon.geojson
  evocity decode runs/lyon-x-montpellier --id 97 -o bred.gpkg
  evocity decode runs/lyon-x-montpellier --id 97 --at lyon-1er -o in-lyon.gpkg
  evocity decode lyon.parquet -o staircases.gpkg --raw"""
)
@click.argument("genome", metavar="GENOME|RUN")
@output_option(
    "MAP",
    "Map to write: .tif (heights with a place), .gpkg or .geojson (footprints with heights), "
    ".png (a picture), .npy (heights)",
)
@id_option
@at_option
@option("--zoom", "Fractal zoom: above 1 adds detail, below 1 simplifies.", float, 1.0)
@option(
    "--low-pass F_C", "Replace pixels that the code calls more than F_C times by ground.", float
)
@option(
    "--high-pass F_C", "Replace pixels that the code calls fewer than F_C times by ground.", float
)
@count_option
@flag("--raw", "Keep footprints along pixel edges, without straight walls.")
def decode(
    genome: str, output: Path, identifier, at, zoom: float, low_pass, high_pass, count, raw
) -> None:
    """Decode a genome, and write its map, the attractor.

    The genome is a GENOME file, or the genome of individual --id of a RUN folder.

    The filters --low-pass and --high-pass replace pixels by ground, and flatten the pixels that the
    code makes from these. Both filters together leave a band of pixels. The command `evocity show
    --usage` prints useful values of F_C; the papers use 1, 10 and 100.

    A file of footprints has one polygon per building, with id, height (the mean of its pixels,
    metres) and area (m²). Walls are straight lines fitted to the pixels, and footprints never
    overlap. A child of two towns has no place on Earth: it can be written as .gpkg, in local
    metres, but not as .geojson. With --at, such a child gets the place of one of its towns.
    """
    from evocity.io import RAW_WRITERS, WRITERS

    check_output(output, genome, RAW_WRITERS if raw else WRITERS)
    filters = {"low-pass": low_pass, "high-pass": high_pass}
    filters = {name: f_c for name, f_c in filters.items() if f_c is not None}
    if count is not None and not filters:
        raise EvocityError(
            "--count without --low-pass or --high-pass",
            "a filter, since --count selects the calls that a filter compares",
            "add --low-pass F_C or --high-pass F_C",
        )
    for name, f_c in filters.items():
        if not f_c >= 0:
            raise EvocityError(
                f"--{name} {f_c:g} is not a number of calls",
                "0 calls or more",
                "give for example 10; evocity show --usage prints useful values",
            )
    note_compiling()
    code = genome_of(genome, identifier)
    if at is not None:
        code = code.replace(**place_at(genome, at))
    if getattr(code, "kind", "fabric") != "fabric":
        _write_form(code, genome, identifier, zoom, filters, output, raw)
        return
    check_zoom(code.pavement, zoom)
    facts = []
    for name, f_c in filters.items():
        code, share = _filter(code, name, f_c, count or "pixels")
        facts.append(f"{name} at {f_c:g} calls: ground on {share:.0%} of the pixels")
    decoding = warn_unconverged(evocity.decode(code, zoom=zoom), genome)
    city = decoding.city
    filtered = "".join(f", {name} at {f_c:g}" for name, f_c in filters.items())
    name = name_decoded(city.name, code, genome, identifier) + filtered
    city = city.replace(city.heights, name=name)
    evocity.write_map(city, output, raw=raw)
    if at is None and city.crs is None and is_run(genome) and output.suffix.lower() in _PLACED:
        _note_nowhere(evocity.open_run(genome), code)
    for line in (describe(city), *facts, f"decoded in {decoding.iterations} steps"):
        echo(line)
    echo(f"wrote {output}")


def _write_form(
    form, source: str, identifier, zoom: float, filters, output: str, raw: bool
) -> None:
    """Write the map of a shape, a curve or a site."""
    if filters:
        fabric_in(form, source)
        raise EvocityError(
            f"--{next(iter(filters))} does not fit a {form.kind}",
            "a fabric",
            "leave the filter out",
        )
    city = decode_genome(form, source, identifier, zoom)
    evocity.write_map(city, output, raw=raw)
    echo(describe(city))
    echo(f"wrote {output}")


def _note_nowhere(run, code) -> None:
    """Name a place for a map that lies nowhere, since the cities of its ``run`` lie in several
    places."""
    from evocity.analysis.georeference import ground_of

    shares = dict(zip(code.cities, code.shares.tolist(), strict=True))
    ground = ground_of(shares, run.sources())
    if ground is not None:
        note(
            "the map lies nowhere on Earth, since its parents lie in several places; "
            f"--at {shlex.quote(ground)} puts it on the ground of its main parent"
        )


def _filter(code, name: str, f_c: float, count: str) -> tuple:
    """The filtered ``code``, and the share of its pixels that the filter turns to ground."""
    from evocity.coding import high_pass, low_pass

    filtered = {"low-pass": low_pass, "high-pass": high_pass}[name](code, f_c, count=count)
    kept = [0 if c.condensation is None else len(c.condensation) for c in (code, filtered)]
    return filtered, (kept[1] - kept[0]) / (code.pavement.height * code.pavement.width)
