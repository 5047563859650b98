"""`evocity pattern`: a town drawn by a rule becomes a map."""

import inspect
from collections.abc import Callable
from pathlib import Path

import click

import evocity
from evocity.cli.common import check_output, describe, echo, output_option
from evocity.cli.settings import settings_of, settings_option
from evocity.errors import EvocityError, near_miss


@click.command(
    epilog="""\b
Examples:
  evocity pattern concentric -o concentric.tif
  evocity pattern concentric -o concentric.gpkg
  evocity pattern chessboard --seed 7 --set block=60 --set storeys=[3,6] -o chess.png
  evocity pattern substitution --set motif=AAB/C.B/CDD --set iterations=3 -o motif.tif"""
)
@click.argument("name", metavar="NAME")
@output_option(
    "MAP",
    "Map to write: .tif (heights), .gpkg (footprints with heights), .png (a picture), .npy (bare "
    "heights); overwritten if it exists.",
)
@click.option(
    "--pixels", type=int, default=256, show_default=True, help="Side of the square map, pixels."
)
@click.option(
    "--metres-per-pixel",
    type=float,
    default=2.0,
    show_default=True,
    help="Side of a pixel, metres.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    show_default="a regular town",
    help="Draw what differs from house to house: a storey, and depth.",
)
@settings_option("the town's own")
def pattern(name: str, output: Path, pixels, metres_per_pixel, seed, settings) -> None:
    """Draw a town by a rule: parents for breeding whose plan is known.

    \b
    NAME is one of
      substitution  a motif put in the place of each of its own shapes, again and again
      concentric    streets in rings about a place, crossed by roads and lanes
      chessboard    square blocks, closed ones and open ones in turn
      radial        streets from a place outwards, ever more of them

    docs/pictures.md tells the parameters of each. The same seed draws the same town.
    """
    from evocity.io import WRITERS
    from evocity.io.polygons import no_geojson
    from evocity.towns import PATTERNS

    if name not in PATTERNS:
        raise EvocityError(
            f"no pattern is called {name!r}",
            f"one of {', '.join(PATTERNS)}",
            near_miss(name, PATTERNS) or "choose one of these",
        )
    check_output(output, "", WRITERS)
    if output.suffix.lower() == ".geojson":
        raise no_geojson(f"a town drawn by the rule {name}")
    town = PATTERNS[name]
    chosen = _chosen(settings, name, town)
    city = town(pixels, metres_per_pixel, rng=_generator(seed), **chosen)
    evocity.write_map(city, output)
    echo(describe(city))
    echo(f"wrote {output}")


def _generator(seed: int | None):
    import numpy as np

    return None if seed is None else np.random.default_rng(seed)


def _chosen(settings: tuple[str, ...], name: str, town: Callable) -> dict[str, object]:
    """Parameters by name, of ``KEY=VALUE`` each."""
    known = dict(inspect.signature(town).parameters)
    for option in ("pixels", "metres_per_pixel", "rng"):  # these have options of their own
        del known[option]
    texts = [key for key, one in known.items() if isinstance(one.default, str)]
    chosen = settings_of(settings, texts)
    for key in chosen:
        if key not in known:
            raise EvocityError(
                f"--set {key}",
                f"KEY=VALUE with a parameter of {name}: {', '.join(known)}",
                near_miss(key, known) or "correct it, or leave it out",
            )
    return chosen
