"""Pictures of shapes with a primitive for each map.

Source: Tosan, Excoffier, Rondet-Mignotte 2005, §5.3, §6, figures 9 and 11.
"""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from evocity.shapes._kernels import DEEPEST, fill_faces
from evocity.shapes.checks import check_range
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import apply_maps
from evocity.shapes.primitives import Primitive, in_space, primitive_of
from evocity.shapes.rendering import Frame, byte_colours, check_plane, paper
from evocity.shapes.shape import MOST_PIECES, Shape


def motif_picture(
    shape: Shape,
    motifs: Sequence[str | Primitive],
    depth: int,
    side: int = 512,
    most: int = MOST_PIECES,
) -> Image.Image:
    """Draw a ``shape`` of the plane with a primitive for each of its maps, for example discs and
    squares.

    A piece shows the motif of the last letter of its word: the map that is applied first. Pieces
    are painted in the order of their words, as in `picture_of` at a ``depth`` of 1 or more.

    Raises `ShapeError` if the number of ``motifs`` differs from the number of maps, if a motif has
    no faces, for a depth of 0, and in the cases of `Shape.pieces`.
    """
    check_plane(shape)
    own = [in_space(primitive_of(motif), 2) for motif in motifs]
    bare = [number for number, motif in enumerate(own) if not len(motif.faces)]
    if len(own) != len(shape):
        found = f"{len(own)} motifs, but the shape has {len(shape)} affine maps"
        raise ShapeError(found, "a motif for each affine map", "add or remove motifs")
    if bare:
        found = f"motif {bare[0]} has no faces; the first motif has the number 0"
        raise ShapeError(found, "motifs with faces, such as 'square'", "choose another motif")
    check_range("depth", depth, 1, DEEPEST, whole=True)
    pieces = shape.pieces(depth, most=most)
    letters = [word[-1] for word in shape.words(depth)]
    placed = [
        apply_maps(matrix[None], own[letter].points)[0]
        for matrix, letter in zip(pieces.maps, letters, strict=True)
    ]
    every = np.vstack(placed)
    frame = Frame.of(np.stack([every.min(axis=0), every.max(axis=0)]), side)
    pixels, colours = paper(side), np.ascontiguousarray(byte_colours(pieces))
    for number, (points, letter) in enumerate(zip(placed, letters, strict=True)):
        at = frame.to_pixels(points)
        at[:, 1] = side - at[:, 1]
        fill_faces(at[None], own[letter].faces, colours[number : number + 1], pixels)
    return Image.fromarray(pixels)
