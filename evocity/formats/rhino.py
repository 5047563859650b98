"""3DM, the format of Rhino: a mesh and an outline for each solid, with names and attributes.

The library rhino3dm comes with the extra ``cad``. Coordinates are metres from the south-west
corner.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evocity.formats.facets import pair_walls
from evocity.formats.materials import names_of, properties_of
from evocity.formats.solids import About, Group
from evocity.formats.trees import mesh_of
from evocity.lazy_imports import library

#: The end of the name of a group's layer of outlines.
OUTLINES = "-outlines"

# The version of the file format: Rhino 7 and newer.
_VERSION = 7


def rhino(groups: Sequence[Group], about: About) -> bytes:
    """Write a .3dm file. A group has one layer of meshes and one layer of closed polylines. Names
    and attributes of objects are the user text of Rhino. Raises `EvocityError` without
    rhino3dm."""
    rhino3dm = library("rhino3dm", "a .3dm file", "cad")
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    notes = {"name": about.name, "attribution": about.attribution, "crs": about.crs or ""}
    notes["offset"] = f"{about.offset[0]:.3f} {about.offset[1]:.3f}"
    for key, text in notes.items():
        model.Strings[f"evocity:{key}"] = text
    for group in (group for group in groups if len(group)):
        meshes, outlines = (_add_layer(model, rhino3dm, group, end) for end in ("", OUTLINES))
        names, columns = names_of(group), properties_of(group)
        texts = [
            {key: str(column[k]) for key, column in columns.items() if column[k] is not None}
            for k in range(len(group))
        ]
        for k, mesh in enumerate(_meshes(rhino3dm, group)):
            model.Objects.AddMesh(mesh, _attributes(rhino3dm, meshes, names[k], texts[k]))
        points, rings = group.rings.points.tolist(), group.rings
        lifts = group.lift.tolist()
        for k, of in enumerate(rings.of.tolist()):
            ring = points[rings.starts[k] : rings.starts[k + 1]]
            line = rhino3dm.Polyline(len(ring) + 1)
            for x, y in [*ring, ring[0]]:
                line.Add(x, y, group.level + lifts[of])
            about_line = _attributes(rhino3dm, outlines, names[of], {})
            model.Objects.AddPolyline(line, about_line)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.3dm"
        if not model.Write(str(path), _VERSION):
            raise OSError("rhino3dm could not write the file")
        return path.read_bytes()


def _add_layer(model, rhino3dm, group: Group, ending: str) -> int:
    layer = rhino3dm.Layer()
    layer.Name = group.name + ending
    layer.Color = (*(round(255 * channel) for channel in group.colour), 255)
    return model.Layers.Add(layer)


def _attributes(rhino3dm, layer: int, name: str, texts: dict[str, str]):
    attributes = rhino3dm.ObjectAttributes()
    attributes.LayerIndex, attributes.Name = layer, name
    for key, text in texts.items():
        attributes.SetUserString(key, text)
    return attributes


def _meshes(rhino3dm, group: Group):
    """Yield the mesh of each solid of a ``group``."""
    mesh = mesh_of(replace(group, floors=True))
    quads, owner, threes, rows = pair_walls(mesh)
    faces = [*map(tuple, quads.tolist()), *map(tuple, threes.tolist())]
    owners = np.r_[owner, mesh.owner[rows]]
    order = np.argsort(owners, kind="stable")
    ends = np.cumsum(np.bincount(owners, minlength=len(group)))
    points = mesh.points.tolist()
    for start, end in zip([0, *ends.tolist()], ends.tolist(), strict=False):
        made = rhino3dm.Mesh()
        number: dict[int, int] = {}
        for face in (faces[k] for k in order[start:end].tolist()):
            for corner in face:
                if corner not in number:
                    number[corner] = len(number)
                    made.Vertices.Add(*points[corner])
            made.Faces.AddFace(*(number[corner] for corner in face))
        made.Normals.ComputeNormals()
        made.Compact()
        yield made
