"""Formats of other programs: arrays of solids become text or bytes; lines of GeoJSON, arrays.

- `solids`: `Group`, solids of one kind: prisms on polygons, and their triangles; `Relief`, the
  ground below them; `Copies`, those of them that share a shape; `shells`, walls and roofs that are
  not prisms; `numbering`, numbers of equal rows
- `cityjson`: CityJSON 2.0, surfaces with semantics; `cityjson_lines`, CityJSONSeq
- `kerbs`: low walls between carriageways and the ground beside them
- `materials`: materials and names of objects, for all formats
- `gltf`: glTF 2.0, binary; `gltf_document`, its arrays; `gltf_properties`, tables of properties
- `vrml`: VRML97, the papers' format, and X3D
- `obj`: Wavefront OBJ and its materials
- `facets`: flat faces with normals and texture coordinates; `trees`: trees and lamps
- `tileset`: tilesets of 3D Tiles 1.1
- `dxf` and `rhino`: DXF and 3DM for CAD, with the extra ``cad``; `printing`: STL and 3MF
- `geojson_lines`: the reader of lines in GeoJSON; `ascii_text`: text in ASCII
"""

from evocity.formats.cityjson import cityjson
from evocity.formats.cityjson_lines import cityjson_lines
from evocity.formats.dxf import dxf
from evocity.formats.gltf import glb
from evocity.formats.obj import mtl, obj
from evocity.formats.printing import stl, threemf
from evocity.formats.rhino import rhino
from evocity.formats.solids import About, Copies, Group, Relief
from evocity.formats.vrml import vrml97, x3d

__all__ = [
    "About",
    "Copies",
    "Group",
    "Relief",
    "cityjson",
    "cityjson_lines",
    "dxf",
    "glb",
    "mtl",
    "obj",
    "rhino",
    "stl",
    "threemf",
    "vrml97",
    "x3d",
]
