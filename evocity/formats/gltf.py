"""Binary glTF 2.0, y up: a mesh for each group, and for each shape with several copies."""

import json
import math
import struct
from collections.abc import Iterator, Sequence

import numpy as np

from evocity.formats.solids import About, Copies, Group, Mesh

# numbers of the specification
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_ARRAY, _ELEMENTS = 34962, 34963

# 16-bit indices stay below this: it would begin a new strip.
_MOST = 2**16 - 1


def glb(groups: Sequence[Group], about: About) -> bytes:
    """Write the bytes of a .glb (Khronos, glTF 2.0 specification): a node, a mesh and a material
    for each group, colours linear.

    A shape with two copies or more in a group has its own mesh, and each copy is a node below the
    group's. A mirrored copy has a scale of x below 0, which reverses its triangles (3.7.4). There
    are no normals: viewers make flat ones (3.7.2.1), so walls share corners.
    """
    place = {"crs": about.crs or "", "offset": list(about.offset), "attribution": about.attribution}
    document = {
        "asset": {"version": "2.0", "generator": "evocity", "copyright": about.attribution},
        "scene": 0,
        # viewers such as Blender only keep the extras of a scene
        "scenes": [{"name": about.name, "nodes": [], "extras": place}],
        "nodes": [],
        "meshes": [],
        "materials": [],
        "accessors": [],
        "bufferViews": [],
    }
    if not about.attribution:
        del document["asset"]["copyright"]
    parts: list[bytes] = []
    for group in groups:
        mesh = group.mesh
        if not len(mesh.triangles):
            continue
        material = len(document["materials"])
        document["materials"].append(_material(group))
        node: dict = {"name": group.name}
        document["scenes"][0]["nodes"].append(len(document["nodes"]))
        document["nodes"].append(node)
        single = _is_single(group)
        alone = mesh.select(single[mesh.owner])
        if len(alone.triangles):
            node["mesh"] = _mesh(document, parts, group.name, alone, material)
        if not single.all():
            node["children"] = _copies(document, parts, group.copies, ~single, material)
    body = b"".join(parts)
    document["buffers"] = [{"byteLength": len(body)}]
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _is_single(group: Group) -> np.ndarray:
    """Mark solids of a group that are not copies, or the only copy of a shape, bool ``(n,)``."""
    if group.copies is None:
        return np.ones(len(group), bool)
    of = group.copies.of
    return (np.bincount(of + 1, minlength=1)[of + 1] < 2) | (of < 0)


def _copies(document: dict, parts: list[bytes], copies: Copies, chosen, material: int) -> list[int]:
    """Add nodes of the copies ``chosen``, bool ``(n,)``, and return their numbers."""
    shapes, nodes = copies.mesh, document["nodes"]
    meshes = {
        shape: _mesh(
            document, parts, copies.names[shape], shapes.select(shapes.owner == shape), material
        )
        for shape in np.unique(copies.of[chosen]).tolist()
    }
    first = len(nodes)
    for k in np.flatnonzero(chosen).tolist():
        (x, y), (along, across, up) = copies.places[k].tolist(), copies.scales[k].tolist()
        half = float(copies.turns[k]) / 2
        shape = int(copies.of[k])
        node = {"name": copies.names[shape], "mesh": meshes[shape]}
        node["translation"] = _short(x, 0.0, -y)
        node["rotation"] = _short(0.0, math.sin(half), 0.0, math.cos(half))
        node["scale"] = _short(along, up, across)
        nodes.append(node)
    return list(range(first, len(nodes)))


def _short(*numbers: float) -> list[float]:
    """Round to the digits of a viewer's numbers."""
    return [float(f"{number:.9g}") + 0.0 for number in numbers]


def _mesh(document: dict, parts: list[bytes], name: str, mesh: Mesh, material: int) -> int:
    primitives = [
        {
            "attributes": {"POSITION": _accessor(document, parts, points, "VEC3", _ARRAY)},
            "indices": _accessor(document, parts, triangles, "SCALAR", _ELEMENTS),
            "material": material,
        }
        for points, triangles in _parts(mesh)
    ]
    document["meshes"].append({"name": name, "primitives": primitives})
    return len(document["meshes"]) - 1


def _parts(mesh: Mesh) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield points, y up, and triangles as indices of them, of whole solids; so few at once that
    indices have 16 bits, unless a single solid has more."""
    order = np.argsort(mesh.owner, kind="stable")
    triangles, owner = mesh.triangles[order], mesh.owner[order]
    solids = np.flatnonzero(np.r_[True, owner[1:] != owner[:-1]])
    most = np.diff(np.r_[solids, len(owner)]) + 2  # points of so many connected triangles
    begin, count = 0, 0
    for solid, own in zip(solids.tolist(), most.tolist(), strict=True):
        if solid > begin and count + own > _MOST:
            yield _index_points(mesh.points, triangles[begin:solid])
            begin, count = solid, 0
        count += own
    yield _index_points(mesh.points, triangles[begin:])


def _index_points(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    used, index = np.unique(triangles, return_inverse=True)
    x, y, z = points[used].T
    return np.stack([x, z, -y + 0.0], axis=1).astype(np.float32), index.ravel()


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


def _accessor(document: dict, parts: list[bytes], array, kind: str, target: int) -> int:
    component = _FLOAT
    if target == _ELEMENTS:
        small = array.max() < _MOST
        component = _UINT16 if small else _UINT32
        array = array.astype(np.uint16 if small else np.uint32)
    data = array.tobytes()
    offset = sum(map(len, parts))
    parts.append(data + b"\0" * (-len(data) % 4))
    document["bufferViews"].append(
        {"buffer": 0, "byteOffset": offset, "byteLength": len(data), "target": target}
    )
    accessor = {
        "bufferView": len(document["bufferViews"]) - 1,
        "componentType": component,
        "count": len(array),
        "type": kind,
    }
    if target == _ARRAY:
        accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
    document["accessors"].append(accessor)
    return len(document["accessors"]) - 1
