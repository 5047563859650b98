"""`evocity grow`: a genome becomes a fabric of any size."""

import time
from pathlib import Path

import click

from evocity.cli.common import (
    check_output,
    json_option,
    output_option,
    print_json,
    progress_bar,
    writing,
)
from evocity.cli.given import id_option
from evocity.cli.parents import parent_options, parents_of
from evocity.errors import EvocityError

#: What is made whole in memory (footprints, a picture, a genome) has at most so many pixels: 4096².
MOST_WHOLE = 1 << 24


@click.command(
    epilog="""\b
Examples:
  evocity grow lyon.parquet --width 4096 --height 4096 -o large.tif
  evocity grow lyon-1er --width 1024 --height 512 --seed 7 --straight -o long.png
  evocity grow runs/lyon-x-montpellier --id 97 --width 1024 --height 1024 -o large.parquet"""
)
@click.argument("genome", metavar="GENOME|RUN|MAP")
@click.option("--width", type=int, required=True, help="Of the fabric, pixels: a multiple of B.")
@click.option("--height", type=int, required=True, help="Of the fabric, pixels: a multiple of B.")
@output_option(
    "FILE",
    "File to write: .tif (heights, where on Earth), .npy (bare heights); up to 4096 × 4096 px "
    "also .gpkg and .geojson (footprints with heights), .png (a picture) and .parquet (the fabric "
    "as a genome); overwritten if it exists.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Of all that is drawn: the same seed grows the same fabric.",
)
@click.option(
    "--corner",
    type=int,
    nargs=2,
    metavar="ROW COLUMN",
    show_default="the middle",
    help="Where in the fabric the original's north-west corner lies, in range blocks.",
)
@click.option(
    "--size-min",
    type=int,
    show_default="just above half of --size-max",
    help="Smallest side of a group, range blocks.",
)
@click.option(
    "--size-max",
    type=int,
    show_default="56 px, or half the original if that is less",
    help="Largest side of a group, range blocks; at most 56 px.",
)
@click.option(
    "--tolerance",
    type=float,
    default=6.0,
    show_default=True,
    help="S: largest mean step along a group's outline, metres.",
)
@click.option(
    "--candidates",
    type=int,
    default=600,
    show_default=True,
    help="How many are drawn for each group; more fit better, and take longer.",
)
@click.option(
    "--straight",
    is_flag=True,
    help="Turn and mirror no group: streets keep their directions.",
)
@id_option
@parent_options
@json_option
def grow(
    genome, width, height, output: Path, seed, corner, size_min, size_max, tolerance, candidates,
    straight, identifier, reading, coding, as_json,
) -> None:  # fmt: skip
    """Grow a fabric of any size around a city.

    The original stays as it is; groups of its lifs are laid around it where their outlines fit
    what stands there, so that no seam is seen, and so that no window of 64 × 64 px comes twice
    but those which the original itself repeats (docs/operators.md). The fabric is written by
    windows: a large one needs little memory.

    GENOME is a genome file, a run folder with --id, a map file or the name of a bundled
    district; maps are coded first.

    JSON keys: groups, step (mean along their outlines, metres), forced (groups without an
    admissible candidate), repeated (groups that make a window come twice), corner, size_min,
    size_max, repaired (lifs; of a genome alone), seconds.
    """
    import numpy as np

    from evocity.growth import grow as grown
    from evocity.io import WINDOW_WRITERS, WRITERS
    from evocity.io.polygons import is_placed, no_geojson

    check_output(output, genome, {*WINDOW_WRITERS, *WRITERS, ".parquet"})
    suffix = output.suffix.lower()
    if suffix not in WINDOW_WRITERS and width * height > MOST_WHOLE:
        raise EvocityError(
            f"{height} × {width} px as {suffix}",
            f"at most {MOST_WHOLE // 10**6} million px, 4096 × 4096",
            "write a .tif or .npy, or choose a smaller size",
        )
    (code,) = parents_of([genome], () if identifier is None else (identifier,), reading, coding)
    if suffix == ".geojson" and not is_placed(code):
        raise no_geojson(" × ".join(code.cities))
    start = time.perf_counter()
    with progress_bar(f"growing {' × '.join(code.cities)}") as progress:
        fabric = grown(
            code,
            height,
            width,
            np.random.default_rng(seed),
            corner=corner or None,
            size_min=size_min,
            size_max=size_max,
            tolerance=tolerance,
            candidates=candidates,
            turned=not straight,
            progress=progress,
        )
    seconds = time.perf_counter() - start
    made = dict(fabric.made) | _write(fabric, output)
    if as_json:
        told = ("groups", "step", "forced", "repeated", "corner", "size_min", "size_max")
        facts = {key: made[key] for key in (*told, "repaired") if key in made}
        print_json({**facts, "seconds": seconds})
        return
    pixel = fabric.metres_per_pixel
    click.echo(
        f"{fabric.name}: {height} × {width} px at {pixel:g} m, "
        f"{height * pixel / 1000:.3g} × {width * pixel / 1000:.3g} km"
    )
    click.echo(
        f"{made['groups']} groups of {made['size_min']} to {made['size_max']} range blocks laid "
        f"in {seconds:.1f} s; mean step along their outlines {made['step']:.2f} m"
    )
    if made["forced"]:
        click.echo(
            f"{made['forced']} of them had no admissible candidate: the least step was taken"
        )
    if made["repeated"]:
        click.echo(f"{made['repeated']} of them make a window of 64 × 64 px come twice")
    if "repaired" in made:
        click.echo(f"{made['repaired']} of {len(fabric.pavement)} lifs repaired")
    click.echo(f"wrote {output}")


def _write(fabric, output: Path) -> dict:
    """Write a fabric as the suffix says; returns what was made besides."""
    import evocity
    from evocity.io import WINDOW_WRITERS, WRITERS, write_windows

    if output.suffix.lower() in WINDOW_WRITERS:
        with progress_bar(f"writing {output.name}") as progress:
            write_windows(fabric, output, progress)
    elif output.suffix.lower() in WRITERS:
        evocity.write_map(fabric.city(), output)
    else:
        genome = fabric.genome()
        with writing(output):
            genome.write(output)
        return dict(genome.made)
    return {}
