"""`evocity shape`: iterated function systems, drawn and counted."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.common import echo, json_option, print_json, warn, writing
from evocity.errors import EvocityError
from evocity.files import whole_file

if TYPE_CHECKING:
    from evocity.shapes import Shape


@click.group()
def shape() -> None:
    """Shapes of few numbers, without any city: draw, count, turn one into another.

    NAME is sierpinski, koch, dragon, levy, carpet, fern or menger; FILE is JSON, as
    `evocity.shapes.write_shape` writes it.
    """


_output = click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    metavar="PNG|SVG|GLB",
    help="File to write; overwritten if it exists. SVG and GLB need --depth.",
)
_side = click.option(
    "--side", type=click.IntRange(8, 8192), default=512, show_default=True, help="Its side, px."
)
_depth = click.option(
    "--depth",
    type=click.IntRange(0, 63),
    show_default="as deep as pieces are a pixel",
    help="How many maps one after another.",
)


@shape.command(
    epilog="""\b
Examples:
  evocity shape show koch -o koch.png
  evocity shape show dragon --depth 10 -o dragon.svg
  evocity shape show menger --depth 2 -o menger.glb
  evocity shape show mine.json --side 1024 -o mine.png"""
)
@click.argument("name", metavar="NAME|FILE")
@_output
@_side
@_depth
def show(name: str, output: Path, side: int, depth: int | None) -> None:
    """Draw a shape: of the plane as a picture, of space as solids in GLB."""
    _drawn(_shape(name), output, side, depth)
    size = "" if output.suffix.lower() == ".glb" else f", {side} × {side} px"
    echo(f"{output}: {name}{size}")


@shape.command(
    epilog="""\b
Examples:
  evocity shape dimension koch
  evocity shape dimension carpet --json"""
)
@click.argument("name", metavar="NAME|FILE")
@click.option(
    "--side",
    type=click.IntRange(64, 8192),
    show_default="4096, in space 256",
    help="Side of the raster that boxes are counted in, px, at most.",
)
@json_option
def dimension(name: str, side: int | None, as_json: bool) -> None:
    """Tell the dimension of a shape: by its maps and its language, and by counting boxes.

    The first is exact where all maps are similarities and pieces do not overlap; there is none for
    others. The second is measured in a raster.

    JSON keys: dimension (null where it is not known), boxes.
    """
    from evocity.shapes import ShapeError, box_dimension, dimension_of

    one = _shape(name)
    exact, why = None, ""
    try:
        exact = dimension_of(one)
    except ShapeError as error:
        why = error.found
    boxes = box_dimension(one, side)
    if as_json:
        print_json({"dimension": exact, "boxes": boxes.dimension})
        return
    echo(f"exact: {exact:.12g}" if exact is not None else f"exact: not known; {why}")
    sides = f"boxes of {boxes.sides[0]} to {boxes.sides[-1]} px"
    echo(f"by {sides}: {boxes.dimension:.4f}")


@shape.command(
    epilog="""\b
Examples:
  evocity shape count koch --depth 6
  evocity shape count mine.json --depth 400 --json"""
)
@click.argument("name", metavar="NAME|FILE")
@click.option(
    "--depth", type=click.IntRange(0, 10000), required=True, help="How many maps one after another."
)
@json_option
def count(name: str, depth: int, as_json: bool) -> None:
    """Tell how many pieces a shape has at a depth, exactly, without drawing them.

    JSON keys: count.
    """
    found = _shape(name).count(depth)
    print_json({"count": found}) if as_json else echo(f"{found}")


@shape.command(
    epilog="""\b
Examples:
  evocity shape morph koch levy -t 0.5 -o between.png"""
)
@click.argument("first", metavar="NAME|FILE")
@click.argument("last", metavar="NAME|FILE")
@click.option("-t", type=click.FloatRange(0, 1), required=True, help="How far, from 0 to 1.")
@_output
@_side
@_depth
def morph(first: str, last: str, t: float, output: Path, side: int, depth: int | None) -> None:
    """Draw what lies between two shapes.

    Lines that hang together do so in between. Of shapes with other numbers of maps it is told
    which map becomes which.
    """
    from evocity.shapes import metamorphosis

    one, other = _shape(first), _shape(last)
    between = metamorphosis(one, other)
    _drawn(between(t), output, side, depth)
    echo(f"{output}: {first} to {last}, t = {t:g}")
    if len(one) != len(other):
        pairs = ", ".join(f"{a}→{b}" for a, b in between.pairs)
        warn(f"{len(one)} maps and {len(other)}: paired {pairs}; what one lacks has no length")


def _shape(name: str) -> "Shape":
    from evocity.shapes import KNOWN, known, read_shape

    if name in KNOWN or not (os.sep in name or "." in name or Path(name).exists()):
        return known(name)
    return read_shape(name)


def _drawn(one: "Shape", output: Path, side: int, depth: int | None) -> None:
    from evocity.shapes import glb_of, picture_of, svg_of

    suffix = output.suffix.lower()
    if suffix not in (".png", ".svg", ".glb"):
        expected = "a name that ends in .png, .svg or .glb"
        raise EvocityError(f"{output}", expected, "choose one of these")
    if suffix != ".png" and depth is None:
        raise EvocityError(
            f"{suffix[1:].upper()} without --depth",
            "how deep to draw",
            "add --depth, for example 6",
        )
    with writing(output), whole_file(output) as temporary:
        if suffix == ".png":
            picture_of(one, side, depth).save(temporary, "PNG")
        elif suffix == ".glb":
            temporary.write_bytes(glb_of(one, depth))
        else:
            temporary.write_text(svg_of(one, depth, side), encoding="utf-8")


__all__ = ["shape"]
