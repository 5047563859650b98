"""`evocity encode`: a map becomes a genome."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    check_output,
    describe,
    json_option,
    map_options,
    output_option,
    print_json,
    progress_bar,
    writing,
)
from evocity.errors import EvocityError


class _Domains(click.ParamType):
    name = "list"

    def convert(self, value, param, ctx) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(int(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is no list of whole numbers such as 2 or 2,3", param, ctx)


class _Reach(click.ParamType):
    name = "reach"

    def convert(self, value, param, ctx) -> int | None:
        if value is None or value == "all":
            return None
        try:
            return int(value)
        except ValueError:
            self.fail(f"{value!r} is neither a whole number of pixels nor all", param, ctx)


@click.command(
    epilog="""\b
Examples:
  evocity encode lyon-1er -o lyon.parquet
  evocity encode buildings.gpkg --center 4.834 45.768 --reach all -o here.parquet
  evocity encode dsm.png --metres-per-pixel 2 --height-scale 0.5 --json -o dsm.parquet"""
)
@click.argument("map", metavar="MAP")
@output_option("GENOME", "Genome file to write, usually .parquet; overwritten if it exists.")
@click.option("--block", default=4, show_default=True, help="B, side of the range blocks, pixels.")
@click.option(
    "--domains",
    type=_Domains(),
    metavar="N[,N…]",
    default="2",
    show_default=True,
    help="Sides of the domain blocks in range blocks; 2,3 searches D = 2B and 3B.",
)
@click.option(
    "--reach",
    type=_Reach(),
    metavar="PIXELS|all",
    default="24",
    show_default=True,
    help="How far a domain block may lie from its range block; all = the whole map.",
)
@click.option(
    "--sigma-max",
    default=0.9,
    show_default=True,
    help="Bound on |σ|; below 1 decoding always converges.",
)
@map_options
@json_option
def encode(map, output: Path, block, domains, reach, sigma_max, reading, as_json) -> None:
    """Code MAP as a fractal genome.

    MAP is a file or the name of a bundled district. Reads GeoJSON, GeoPackage, Shapefile, OSM
    XML and PBF, CityJSON, GeoTIFF, PNG and NPY. The genome file is Parquet, one row a lifs:
    DuckDB, polars and pandas read it as it is.

    JSON keys: psnr (dB, of the decoded genome), collage_rmse (metres), lifs, uniform (flat
    range blocks, coded without search), pairs (range and domain blocks compared), seconds.
    """
    check_output(output, map)
    _check_no_map_name(output)
    city = evocity.read_map(map, **reading)
    with progress_bar(f"coding {city.name}") as progress:
        encoding = evocity.encode(
            city,
            block=block,
            domains=domains,
            reach=reach,
            sigma_max=sigma_max,
            progress=progress,
        )
    psnr = encoding.psnr  # decodes: a code that diverges is told before anything is written
    with writing(output):
        encoding.genome.write(output)
    if as_json:
        print_json(
            {
                "psnr": psnr,
                "collage_rmse": encoding.collage_rmse,
                "lifs": len(encoding.genome),
                "uniform": encoding.uniform,
                "pairs": encoding.pairs,
                "seconds": encoding.seconds,
            }
        )
        return
    click.echo(describe(city))
    if city.height_rules:
        rules = ", ".join(f"{count} by {rule}" for rule, count in city.height_rules.items())
        click.echo(f"heights of buildings: {rules}")
    click.echo(
        f"{len(encoding.genome)} lifs, {encoding.uniform} of them uniform; "
        f"{encoding.pairs:,} pairs searched in {encoding.seconds:.1f} s"
    )
    click.echo(f"decoded PSNR {psnr:.1f} dB, collage error {encoding.collage_rmse:.2f} m (RMS)")
    click.echo(f"wrote {output}")


def _check_no_map_name(output: Path) -> None:
    from evocity.io import suffixes

    if any(output.name.lower().endswith(suffix) for suffix in suffixes()):
        raise EvocityError(
            f"{output.name}: the name of a map for a genome",
            "a genome file's name, such as genome.parquet",
            "choose a name that ends in .parquet; to write a map, use evocity decode",
        )
