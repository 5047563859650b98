"""Seals of Parquet files: digests inside a file that show whether its bytes are unchanged.

A seal stands in the footer under a key, as 32 hexadecimal digits, and is computed with zeros in its
place. A file of its own, such as a genome, has a digest of all its other bytes, and is checked
before Arrow opens it. A file without a seal is parsed in `evocity.parquet_child`.
"""

import hashlib
import os
import stat
from collections.abc import Sequence
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from evocity import parquet_child

#: The key of the digest of a whole file, and a digest's value while it is computed.
FILE_SEAL, UNSEALED = b"evocity.file-seal", b"0" * 32
# A second key of the metadata of sealed files, which stays where damage hides the seal.
_SEALED = b"evocity.sealed"
_METADATA = {FILE_SEAL.decode(): UNSEALED.decode(), _SEALED.decode(): "yes"}
#: Bytes of a whole file that is read at once, at most.
MOST_BYTES = 1 << 31

_MAGIC = b"PAR1"
# Bytes of a footer, at most: 64 generations of a thousand columns take less than a tenth.
_MOST_FOOTER = 1 << 28
_BINARY = getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)


class ChangedFileError(ValueError):
    """A sealed file whose bytes are not the ones that evocity wrote."""


def digest_of(*parts: bytes | memoryview) -> bytes:
    """Return the digest of the ``parts``, one after the other, as 32 hexadecimal digits."""
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        state.update(part)
    return state.hexdigest().encode()


def read_footer(file: BinaryIO) -> tuple[int, bytes]:
    """Return the start of a Parquet file's footer, and all bytes from there to the end. Raises
    ValueError for other files."""
    file.seek(0)
    if file.read(len(_MAGIC)) != _MAGIC:
        raise ValueError("it does not begin as a Parquet file")
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 8))
    end = file.read(8)
    length = int.from_bytes(end[:4], "little")
    if end[4:] != _MAGIC or not length + 12 <= size or length > _MOST_FOOTER:
        raise ValueError("it does not end as a Parquet file")
    file.seek(size - 8 - length)
    return size - 8 - length, file.read(length + 8)


def place_of_seal(footer: bytes, key: bytes) -> int | None:
    """Return the place of the seal under ``key`` in a ``footer``, None without one. It stands after
    its key, the type of the next field and its length."""
    at = footer.rfind(key)
    return None if at < 0 else at + len(key) + 2


def write_table(table: pa.Table, path: str | os.PathLike) -> None:
    """Write a ``table`` to a Parquet file, with checksums of its pages and the seal `FILE_SEAL`.
    Files are read whole, so they have no statistics, which take more bytes than the seal."""
    packing = {"compression": "zstd", "write_page_checksum": True, "write_statistics": False}
    with (
        open(path, "wb") as file,
        pq.ParquetWriter(file, table.schema, **packing) as writer,
    ):
        writer.write_table(table)
        writer.add_key_value_metadata(_METADATA)
    with open(path, "rb+") as written:
        start, footer = read_footer(written)
        place = place_of_seal(footer, FILE_SEAL)
        if place is None or footer[place : place + len(UNSEALED)] != UNSEALED:
            raise OSError(f"{os.fspath(path)!r} has no room for its seal")
        written.seek(0)
        digest = digest_of(written.read())
        written.seek(start + place)
        written.write(digest)


def open_table(path: str | os.PathLike, keys: Sequence[bytes], most: int) -> pq.ParquetFile:
    """Open the Parquet file of a table with one of the ``keys`` in its metadata; all its bytes are
    in memory.

    The child rewrites a file without the seal `FILE_SEAL`: an unsealed table of more than ``most``
    rows raises `evocity.parquet_child.UnreadableParquetError`. Raises `ChangedFileError` if the
    bytes of a sealed file changed, ValueError for other content, and OSError.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | _BINARY), "rb") as file:
        about = os.fstat(file.fileno())
        if not stat.S_ISREG(about.st_mode):
            raise ValueError("it is not a plain file")
        if about.st_size > MOST_BYTES:
            raise ValueError(f"it has more than {MOST_BYTES >> 30} GiB")
        start, footer = read_footer(file)
        file.seek(0)
        content = file.read(start + len(footer))
    place = place_of_seal(footer, FILE_SEAL)
    if place is not None:
        check_content(content, start + place)
    elif _SEALED in footer:
        raise ChangedFileError("its seal is missing")
    else:
        content = parquet_child.rewrite(content, keys, most)
    return pq.ParquetFile(pa.BufferReader(content))


def check_content(content: bytes, place: int) -> None:
    """Raise `ChangedFileError` unless the seal at ``place`` is that of the ``content``."""
    view, after = memoryview(content), place + len(UNSEALED)
    if content[place:after] != digest_of(view[:place], UNSEALED, view[after:]):
        raise ChangedFileError("its bytes are not the ones that evocity wrote")
