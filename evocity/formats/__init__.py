"""Formats of other programs: arrays of solids become text or bytes; lines of GeoJSON, arrays.

- `solids`: `Group`, solids of one kind: prisms on polygons, and their triangles; `Copies`, those of
  them that share a shape
- `cityjson`: CityJSON 2.0, LoD 1.2, surfaces with semantics
- `gltf`: glTF 2.0, binary
- `vrml`: VRML97, the papers' format, and X3D
- `obj`: Wavefront OBJ
- `geojson_lines`: the reader of lines in GeoJSON
"""

from evocity.formats.cityjson import cityjson
from evocity.formats.gltf import glb
from evocity.formats.obj import obj
from evocity.formats.solids import About, Copies, Group
from evocity.formats.vrml import vrml97, x3d

__all__ = ["About", "Copies", "Group", "cityjson", "glb", "obj", "vrml97", "x3d"]
