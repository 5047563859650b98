"""Colours from elsewhere: palettes carried from form to form, colours stolen from a picture.

Source: Tosan, Excoffier, Rondet-Mignotte 2005, §5.2; Barnsley 2005 (tops, colour stealing).
"""

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from evocity.shapes._kernels import DEEPEST, walked
from evocity.shapes.checks import corners, no_long_words, too_many
from evocity.shapes.drawing import Frame
from evocity.shapes.languages import ShapeError
from evocity.shapes.shape import MOST_PIECES, Shape

_PAPER = (255, 255, 255)


def palette(colours: ArrayLike, mix: float = 0.5) -> Shape:
    """The chequer of the unit square with ``colours`` ``(m, m, 3)`` of 0…1, column by column from
    the left, each from below: m² maps, whose order is theirs. Its colours are carried to another
    form of as many maps by `coloured_as`. Raises `ShapeError` for colours that are none."""
    given = np.array(colours, np.float64)
    if given.ndim != 3 or given.shape[0] != given.shape[1] or given.shape[2] != 3:
        raise ShapeError(f"colours of shape {given.shape}", "(m, m, 3)", "give m times m of them")
    side = len(given)
    maps = [
        [[1 / side, 0, i / side], [0, 1 / side, j / side]]
        for i, j in product(range(side), repeat=2)
    ]
    return Shape(np.array(maps), "square", None, given.reshape(-1, 3), mix)


def palette_of(picture: Image.Image, side: int = 4, mix: float = 0.5) -> Shape:
    """The `palette` of the mean colours of ``side`` × ``side`` parts of a picture."""
    if isinstance(side, bool) or not 1 <= side <= 16:
        raise ShapeError(f"side = {side}", "1…16", "choose another")
    small = picture.convert("RGB").resize((side, side), Image.Resampling.BOX)
    cells = np.asarray(small, np.float64) / 255
    return palette(cells[::-1].transpose(1, 0, 2), mix)


def coloured_as(shape: Shape, other: Shape) -> Shape:
    """The forms of a ``shape`` with the colours of an ``other``, map by map in their order. Raises
    `ShapeError` if the other has no colours, or not as many maps."""
    if other.colours is None:
        raise ShapeError("a shape without colours", "one with colours", "give colours=")
    return replace(shape, colours=other.colours, mix=other.mix)


def stolen(
    shape: Shape,
    source: Shape,
    picture: Image.Image,
    side: int = 512,
    most: int = MOST_PIECES,
) -> Image.Image:
    """The ``shape`` in the colours of a ``picture``: each point has that of the place with the same
    address under ``source``, which has as many maps and lies on the picture, whose width and height
    are 1, x to the right, y upwards. Where pieces overlap, the greatest address counts.

    Raises `ShapeError` for shapes of space, other numbers of maps, and too many pieces.
    """
    if shape.size != 2 or source.size != 2:
        raise ShapeError("a shape of space", "two of the plane", "choose another")
    if len(shape) != len(source):
        raise ShapeError(
            f"{len(source)} maps on the picture for {len(shape)}", "as many", "choose another"
        )
    if not shape.language.lasts:
        raise no_long_words()
    frame = Frame.of(shape.box, side)
    # both at once: maps of the plane times the plane, of which the first is as fine as pixels
    pairs = np.zeros((len(shape), 4, 5))
    pairs[:, :2, [0, 1, 4]], pairs[:, 2:, [2, 3, 4]] = shape.maps, source.maps
    box = corners(shape.box)
    ends = np.column_stack([box, np.zeros_like(box)])
    lasting = shape._goes_on
    grid = np.zeros(0, np.uint8), np.zeros((0, 0)), np.zeros(0), 1.0, np.zeros(0), 0
    room = 4096
    while True:
        found, lengths = np.empty((room, 4, 5)), np.empty(room, np.int64)
        count = walked(
            pairs, *lasting, ends, DEEPEST, (1 + 1e-9) / frame.scale, np.zeros((len(shape), 0)),
            0.5, found, lengths, np.empty((room, 0)), grid, most,
        )  # fmt: skip
        if count > most:
            raise too_many(count, most, " or more")
        if count <= room:
            break
        room = count
    found = found[:count]
    middles = [one.box.mean(axis=0) for one in (shape, source)]
    at = np.einsum("kij,j->ki", found[:, :2, :2], middles[0]) + found[:, :2, 4]
    there = np.einsum("kij,j->ki", found[:, 2:, 2:4], middles[1]) + found[:, 2:, 4]
    colours = np.asarray(picture.convert("RGB"))
    height, width = colours.shape[:2]
    rows = np.clip(np.floor((1 - there[:, 1]) * height), 0, height - 1).astype(np.int64)
    columns = np.clip(np.floor(there[:, 0] * width), 0, width - 1).astype(np.int64)
    painted = np.empty((side, side, 3), np.uint8)
    painted[:] = _PAPER
    cells = frame.cells(at)
    flat = cells[:, 0] * side + cells[:, 1]
    # of several pieces in a cell the last
    last = len(flat) - 1 - np.unique(flat[::-1], return_index=True)[1]
    painted.reshape(-1, 3)[flat[last]] = colours[rows[last], columns[last]]
    return Image.fromarray(painted)


__all__ = ["coloured_as", "palette", "palette_of", "stolen"]
