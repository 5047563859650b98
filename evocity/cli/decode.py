"""`evocity decode`: a genome becomes a map."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, converged, describe, output_option
from evocity.cli.given import decoded_name, genome_of, id_option
from evocity.errors import EvocityError


@click.command(
    epilog="""\b
Examples:
  evocity decode lyon.parquet -o lyon.tif
  evocity decode lyon.parquet -o detailed.png --zoom 2
  evocity decode runs/lyon-x-montpellier --id 97 -o bred.tif"""
)
@click.argument("genome", metavar="GENOME|RUN")
@output_option(
    "MAP",
    "Map to write: .tif (heights, where on Earth), .png (a picture), .npy (bare heights); "
    "overwritten if it exists.",
)
@id_option
@click.option(
    "--zoom",
    type=float,
    default=1.0,
    show_default=True,
    help="Fractal zoom: above 1 creates detail, below 1 simplifies.",
)
def decode(genome: str, output: Path, identifier, zoom: float) -> None:
    """Write the map that a genome stands for, its attractor.

    The genome is a GENOME file, or that of one individual of a RUN folder, named by --id.
    """
    from evocity.io import WRITERS

    check_output(output, genome, WRITERS)
    code = genome_of(genome, identifier)
    _check_size(code.pavement, zoom)
    decoding = converged(evocity.decode(code, zoom=zoom), genome)
    city = decoding.city
    city = city.replace(city.heights, name=decoded_name(city.name, genome, identifier))
    evocity.write_map(city, output)
    click.echo(describe(city))
    click.echo(f"decoded in {decoding.iterations} steps")
    click.echo(f"wrote {output}")


def _check_size(pavement, zoom: float) -> None:
    from evocity.citymap import MAX_PIXELS

    pixels = pavement.height * pavement.width * zoom**2
    if pixels > MAX_PIXELS:
        most = (MAX_PIXELS / (pavement.height * pavement.width)) ** 0.5
        raise EvocityError(
            f"zoom = {zoom:g} makes a map of {pixels / 1e6:.0f} million pixels",
            f"at most {MAX_PIXELS // 10**6} million",
            f"choose a zoom below {most:.0f}",
        )
