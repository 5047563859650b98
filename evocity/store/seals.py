"""Seals: whether the files of a run are those that were written.

Pages of a Parquet file have checksums, which Arrow verifies as it reads them. What tells of the
pages, the footer, has none in the format: its digest stands in itself, under the key `SEAL`, taken
while zeros stand there. Other files have theirs in ``provenance.json``. Files of releases that
wrote no seals are read without.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyarrow.parquet as pq

from evocity.store.packing import packing_of
from evocity.store.parts import open_to_read

#: The key of the digest in a footer, and what stands there while it is taken.
SEAL, UNSEALED = b"evocity.seal", b"0" * 32

_MAGIC = b"PAR1"
# Bytes of a footer, at most: 64 generations of a thousand columns have less than a tenth.
_MOST = 1 << 28


@contextmanager
def sealed(path: Path, schema) -> Iterator[pq.ParquetWriter]:
    """A writer of the Parquet file ``path``, which is sealed once all is written."""
    with pq.ParquetWriter(path, schema, **packing_of(schema)) as writer:
        yield writer
        writer.add_key_value_metadata({SEAL.decode(): UNSEALED.decode()})
    with open(path, "rb+") as file:
        start, footer = _footer(file)
        place = _place(footer)
        if place is None or footer[place : place + len(UNSEALED)] != UNSEALED:
            raise OSError(f"{path.name} has no room for its seal")
        file.seek(start + place)
        file.write(_digest(footer))


@contextmanager
def opened(path: Path, read_dictionary: Sequence[str] = ()) -> Iterator[pq.ParquetFile]:
    """The Parquet file ``path``, opened to be read; its pages are verified as they are read. The
    texts of ``read_dictionary`` stay in dictionaries. Raises ValueError if its footer is not the
    one that was written, and OSError."""
    check_seal(path)
    with pq.ParquetFile(
        path, read_dictionary=[*read_dictionary], page_checksum_verification=True
    ) as file:
        yield file


def check_seal(path: Path) -> None:
    """Raise ValueError if the footer of a Parquet file is not the one that was written."""
    with open_to_read(path) as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("it does not begin as a Parquet file")
        _, footer = _footer(file)
    place = _place(footer)
    if place is None:  # of an older release
        return
    told = footer[place : place + len(UNSEALED)]
    if told != _digest(footer[:place] + UNSEALED + footer[place + len(UNSEALED) :]):
        raise ValueError("its footer is not the one that was written")


def _footer(file) -> tuple[int, bytes]:
    """Where the footer of a Parquet file begins, and all from there to its end."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 8))
    end = file.read(8)
    length = int.from_bytes(end[:4], "little")
    if end[4:] != _MAGIC or not length + 12 <= size or length > _MOST:
        raise ValueError("it does not end as a Parquet file")
    file.seek(size - 8 - length)
    return size - 8 - length, file.read(length + 8)


def _place(footer: bytes) -> int | None:
    """Where the seal stands: behind its key, the next field's type and its length, a byte each."""
    at = footer.rfind(SEAL)
    return None if at < 0 else at + len(SEAL) + 2


def _digest(footer: bytes) -> bytes:
    return hashlib.blake2b(footer, digest_size=16).hexdigest().encode()


def digests_of(root: Path, *places: Path) -> dict[str, str]:
    """Name below ``root`` -> digest, of all files in the folders ``places`` that are there."""
    found = {}
    for place in places:
        for path in sorted(place.iterdir()) if place.is_dir() else ():
            found[path.relative_to(root).as_posix()] = _digest(path.read_bytes()).decode()
    return found


def check_digests(root: Path, place: Path, digests: Mapping[str, str]) -> None:
    """Raise ValueError unless the files in the folder ``place`` are those of ``digests``, as far as
    these tell of any there; OSError where one cannot be read."""
    inside = place.relative_to(root).as_posix() + "/"
    for name in (one for one in digests if one.startswith(inside)):
        path = root / name
        if not os.path.lexists(path):
            raise ValueError(f"{name} is missing")
        with open_to_read(path) as file:
            if hashlib.file_digest(file, _blake).hexdigest() != digests[name]:
                raise ValueError(f"{path.name} is not the file that was written")


def _blake():
    return hashlib.blake2b(digest_size=16)


__all__ = ["SEAL", "check_digests", "check_seal", "digests_of", "opened", "sealed"]
