"""Seals of GeoTIFFs: a digest of a whole file in its metadata, which shows changed bytes.

The metadata item `SEAL` has the file's size in 16 digits, and the digest in 32 hexadecimal digits,
computed with zeros in place of both. A mark at the end of the file shows where damage hides the
item. A file of another size was saved by another program, and is read without.
"""

import hashlib
import os
import re
from pathlib import Path
from typing import BinaryIO

from evocity.errors import MapError

#: The metadata item, and its value while the digest is computed.
SEAL, UNSEALED = "EVOCITY_SEAL", "0" * 48

# Bytes at either end of a file in which GDAL writes its metadata.
_SEARCHED = 1 << 20
# Bytes that are read at a time.
_AT_ONCE = 1 << 20
_KEY = f'"{SEAL}">'.encode()
# The last bytes of a sealed file.
_MARK = b"evocity.sealed"


def seal(path: Path) -> None:
    """Put the seal into a written GeoTIFF that has the item `SEAL` with the value `UNSEALED`. Files
    with metadata far from their ends stay without."""
    with open(path, "rb+") as file:
        size, place = _find(file)
        if place is None or _read(file, place, len(UNSEALED)) != UNSEALED.encode():
            return
        file.seek(size)
        file.write(_MARK)
        size += len(_MARK)
        digest = _digest(file, size, place)
        file.seek(place)
        file.write(b"%016d" % size + digest)


def check_seal(path: Path) -> None:
    """Raise `MapError` if the bytes of a sealed GeoTIFF changed; OSError if reading fails."""
    with open(path, "rb") as file:
        size, place = _find(file)
        if place is None:
            if _read(file, max(0, size - len(_MARK)), len(_MARK)) != _MARK:
                return
        else:
            value = _read(file, place, len(UNSEALED))
            # emptied on purpose, never computed, or saved by another program
            if value[:1] == b"<" or value == UNSEALED.encode() or _other_size(value, size):
                return
            if value[16:] == _digest(file, size, place):
                return
    raise MapError(
        f"{path.name} is damaged: its content does not match its checksum",
        "an unchanged file from evocity, or a file that another program saved",
        "restore the file from a copy; if you changed the file on purpose, remove its checksum: "
        f"rio edit-info --tag {SEAL}= {path.name}",
    )


def _other_size(value: bytes, size: int) -> bool:
    return re.fullmatch(rb"\d{16}", value[:16]) is not None and int(value[:16]) != size


def _find(file: BinaryIO) -> tuple[int, int | None]:
    """Return the size of a file, and the place of its seal, None without one."""
    size = file.seek(0, os.SEEK_END)
    for start in (max(0, size - _SEARCHED), 0):
        at = _read(file, start, _SEARCHED).rfind(_KEY)
        if at >= 0:
            return size, start + at + len(_KEY)
    return size, None


def _read(file: BinaryIO, start: int, length: int) -> bytes:
    file.seek(start)
    return file.read(length)


def _digest(file: BinaryIO, size: int, place: int) -> bytes:
    """Return the digest of a file with zeros from ``place`` on."""
    state = hashlib.blake2b(digest_size=16)
    for first, last in ((0, place), (place + len(UNSEALED), size)):
        if first:
            state.update(UNSEALED.encode())
        file.seek(first)
        while first < last and (part := file.read(min(_AT_ONCE, last - first))):
            state.update(part)
            first += len(part)
    return state.hexdigest().encode()
