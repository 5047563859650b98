"""Ways to damage a file, each drawn at random by a seeded generator."""

import bz2
import gzip
import json
import re
import sqlite3
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

TEXTS = (".geojson", ".json", ".jsonl", ".toml", ".osm", ".prj")

_NUMBERS = (
    "0", "-1", "1", "1e308", "-1e308", "1e400", "1e-320", "NaN", "nan", "Infinity", "-Infinity",
    "inf", "2147483648", "4294967296", "9223372036854775808", "1" + "0" * 30, "0.1", "null", "true",
    "[]", "{}", "1e5", "255", "65536", "9" * 5000,
)  # fmt: skip
_WORDS = (
    "", "\\u0000", "\x1b[31mred\x1b[0m", "\\u001b]0;title\\u0007", "=cmd|' /C calc'!A1",
    "A" * 10_000,
    "../../../../etc/passwd", "/dev/zero", "/vsicurl/http://localhost:9/x", "\u202egnp.exe",
    "http://localhost:9/a", "file:///etc/passwd", "\\ud800", "EPSG:999999",
    "+proj=merc +nadgrids=x",
    "é" * 700, "a\\nb\\r\\nc", "<script>", "%s%n{0}", "NaN", "-1", "Polygon", "yes", "2154",
)  # fmt: skip
_NESTS = ("[" * 100_000, '{"a":' * 100_000, "[" * 100_000 + "]" * 100_000, "(" * 100_000)
_INTEGERS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40)
_SQL = (
    "UPDATE gpkg_contents SET table_name = '{word}'",
    "UPDATE gpkg_contents SET data_type = '{word}'",
    "UPDATE gpkg_contents SET identifier = '{word}'",
    "UPDATE gpkg_contents SET srs_id = {number}",
    "UPDATE gpkg_contents SET min_x = {number}, max_x = {number}",
    "UPDATE gpkg_geometry_columns SET column_name = '{word}'",
    "UPDATE gpkg_geometry_columns SET geometry_type_name = '{word}'",
    "UPDATE gpkg_geometry_columns SET srs_id = {number}",
    "UPDATE gpkg_spatial_ref_sys SET definition = '{word}', organization = '{word}'",
    "UPDATE gpkg_spatial_ref_sys SET organization_coordsys_id = {number}",
    "DELETE FROM gpkg_spatial_ref_sys",
    "DELETE FROM gpkg_geometry_columns",
    "DELETE FROM gpkg_contents",
    "DROP TABLE gpkg_contents",
    "DROP TABLE gpkg_geometry_columns",
    'UPDATE "{table}" SET "{column}" = {number}',
    'UPDATE "{table}" SET "{column}" = \'{word}\'',
    'UPDATE "{table}" SET "{column}" = NULL',
    'UPDATE "{table}" SET "{column}" = zeroblob(1000)',
    'UPDATE "{table}" SET geom = substr(geom, 1, {small})',
    "UPDATE \"{table}\" SET geom = CAST(substr(geom, 1, {small}) || x'{blob}' AS BLOB)",
    'DELETE FROM "{table}"',
    'ALTER TABLE "{table}" RENAME COLUMN "{column}" TO "{word}"',
    'ALTER TABLE "{table}" ADD COLUMN "{word}" TEXT',
    'CREATE VIEW "v{small}" AS SELECT * FROM "{table}", "{table}"',
    'ALTER TABLE "{table}" ADD COLUMN more AS (hex(zeroblob(100000)))',
)


def damaged(rng: np.random.Generator, path: Path, others: list[Path], work: Path) -> bytes:
    """The content of the file at ``path`` with some damage; of ``others`` parts are put in."""
    content = path.read_bytes()
    ways: list[Callable] = [_bytes, _bytes, _shortened, _doubled, _without, _header]
    ways += [lambda r, c: _spliced(r, c, others)]
    name = path.name.lower()
    if name.endswith(TEXTS):
        ways += [_text] * 8
    if name.endswith((".gz", ".bz2")):
        ways += [lambda r, c: _repacked(r, c, gzip if name.endswith(".gz") else bz2)] * 6
    if name.endswith(".png"):
        ways += [_chunks] * 8
    if name.endswith(".parquet"):
        ways += [lambda r, c: _table(r, path, work)] * 10
    if name.endswith(".gpkg"):
        ways += [lambda r, c: _database(r, c, work)] * 10
    if name.endswith(".npy"):
        ways += [_text] * 3
    if name.endswith((".tif", ".shp", ".shx", ".dbf")):
        ways += [_header] * 5
    for _ in range(int(rng.integers(1, 3))):
        content = ways[rng.integers(len(ways))](rng, content)
    return content


def _at(rng: np.random.Generator, content: bytes, most: int | None = None) -> int:
    return int(rng.integers(0, max(1, min(len(content), most or len(content)))))


def _bytes(rng, content: bytes) -> bytes:
    found = bytearray(content)
    most = None if rng.random() < 0.5 else 4096
    for _ in range(int(rng.integers(1, 9))):
        if found:
            found[_at(rng, found, most)] ^= 1 << int(rng.integers(8))
    return bytes(found)


def _shortened(rng, content: bytes) -> bytes:
    return content[: _at(rng, content)]


def _doubled(rng, content: bytes) -> bytes:
    first = _at(rng, content)
    last = first + int(rng.integers(1, 2000))
    return content[:last] + content[first:last] * int(rng.integers(1, 50)) + content[last:]


def _without(rng, content: bytes) -> bytes:
    first = _at(rng, content)
    return content[:first] + content[first + int(rng.integers(1, 500)) :]


def _spliced(rng, content: bytes, others: list[Path]) -> bytes:
    other = others[rng.integers(len(others))].read_bytes()
    return content[: _at(rng, content)] + other[_at(rng, other) :]


def _header(rng, content: bytes) -> bytes:
    """A number of 1, 2, 4 or 8 bytes that is far too large, or none, in the first kilobyte."""
    size = int(2 ** rng.integers(0, 4))
    order = "little" if rng.random() < 0.5 else "big"
    number = _INTEGERS[rng.integers(len(_INTEGERS))] % (1 << 8 * size)
    first = _at(rng, content, 1024)
    return content[:first] + number.to_bytes(size, order) + content[first + size :]


def _text(rng, content: bytes) -> bytes:
    text = content.decode("utf-8", "surrogateescape")
    numbers = list(re.finditer(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", text))
    words = list(re.finditer(r'(?<=")[^"\n]{0,200}(?=")|(?<=\')[^\'\n]{0,200}(?=\')', text))
    draw, nest = rng.random(), _NESTS[rng.integers(len(_NESTS))]
    if draw < 0.45 and numbers:
        found, new = numbers[rng.integers(len(numbers))], _NUMBERS[rng.integers(len(_NUMBERS))]
    elif draw < 0.9 and words:
        found, new = words[rng.integers(len(words))], _WORDS[rng.integers(len(_WORDS))]
        if rng.random() < 0.1:
            new = nest
    elif numbers:
        found, new = numbers[rng.integers(len(numbers))], nest
    else:
        return content
    return (text[: found.start()] + new + text[found.end() :]).encode("utf-8", "surrogateescape")


def _repacked(rng, content: bytes, packer) -> bytes:
    try:
        return packer.compress(_text(rng, packer.decompress(content)))
    except (OSError, ValueError, EOFError, zlib.error):
        return content


def _chunks(rng, content: bytes) -> bytes:
    """A PNG with one chunk changed, its checksum right."""
    chunks, at = [], 8
    while at + 12 <= len(content):
        size = int.from_bytes(content[at : at + 4], "big")
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + size]))
        at += 12 + size
    if not chunks:
        return content
    k = int(rng.integers(len(chunks)))
    kind, body = chunks[k]
    draw = rng.random()
    if draw < 0.5:
        chunks[k] = kind, _header(rng, body) if body else body
    elif draw < 0.7:
        chunks.insert(k, chunks[rng.integers(len(chunks))])
    else:
        names = (b"tEXt", b"zTXt", b"iTXt", b"iCCP", b"tRNS", b"PLTE", b"acTL", b"fdAT", b"eXIf")
        packed = zlib.compress(b"\x1b[31m" * 1000)
        bodies = (b"", b"a\0b", b"a\0\0" + packed, b"a\0\1\0\0\0" + packed, bytes(900))
        fresh = names[rng.integers(len(names))], bodies[rng.integers(len(bodies))]
        chunks.insert(int(rng.integers(1, len(chunks) + 1)), fresh)
    return content[:8] + b"".join(map(chunk, *zip(*chunks, strict=True)))


def chunk(kind: bytes, body: bytes) -> bytes:
    """A chunk of a PNG."""
    size, check = len(body).to_bytes(4, "big"), zlib.crc32(kind + body).to_bytes(4, "big")
    return size + kind + body + check


def _table(rng, path: Path, work: Path) -> bytes:
    """A Parquet file, whole, with other values, columns or metadata."""
    table = pq.read_table(path)
    about = dict(table.schema.metadata or {})
    draw, names = rng.random(), table.column_names
    k = int(rng.integers(len(names)))
    kind = table.schema.types[k]
    if draw < 0.4 and about:
        key = list(about)[rng.integers(len(about))]
        about[key] = _text(rng, about[key])
    elif draw < 0.7:
        values = _values(rng, kind, table.column(k).to_pylist())
        if values is not None:
            field = table.schema.field(k)
            table = table.set_column(k, field, pa.chunked_array([values]))
    elif draw < 0.8:
        table = table.slice(0, _at(rng, bytes(len(table) + 1)))
    elif draw < 0.9:
        table = pa.concat_tables([table] * int(rng.integers(2, 5)))
    elif draw < 0.95:
        table = table.drop_columns([names[k]])
    else:
        table = table.set_column(k, names[k], pa.array(["x"] * len(table)))
    target = work / "made.parquet"
    pq.write_table(table.replace_schema_metadata(about), target)
    return target.read_bytes()


def _values(rng, kind: pa.DataType, values: list) -> pa.Array | None:
    """The ``values`` of a column with one changed to an extreme."""
    if not values:
        return None
    at = int(rng.integers(len(values)))
    kind_of = kind.value_type if pa.types.is_dictionary(kind) else kind
    if pa.types.is_integer(kind_of):
        bits = kind_of.bit_width
        values[at] = int(rng.choice(np.array([0, 1, (1 << (bits - 1)) - 1], dtype=np.int64)))
    elif pa.types.is_floating(kind_of):
        values[at] = float(rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e30, -1.0, 1e-40]))
    elif pa.types.is_string(kind_of):
        word = _WORDS[rng.integers(len(_WORDS))]
        values[at] = word if rng.random() < 0.6 else _NESTS[rng.integers(len(_NESTS))]
    elif pa.types.is_boolean(kind_of):
        values[at] = not values[at]
    elif pa.types.is_list(kind_of):
        values[at] = [] if rng.random() < 0.5 or not values[at] else list(values[at]) * 3
    else:
        values[at] = None
    try:
        return pa.array(values, kind)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError, OverflowError):
        return None


def _database(rng, content: bytes, work: Path) -> bytes:
    """A GeoPackage in which some SQL was carried out."""
    target = work / "made.gpkg"
    target.write_bytes(content)
    for suffix in ("-journal", "-wal", "-shm"):
        target.with_name(target.name + suffix).unlink(missing_ok=True)
    file = sqlite3.connect(target)
    try:
        table = file.execute("SELECT table_name FROM gpkg_contents").fetchone()[0]
        columns = [row[1] for row in file.execute(f'PRAGMA table_info("{table}")')]
        named = {
            "table": table,
            "column": columns[rng.integers(len(columns))],
            "word": _WORDS[rng.integers(len(_WORDS))].replace("'", "''").replace('"', '""'),
            "number": _NUMBERS[rng.integers(len(_NUMBERS))],
            "small": int(rng.integers(1, 60)),
            "blob": rng.bytes(12).hex(),
        }
        file.executescript(_SQL[rng.integers(len(_SQL))].format(**named))
        file.commit()
    except (sqlite3.Error, sqlite3.Warning, TypeError, ValueError):
        pass
    finally:
        file.close()
    return target.read_bytes()


def described(rng: np.random.Generator, path: Path) -> bytes:
    """A GeoTIFF whose transform, reference system or tags are strange."""
    import rasterio
    from rasterio.io import MemoryFile

    extremes = [0.0, 1e-320, 1e300, -1e300, np.nan, np.inf, 1e-30, 2.0, -2.0, 1e12, 770000.0]
    numbers = [2.0, 0.0, 770000.0, 0.0, -2.0, 6270128.0]
    for _ in range(int(rng.integers(1, 4))):
        numbers[rng.integers(6)] = extremes[rng.integers(len(extremes))]
    systems = ["EPSG:2154", "EPSG:4326", "EPSG:3857", "EPSG:32661", "EPSG:2263", "EPSG:4978", None]
    tags = {"NAME": _WORDS[rng.integers(len(_WORDS))], "METRES_PER_PIXEL": "1e-320"}
    with rasterio.open(path) as whole:
        profile, band = whole.profile, whole.read(1)
    profile |= {"transform": rasterio.Affine(*numbers), "crs": systems[rng.integers(len(systems))]}
    profile["nodata"] = [None, None, np.nan, 0.0, -2.0][rng.integers(5)]
    with MemoryFile() as memory:
        with memory.open(**profile) as tif:
            tif.write(band, 1)
            tif.update_tags(**{k: v.replace("\\u0000", "") for k, v in tags.items()})
            if rng.random() < 0.3:
                tif.scales, tif.offsets = [extremes[rng.integers(11)]], [extremes[rng.integers(11)]]
        return memory.read()


def as_json(document) -> bytes:
    return json.dumps(document).encode()


def nested(rng: np.random.Generator, text: str) -> str:
    """A recipe's ``text`` with dotted keys, headers, inline tables and lists in each other."""
    lines = text.splitlines()
    for _ in range(int(rng.integers(1, 6))):
        depth = int(rng.choice([2, 8, 31, 32, 33, 34, 100, 3000, 40_000]))
        part = str(rng.choice(["a", '"a b"', "'q'", "operators", "é", "1", "a-b", '""', "run"]))
        path = str(rng.choice([".", " . ", ".\t"])).join([part] * depth)
        line = str(
            rng.choice(
                [
                    f"{path} = 1",
                    f"[{path}]",
                    f"[[{path}]]",
                    f"x = {{ {path} = 1 }}",
                    "x = " + "{ a = " * min(depth, 5000) + "1" + " }" * min(depth, 5000),
                    "x = " + "[" * depth + "]" * depth,
                    "x = [" + f"{{ {path} = 1.5 }}, " * 3 + "]",
                    f'x = """{path}""""" # {path}',
                    f"x = '''{path}",
                    f"x = {'1' * depth}",
                    f"{path}",
                    f"# {path}",
                ]
            )
        )
        lines.insert(int(rng.integers(0, len(lines) + 1)), line)
    return "\n".join(lines)
