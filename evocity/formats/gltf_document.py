"""The document of a glTF file: its arrays in buffers, and its members."""

import json
import struct
from typing import Any

import numpy as np

# numbers of the specification
_COMPONENTS = {"<f4": 5126, "<u2": 5123, "<u4": 5125}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_ARRAY, _ELEMENTS = 34962, 34963

#: Indices of 16 bits stay below this: it would begin a new strip.
MOST = 2**16 - 1


class Document:
    """A glTF document to which arrays and members are added.

    members : the JSON members, lists or dicts by name.
    """

    def __init__(self, members: dict[str, Any]):
        self.members = members | {"accessors": [], "bufferViews": []}
        self._pools: dict[str, list[bytes]] = {}
        self._filled: dict[str, int] = {}
        self._views: dict[str, dict] = {}
        self._extensions: dict[str, bool] = {}

    def append(self, member: str, value: dict) -> int:
        """Append ``value`` to the list ``member``, and return its index."""
        listed = self.members.setdefault(member, [])
        listed.append(value)
        return len(listed) - 1

    def use(self, extension: str, required: bool = False) -> str:
        """Name an ``extension`` that the file uses, or that viewers must know."""
        self._extensions[extension] = required
        return extension

    def add(self, pool: str, array: np.ndarray, kind: str = "") -> int:
        """Add the bytes of an ``array`` to a ``pool``, one buffer view, and return their offset.

        kind : "vertices" for attributes of vertices, "indices" for corners of triangles.
        """
        data = np.ascontiguousarray(array).tobytes()
        parts = self._pools.setdefault(pool, [])
        at = self._filled.get(pool, 0)
        parts.append(data + b"\0" * (-len(data) % 4))
        self._filled[pool] = at + len(parts[-1])
        view = self._views.setdefault(pool, {})
        if kind == "vertices":
            view |= {"byteStride": array.itemsize * array[0].size, "target": _ARRAY}
        elif kind == "indices":
            view["target"] = _ELEMENTS
        return at

    def accessor(
        self, pool: str, at: int, count: int, component: str, kind: str, bounds: tuple = ()
    ) -> int:
        """Add an accessor of ``count`` values at byte ``at`` of a ``pool``, and return its index.

        component : NumPy's name of the numbers, ``<f4``, ``<u2`` or ``<u4``.
        kind : "SCALAR", "VEC2", "VEC3" or "VEC4".
        bounds : the least and the greatest values, two lists; or nothing.
        """
        made: dict[str, Any] = {"bufferView": pool, "componentType": _COMPONENTS[component]}
        if at:
            made["byteOffset"] = at
        made |= {"count": count, "type": kind}
        if bounds:
            made |= {"min": bounds[0], "max": bounds[1]}
        return self.append("accessors", made)

    def array(self, pool: str, array: np.ndarray, kind: str = "") -> int:
        """Add a whole ``array``, float32 ``(n, w)`` or ``(n,)``, and return the index of its
        accessor."""
        at, wide = self.add(pool, array, kind), array[0].size
        shape = next(name for name, width in _WIDTHS.items() if width == wide)
        return self.accessor(pool, at, len(array), array.dtype.str, shape)

    def view(self, array: np.ndarray) -> int:
        """Add an ``array`` as a buffer view of its own; return a number that stays its index."""
        return self.append("alone", {"array": array})

    def data(self) -> bytes:
        """Return the bytes of the binary file."""
        members, views, body = self.members, self.members["bufferViews"], bytearray()
        for one in members.pop("alone", []):
            _place(views, body, one["array"].tobytes(), {})
        index = {}
        for pool, parts in self._pools.items():
            index[pool] = len(views)
            _place(views, body, b"".join(parts), self._views[pool])
        for accessor in members["accessors"]:
            accessor["bufferView"] = index[accessor["bufferView"]]
        if self._extensions:
            members["extensionsUsed"] = list(self._extensions)
            members["extensionsRequired"] = [k for k, needed in self._extensions.items() if needed]
        body += b"\0" * (-len(body) % 4)
        members["buffers"] = [{"byteLength": len(body)}]
        members = {key: value for key, value in members.items() if value != []}
        if not body:
            del members["buffers"]
        text = json.dumps(members, ensure_ascii=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if body:
            chunks += struct.pack("<I4s", len(body), b"BIN\0") + bytes(body)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _place(views: list[dict], body: bytearray, data: bytes, view: dict) -> None:
    # property tables need a boundary of 8 bytes
    body += b"\0" * (-len(body) % 8)
    views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)} | view)
    body += data


def shortest(rows: np.ndarray) -> list[list[float]]:
    """Return float32 ``rows`` with the fewest digits that give the same numbers."""
    return [list(map(float, row)) for row in rows.astype(np.float32).astype("U").tolist()]


def short(*numbers: float) -> list[float]:
    """Round to the digits of a viewer's numbers."""
    return [float(f"{number:.9g}") + 0.0 for number in numbers]
