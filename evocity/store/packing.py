"""How columns of Parquet files of a run are packed."""

import pyarrow as pa

#: Words of few kinds: each row group has a dictionary of them, and a few bits a row.
_WORDS = ("operator", "status", "island")
#: A list of whole numbers, of few elements.
_FEW = "parents"


def packing_of(schema: pa.Schema) -> dict:
    """What `pyarrow.parquet.ParquetWriter` is told of a ``schema``'s columns.

    Large ones, lists and bytes and texts, are compressed. Those of one number or word a row are
    not: a generation has a few hundred bytes of each, most of them are larger as a frame of zstd,
    and to begin a frame takes longer than to read them, thirty microseconds on a virtual machine.
    Whole numbers are written as differences, which is smaller than compressed or plain. Other
    numbers are mostly distinct, so they have no dictionary. Statistics, by which rows are found,
    stand for one number or word a row alone: those of others would only make the footer longer.

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
    """The path by which Parquet calls a column, whatever Arrow calls the elements of a list."""
    if pa.types.is_list(one.type) or pa.types.is_fixed_size_list(one.type):
        return f"{one.name}.list.element"
    if pa.types.is_nested(one.type):
        raise TypeError(f"a column {one.name} of {one.type}")
    return one.name


__all__ = ["packing_of"]
