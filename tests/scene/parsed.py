"""Scenes read back from their files, by parsers of the tests' own: triangles of each group."""

import json
import re
import struct
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

#: By group, float64 ``(t, 3, 3)``: corners of triangles, x to the east, y to the north, z up.
Triangles = dict[str, np.ndarray]


def read(path: Path) -> Triangles:
    suffix = "".join(path.suffixes[-2:]) if path.name.endswith(".city.json") else path.suffix
    return {
        ".glb": _glb,
        ".obj": _obj,
        ".wrl": _wrl,
        ".x3d": _x3d,
    }[suffix](path)


def _z_up(points: np.ndarray) -> np.ndarray:
    """From y up."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def glb_document(path: Path) -> tuple[dict, bytes]:
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    document = json.loads(data[20 : 20 + size])
    length, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    return document, data[28 + size : 28 + size + length]


def _glb(path: Path) -> Triangles:
    document, body = glb_document(path)

    def array(number: int) -> np.ndarray:
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        count = accessor["count"] * width
        return np.frombuffer(body, kind, count, view["byteOffset"]).reshape(-1, width)

    found = {}
    for mesh in document["meshes"]:
        parts = []
        for primitive in mesh["primitives"]:
            points = _z_up(array(primitive["attributes"]["POSITION"]).astype(float))
            parts.append(points[array(primitive["indices"]).ravel()].reshape(-1, 3, 3))
        found[mesh["name"]] = np.concatenate(parts)
    return found


def _obj(path: Path) -> Triangles:
    points, faces, group = [], {}, ""
    for line in path.read_text(encoding="utf-8").splitlines():
        word, *rest = line.split()
        if word == "v":
            points.append([float(x) for x in rest])
        elif word == "g":
            (group,) = rest
        elif word == "f":
            faces.setdefault(group, []).append([int(x) - 1 for x in rest])
    placed = _z_up(np.array(points, float).reshape(-1, 3))
    return {name: placed[np.array(own)] for name, own in faces.items()}


def _indexed(points: str, faces: str) -> np.ndarray:
    placed = _z_up(np.array(re.split(r"[\s,]+", points.strip(" \n,")), float).reshape(-1, 3))
    index = np.array(faces.split(), int).reshape(-1, 4)
    assert (index[:, 3] == -1).all()
    return placed[index[:, :3]]


def _wrl(path: Path) -> Triangles:
    text = path.read_text(encoding="utf-8")
    assert text.startswith("#VRML V2.0 utf8\n")
    shape = r"DEF (\w+) Shape \{.*?point \[([^\]]*)\].*?coordIndex \[([^\]]*)\]"
    return {
        name: _indexed(points, faces)
        for name, points, faces in re.findall(shape, text, flags=re.DOTALL)
    }


def _x3d(path: Path) -> Triangles:
    root = ElementTree.parse(path).getroot()
    assert root.tag == "X3D"
    found = {}
    for shape in root.iter("Shape"):
        (faces,) = shape.iter("IndexedFaceSet")
        (points,) = shape.iter("Coordinate")
        found[shape.get("DEF")] = _indexed(points.get("point"), faces.get("coordIndex"))
    return found
