"""Shapes of space as files of solids: GLB."""

from dataclasses import dataclass

import numpy as np

from evocity.formats.gltf import glb
from evocity.formats.solids import WALL, About, Mesh
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import determinants
from evocity.shapes.shape import Shape

#: The most triangles of a file.
MOST_TRIANGLES = 2_000_000
_INK = (0.75, 0.75, 0.72)


@dataclass(frozen=True, eq=False)
class _ColourGroup:
    name: str
    colour: tuple[float, float, float]
    mesh: Mesh
    count: int
    copies: None = None

    def __len__(self) -> int:
        return self.count


def glb_of(
    shape: Shape, depth: int | None = None, pixel: float | None = None, name: str = "shape"
) -> bytes:
    """Return the bytes of a ``.glb`` file with the pieces of a shape, z up, one mesh per colour.
    Choose ``depth`` or ``pixel`` as in `Shape.pieces`. Shapes of the plane lie on the ground.

    Raises `ShapeError` as `Shape.pieces` does, for a primitive without faces, and for more than
    `MOST_TRIANGLES` triangles.
    """
    pieces = shape.pieces(depth, pixel)
    faces = pieces.primitive.faces
    if not len(faces):
        raise ShapeError(
            "the primitive has no faces",
            "a primitive with faces: cube, sphere or cylinder",
            "choose another primitive with primitive=",
        )
    if len(pieces) * len(faces) > MOST_TRIANGLES:
        raise ShapeError(
            f"the shape has {len(pieces) * len(faces)} triangles",
            f"at most {MOST_TRIANGLES} triangles",
            "lower the depth",
        )
    points = pieces.points
    if shape.size == 2:
        points = np.concatenate([points, np.zeros((*points.shape[:2], 1))], axis=2)
    mirrored = determinants(pieces.maps[:, :, : shape.size]) < 0
    turned = np.where(mirrored[:, None, None], faces[None, :, ::-1], faces[None])
    colours = pieces.colours if pieces.colours.shape[1] else np.tile(_INK, (len(pieces), 1))
    rounded = np.round(colours, 3)
    groups = []
    for number, colour in enumerate(np.unique(rounded, axis=0).tolist()):
        own = np.flatnonzero((rounded == colour).all(axis=1))
        first = len(pieces.primitive.points) * np.arange(len(own))[:, None, None]
        triangles = (turned[own] + first).reshape(-1, 3).astype(np.int32)
        owner = np.repeat(np.arange(len(own), dtype=np.int32), len(faces))
        part = np.full(len(triangles), WALL, np.uint8)
        mesh = Mesh(points[own].reshape(-1, 3), triangles, owner, part)
        groups.append(_ColourGroup(f"{name} {number}", tuple(colour), mesh, len(own)))
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    size = float(high[0] - low[0]), float(high[1] - low[1])
    middle = float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2
    return glb(groups, About(name, "", None, (0.0, 0.0), size, (*middle, 1.0)))
