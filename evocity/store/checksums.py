"""Parquet files of a run: how they are packed, and seals that show whether they are unchanged.

Arrow verifies the checksums of a file's pages. The format has none for the footer, which describes
the pages: its digest stands in the footer itself, under the key `SEAL`, computed with zeros in its
place. Other files have digests in ``provenance.json``. Files of releases without seals are read
without.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from evocity.store.safe_open import open_to_read

#: The key of the digest in a footer, and its value while the digest is computed.
SEAL, UNSEALED = b"evocity.seal", b"0" * 32

_MAGIC = b"PAR1"
# Bytes of a footer, at most: 64 generations of a thousand columns take less than a tenth.
_MOST = 1 << 28
# Texts of few values: each row group has a dictionary, and a few bits per row.
_WORDS = ("operator", "status", "island")
# A short list of whole numbers.
_FEW = "parents"


def packing_of(schema: pa.Schema) -> dict:
    """Return arguments of `pyarrow.parquet.ParquetWriter` for the columns of a ``schema``.

    Lists, bytes and texts are compressed. Columns of one number or word per row are not: a
    generation has a few hundred bytes of each, which zstd makes larger and slower to read. Whole
    numbers are written as differences, the smallest form. Other numbers are mostly distinct, so
    they have no dictionary. Only columns of one number or word per row have statistics, by which
    rows are searched.

    Raises TypeError for a column of several leaves, such as a struct.
    """
    leaves = {one.name: _leaf(one) for one in schema}
    single = {one.name for one in schema if one.name in _WORDS or pa.types.is_primitive(one.type)}
    whole = {one.name for one in schema if _is_whole(one)}
    packed = [leaf for name, leaf in leaves.items() if name not in single | whole]
    return {
        "compression": dict.fromkeys(leaves.values(), "none") | dict.fromkeys(packed, "zstd"),
        "compression_level": dict.fromkeys(packed, 3),
        "write_statistics": sorted(single),
        "use_dictionary": [*packed, *(name for name in _WORDS if name in single)],
        "column_encoding": {leaves[name]: "DELTA_BINARY_PACKED" for name in whole},
        "write_page_checksum": True,
    }


def _is_whole(one: pa.Field) -> bool:
    if one.name == _FEW and pa.types.is_list(one.type):
        return pa.types.is_integer(one.type.value_type)
    return pa.types.is_integer(one.type)


def _leaf(one: pa.Field) -> str:
    """The path of a column in Parquet."""
    if pa.types.is_list(one.type) or pa.types.is_fixed_size_list(one.type):
        return f"{one.name}.list.element"
    if pa.types.is_nested(one.type):
        raise TypeError(f"a column {one.name} of {one.type}")
    return one.name


@contextmanager
def write_sealed(path: Path, schema) -> Iterator[pq.ParquetWriter]:
    """Open a writer of the Parquet file ``path``; seal the file at the end."""
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
def open_sealed(path: Path, read_dictionary: Sequence[str] = ()) -> Iterator[pq.ParquetFile]:
    """Open the Parquet file ``path`` for reading, with verified pages and texts of
    ``read_dictionary`` in dictionaries. Raises ValueError if the footer was changed, and
    OSError."""
    check_seal(path)
    with pq.ParquetFile(
        path, read_dictionary=[*read_dictionary], page_checksum_verification=True
    ) as file:
        yield file


def check_seal(path: Path) -> None:
    """Raise ValueError if the footer of a Parquet file was changed."""
    with open_to_read(path) as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise ValueError("it does not begin as a Parquet file")
        _, footer = _footer(file)
    place = _place(footer)
    if place is None:  # of an older release
        return
    seal = footer[place : place + len(UNSEALED)]
    if seal != _digest(footer[:place] + UNSEALED + footer[place + len(UNSEALED) :]):
        raise ValueError("its footer is not the one that was written")


def _footer(file) -> tuple[int, bytes]:
    """The start of a Parquet file's footer, and all bytes from there to the end."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - 8))
    end = file.read(8)
    length = int.from_bytes(end[:4], "little")
    if end[4:] != _MAGIC or not length + 12 <= size or length > _MOST:
        raise ValueError("it does not end as a Parquet file")
    file.seek(size - 8 - length)
    return size - 8 - length, file.read(length + 8)


def _place(footer: bytes) -> int | None:
    """The place of the seal: after its key, the type of the next field and its length."""
    at = footer.rfind(SEAL)
    return None if at < 0 else at + len(SEAL) + 2


def _digest(footer: bytes) -> bytes:
    return hashlib.blake2b(footer, digest_size=16).hexdigest().encode()


def digests_of(root: Path, *places: Path) -> dict[str, str]:
    """Return name below ``root`` -> digest, of all files in the folders ``places``."""
    return {
        path.relative_to(root).as_posix(): _digest(path.read_bytes()).decode()
        for place in places
        for path in (sorted(place.iterdir()) if place.is_dir() else ())
    }


def check_digests(root: Path, place: Path, digests: Mapping[str, str]) -> None:
    """Raise ValueError unless the files in the folder ``place`` have their ``digests``; OSError
    where one cannot be read. Files without a digest are not checked."""
    inside = place.relative_to(root).as_posix() + "/"
    for name in (one for one in digests if one.startswith(inside)):
        path = root / name
        if not os.path.lexists(path):
            raise ValueError(f"{name} is missing")
        with open_to_read(path) as file:
            digest = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16))
            if digest.hexdigest() != digests[name]:
                raise ValueError(f"{path.name} is not the file that was written")
