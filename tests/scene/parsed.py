"""Scenes read back from their files, by parsers of the tests' own: triangles of each group."""

import itertools
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
        return glb_array(document, body, number)

    def triangles(node: dict) -> np.ndarray:
        """Of a node and what is below it, where it stands; y up."""
        parts = [
            np.empty((0, 3, 3)),
            *(triangles(document["nodes"][k]) for k in node.get("children", [])),
        ]
        if "mesh" in node:
            for primitive in document["meshes"][node["mesh"]]["primitives"]:
                points = array(primitive["attributes"]["POSITION"]).astype(float)
                parts.append(points[array(primitive["indices"]).ravel()].reshape(-1, 3, 3))
        own = np.concatenate(parts)
        placed = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if placed is None:
            return _moved(own, node)
        moves = [array(number) for number in placed["attributes"].values()]
        names = [name.lower() for name in placed["attributes"]]
        return np.concatenate(
            [_moved(own, dict(zip(names, row, strict=True))) for row in zip(*moves, strict=True)]
        )

    roots = [document["nodes"][k] for k in document["scenes"][document["scene"]]["nodes"]]
    return {node["name"]: _z_up(triangles(node)) for node in roots}


def glb_array(document: dict, body: bytes, number: int) -> np.ndarray:
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    assert view.get("byteStride", width * int(kind[2])) == width * int(kind[2])
    start = view["byteOffset"] + accessor.get("byteOffset", 0)
    assert start + accessor["count"] * width * int(kind[2]) <= (
        view["byteOffset"] + view["byteLength"]
    )
    return np.frombuffer(body, kind, accessor["count"] * width, start).reshape(-1, width)


def _moved(corners: np.ndarray, node: dict) -> np.ndarray:
    """Scaled, turned, moved; turned inside out again where the node mirrors (3.7.4)."""
    scale = np.array(node.get("scale", (1, 1, 1)))
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    found = (corners * scale) @ turn.T + node.get("translation", (0, 0, 0))
    return found[:, ::-1] if scale.prod() < 0 else found


def _obj(path: Path) -> Triangles:
    points, faces, group = [], {}, ""
    for line in path.read_text(encoding="utf-8").splitlines():
        word, *rest = line.split()
        if word == "v":
            points.append([float(x) for x in rest[:3]])  # their colours stand behind
        elif word == "g":
            (group,) = rest
        elif word == "f":
            faces.setdefault(group, []).extend(_fan([int(x) - 1 for x in rest]))
    placed = _z_up(np.array(points, float).reshape(-1, 3))
    return {name: placed[np.array(own)] for name, own in faces.items()}


def _fan(face: list[int]) -> list[list[int]]:
    """Triangles of a face without dents."""
    return [[face[0], b, c] for b, c in itertools.pairwise(face[1:])]


def _numbers(text: str) -> np.ndarray:
    return np.array(text.split(), float)


def _indexed(points: str, faces: str) -> np.ndarray:
    placed = _numbers(points).reshape(-1, 3)
    *told, last = faces.split("-1")
    assert not last.strip()
    fans = [three for face in told for three in _fan([int(x) for x in face.split()])]
    assert {n for three in fans for n in three} == set(range(len(placed)))
    return placed[fans]


def _placed(solids: list[np.ndarray], translation: str, scale: str) -> np.ndarray:
    """As the Transform about all lays them."""
    return _z_up(np.concatenate(solids) * _numbers(scale) + _numbers(translation))


# Points, faces, and where there are two materials, their colours and the colour of each face.
_VRML_FACES = re.compile(
    r"IndexedFaceSet\{coord Coordinate\{point\[(.*?)\]\}coordIndex\[(.*?)\]"
    r"(?: colorPerVertex FALSE color Color\{color\[(.*?)\]\}colorIndex\[(.*?)\])?\}"
)


def vrml_faces(text: str) -> list[tuple[str, str, str, str]]:
    """Points, faces, colours and the colour of each face, of each shape of a .wrl in order."""
    return _VRML_FACES.findall(text.replace("\ncolor", " color"))


def _wrl(path: Path) -> Triangles:
    text = path.read_text(encoding="utf-8")
    assert text.startswith("#VRML V2.0 utf8\n")
    (how,) = re.findall(r"^Transform \{ translation (.*?) scale (.*?) children \[$", text, re.M)
    found, looks = {}, {}
    for name, shapes in re.findall(
        r"^DEF (\S+) Group \{ children \[$(.*?)^\] \}$", text, re.M | re.S
    ):
        solids, own = [], set()
        joined = shapes.strip().replace("\ngeometry", " geometry").replace("\ncolor", " color")
        for line in joined.splitlines():
            label, look, geometry = re.fullmatch(
                r"DEF (\S+) Shape\{appearance (.*) geometry (\w+\{.*\})\}", line
            ).groups()
            own.add(label)
            if look.startswith("DEF"):
                looks[look.split()[1]] = look
            else:
                assert look.removeprefix("USE ") in looks
            points, faces, *_ = _VRML_FACES.fullmatch(geometry).groups()
            solids.append(_indexed(points, faces))
        assert len(own) == len(solids)
        found[name] = _placed(solids, *how)
    return found


def _x3d(path: Path) -> Triangles:
    root = ElementTree.parse(path).getroot()
    assert root.tag == "X3D"
    (whole,) = root.find("Scene").findall("Transform")
    found = {}
    for group in whole.findall("Group"):
        solids = []
        for shape in group.findall("Shape"):
            _, geometry = shape
            assert shape.get("DEF").startswith(group.get("DEF"))
            (points,) = geometry.iter("Coordinate")
            solids.append(_indexed(points.get("point"), geometry.get("coordIndex")))
        found[group.get("DEF")] = _placed(solids, whole.get("translation"), whole.get("scale"))
    return found
