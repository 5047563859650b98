"""glTF 2.0 in one binary file, y up: a mesh a group."""

import json
import struct
from collections.abc import Sequence

import numpy as np

from evocity.formats.solids import About, Group

# numbers of the specification
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_ARRAY, _ELEMENTS = 34962, 34963


def glb(groups: Sequence[Group], about: About) -> bytes:
    """The bytes of a .glb: positions, flat normals, one material a group, colours linear.

    Source: Khronos, glTF 2.0 specification.
    """
    document = {
        "asset": {"version": "2.0", "generator": "evocity", "copyright": about.attribution},
        "scene": 0,
        "scenes": [{"name": about.name, "nodes": []}],
        "nodes": [],
        "meshes": [],
        "materials": [],
        "accessors": [],
        "bufferViews": [],
        "extras": {"crs": about.crs or "", "offset": list(about.offset)},
    }
    if not about.attribution:
        del document["asset"]["copyright"]
    parts: list[bytes] = []
    for group in groups:
        mesh = group.mesh
        if not len(mesh.triangles):
            continue
        points, normals, triangles = _flat(mesh)
        number = len(document["meshes"])
        primitive = {
            "attributes": {
                "POSITION": _accessor(document, parts, points, "VEC3", _ARRAY, bounds=True),
                "NORMAL": _accessor(document, parts, normals, "VEC3", _ARRAY),
            },
            "indices": _accessor(document, parts, triangles, "SCALAR", _ELEMENTS),
            "material": number,
        }
        document["meshes"].append({"name": group.name, "primitives": [primitive]})
        document["materials"].append(_material(group))
        document["nodes"].append({"name": group.name, "mesh": number})
        document["scenes"][0]["nodes"].append(number)
    body = b"".join(parts)
    document["buffers"] = [{"byteLength": len(body)}]
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _flat(mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and normals, y up, each pair once; triangles as indices of them."""
    corners = mesh.triangles.ravel()
    normals = np.round(np.repeat(mesh.normals, 3, axis=0), 6) + 0.0
    _, direction = np.unique(normals, axis=0, return_inverse=True)
    pairs = corners.astype(np.int64) * (direction.max() + 1) + direction.ravel()
    _, first, index = np.unique(pairs, return_index=True, return_inverse=True)
    return _y_up(mesh.points[corners[first]]), _y_up(normals[first]), index.ravel()


def _y_up(rows: np.ndarray) -> np.ndarray:
    return np.stack([rows[:, 0], rows[:, 2], -rows[:, 1] + 0.0], axis=1).astype(np.float32)


def _material(group: Group) -> dict:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in group.colour]
    return {
        "name": group.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*(round(c, 6) for c in linear), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.9,
        },
    }


def _accessor(document, parts, array, kind: str, target: int, bounds: bool = False) -> int:
    component = _FLOAT
    if kind == "SCALAR":
        small = len(array) == 0 or array.max() < 2**16 - 1
        component = _UINT16 if small else _UINT32
        array = array.astype(np.uint16 if small else np.uint32)
    data = array.tobytes()
    offset = sum(map(len, parts))
    parts.append(data + b"\0" * (-len(data) % 4))
    document["bufferViews"].append(
        {"buffer": 0, "byteOffset": offset, "byteLength": len(data), "target": target}
    )
    found = {
        "bufferView": len(document["bufferViews"]) - 1,
        "componentType": component,
        "count": len(array),
        "type": kind,
    }
    if bounds:
        found |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
    document["accessors"].append(found)
    return len(document["accessors"]) - 1
