"""Colours for shapes: palettes for other forms, and colours stolen from a picture.

Source: Tosan, Excoffier, Rondet-Mignotte 2005, §5.2; Barnsley 2005 (tops, colour stealing).
"""

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from evocity.shapes._kernels import DEEPEST
from evocity.shapes.checks import (
    array_like,
    check_range,
    colours_of,
    corners,
    finite_language_error,
)
from evocity.shapes.languages import ShapeError
from evocity.shapes.rendering import Frame
from evocity.shapes.shape import MOST_PIECES, Shape, walk

_PAPER = (255, 255, 255)


def palette(colours: ArrayLike, mix: float = 0.5) -> Shape:
    """Make a palette: the unit square, divided into m × m squares of the ``colours`` ``(m, m, 3)``.

    The numbers for red, green and blue are 0 to 1. The squares follow the columns of colours from
    the left, and run upwards in each column. The function `coloured_as` gives the colours of a
    palette to a shape with the same number of maps. Raises `ShapeError` for invalid colours.
    """
    given = array_like(
        colours, "colours", "(m, m, 3)", lambda s: len(s) == 3 and s[0] == s[1] and s[2] == 3
    )
    side = len(given)
    maps = [
        [[1 / side, 0, i / side], [0, 1 / side, j / side]]
        for i, j in product(range(side), repeat=2)
    ]
    return Shape(np.array(maps), "square", None, given.reshape(-1, 3), mix)


def palette_of(picture: Image.Image, side: int = 4, mix: float = 0.5) -> Shape:
    """Make the palette of a ``picture``: the mean colours of its ``side`` × ``side`` parts."""
    check_range("side", side, 1, 16)
    small = picture.convert("RGB").resize((side, side), Image.Resampling.BOX)
    cells = np.asarray(small, np.float64) / 255
    return palette(cells[::-1].transpose(1, 0, 2), mix)


def coloured_as(shape: Shape, other: Shape) -> Shape:
    """Give each map of a ``shape`` the colour of the map with the same number in the shape
    ``other``. Raises `ShapeError` if the shape ``other`` has no colours, or a different number of
    maps."""
    if other.colours is None:
        raise ShapeError(
            "the shape that gives its colours has no colours",
            "a shape that was made with colours",
            "make this shape with the parameter 'colours'",
        )
    return replace(shape, colours=other.colours, mix=other.mix)


def tinted(shape: Shape, colour: ArrayLike, depth: int) -> Shape:
    """Change the colours of a ``shape`` so that each mixture of ``depth`` maps begins with
    ``colour``: red, green and blue, 0…1 (Tosan, Excoffier, Rondet-Mignotte 2005, §5.1).

    A piece at this depth has the colour T̃_α c of the initial colour c, instead of the centre of
    T̃_α. The share of the initial colour is ``mix`` to the power ``depth``, so it vanishes in
    pictures without a depth. Raises `ShapeError` for a shape without colours or an invalid colour.
    """
    if shape.colours is None:
        raise ShapeError(
            "the shape has no colours", "a shape with colours", "make it with 'colours'"
        )
    initial = colours_of([colour], 1)
    check_range("depth", depth, 0, DEEPEST, whole=True)
    share = float(shape.mix) ** depth
    return replace(shape, colours=(1 - share) * shape.colours + share * initial)


def stolen(
    shape: Shape,
    source: Shape,
    picture: Image.Image,
    side: int = 512,
    most: int = MOST_PIECES,
) -> Image.Image:
    """Draw a ``shape`` with colours that another shape takes from a ``picture``.

    The shape ``source`` lies on the picture, which is 1 wide and 1 high, x to the right, y upwards.
    Each point of ``shape`` takes the colour at the point of ``source`` with the same address. The
    address of a point is the word whose maps lead to the point. If pieces overlap at a point, the
    greatest address of the point determines the colour.

    Raises `ShapeError` for three-dimensional shapes, for too many pieces, or if the two shapes have
    different numbers of maps.
    """
    if shape.size != 2 or source.size != 2:
        found = "one of the two shapes is not two-dimensional"
        raise ShapeError(found, "two two-dimensional shapes", "choose two such shapes")
    if len(shape) != len(source):
        raise ShapeError(
            f"the source shape has {len(source)} affine maps, but the shape has {len(shape)} "
            "affine maps",
            "two shapes with the same number of affine maps",
            f"choose a source with {len(shape)} affine maps",
        )
    if not shape.language.lasts:
        raise finite_language_error()
    frame = Frame.of(shape.box, side)
    # both at once: maps of the plane times the plane; pieces of the first are as fine as pixels
    pairs = np.zeros((len(shape), 4, 5))
    pairs[:, :2, [0, 1, 4]], pairs[:, 2:, [2, 3, 4]] = shape.maps, source.maps
    box = corners(shape.box)
    ends = np.column_stack([box, np.zeros_like(box)])
    fine, base = (1 + 1e-9) / frame.scale, np.zeros((len(shape), 0))
    automaton = shape._endless_automaton
    products, _, _ = walk(pairs, automaton, ends, DEEPEST, fine, base, 0.5, most)
    middles = [each.box.mean(axis=0) for each in (shape, source)]
    at = np.einsum("kij,j->ki", products[:, :2, :2], middles[0]) + products[:, :2, 4]
    there = np.einsum("kij,j->ki", products[:, 2:, 2:4], middles[1]) + products[:, 2:, 4]
    colours = np.asarray(picture.convert("RGB"))
    height, width = colours.shape[:2]
    rows = np.clip(np.floor((1 - there[:, 1]) * height), 0, height - 1).astype(np.int64)
    columns = np.clip(np.floor(there[:, 0] * width), 0, width - 1).astype(np.int64)
    painted = np.empty((side, side, 3), np.uint8)
    painted[:] = _PAPER
    cells = frame.cells(at)
    flat = cells[:, 0] * side + cells[:, 1]
    # the last of several pieces in a cell
    last = len(flat) - 1 - np.unique(flat[::-1], return_index=True)[1]
    painted.reshape(-1, 3)[flat[last]] = colours[rows[last], columns[last]]
    return Image.fromarray(painted)
