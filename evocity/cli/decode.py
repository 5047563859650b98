"""`evocity decode`: a genome becomes a map."""

import shlex
from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    check_output,
    converged,
    count_option,
    describe,
    echo,
    note,
    note_compiling,
    output_option,
)
from evocity.cli.given import (
    at_option,
    decoded,
    decoded_name,
    fabric_in,
    genome_of,
    id_option,
    is_run,
    place_at,
)
from evocity.errors import EvocityError, setting

# What is written in these lies somewhere.
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
    "Map to write: .tif (heights, where on Earth), .gpkg or .geojson (footprints with heights), "
    ".png (a picture), .npy (bare heights); overwritten if it exists.",
)
@id_option
@at_option
@click.option(
    "--zoom",
    type=float,
    default=1.0,
    show_default=True,
    help="Fractal zoom: above 1 creates detail, below 1 simplifies.",
)
@click.option(
    "--low-pass",
    type=float,
    metavar="F_C",
    show_default="none",
    help="Cut frequency: what the code calls more often becomes ground, and what is made of it "
    "flat. `show --usage` tells which numbers make sense; the papers take 1, 10 and 100.",
)
@click.option(
    "--high-pass",
    type=float,
    metavar="F_C",
    show_default="none",
    help="Cut frequency: what the code calls less often becomes ground, and what is made of it "
    "flat. With --low-pass it leaves a band.",
)
@count_option
@click.option(
    "--raw",
    is_flag=True,
    help="Footprints along the edges of their pixels, in place of straight walls.",
)
def decode(
    genome: str, output: Path, identifier, at, zoom: float, low_pass, high_pass, count, raw
) -> None:
    """Write the map that a genome stands for, its attractor.

    The genome is a GENOME file, or that of one individual of a RUN folder, named by --id.

    Footprints are a polygon a building, with id, height (the mean of its pixels, metres) and area
    (m²). Their walls are straight lines fitted to the pixels, and none overlaps another. A map that
    lies nowhere on Earth, such as a child of two towns, is written as .gpkg, in local metres, not
    as .geojson; --at lays it on the ground of one of them.
    """
    from evocity.io import RAW_WRITERS, WRITERS

    check_output(output, genome, RAW_WRITERS if raw else WRITERS)
    filters = {"low-pass": low_pass, "high-pass": high_pass}
    filters = {name: f_c for name, f_c in filters.items() if f_c is not None}
    if count is not None and not filters:
        raise EvocityError(
            "--count without --low-pass or --high-pass",
            "a filter to count for",
            "add --low-pass F_C or --high-pass F_C",
        )
    for name, f_c in filters.items():
        if not f_c >= 0:
            raise EvocityError(
                f"--{name} {f_c:g}", "calls, 0 or more", "give for example 10; see show --usage"
            )
    note_compiling()
    code = genome_of(genome, identifier)
    if at is not None:
        code = code.replace(**place_at(genome, at))
    if getattr(code, "kind", "fabric") != "fabric":
        _write_form(code, genome, identifier, zoom, filters, output, raw)
        return
    check_zoom(code.pavement, zoom)
    told = []
    for name, f_c in filters.items():
        code, share = _filtered(code, name, f_c, count or "pixels")
        told.append(f"{name} at {f_c:g} calls: {share:.0%} of the pixels go to ground")
    decoding = converged(evocity.decode(code, zoom=zoom), genome)
    city = decoding.city
    filtered = "".join(f", {name} at {f_c:g}" for name, f_c in filters.items())
    name = decoded_name(city.name, code, genome, identifier) + filtered
    city = city.replace(city.heights, name=name)
    evocity.write_map(city, output, raw=raw)
    if at is None and city.crs is None and is_run(genome) and output.suffix.lower() in _PLACED:
        _note_nowhere(evocity.open_run(genome), code)
    for line in (describe(city), *told, f"decoded in {decoding.iterations} steps"):
        echo(line)
    echo(f"wrote {output}")


def _write_form(
    form, source: str, identifier, zoom: float, filters, output: str, raw: bool
) -> None:
    """Write the map of what is no fabric alone."""
    if filters:
        fabric_in(form, source)
        raise EvocityError(
            f"--{next(iter(filters))} of a {form.kind}",
            "a fabric alone",
            "leave it out",
        )
    city = decoded(form, source, identifier, zoom)
    evocity.write_map(city, output, raw=raw)
    echo(describe(city))
    echo(f"wrote {output}")


def _note_nowhere(run, code) -> None:
    """Say where a map may be laid that lies nowhere, for the cities of its ``run`` lie in several
    places."""
    from evocity.analysis.placing import ground_of

    shares = dict(zip(code.cities, code.shares.tolist(), strict=True))
    ground = ground_of(shares, run.sources())
    if ground is not None:
        note(
            "it lies nowhere on Earth, since its parents lie in several places; "
            f"--at {shlex.quote(ground)} lays it on the ground of the one that it has most of"
        )


def _filtered(code, name: str, f_c: float, count: str) -> tuple:
    """The filtered ``code``, and the share of its pixels that the filter laid bare."""
    from evocity.coding import high_pass, low_pass

    filtered = {"low-pass": low_pass, "high-pass": high_pass}[name](code, f_c, count=count)
    kept = [0 if one.condensation is None else len(one.condensation) for one in (code, filtered)]
    return filtered, (kept[1] - kept[0]) / (code.pavement.height * code.pavement.width)


def check_zoom(pavement, zoom: float) -> None:
    """Raise if a genome of this ``pavement``, decoded at ``zoom``, is a map too large."""
    from evocity.citymap import MAX_PIXELS

    pixels = pavement.height * pavement.width * zoom**2
    if pixels > MAX_PIXELS:
        most = (MAX_PIXELS / (pavement.height * pavement.width)) ** 0.5
        raise EvocityError(
            f"{setting('zoom', zoom)} makes a map of {pixels / 1e6:.0f} million pixels",
            f"at most {MAX_PIXELS // 10**6} million",
            f"choose a zoom below {most:.0f}",
        )
