"""`evocity pattern`: a map of a town, drawn by a rule."""

import inspect
from collections.abc import Callable
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output
from evocity.cli.shared.commands import command
from evocity.cli.shared.options import (
    WHOLE,
    metres_option,
    option,
    output_option,
    pixels_option,
    settings_of,
    settings_option,
)
from evocity.cli.shared.terminal import describe, echo
from evocity.errors import EvocityError, near_miss


@command("""
  evocity pattern concentric -o concentric.tif
  evocity pattern concentric -o concentric.gpkg
  evocity pattern chessboard --seed 7 --set block=60 --set storeys=[3,6] -o chess.png
  evocity pattern substitution --set motif=AAB/C.B/CDD --set iterations=3 -o motif.tif""")
@click.argument("name", metavar="NAME")
@output_option(
    "MAP",
    "Map to write: .tif (heights), .gpkg (footprints with heights), .png (a picture) or .npy (only"
    " heights)",
)
@pixels_option
@metres_option
@option("--seed", "Seed of the random heights and depths of houses. [a regular town]", WHOLE)
@settings_option("the town's own")
def pattern(name: str, output: Path, pixels, metres_per_pixel, seed, settings) -> None:
    """Draw a town according to a rule, for use as a parent with a known plan.

    NAME is substitution, concentric, chessboard or radial. A substitution town repeats a motif: in
    each step, the whole motif replaces every shape in the town. A concentric town has ring streets
    around a central square, and roads and lanes that cross the ring streets. A chessboard town has
    square street blocks, where high blocks with a closed court alternate with low open blocks. A
    radial town has streets from a central square outwards, and the number of streets grows with the
    distance from the square.

    The page docs/pictures.md explains the parameters of each pattern. The same seed draws the same
    town.
    """
    import numpy as np

    from evocity.io import WRITERS
    from evocity.io.footprint_files import no_geojson
    from evocity.towns import PATTERNS

    if name not in PATTERNS:
        raise EvocityError(
            f"there is no pattern {name!r}",
            f"one of {', '.join(PATTERNS)}",
            near_miss(name, PATTERNS) or "choose one of these",
        )
    check_output(output, "", WRITERS)
    if output.suffix.lower() == ".geojson":
        raise no_geojson(f"a town drawn by the rule {name}")
    town = PATTERNS[name]
    parameters = _parameters(settings, name, town)
    rng = None if seed is None else np.random.default_rng(seed)
    city = town(pixels, metres_per_pixel, rng=rng, **parameters)
    evocity.write_map(city, output)
    echo(describe(city))
    echo(f"wrote {output}")


def _parameters(settings: tuple[str, ...], name: str, town: Callable) -> dict[str, object]:
    """Read parameters by name, from ``KEY=VALUE`` each."""
    known = dict(inspect.signature(town).parameters)
    for option_name in ("pixels", "metres_per_pixel", "rng"):  # these have options of their own
        del known[option_name]
    texts = [key for key, parameter in known.items() if isinstance(parameter.default, str)]
    values = settings_of(settings, texts)
    for key in values:
        if key not in known:
            raise EvocityError(
                f"--set {key}",
                f"KEY=VALUE with a parameter of {name}: {', '.join(known)}",
                near_miss(key, known) or "correct it, or leave it out",
            )
    return values
