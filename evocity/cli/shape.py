"""`evocity shape`: draws and counts iterated function systems."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.shared.checks import replace_file
from evocity.cli.shared.commands import command
from evocity.cli.shared.options import frames_option, json_option, option
from evocity.cli.shared.terminal import echo, print_json, warn
from evocity.errors import EvocityError

if TYPE_CHECKING:
    from evocity.shapes import Shape


@click.group()
def shape() -> None:
    """Draw, measure, count and morph fractal shapes without a city.

    NAME is sierpinski, koch, dragon, levy, carpet, fern or menger; FILE is a JSON file that
    `evocity.shapes.write_shape` wrote.
    """


_output = option(
    "-o --output PNG|SVG|GLB",
    "File to write; an existing file is overwritten. An SVG or GLB file needs --depth.",
    click.Path(path_type=Path, dir_okay=False),
    required=True,
)
_side = option("--side", "Side of the picture, in pixels.", click.IntRange(8, 8192), 512)
_depth = option(
    "--depth",
    "Depth of the recursion: the number of affine maps that are applied in sequence. [until pieces"
    " are a pixel]",
    click.IntRange(0, 63),
)


@command("""
  evocity shape show koch -o koch.png
  evocity shape show dragon --depth 10 -o dragon.svg
  evocity shape show menger --depth 2 -o menger.glb
  evocity shape show menger --depth 2 --paint position -o colours.glb
  evocity shape show mine.json --side 1024 -o mine.png""")
@click.argument("name", metavar="NAME|FILE")
@_output
@_side
@_depth
@option(
    "--paint",
    'Colours in a GLB file: "maps" for the colours of the maps, or "position" for x, y and z as '
    "red, green and blue; the shape must lie between 0 and 1. [maps]",
    click.Choice(["maps", "position"]),
)
def show(name: str, output: Path, side: int, depth: int | None, paint: str | None) -> None:
    """Draw a two-dimensional shape as a picture, or a three-dimensional shape as a GLB file."""
    if paint is not None and output.suffix.lower() != ".glb":
        raise EvocityError(
            f"--paint cannot be used with the output {output.name}",
            "an output file whose name ends in .glb",
            "leave --paint out, or choose another file name",
        )
    _draw(_read_shape(name), output, side, depth, paint or "maps")
    size = "" if output.suffix.lower() == ".glb" else f", {side} × {side} px"
    echo(f"{output}: {name}{size}")


@command("""
  evocity shape dimension koch
  evocity shape dimension carpet --json""")
@click.argument("name", metavar="NAME|FILE")
@option("--side", "Largest raster side, in pixels. [4096, in space 256]", click.IntRange(64, 8192))
@json_option
def dimension(name: str, side: int | None, as_json: bool) -> None:
    """Print two fractal dimensions of a shape: one from the affine maps, and one from box counting.

    The dimension from the affine maps is exact if all affine maps are similarities and the pieces
    of the shape do not overlap. If pieces overlap, the exact dimension of a shape is unknown. Box
    counting uses the cells of a raster as boxes.

    The JSON document has the keys "dimension" (from the affine maps; null if unknown) and "boxes"
    (from box counting).
    """
    from evocity.shapes import ShapeError, box_dimension, dimension_of

    drawn = _read_shape(name)
    exact, why = None, ""
    try:
        exact = dimension_of(drawn)
    except ShapeError as error:
        why = error.found
    boxes = box_dimension(drawn, side)
    if as_json:
        print_json({"dimension": exact, "boxes": boxes.dimension})
        return
    echo(f"exact: {exact:.12g}" if exact is not None else f"exact: unknown; {why}")
    sides = f"boxes of {boxes.sides[0]} to {boxes.sides[-1]} px"
    echo(f"by {sides}: {boxes.dimension:.4f}")


@command("""
  evocity shape count koch --depth 6
  evocity shape count mine.json --depth 400 --json""")
@click.argument("name", metavar="NAME|FILE")
@option(
    "--depth",
    "Depth of the recursion: the number of affine maps that are applied in sequence.",
    click.IntRange(0, 10000),
    required=True,
)
@json_option
def count(name: str, depth: int, as_json: bool) -> None:
    """Print the exact number of pieces of a shape at a given depth, without drawing the shape.

    The JSON document has the key "count".
    """
    pieces = _read_shape(name).count(depth)
    print_json({"count": pieces}) if as_json else echo(f"{pieces}")


@command("""
  evocity shape morph koch levy -t 0.5 -o between.png
  evocity shape morph koch levy --frames 25 -o film.webp
  evocity shape morph koch carpet --frames 8 --side 256 -o strip.png""")
@click.argument("first", metavar="NAME|FILE")
@click.argument("last", metavar="NAME|FILE")
@option(
    "-t",
    "Position of the drawn shape between the first shape (0) and the second shape (1).",
    click.FloatRange(0, 1),
)
@frames_option
@_output
@_side
@_depth
def morph(
    first: str, last: str, t: float | None, frames, output: Path, side: int, depth: int | None
) -> None:
    """Draw an intermediate shape between two given shapes, or the whole course in frames.

    With --frames, all frames show the same part of the plane, the first frame shows the first
    shape, and the last frame shows the second shape.

    Lines that are connected in both given shapes stay connected in every intermediate shape. If the
    shapes have different numbers of affine maps, the command prints how it pairs the affine maps.
    """
    from evocity.shapes import metamorphosis

    if (t is None) == (frames is None):
        raise EvocityError(
            f"{'neither -t nor --frames is' if t is None else '-t and --frames are both'} given",
            "either -t with a position from 0 to 1, or --frames with a number of frames",
            "give for example -t 0.5 or --frames 25",
        )
    if frames is not None:
        from evocity.cli.shared.frames import check_film

        check_film(output, frames)
    start, end = _read_shape(first), _read_shape(last)
    between = metamorphosis(start, end)
    if frames is None:
        _draw(between(t), output, side, depth)
        echo(f"{output}: {first} to {last}, t = {t:g}")
    else:
        _film(between, output, frames, side, depth)
        echo(f"{output}: {first} to {last}, {frames} frames")
    if len(start) != len(end):
        pairs = ", ".join(f"{a}→{b}" for a, b in between.pairs)
        warn(
            f"{len(start)} maps and {len(end)}: paired {pairs}; a map without a pair has no length"
        )


def _film(between, output: Path, frames: int, side: int, depth: int | None) -> None:
    """Write a metamorphosis in frames that all show the box of all of them."""
    import numpy as np

    from evocity.cli.shared.frames import write_film
    from evocity.shapes import picture_of
    from evocity.shapes.rendering import box_of

    shapes = [between(number / (frames - 1)) for number in range(frames)]
    boxes = np.stack([box_of(shape, depth) for shape in shapes])
    box = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    pictures = (picture_of(shape, side, depth, box) for shape in shapes)
    write_film(pictures, output, frames=frames)


def _read_shape(name: str) -> "Shape":
    from evocity.shapes import KNOWN, known, read_shape

    if name in KNOWN or not (os.sep in name or "." in name or Path(name).exists()):
        return known(name)
    return read_shape(name)


def _draw(drawn: "Shape", output: Path, side: int, depth: int | None, paint: str = "maps") -> None:
    from evocity.shapes import glb_of, picture_of, svg_of

    suffix = output.suffix.lower()
    if suffix not in (".png", ".svg", ".glb"):
        expected = "a name that ends in .png, .svg or .glb"
        raise EvocityError(f"the output {output}", expected, "choose another name after -o")
    if suffix != ".png" and depth is None:
        name = suffix[1:].upper()
        raise EvocityError(
            f"a file in the format {name} needs a depth, but --depth is missing",
            "the option --depth with a number of recursions",
            "add --depth, for example --depth 6",
        )
    with replace_file(output) as temporary:
        if suffix == ".png":
            picture_of(drawn, side, depth).save(temporary, "PNG")
        elif suffix == ".glb":
            temporary.write_bytes(glb_of(drawn, depth, paint=paint))
        else:
            temporary.write_text(svg_of(drawn, depth, side), encoding="utf-8")


for _command in (show, dimension, count, morph):
    shape.add_command(_command)
