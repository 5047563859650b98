"""Rendering of shapes and lines: masks, pictures, SVG, solids in GLB."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw

from evocity.errors import check_word, setting
from evocity.formats.gltf import glb
from evocity.formats.solids import WALL, About, Mesh
from evocity.shapes._kernels import fill_faces
from evocity.shapes.checks import check_range
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import determinants
from evocity.shapes.lines import line_of
from evocity.shapes.shape import MOST_PIECES, Pieces, Shape

#: The most triangles of a GLB file.
MOST_TRIANGLES = 2_000_000
#: The largest side of a picture, px.
MOST_SIDE = 8192
#: Sources of the colours of solids.
PAINTS = ("maps", "position")
_INK, _GREY, _PAPER = (31, 41, 51), (170, 178, 189), (255, 255, 255)
_MATERIAL = (0.75, 0.75, 0.72)


@dataclass(frozen=True)
class Frame:
    """The place of a box of a shape in a picture: ``scale`` px a unit, y upwards; ``origin``: the
    box's lower left corner in px from the picture's lower left."""

    scale: float
    low: np.ndarray
    origin: np.ndarray
    side: int

    @classmethod
    def of(cls, box: np.ndarray, side: int) -> "Frame":
        """Put the ``box`` ``(2, m)`` in the middle of a square of ``side`` px."""
        check_range("side", side, 8, MOST_SIDE, whole=True)
        wide = box[1] - box[0]
        scale = side / max(float(wide.max()), 1e-300)
        return cls(scale, box[0], (side - scale * wide) / 2, side)

    @property
    def offset(self) -> np.ndarray:
        """The shape's origin, in px from the lower left ``(m,)``."""
        return self.origin - self.low * self.scale

    def to_pixels(self, points: np.ndarray) -> np.ndarray:
        """Convert ``points`` ``(…, m)`` to px, y upwards."""
        return points * self.scale + self.offset

    def cells(self, points: np.ndarray) -> np.ndarray:
        """Find the cells of ``points``, int; row from the top, then column, and layer."""
        at = np.clip(np.floor(self.to_pixels(points)), 0, self.side - 1).astype(np.int64)
        return np.concatenate([self.side - 1 - at[..., 1:2], at[..., 0:1], at[..., 2:]], axis=-1)


def box_of(shape: Shape, depth: int | None) -> np.ndarray:
    """Return the box of a picture: the attractor's; at a ``depth`` that of its pieces."""
    if depth is None:
        return shape.box
    points = shape.pieces(depth).points.reshape(-1, shape.size)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def mask_of(
    shape: Shape,
    side: int = 512,
    depth: int | None = None,
    box: np.ndarray | None = None,
    most: int = MOST_PIECES,
) -> np.ndarray:
    """Mark the cells that a ``shape`` fills in a raster of ``side`` cells along each axis. The
    result is a bool array, north up.

    Without a ``depth``, pieces are as fine as a cell, and each piece marks the cell that contains
    the middle of the piece. The argument ``box`` ``(2, m)`` is the part of the shape to show, in m
    coordinates; the default is the whole shape.

    Raises `ShapeError` for more pieces than the limit ``most``, or if `depth` is given for a
    three-dimensional shape.
    """
    if depth is not None:
        if shape.size == 3:
            found = setting("depth", depth)
            raise ShapeError(found, "no depth for a mask in space", "leave the depth out")
        return np.asarray(picture_of(shape, side, depth, box, most).convert("L")) < 255
    frame = Frame.of(shape.box if box is None else np.asarray(box, float), side)
    return shape.laid(side, frame.scale, frame.offset)[0]


def picture_of(
    shape: Shape,
    side: int = 512,
    depth: int | None = None,
    box: np.ndarray | None = None,
    most: int = MOST_PIECES,
) -> Image.Image:
    """Draw a ``shape`` of the plane in a picture of ``side`` × ``side`` px.

    Pieces are painted in the order of their words, so later pieces cover earlier pieces. Each point
    gets the colour of the greatest word among all words that lead to this point (Barnsley 2005,
    *tops*). The parameters ``depth``, ``box`` and ``most`` are as in `mask_of`.
    """
    check_plane(shape)
    frame = Frame.of(box_of(shape, depth) if box is None else np.asarray(box, float), side)
    if depth is not None:
        return _paint(shape.pieces(depth, most=most), frame)
    marks, paint = shape.laid(side, frame.scale, frame.offset)
    pixels = paper(side)
    pixels[marks] = np.round(paint[marks] * 255) if paint.shape[2] else _INK
    return Image.fromarray(pixels)


def inked(frame: Frame, points: np.ndarray, colours: np.ndarray) -> Image.Image:
    """Mark the cells of ``points`` ``(n, 2)`` in their ``colours`` ``(n, 3)``, 0…1, or in ink for
    ``(n, 0)``; later points cover earlier ones."""
    cells = frame.cells(points)
    flat = cells[:, 0] * frame.side + cells[:, 1]
    last = len(flat) - 1 - np.unique(flat[::-1], return_index=True)[1]
    pixels = np.full((frame.side * frame.side, 3), _PAPER, np.uint8)
    pixels[flat[last]] = np.round(colours[last] * 255) if colours.shape[1] else _INK
    return Image.fromarray(pixels.reshape(frame.side, frame.side, 3))


def _paint(pieces: Pieces, frame: Frame) -> Image.Image:
    """Paint pieces in their order. A face fills the pixels whose middles it holds; a piece that
    holds no middle marks the pixels along its edges."""
    primitive = pieces.primitive
    placed = frame.to_pixels(pieces.points)
    placed[..., 1] = frame.side - placed[..., 1]
    if len(primitive.faces):
        pixels = paper(frame.side)
        colours = np.ascontiguousarray(byte_colours(pieces))
        fill_faces(np.ascontiguousarray(placed), primitive.faces, colours, pixels)
        return Image.fromarray(pixels)
    image = Image.new("RGB", (frame.side, frame.side), _PAPER)
    draw = ImageDraw.Draw(image)
    for points, colour in zip(placed, map(tuple, byte_colours(pieces).tolist()), strict=True):
        for start, end in primitive.lines:
            draw.line([tuple(points[start]), tuple(points[end])], fill=colour)
        if not len(primitive.lines):
            draw.point([tuple(point) for point in points], fill=colour)
    return image


def paper(side: int) -> np.ndarray:
    """Make an empty picture, uint8 ``(side, side, 3)``."""
    return np.full((side, side, 3), _PAPER, np.uint8)


def svg_of(shape: Shape, depth: int, side: int = 512, most: int = 10**5) -> str:
    """Draw a ``shape`` of the plane as SVG, with the pieces at the given ``depth``. Successive
    pieces of one colour share a path, and paths follow the order of the words."""
    check_plane(shape)
    pieces = shape.pieces(depth, most=most)
    frame = Frame.of(box_of(shape, depth), side)
    placed = frame.to_pixels(pieces.points)
    placed[..., 1] = side - placed[..., 1]
    paths = []
    for path, colour, filled in _paths(placed, pieces):
        style = f'fill="{colour}"' if filled else f'fill="none" stroke="{colour}"'
        paths.append(f'<path {style} d="{path}"/>')
    return _svg(side, paths)


def line_picture(lines: Sequence[ArrayLike], side: int = 512) -> Image.Image:
    """Draw ``lines``, each ``(n, 2)``, in a picture of ``side`` × ``side`` px, north up. The first
    line is dark and covers the remaining lines, which are grey. Raises `ShapeError` if a line is
    not a polyline of the plane."""
    lines = [line_of(line) for line in lines]
    every = np.vstack(lines)
    frame = Frame.of(np.stack([every.min(axis=0), every.max(axis=0)]), side)
    image = Image.new("RGB", (side, side), _PAPER)
    draw = ImageDraw.Draw(image)
    for number in range(len(lines) - 1, -1, -1):
        placed = frame.to_pixels(lines[number])
        at = np.column_stack([placed[:, 0], side - placed[:, 1]])
        draw.line([tuple(point) for point in at.tolist()], fill=_GREY if number else _INK)
    return image


def line_mask(line: ArrayLike, side: int = 1024) -> np.ndarray:
    """Mark the ``side`` × ``side`` cells of a line ``(n, 2)``, bool, north up."""
    return np.asarray(line_picture([line], side).convert("L")) < 255


def line_svg(line: ArrayLike, side: int = 512) -> str:
    """Draw a line ``(n, 2)`` as SVG, ``side`` × ``side`` px, north up."""
    line = line_of(line)
    frame = Frame.of(np.stack([line.min(axis=0), line.max(axis=0)]), side)
    placed = frame.to_pixels(line)
    path = _path(np.column_stack([placed[:, 0], side - placed[:, 1]]), False)
    return _svg(side, [f'<path fill="none" stroke="#1f2933" d="{path}"/>'])


def _svg(side: int, paths: Sequence[str]) -> str:
    size = f'width="{side}" height="{side}" viewBox="0 0 {side} {side}"'
    return "\n".join([f'<svg xmlns="http://www.w3.org/2000/svg" {size}>', *paths, "</svg>\n"])


def _paths(placed: np.ndarray, pieces: Pieces) -> Iterator[tuple[str, str, bool]]:
    """Yield runs of pieces of a colour: path, colour, and whether it is filled."""
    primitive, colours = pieces.primitive, byte_colours(pieces)
    changes = np.flatnonzero((colours[1:] != colours[:-1]).any(axis=1)) + 1
    for some in np.split(np.arange(len(pieces)), changes):
        if not len(some):
            continue
        colour = "#{:02x}{:02x}{:02x}".format(*colours[some[0]].tolist())
        for parts, filled in ((primitive.faces, True), (primitive.lines, False)):
            if len(parts):
                yield (
                    " ".join(_path(placed[k][part], filled) for k in some for part in parts),
                    colour,
                    filled,
                )
        if not len(primitive.faces) and not len(primitive.lines):
            dots = [point for k in some for point in placed[k]]
            yield " ".join(f"M{x:.4g} {y:.4g}h.5" for x, y in dots), colour, False


def _path(points: np.ndarray, closed: bool) -> str:
    listed = "L".join(f"{x:.7g} {y:.7g}" for x, y in points.tolist())
    return f"M{listed}{'Z' if closed else ''}"


def byte_colours(pieces: Pieces) -> np.ndarray:
    """Return the colours of pieces, uint8 ``(n, 3)``: their own, or ink."""
    if not pieces.colours.shape[1]:
        return np.broadcast_to(np.array(_INK, np.uint8), (len(pieces), 3))
    return np.round(pieces.colours * 255).astype(np.uint8)


def check_plane(shape: Shape) -> None:
    """Raise `ShapeError` unless the shape lies in the plane."""
    if shape.size != 2:
        raise ShapeError(
            "the shape is not two-dimensional, so it has no picture",
            "a two-dimensional shape",
            "make a mask of the shape instead: evocity.shapes.mask_of",
        )


@dataclass(frozen=True, eq=False)
class _ColourGroup:
    name: str
    colour: tuple[float, float, float]
    mesh: Mesh
    heights: np.ndarray
    attributes: Mapping[str, list] = field(default_factory=dict)
    copies: None = None
    city_object: str = "LandUse"  # a writer makes one mesh of a surface

    @property
    def city_objects(self) -> list[str]:
        return [self.city_object] * len(self)

    def __len__(self) -> int:
        return len(self.heights)


def position_colours(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Take the position of ``points`` ``(…, m)`` as colour: red x, green y, blue z, or 0 in the
    plane. The attractor of the pairs (T_i, T_i) is {(p, p)} (Tosan, Excoffier, Rondet-Mignotte
    2005, §5.3).

    Raises `ShapeError` if the shape's box is not within 0…1.
    """
    if shape.box.min() < -1e-6 or shape.box.max() > 1 + 1e-6:
        low, high = (", ".join(f"{one:.3g}" for one in end) for end in shape.box)
        raise ShapeError(
            f"the shape lies from ({low}) to ({high})",
            "a shape with coordinates from 0 to 1, because its positions are colours",
            "move the shape into the unit cube: shape.moved(matrix)",
        )
    colours = np.zeros((*points.shape[:-1], 3))
    colours[..., : shape.size] = np.clip(points, 0, 1)
    return colours


def glb_of(
    shape: Shape,
    depth: int | None = None,
    pixel: float | None = None,
    name: str = "shape",
    paint: str = "maps",
) -> bytes:
    """Return the bytes of a ``.glb`` file with the pieces of a shape, with z upwards and a mesh for
    each colour.

    With ``paint`` = "maps", a piece has the colours of its word. With "position", red, green and
    blue are the coordinates x, y and z of the piece's middle, in steps of a sixteenth; the shape
    must lie within 0…1 (Tosan, Excoffier, Rondet-Mignotte 2005, §5.3).

    Give either ``depth`` or ``pixel``, not both, as in `Shape.pieces`. Two-dimensional shapes lie
    on the ground. Raises `ShapeError` for a primitive without faces, for more than `MOST_TRIANGLES`
    triangles, and in the cases of `Shape.pieces`.
    """
    pieces = shape.pieces(depth, pixel)
    faces = pieces.primitive.faces
    if not len(faces):
        raise ShapeError(
            "the primitive of the shape has no faces",
            "a primitive with faces, such as 'cube', 'sphere' or 'cylinder'",
            "choose a primitive with faces in the parameter 'primitive'",
        )
    if len(pieces) * len(faces) > MOST_TRIANGLES:
        raise ShapeError(
            f"the shape has {len(pieces) * len(faces)} triangles",
            f"a shape of at most {MOST_TRIANGLES} triangles",
            "choose a smaller depth",
        )
    points = pieces.points
    if shape.size == 2:
        points = np.concatenate([points, np.zeros((*points.shape[:2], 1))], axis=2)
    mirrored = determinants(pieces.maps[:, :, : shape.size]) < 0
    turned = np.where(mirrored[:, None, None], faces[None, :, ::-1], faces[None])
    check_word("paint", paint, PAINTS, "leave it out for the colours of maps", ShapeError)
    colours = pieces.colours if pieces.colours.shape[1] else np.tile(_MATERIAL, (len(pieces), 1))
    if paint == "position":
        ends = pieces.points.min(axis=1), pieces.points.max(axis=1)
        colours = position_colours(shape, (ends[0] + ends[1]) / 2)
        colours = (np.floor(np.minimum(colours * 16, 15)) + 0.5) / 16
    rounded = np.round(colours, 3)
    groups = []
    for number, colour in enumerate(np.unique(rounded, axis=0).tolist()):
        own = np.flatnonzero((rounded == colour).all(axis=1))
        first = len(pieces.primitive.points) * np.arange(len(own))[:, None, None]
        triangles = (turned[own] + first).reshape(-1, 3).astype(np.int32)
        owner = np.repeat(np.arange(len(own), dtype=np.int32), len(faces))
        part = np.full(len(triangles), WALL, np.uint8)
        mesh = Mesh(points[own].reshape(-1, 3), triangles, owner, part)
        groups.append(_ColourGroup(f"{name} {number}", tuple(colour), mesh, np.zeros(len(own))))
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    size = float(high[0] - low[0]), float(high[1] - low[1])
    middle = float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2
    return glb(groups, About(name, "", None, (0.0, 0.0), size, (*middle, 1.0)))
