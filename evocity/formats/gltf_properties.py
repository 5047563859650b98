"""Properties of objects in a merged glTF mesh: EXT_structural_metadata.

Source: Cesium, EXT_structural_metadata and EXT_mesh_features, 3D Tiles 1.1.
"""

import re
from collections.abc import Collection
from typing import Any

import numpy as np

from evocity.formats.gltf_document import Document

_EXTENSION = "EXT_structural_metadata"
#: The value of a missing number.
_NO_DATA = -9999


def add_property_table(document: Document, name: str, columns: dict[str, list]) -> int:
    """Add a table of ``columns``, lists of one length, and return its index. Columns hold text,
    whole numbers or numbers; None is a missing value."""
    extensions = document.members.setdefault("extensions", {})
    document.use(_EXTENSION)
    empty: dict[str, Any] = {"schema": {"id": "evocity", "classes": {}}, "propertyTables": []}
    whole = extensions.setdefault(_EXTENSION, empty)
    classes, tables = whole["schema"]["classes"], whole["propertyTables"]
    kind = _identifier(name, classes)
    described: dict[str, dict] = {}
    values: dict[str, dict] = {}
    for label, column in columns.items():
        known = [value for value in column if value is not None]
        if not known:
            continue
        key = _identifier(label, described)
        described[key], values[key] = _property(document, column, known)
    classes[kind] = {"name": name, "properties": described}
    count = len(next(iter(columns.values())))
    tables.append({"name": name, "class": kind, "count": count, "properties": values})
    return len(tables) - 1


def _property(document: Document, column: list, known: list) -> tuple[dict, dict]:
    """Describe a column, and add its values."""
    if all(isinstance(value, int) for value in known):
        return _numbers(document, column, known, "INT32", np.int32)
    if all(isinstance(value, int | float) for value in known):
        return _numbers(document, column, known, "FLOAT32", np.float32)
    texts = ["" if value is None else str(value).encode() for value in column]
    coded = [text if isinstance(text, bytes) else text.encode() for text in texts]
    offsets = np.cumsum([0, *map(len, coded)]).astype(np.uint32)
    data = b"".join(coded) or b"\0"
    values = document.view(np.frombuffer(data, np.uint8))
    placed = {"values": values, "stringOffsets": document.view(offsets)}
    described: dict[str, Any] = {"type": "STRING"}
    if len(known) < len(column):
        described["noData"] = ""
    return described, placed


def _numbers(document: Document, column: list, known: list, word: str, kind) -> tuple[dict, dict]:
    filled = np.array([_NO_DATA if value is None else value for value in column], kind)
    described: dict[str, Any] = {"type": "SCALAR", "componentType": word}
    if len(known) < len(column):
        described["noData"] = _NO_DATA
    return described, {"values": document.view(filled)}


def _identifier(text: str, taken: Collection[str]) -> str:
    """Return an identifier of letters and digits that is not yet ``taken``."""
    word = re.sub(r"\W", "_", text, flags=re.ASCII)
    word = word if re.match(r"[A-Za-z_]", word) else f"_{word}"
    while word in taken:
        word += "_"
    return word
