"""Parquet files of a run: how they are packed, and seals that show whether they are unchanged.

Arrow verifies the checksums of a file's pages. The format has none for the footer, which describes
the pages: its digest stands in the footer itself, under the key `SEAL`, computed with zeros in its
place. Other files have digests in ``provenance.json``. A file without a seal, of an older release,
is read in a child process first, in case it is one that ends Arrow.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import PurePosixPath
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from evocity import parquet_child
from evocity.sealed_parquet import UNSEALED, digest_of, place_of_seal, read_footer
from evocity.store.run_directory import RunDirectory

#: The key of the digest in a footer.
SEAL = b"evocity.seal"

# The bytes at the end of a footer that are searched first, and the type of a text in it.
_TAIL, _TEXT = 1 << 14, b"\x18"
# Texts of few values: each row group has a dictionary, and a few bits per row.
_WORDS = ("operator", "status", "island")
# A short list of whole numbers.
_FEW = "parents"
# Lists of whole numbers, the next mostly a little above the one before; and of distinct numbers.
_STEPS, _DISTINCT = "source", ("sigma", "beta")
# Values that are encoded in one go; Arrow's own number is 1 024.
_BATCH = 1 << 16
# Files without a seal that a child process has read, and their most.
_tried: set[tuple[int, ...]] = set()
_MOST_TRIED = 1 << 16


def packing_of(schema: pa.Schema) -> dict:
    """Return arguments of `pyarrow.parquet.ParquetWriter` for the columns of a ``schema``.

    Lists, bytes and texts are compressed. Columns of one number or word per row are too small for
    that, and have statistics, by which rows are searched. Whole numbers are written as differences,
    and so are places in a source city, which mostly follow one another. Other numbers are mostly
    distinct, so they have no dictionary, and neither have σ and β. Raises TypeError for a struct.
    """
    leaves = {one.name: _leaf(one) for one in schema}
    single = {one.name for one in schema if one.name in _WORDS or pa.types.is_primitive(one.type)}
    whole = {one.name for one in schema if _is_whole(one)}
    packed = [leaf for name, leaf in leaves.items() if name not in single | whole]
    steps = {leaves[one.name] for one in schema if _is_steps(one)}
    plain = {leaves[name] for name in _DISTINCT if name in leaves}
    return {
        "compression": dict.fromkeys(leaves.values(), "none") | dict.fromkeys(packed, "zstd"),
        "compression_level": dict.fromkeys(packed, 3),
        "write_statistics": sorted(single),
        "use_dictionary": [
            *(leaf for leaf in packed if leaf not in steps | plain),
            *(name for name in _WORDS if name in single),
        ],
        "column_encoding": dict.fromkeys(
            [*(leaves[name] for name in whole), *steps], "DELTA_BINARY_PACKED"
        ),
        "write_batch_size": _BATCH,
        "write_page_checksum": True,
    }


def _is_whole(one: pa.Field) -> bool:
    if one.name == _FEW and pa.types.is_list(one.type):
        return pa.types.is_integer(one.type.value_type)
    return pa.types.is_integer(one.type)


def _is_steps(one: pa.Field) -> bool:
    return one.name == _STEPS and pa.types.is_list(one.type) and one.type.value_type == pa.int32()


def _leaf(one: pa.Field) -> str:
    if pa.types.is_list(one.type) or pa.types.is_fixed_size_list(one.type):
        return f"{one.name}.list.element"
    if pa.types.is_nested(one.type):
        raise TypeError(f"a column {one.name} of {one.type}")
    return one.name


@contextmanager
def write_sealed(
    file: BinaryIO, schema, about: Mapping[str, str] | None = None
) -> Iterator[pq.ParquetWriter]:
    """Open a writer of Parquet into a new ``file``, open to read and write; seal it at the end.
    ``about``: short entries of the footer, see `footer_value`."""
    with pq.ParquetWriter(file, schema, **packing_of(schema)) as writer:
        yield writer
        writer.add_key_value_metadata({**(about or {}), SEAL.decode(): UNSEALED.decode()})
    start, footer = read_footer(file)
    place = place_of_seal(footer, SEAL)
    if place is None or footer[place : place + len(UNSEALED)] != UNSEALED:
        raise OSError(f"{file.name} has no room for its seal")
    file.seek(start + place)
    file.write(digest_of(footer))


@contextmanager
def open_sealed(file: BinaryIO, read_dictionary: Sequence[str] = ()) -> Iterator[pq.ParquetFile]:
    """Open Parquet in an open ``file`` for reading, with verified pages and texts of
    ``read_dictionary`` in dictionaries. Raises OSError, and ValueError if the footer was changed.

    Arrow gets no path: it takes paths as UTF-8, and a path may lead to another file meanwhile.
    """
    check_seal(file)
    with pq.ParquetFile(
        file, read_dictionary=[*read_dictionary], page_checksum_verification=True
    ) as opened:
        yield opened


def check_seal(file: BinaryIO) -> None:
    """Raise ValueError if the footer of Parquet in an open ``file`` was changed, or if a file
    without a seal ends the process that reads it."""
    _, footer = read_footer(file)
    place = place_of_seal(footer, SEAL)
    if place is None:  # of an older release
        _try_unsealed(file)
        return
    seal = footer[place : place + len(UNSEALED)]
    if seal != digest_of(footer[:place], UNSEALED, footer[place + len(UNSEALED) :]):
        raise ValueError("its footer is not the one that was written")


def _try_unsealed(file: BinaryIO) -> None:
    """Read an open ``file`` without a seal in a child process, once as long as it is the same."""
    about = os.fstat(file.fileno())
    identity = about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns
    if identity in _tried or about.st_size > parquet_child.MOST_BYTES:
        return
    file.seek(0)
    parquet_child.try_to_read(file.read())
    if len(_tried) >= _MOST_TRIED:
        _tried.clear()
    _tried.add(identity)


def footer_value(file: BinaryIO, key: bytes) -> bytes | None:
    """Return the short text under a ``key`` in the footer of an open ``file``, which is read, not
    parsed; None without one. Raises ValueError for another file."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - _TAIL))
    footer = file.read(_TAIL)
    if (at := footer.rfind(key + _TEXT)) < 0 and size > _TAIL:
        footer = read_footer(file)[1]
        at = footer.rfind(key + _TEXT)
    if at < 0:
        return None
    start = at + len(key) + len(_TEXT)
    return footer[start + 1 : start + 1 + footer[start]]


def digests_of(directory: RunDirectory, *places: str) -> dict[str, str]:
    """Return name in the run -> digest, of all files in the folders ``places``."""
    return {
        f"{place}/{name}": _digest_in(directory, f"{place}/{name}")
        for place in places
        if directory.exists(place)
        for name in directory.entries(place)
    }


def check_digests(directory: RunDirectory, place: str, digests: Mapping[str, str]) -> None:
    """Raise ValueError unless the files in the folder ``place`` have their ``digests``; OSError
    where one cannot be read. Files without a digest are not checked."""
    for name in (one for one in digests if one.startswith(f"{place}/")):
        if not directory.exists(name):
            raise ValueError(f"{name} is missing")
        if _digest_in(directory, name) != digests[name]:
            raise ValueError(f"{PurePosixPath(name).name} is not the file that was written")


def _digest_in(directory: RunDirectory, name: str) -> str:
    with directory.open(name) as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
