"""The PBF packing of OpenStreetMap extracts (wiki.openstreetmap.org/wiki/PBF_Format)."""

import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evocity.io.osm import Elements, broken_extract, footprints_of
from evocity.io.sources import Footprints, Request

# limits the format itself sets
_LARGEST_HEADER, _LARGEST_BLOB = 64 * 1024, 32 * 1024 * 1024

_MEMBER_IS_WAY = 1


def read_osm_pbf(path: Path, request: Request) -> Footprints:
    """Read the buildings of an ``.osm.pbf`` file."""
    elements = Elements()
    try:
        for block in _blocks(path):
            _add_block(block, elements)
    except (ValueError, KeyError, IndexError, zlib.error, OSError, OverflowError) as error:
        raise broken_extract(path, error) from error
    return footprints_of(path, elements)


def _blocks(path: Path) -> Iterator[bytes]:
    """The unpacked data blocks of a file."""
    with open(path, "rb") as file:
        while size := file.read(4):
            header = dict(_fields(_exactly(file, int.from_bytes(size), _LARGEST_HEADER)))
            blob = dict(_fields(_exactly(file, header[3], _LARGEST_BLOB)))
            if header[1] == b"OSMData":
                yield _unpacked(blob)


def _exactly(file, size: int, most: int) -> bytes:
    if size > most:
        raise ValueError(f"a piece of {size} bytes, where {most} are allowed")
    piece = file.read(size)
    if len(piece) < size:
        raise ValueError("it ends within a block")
    return piece


def _unpacked(blob: dict) -> bytes:
    if 1 in blob:
        return blob[1]
    if 3 not in blob:
        raise ValueError("a block is packed by another method than zlib")
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(blob[3], _LARGEST_BLOB)
    if not unpacker.eof:
        raise ValueError("a block is larger than allowed, or cut off")
    return data


def _add_block(block: bytes, elements: Elements) -> None:
    parts = list(_fields(block))
    about = dict(parts)
    strings = [text for _, text in _fields(next(value for key, value in parts if key == 1))]
    scale = about.get(17, 100) * 1e-9
    corner = np.array([_signed64(about.get(20, 0)), _signed64(about.get(19, 0))]) * 1e-9
    for group in (value for key, value in parts if key == 2):
        single = []
        for kind, message in _fields(group):
            if kind == 1:
                node = dict(_fields(message))
                single.append([_zigzag(node[key]) for key in (1, 9, 8)])
                continue
            found = dict(_fields(message))
            if kind == 2:
                columns = [np.cumsum(_zigzags(_packed(found[key]))) for key in (1, 9, 8)]
                _add_nodes(elements, *columns, scale, corner)
            elif kind == 3:
                refs = np.cumsum(_zigzags(_packed(found.get(8, b""))))
                if len(refs):
                    elements.ways[found[1]] = refs, _tags(found, strings)
            elif kind == 4:
                tags = _tags(found, strings)
                if tags.get("type") == "multipolygon":
                    elements.relations.append((_members(found, strings), tags))
        if single:
            _add_nodes(elements, *np.array(single, dtype=np.int64).T, scale, corner)


def _add_nodes(elements: Elements, ids, lon, lat, scale: float, corner: np.ndarray) -> None:
    if not len(ids) == len(lon) == len(lat):
        raise ValueError("a node lacks its place")
    elements.nodes.append((ids, np.column_stack([lon, lat]) * scale + corner))


def _tags(found: dict, strings: list[bytes]) -> dict[str, str]:
    keys, values = _packed(found.get(2, b"")), _packed(found.get(3, b""))
    pairs = zip(keys.tolist(), values.tolist(), strict=True)
    return {_text(strings[key]): _text(strings[value]) for key, value in pairs}


def _members(found: dict, strings: list[bytes]) -> list[tuple[int, str]]:
    roles, kinds = _packed(found.get(8, b"")), _packed(found.get(10, b""))
    ids = np.cumsum(_zigzags(_packed(found.get(9, b""))))
    members = zip(ids.tolist(), roles.tolist(), kinds.tolist(), strict=True)
    return [(way, _text(strings[role])) for way, role, kind in members if kind == _MEMBER_IS_WAY]


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")


# ---- protocol buffers: (field number, whole number or bytes) pairs, and packed numbers


def _fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        wire = key & 7
        if wire == 0:
            value, at = _varint(message, at)
        elif wire in (1, 2, 5):
            size, at = _varint(message, at) if wire == 2 else (8 if wire == 1 else 4, at)
            value = message[at : at + size]
            at += size
            if at > len(message):
                raise ValueError("a field reaches beyond its block")
        else:
            raise ValueError("a field of unknown kind")
        yield key >> 3, value


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number of more than 64 bits")


def _packed(raw: bytes) -> np.ndarray:
    """The whole numbers of a packed field, uint64."""
    septets = np.frombuffer(raw, dtype=np.uint8)
    last = np.flatnonzero(septets < 128)
    if not len(last):
        return np.empty(0, dtype=np.uint64)
    first = np.concatenate([[0], last[:-1] + 1])
    place = np.arange(last[-1] + 1) - np.repeat(first, last - first + 1)
    shifted = (septets[: last[-1] + 1] & 127).astype(np.uint64) << (7 * place).astype(np.uint64)
    return np.bitwise_or.reduceat(shifted, first)


def _zigzags(numbers: np.ndarray) -> np.ndarray:
    return (numbers >> np.uint64(1)).astype(np.int64) ^ -(numbers & np.uint64(1)).astype(np.int64)


def _zigzag(number: int) -> int:
    return (number >> 1) ^ -(number & 1)


def _signed64(number: int) -> int:
    return number - 2**64 if number >= 2**63 else number


__all__ = ["read_osm_pbf"]
