"""`evocity decode`: the map of a genome."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_crs, check_needs, check_output, check_zoom
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import (
    decode_genome,
    fabric_in,
    genome_of,
    name_decoded,
    note_nowhere,
    place_at,
    warn_unconverged,
)
from evocity.cli.shared.options import (
    at_option,
    count_option,
    crs_option,
    flag,
    id_option,
    option,
    output_option,
    part_option,
    settle_options,
)
from evocity.cli.shared.terminal import describe, echo, note_compiling
from evocity.errors import EvocityError

# Suffixes of files that have a place on Earth.
_PLACED = (".gpkg", ".fgb", ".geoparquet", ".tif", ".tiff")


@command("""
  evocity decode lyon.parquet -o lyon.tif
  evocity decode lyon.parquet -o detailed.png --zoom 2
  evocity decode lyon.parquet -o simpler.png --low-pass 10
  evocity decode lyon.parquet -o blocks.png --low-pass 1 --count ranges --part blocks
  evocity decode lyon.parquet -o called.png --high-pass 2
  evocity decode lyon.parquet -o lyon.geojson
  evocity decode lyon.parquet -o steps.tif --settle roofs
  evocity decode lyon.parquet -o lambert.gpkg --crs EPSG:2154
  evocity decode runs/lyon-x-montpellier --id 97 -o bred.gpkg
  evocity decode runs/lyon-x-montpellier --id 97 --at lyon-1er -o in-lyon.gpkg
  evocity decode lyon.parquet -o staircases.gpkg --raw""")
@click.argument("genome", metavar="GENOME|RUN")
@output_option(
    "MAP",
    "Map to write: .tif (heights with coordinates), .gpkg, .fgb, .geoparquet or .geojson "
    "(footprints with heights), .png (a picture) or .npy (only heights)",
)
@id_option
@at_option
@crs_option
@option(
    "--zoom",
    "Fractal zoom factor: values above 1 add detail, and values below 1 simplify the map.",
    float,
    1.0,
)
@option(
    "--low-pass F_C",
    "Replace pixels with ground if the genome copies them more than F_C times.",
    float,
)
@option(
    "--high-pass F_C",
    "Replace pixels with ground if the genome copies them fewer than F_C times.",
    float,
)
@count_option
@part_option
@settle_options("as the genome")
@flag("--raw", "Write footprints along pixel edges, without fitting straight walls.")
def decode(
    genome: str,
    output: Path,
    identifier,
    at,
    crs,
    zoom: float,
    low_pass,
    high_pass,
    count,
    part,
    settle,
    raw,
) -> None:
    """Decode a genome, and write the decoded map (the attractor of the genome).

    The genome comes from a GENOME file, or from the individual that --id names in a RUN folder.

    The filters --low-pass and --high-pass replace some pixels with ground. If a filter replaces a
    pixel with ground, all pixels that the genome copies from this pixel become flat. With both
    --low-pass and --high-pass, the map keeps only the pixels whose number of copies is between the
    two limits. The command `evocity show --usage` prints useful values of F_C for --low-pass and
    --high-pass; published examples use 1, 10 and 100. With --part blocks and --count ranges, range
    blocks become flat, which simplifies buildings. With --part buildings, whole buildings become
    ground, and the other buildings stay as they are.

    The genome says how decoding makes roofs flat. With --settle or --no-settle, this map gets
    other roofs, and the genome stays the same.

    A footprint file has one polygon per building, with the columns "id", "height" (mean height of
    the building, in metres) and "area" (in m²). Except GeoJSON, it also has "class" and "source",
    the source city. Walls are straight lines fitted to the pixels, and footprints never overlap. If
    the parents of a child are two towns, the child's map has no coordinates on Earth: write the map
    as .gpkg, in local metres, not as .geojson. With --at, the map of a child gets the coordinates
    of one source city. With --crs, the output gets another reference system. QGIS shows a .gpkg or
    .tif file in the colours of evocity's pictures. The style of a .tif file is a second file, with
    the suffix .qml.
    """
    from evocity.io import RAW_WRITERS, WRITERS
    from evocity.io.writers import PLACED

    check_output(output, genome, RAW_WRITERS if raw else WRITERS)
    check_crs(crs, output, PLACED)
    filters = {"low-pass": low_pass, "high-pass": high_pass}
    filters = {name: f_c for name, f_c in filters.items() if f_c is not None}
    for option_name, value in (("--count", count), ("--part", part)):
        check_needs(option_name, "--low-pass or --high-pass", value is not None and not filters)
    for name, f_c in filters.items():
        if not f_c >= 0:
            raise EvocityError(
                f"--{name} {f_c:g} is not a number of copies of a pixel",
                "the number of times that the genome copies a pixel, 0 or more",
                "use for example 10; the command `evocity show --usage` prints useful numbers",
            )
    note_compiling()
    code = genome_of(genome, identifier)
    if at is not None:
        code = code.replace(**place_at(genome, at))
    if getattr(code, "kind", "fabric") != "fabric":
        if settle is not None:
            raise EvocityError(
                f"{'--settle' if settle else '--no-settle'} cannot be used with a {code.kind}",
                "the genome of a city fabric, because only city fabrics have roofs to settle",
                "leave out the options --settle and --no-settle",
            )
        _write_form(code, genome, identifier, zoom, filters, output, raw, crs)
        return
    check_zoom(code.pavement, zoom)
    facts = []
    for name, f_c in filters.items():
        code, fact = _filter(code, name, f_c, count or "pixels", part or "pixels")
        facts.append(f"{name} at {f_c:g} calls: {fact}")
    decoding = warn_unconverged(evocity.decode(code, zoom=zoom, settle=settle), genome)
    city = decoding.city
    filtered = "".join(f", {name} at {f_c:g}" for name, f_c in filters.items())
    name = name_decoded(city.name, code, genome, identifier) + filtered
    city = city.replace(city.heights, name=name)
    evocity.write_map(city, output, raw=raw, crs=crs, columns=_sources(city, code, output, raw))
    if output.suffix.lower() in _PLACED:
        note_nowhere(genome, code, city)
    for line in (describe(city), *facts, f"decoded in {decoding.iterations} steps"):
        echo(line)
    echo(f"wrote {output}")


def _sources(city, code, output: Path, raw: bool) -> dict | None:
    """The column of the source city of each footprint; None for files without columns."""
    import numpy as np

    from evocity.fitness.heredity import building_sources
    from evocity.io.writers import TABLES

    if output.suffix.lower() not in TABLES:
        return None
    named = np.array(building_sources(city, code), dtype=object)
    return {"source": named if raw else named[city.walls.buildings - 1]}


def _write_form(
    form, source: str, identifier, zoom: float, filters, output: str, raw: bool, crs
) -> None:
    """Write the map of a shape, a curve or a site."""
    if filters:
        fabric_in(form, source)
        raise EvocityError(
            f"--{next(iter(filters))} cannot be used with a {form.kind}",
            "the genome of a city fabric, because the filters work only on city fabrics",
            "leave out the options --low-pass and --high-pass",
        )
    city = decode_genome(form, source, identifier, zoom)
    evocity.write_map(city, output, raw=raw, crs=crs)
    echo(describe(city))
    echo(f"wrote {output}")


def _filter(code, name: str, f_c: float, count: str, part: str) -> tuple:
    """The filtered ``code``, and the share of its pixels that the filter changes."""
    from evocity.coding import decoded, high_pass, low_pass

    filtering = {"low-pass": low_pass, "high-pass": high_pass}[name]
    filtered = filtering(code, f_c, count=count, part=part)
    pixels = code.pavement.height * code.pavement.width
    if part == "pixels":
        kept = [0 if c.condensation is None else len(c.condensation) for c in (code, filtered)]
        return filtered, f"ground on {(kept[1] - kept[0]) / pixels * 100:.0f} % of the pixels"
    if part == "blocks":
        level = filtered.uniform & ~code.uniform
        share = code.pavement.area[level].sum() / pixels
        return filtered, f"flat range blocks on {100 * share:.0f} % of the pixels"
    counts = [len(decoded(one).city.areas) for one in (code, filtered)]
    return filtered, f"{counts[0] - counts[1]} of {counts[0]} built components became ground"
