"""How columns of Parquet files of a run are packed."""

import pyarrow as pa

#: Words of few kinds: a dictionary of each row group has them, and numbers of a few bits.
_WORDS = ("operator", "status", "island")
#: A list of whole numbers, of few elements.
_FEW = "parents"


def packing_of(schema: pa.Schema) -> dict:
    """What `pyarrow.parquet.ParquetWriter` is told of a ``schema``'s columns.

    Large ones, lists and bytes and texts, are compressed. Those of one number or word a row are
    not: a generation's are a few hundred bytes, a frame of zstd makes most of them larger, and to
    begin one takes longer than to read them, on virtual machines thirty microseconds each of
    thousands. Whole numbers are written as differences, which is smaller than either.
    """
    leaves = {one.name: _leaf(one) for one in schema}
    plain = {one.name for one in schema if _is_small(one)}
    whole = {one.name for one in schema if one.name == _FEW or pa.types.is_integer(one.type)}
    packed = [leaves[one.name] for one in schema if one.name not in plain]
    return {
        "compression": {
            **dict.fromkeys((leaves[name] for name in plain), "none"),
            **dict.fromkeys(packed, "zstd"),
        },
        "compression_level": dict.fromkeys(packed, 3),
        "write_statistics": [leaves[name] for name in plain],
        "use_dictionary": [leaf for name, leaf in leaves.items() if name not in whole],
        "column_encoding": {leaves[name]: "DELTA_BINARY_PACKED" for name in whole},
        "write_page_checksum": True,
    }


def _is_small(one: pa.Field) -> bool:
    return one.name in (*_WORDS, _FEW) or pa.types.is_primitive(one.type)


def _leaf(one: pa.Field) -> str:
    """The path by which Parquet calls a column, whatever Arrow calls the elements of a list."""
    return f"{one.name}.list.element" if pa.types.is_nested(one.type) else one.name


__all__ = ["packing_of"]
