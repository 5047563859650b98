"""`evocity grow`: a genome becomes a fabric of any size."""

import contextlib
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import click

from evocity.cli.common import (
    check_output,
    echo,
    json_option,
    output_option,
    print_json,
    progress_bar,
    writing,
)
from evocity.cli.given import ids_option
from evocity.cli.parents import parent_options, parents_of
from evocity.errors import EvocityError

#: What is made whole in memory (footprints, a picture, a genome) has at most so many pixels: 4096².
MOST_WHOLE = 1 << 24


@click.command(
    epilog="""\b
Examples:
  evocity grow lyon.parquet --width 4096 --height 4096 -o large.tif
  evocity grow lyon-1er --width 1024 --height 512 --seed 7 --straight -o long.png
  evocity grow lyon-1er --width 1024 --height 1024 --top -5000 --left 20000 -o far.tif
  evocity grow lyon-1er montpellier-pas-du-loup --width 1024 --height 512 -o between.tif
  evocity grow runs/lyon-x-montpellier --id 97 --width 1024 --height 1024 -o large.parquet"""
)
@click.argument("genomes", metavar="GENOME|RUN|MAP...", nargs=-1, required=True)
@click.option("--width", type=int, required=True, help="Of the map that is written, pixels.")
@click.option("--height", type=int, required=True, help="Of the map that is written, pixels.")
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
    help="Seed of all random draws: the same seed grows the same fabric.",
)
@click.option(
    "--top",
    type=int,
    metavar="PIXELS",
    show_default="such that the original stands in the middle, or 0 with --left",
    help="Row of the map's north-west pixel, counted from the first original's; may be negative.",
)
@click.option(
    "--left",
    type=int,
    metavar="PIXELS",
    show_default="such that the original stands in the middle (of several, in the west), or 0 "
    "with --top",
    help="Column of the map's north-west pixel, counted from the first original's.",
)
@click.option(
    "--corner",
    type=int,
    nargs=2,
    metavar="ROW COLUMN",
    show_default="the middle",
    help="Where in the map the original's north-west corner lies, in cells; in place of --top "
    "and --left.",
)
@click.option(
    "--share",
    multiple=True,
    metavar="FILE|NUMBER",
    show_default="a ramp from west to east",
    help="Of two genomes: a picture laid over the map, black where the first is laid, white where "
    "the second is; or the second's share, 0 to 1. Of more: one for each genome, in their order.",
)
@click.option(
    "--share-over",
    type=int,
    nargs=4,
    metavar="TOP LEFT HEIGHT WIDTH",
    show_default="the map that is written",
    help="What the picture or the ramp is laid over, pixels from the first original's corner: the "
    "same for maps that are to fit each other.",
)
@click.option(
    "--cell",
    type=int,
    metavar="PIXELS",
    show_default="about 8 m, whole range blocks",
    help="Side of the squares that groups are cut along.",
)
@click.option(
    "--side-min",
    type=float,
    metavar="METRES",
    show_default="just above half of --side-max",
    help="Smallest side of a group.",
)
@click.option(
    "--side-max",
    type=float,
    metavar="METRES",
    show_default="56 px, or half the original if that is less",
    help="Largest side of a group, at most 56 px.",
)
@click.option(
    "--size-min",
    type=int,
    show_default="none",
    help="Deprecated: --side-min in range blocks.",
)
@click.option(
    "--size-max",
    type=int,
    show_default="none",
    help="Deprecated: --side-max in range blocks.",
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
@ids_option("Of a run folder: which individual. Once for each run among the genomes, in order.")
@parent_options
@json_option
def grow(
    genomes, width, height, output: Path, seed, top, left, corner, share, share_over, cell,
    side_min, side_max, size_min, size_max, tolerance, candidates, straight, identifiers,
    reading, coding, as_json,
) -> None:  # fmt: skip
    """Grow a fabric without end around a city, or between several.

    The original stays as it is; groups of its fabric are laid around it where their outlines fit
    what stands there, so that no seam is seen, and so that no window of 64 × 64 px comes twice
    but those which the original itself repeats (docs/operators.md). What stands at a place
    depends on the genomes, the options and the seed alone: --top and --left show any place of
    the same fabric, and maps that meet fit each other. The map is written by windows: a large
    one needs little memory.

    Each GENOME is a genome file, a run folder with --id, a map file or the name of a bundled
    district; maps are coded first. Of several, the first stands in the fabric, and groups of
    each are laid by their --share.

    JSON keys: groups, step (mean along their outlines, metres), forced (groups without an
    admissible candidate), repeated (groups that make a window come twice), top, left, cell
    (pixels), side_min, side_max (metres), repaired (lifs; of a genome alone), seconds.
    """
    import numpy as np

    from evocity.growth import grow as grown
    from evocity.io import WINDOW_WRITERS, WRITERS
    from evocity.io.polygons import is_placed, no_geojson

    for genome in genomes:
        check_output(output, genome, {*WINDOW_WRITERS, *WRITERS, ".parquet"})
    suffix = output.suffix.lower()
    if suffix not in WINDOW_WRITERS and width * height > MOST_WHOLE:
        raise EvocityError(
            f"{height} × {width} px as {suffix}",
            f"at most {MOST_WHOLE // 10**6} million px, 4096 × 4096",
            "write a .tif or .npy, or choose a smaller size",
        )
    if corner and not (top is None and left is None):
        raise EvocityError(
            "--corner with --top or --left",
            "one way to say where the map lies",
            "leave --corner out",
        )
    if share_over and top is None and left is None:
        raise EvocityError(
            "--share-over without --top and --left",
            "the place of the map too: both are counted from the first original",
            "add --top and --left, or leave --share-over out",
        )
    painted = _share(share, len(genomes))
    codes = parents_of(genomes, identifiers, reading, coding)
    if suffix == ".geojson" and not is_placed(codes[0]):
        raise no_geojson(" × ".join(codes[0].cities))
    start = time.perf_counter()
    placed = top is not None or left is not None
    place = (top or 0, left or 0, height, width)
    fabric = grown(
        codes,
        height,
        width,
        np.random.default_rng(seed),
        corner=(0, 0) if placed else corner or None,
        share=painted,
        share_over=share_over or (place if placed and len(codes) > 1 else None),
        cell=cell,
        side_min=side_min,
        side_max=side_max,
        size_min=size_min,
        size_max=size_max,
        tolerance=tolerance,
        candidates=candidates,
        turned=not straight,
    )
    if placed:
        fabric = fabric.at(*place)
    top, left = (-at for at in fabric.place)
    with progress_bar(f"growing {fabric.name}") as progress:
        made = {**fabric.made, **fabric.account(progress=progress)}
    seconds = time.perf_counter() - start
    made |= _write(fabric, output) | {"top": top, "left": left}
    if as_json:
        told = (
            "groups",
            "step",
            "forced",
            "repeated",
            "top",
            "left",
            "cell",
            "side_min",
            "side_max",
        )
        facts = {key: made[key] for key in (*told, "repaired") if key in made}
        print_json({**facts, "seconds": seconds})
        return
    pixel = fabric.metres_per_pixel
    echo(
        f"{fabric.name}: {height} × {width} px at {pixel:g} m, "
        f"{height * pixel / 1000:.3g} × {width * pixel / 1000:.3g} km, "
        f"from row {top}, column {left}"
    )
    echo(
        f"{made['groups']} groups of {made['side_min']:g} to {made['side_max']:g} m laid "
        f"in {seconds:.1f} s; mean step along their outlines {made['step']:.2f} m"
    )
    if made["forced"]:
        echo(f"{made['forced']} of them had no admissible candidate: the least step was taken")
    if made["repeated"]:
        echo(f"{made['repeated']} of them make a window of 64 × 64 px come twice")
    if "repaired" in made:
        echo(f"{made['repaired']} lifs repaired")
    echo(f"wrote {output}")


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


def _share(words: Sequence[str], count: int):
    """What --share says: None, a number, or an array of shares."""
    if not words:
        return None
    wanted = 1 if count == 2 else count
    if count == 1 or len(words) != wanted:
        raise EvocityError(
            f"{len(words)} × --share for {count} genomes",
            "one for two genomes; one for each of three or more",
            "leave --share out" if count == 1 else f"give --share {wanted} times",
        )
    shares = [_one_share(word) for word in words]
    if wanted == 1:
        return shares[0]
    rasters = {one.shape for one in shares if not isinstance(one, float)}
    if len(rasters) > 1:
        sizes = " and ".join(f"{tall} × {wide}" for tall, wide in sorted(rasters))
        raise EvocityError(
            f"--share with pictures of {sizes} px",
            "pictures of one size",
            "scale them to one size",
        )
    if not rasters:
        return shares
    import numpy as np

    return np.stack([np.broadcast_to(one, *rasters) for one in shares])


def _one_share(word: str):
    """A number, or what a picture says: 0 where it is black, 1 where it is white."""
    with contextlib.suppress(ValueError):
        return float(word)
    import numpy as np
    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"), Image.open(word) as image:
            if image.mode.startswith("I"):  # 16 bits a pixel
                return np.asarray(image, float) / 65535
            return np.asarray(image.convert("L"), float) / 255
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise EvocityError(
            f"--share {word}: {error}",
            "a number from 0 to 1, or a picture such as a PNG: black where the first is laid, "
            "white where the second is",
            "check the name and the file",
        ) from error
