"""DXF for CAD programs: closed polylines with a thickness, and 3D faces, on separate layers.

The library ezdxf comes with the extra ``cad``. Coordinates are metres from the south-west corner.
"""

import io
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evocity.formats.facets import pair_walls
from evocity.formats.solids import About, Group
from evocity.formats.trees import mesh_of
from evocity.lazy_imports import library

#: Ends of the names of a group's layers of holes and of faces. Outlines have the name of the group.
HOLES, FACES = "-holes", "-faces"

# The version of AutoCAD 2010, with texts in UTF-8; $INSUNITS of metres.
_VERSION, _METRES = "R2010", 6
# Bits of a 3D face that hide its edges.
_BITS = (1, 2, 4, 8)
# The cosine between the normals of two triangles of one flat face, at least.
_FLAT = 1 - 1e-6


def dxf(groups: Sequence[Group], about: About) -> bytes:
    """Write a drawing, UTF-8 text. Each solid has the closed polyline of its outline, on the ground
    and with the height of its walls as thickness, and 3D faces. Raises
    `EvocityError` without ezdxf."""
    ezdxf = library("ezdxf", "a .dxf file", "cad")
    drawing = ezdxf.new(_VERSION, setup=False)
    drawing.header["$INSUNITS"] = _METRES
    drawing.header["$MEASUREMENT"] = 1
    notes = {"name": about.name, "attribution": about.attribution, "crs": about.crs or ""}
    notes["offset"] = f"{about.offset[0]:.3f} {about.offset[1]:.3f}"
    for key, text in notes.items():
        drawing.header.custom_vars.append(key, " ".join(text.split()))
    space = drawing.modelspace()
    for group in (group for group in groups if len(group)):
        holed = len(group.rings.of) > len(group)
        for ending in ("", HOLES, FACES) if holed else ("", FACES):
            red, green, blue = (round(255 * channel) for channel in group.colour)
            name = _layer_name(group.name + ending)
            layer = drawing.layers.get(name) if name in drawing.layers else drawing.layers.add(name)
            layer.rgb = (red, green, blue)
        _add_outlines(space, group)
        _add_faces(space, group)
    written = io.StringIO()
    drawing.write(written)
    return written.getvalue().encode("utf-8")


def _layer_name(name: str) -> str:
    """Replace letters that names of layers must not have."""
    return "".join("_" if letter in '<>/\\":;?*|=`,' else letter for letter in name)


def _add_outlines(space, group: Group) -> None:
    rings, lifts = group.rings, np.round(group.lift, 3).tolist()
    points = np.round(rings.points, 3).tolist()
    eaves = group.attributes.get("eavesHeight", [None] * len(group))
    heights = [
        high if low is None else low
        for high, low in zip(group.heights.tolist(), eaves, strict=True)
    ]
    previous = -1
    for k, of in enumerate(rings.of.tolist()):
        layer = _layer_name(group.name + (HOLES if of == previous else ""))
        previous = of
        how = {"layer": layer, "elevation": group.level + lifts[of]}
        if heights[of] > 0:
            how["thickness"] = round(heights[of], 3)
        ring = points[rings.starts[k] : rings.starts[k + 1]]
        space.add_lwpolyline(ring, format="xy", close=True, dxfattribs=how)


def _add_faces(space, group: Group) -> None:
    mesh = mesh_of(replace(group, floors=True))
    quads, _, triangles, rows = pair_walls(mesh)
    at = list(map(tuple, np.round(mesh.points, 3).tolist()))
    how = {"layer": _layer_name(group.name + FACES)}
    for a, b, c, d in quads.tolist():
        space.add_3dface((at[a], at[b], at[c], at[d]), dxfattribs=how)
    hidden = _hidden_edges(triangles, mesh.normals[rows]).tolist()
    for (a, b, c), edges in zip(triangles.tolist(), hidden, strict=True):
        face = space.add_3dface((at[a], at[b], at[c], at[c]), dxfattribs=how)
        if edges:
            face.dxf.invisible_edges = edges


def _hidden_edges(triangles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the bits that hide edges between two triangles of one flat face, int ``(t,)``."""
    count = len(triangles)
    ends = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    bits = np.repeat(np.array([_BITS[0], _BITS[1], _BITS[3]]), count)
    face = np.tile(np.arange(count), 3)
    ends = np.sort(ends, axis=1)
    order = np.lexsort(ends.T)
    one, other = order[:-1], order[1:]
    same = (ends[one] == ends[other]).all(axis=1)
    same &= (normals[face[one]] * normals[face[other]]).sum(axis=1) > _FLAT
    found = np.zeros(count, np.int64)
    for edge in (one[same], other[same]):
        np.bitwise_or.at(found, face[edge], bits[edge])
    return found
