"""Colours for shapes: palettes for other forms, and colours stolen from a picture.

Source: Tosan, Excoffier, Rondet-Mignotte 2005, §5.2; Barnsley 2005 (tops, colour stealing).
"""

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from evocity.shapes._kernels import DEEPEST
from evocity.shapes.checks import corners, finite_language_error
from evocity.shapes.languages import ShapeError
from evocity.shapes.rendering import Frame
from evocity.shapes.shape import MOST_PIECES, Shape, walk

_PAPER = (255, 255, 255)


def palette(colours: ArrayLike, mix: float = 0.5) -> Shape:
    """Make the chequer of the unit square with ``colours`` ``(m, m, 3)``, each 0…1. Its m² maps go
    column by column from the left, each column from below. Use `coloured_as` to give these colours
    to a form with the same number of maps. Raises `ShapeError` for invalid colours."""
    given = np.array(colours, np.float64)
    if given.ndim != 3 or given.shape[0] != given.shape[1] or given.shape[2] != 3:
        raise ShapeError(
            f"the colours have the shape {given.shape}", "(m, m, 3)", "give m × m colours"
        )
    side = len(given)
    maps = [
        [[1 / side, 0, i / side], [0, 1 / side, j / side]]
        for i, j in product(range(side), repeat=2)
    ]
    return Shape(np.array(maps), "square", None, given.reshape(-1, 3), mix)


def palette_of(picture: Image.Image, side: int = 4, mix: float = 0.5) -> Shape:
    """Make the palette of a picture: the mean colours of its ``side`` × ``side`` parts."""
    if isinstance(side, bool) or not 1 <= side <= 16:
        raise ShapeError(f"side = {side}", "a whole number, 1 to 16", "choose another side")
    small = picture.convert("RGB").resize((side, side), Image.Resampling.BOX)
    cells = np.asarray(small, np.float64) / 255
    return palette(cells[::-1].transpose(1, 0, 2), mix)


def coloured_as(shape: Shape, other: Shape) -> Shape:
    """Give a shape the colours of the shape ``other``, map by map in their order. Raises
    `ShapeError` if ``other`` has no colours, or a different number of maps."""
    if other.colours is None:
        raise ShapeError(
            "the shape has no colours",
            "a shape with colours",
            "give the shape colours with colours=",
        )
    return replace(shape, colours=other.colours, mix=other.mix)


def stolen(
    shape: Shape,
    source: Shape,
    picture: Image.Image,
    side: int = 512,
    most: int = MOST_PIECES,
) -> Image.Image:
    """Draw a shape in the colours of a picture. The shape ``source`` lies on the picture. Each
    point takes the colour at the place with the same address in ``source``. The picture's width and
    height are 1, x to the right, y upwards. Where pieces overlap, the greatest address counts.

    Raises `ShapeError` for shapes of space, too many pieces, and if the two shapes differ in their
    number of maps.
    """
    if shape.size != 2 or source.size != 2:
        raise ShapeError("a shape lies in space", "two shapes of the plane", "choose another shape")
    if len(shape) != len(source):
        raise ShapeError(
            f"the source has {len(source)} maps, but the shape {len(shape)}",
            "the same number of maps",
            "choose another source",
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
