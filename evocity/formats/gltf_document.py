"""The document of a glTF file: its arrays in buffers, and its members."""

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

# numbers of the specification
_COMPONENTS = {"<f4": 5126, "<u2": 5123, "<u4": 5125}
_ARRAY, _ELEMENTS = 34962, 34963

#: The type of accessors by the numbers of a value.
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}

#: Indices of 16 bits stay below this: it would begin a new strip.
MOST = 2**16 - 1

# One encoder for all values: `json.dumps` makes a new one each time.
_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"))


class Document:
    """A glTF document to which arrays and members are added.

    members : the JSON members by name. Lists hold values, or texts that are JSON already: a scene
        has some thousands of nodes, which are quicker to write as text at once.
    """

    def __init__(self, members: dict[str, Any]):
        self.members = members | {"accessors": [], "bufferViews": []}
        self._accessors: list[tuple[str, str]] = []
        self._pools: dict[str, list[bytes]] = {}
        self._filled: dict[str, int] = {}
        self._views: dict[str, dict] = {}
        self._extensions: dict[str, bool] = {}

    def append(self, member: str, value: dict) -> int:
        """Append ``value`` to the list ``member``, and return its index."""
        listed = self.members.setdefault(member, [])
        listed.append(value)
        return len(listed) - 1

    def append_texts(self, member: str, texts: Sequence[str]) -> range:
        """Append values that are JSON already to the list ``member``, and return their indices."""
        listed = self.members.setdefault(member, [])
        listed += texts
        return range(len(listed) - len(texts), len(listed))

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

    def accessors(
        self,
        pool: str,
        places: list[int],
        counts: list[int],
        component: str,
        kind: str,
        bounds: list[str] | None = None,
    ) -> int:
        """Add accessors of so many values (``counts``) from the bytes ``places`` of a ``pool`` on.
        Return the index of the first; the others follow it.

        component : NumPy's name of the numbers, ``<f4``, ``<u2`` or ``<u4``.
        kind : "SCALAR", "VEC2", "VEC3" or "VEC4".
        bounds : JSON of the least and the greatest values of each, as of `bounds_of`; or None.
        """
        # a scene has some thousands of accessors, so each is text at once
        begin = f'"componentType":{_COMPONENTS[component]}'
        end = f',"type":"{kind}"'
        first = len(self._accessors)
        self._accessors += [
            (pool, f'{begin},"byteOffset":{at},"count":{count}{end}{around}')
            for at, count, around in zip(places, counts, bounds or [""] * len(counts), strict=True)
        ]
        return first

    def array(self, pool: str, array: np.ndarray, kind: str = "") -> int:
        """Add a whole ``array``, float32 ``(n, w)`` or ``(n,)``, and return the index of its
        accessor."""
        at, shape = self.add(pool, array, kind), KINDS[array[0].size]
        return self.accessors(pool, [at], [len(array)], array.dtype.str, shape)

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
        if self._extensions:
            needed = [name for name, required in self._extensions.items() if required]
            members["extensionsUsed"] = [to_json(name) for name in self._extensions]
            members["extensionsRequired"] = [to_json(name) for name in needed]
        body += b"\0" * (-len(body) % 4)
        members["buffers"] = [{"byteLength": len(body)}]
        if not body:
            del members["buffers"]
        members["accessors"] = [
            f'{{"bufferView":{index[pool]},{rest}}}' for pool, rest in self._accessors
        ]
        texts = {key: _texts(value) for key, value in members.items()}
        listed = [f'"{key}":{value}' for key, value in texts.items() if value != "[]"]
        text = f"{{{','.join(listed)}}}".encode()
        text += b" " * (-len(text) % 4)
        chunks: list[bytes | bytearray] = [struct.pack("<I4s", len(text), b"JSON"), text]
        if body:
            chunks += [struct.pack("<I4s", len(body), b"BIN\0"), body]
        head = struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks)))
        return b"".join([head, *chunks])


def _place(views: list[dict], body: bytearray, data: bytes, view: dict) -> None:
    # property tables need a boundary of 8 bytes
    body += b"\0" * (-len(body) % 8)
    views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)} | view)
    body += data


def _texts(value: Any) -> str:
    """Write a member as JSON; texts in a list are JSON already."""
    if not isinstance(value, list):
        return to_json(value)
    return f"[{','.join([one if isinstance(one, str) else to_json(one) for one in value])}]"


def to_json(value: Any) -> str:
    """Write ``value`` as JSON without spaces."""
    return _ENCODER.encode(value)


def bounds_of(points: np.ndarray, starts: np.ndarray) -> list[str]:
    """Return the JSON of the bounds of accessors: the least and the greatest of the float32 rows
    ``points`` from each of ``starts`` on, with the digits that give the same numbers."""
    both = [how.reduceat(points, starts) for how in (np.minimum, np.maximum)]
    side = ",".join(["%.9g"] * points.shape[1])
    template = f',"min":[{side}],"max":[{side}]'
    return [template % tuple(row) for row in np.hstack(both).tolist()]


def short(*numbers: float) -> list[float]:
    """Round to the digits of a viewer's numbers."""
    return [float(f"{number:.9g}") + 0.0 for number in numbers]
