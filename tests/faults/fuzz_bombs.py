"""Small files that stand for gigabytes, or for work without end."""

import bz2
import gzip
import json
import shutil
import sqlite3
import zlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import rasterio
from fuzz_damage import as_json, chunk
from toy_runs import unsealed

from evocity.parquet_child import MEMORY

CORNER = (770000.0, 6270000.0)

_RECURSIVE = (
    "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
    "SELECT i AS fid, (SELECT geom FROM {table} LIMIT 1) AS geom, 3.0 AS height FROM n"
)


def bombs(folder: Path, files: dict[str, list[Path]], long: bool) -> list[dict]:
    """Jobs, each with a ``name`` besides; those of a gigabyte only if ``long``."""
    jobs = []
    folder.mkdir(parents=True)

    def add(name: str, kind: str, suffix: str, content: bytes, **more) -> None:
        place = folder / f"bomb-{name}{suffix}"
        place.mkdir()
        path = place / f"a{suffix}"
        path.write_bytes(content)
        jobs.append({"name": name, "kind": kind, "path": str(path), **more})

    for name, content in _databases(folder, files["map"]):
        add(name, "map", ".gpkg", content)
        add(f"library-{name}", "library", ".gpkg", content, base=str(files["library"][0]),
            part="objects.gpkg")  # fmt: skip
    for name, suffix, content in (*_outlines(folder), *_texts(long)):
        add(name, "map", suffix, content)
    for name, suffix, content, *pixels in _rasters(folder, files, long):
        # a valid map of so many pixels takes several times its heights, and time
        large = {"mib": pixels[0] * 4 * 4 / 2**20, "seconds": 120.0} if pixels else {}
        add(name, "whole map", suffix, content, **large)
    genome = next(one for one in files["genome"] if one.name == "genome.parquet")
    for name, content in _genomes(folder, genome, long):
        # the process that parses Parquet without a seal has a limit of its own
        large = {"mib": MEMORY / 2**20} if name == "rows" else {}
        add(name, "genome", ".parquet", content, **large)
    run = files["run"][-1]
    for name, part, content in _parts(folder, run, long):
        for kind in ("run", "told"):
            add(f"{kind}-{name}", kind, Path(part).suffix, content, base=str(run), part=part)
    deep = b"a = " + b"[" * 100_000
    for kind in ("recipe", "classes", "kinds", "types"):
        add(f"deep-{kind}", kind, ".toml", deep)
        add(f"digits-{kind}", kind, ".toml", b"a = " + b"9" * 100_000)
        add(f"name-{kind}", kind, ".toml", b'"\\u001b[31m' + b"A" * 100_000 + b'" = 1')
    return jobs


def _databases(folder: Path, maps: list[Path]):
    whole = next(one for one in maps if one.suffix == ".gpkg")

    def made(*statements: str) -> bytes:
        target = folder / "made.gpkg"
        shutil.copyfile(whole, target)
        file = sqlite3.connect(target)
        file.executescript(";".join(one.format(table='"hidden"') for one in statements))
        file.close()
        return target.read_bytes()

    hide = 'ALTER TABLE "map" RENAME TO "hidden"', "UPDATE gpkg_contents SET table_name = 'map'"
    place = "UPDATE gpkg_geometry_columns SET table_name = 'map'"
    for name, view in {
        "recursive-view": _RECURSIVE,
        "recursive-view-without-rows": f"{_RECURSIVE} WHERE i < 0",
        "view-of-ten-tables": "SELECT a.fid, a.geom, a.height FROM "
        + ", ".join(f"{{table}} {letter}" for letter in "abcdefghij"),
        "random-view": _RECURSIVE.replace("FROM n)", "FROM n WHERE random() > 0)"),
        "view-of-blobs": "SELECT fid, geom, hex(zeroblob(200000000)) AS height FROM {table}",
    }.items():
        yield name, made(*hide, place, f'CREATE VIEW "map" AS {view}')
    yield (
        "recursive-contents",
        made(
            "ALTER TABLE gpkg_contents RENAME TO other",
            "CREATE VIEW gpkg_contents AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 "
            "FROM n) SELECT other.* FROM other, n",
        ),
    )
    yield (
        "generated-column",
        made('ALTER TABLE "map" ADD COLUMN more AS (hex(zeroblob(100000000)))'),
    )


def _outlines(folder: Path):
    rng = np.random.default_rng(0)
    points = rng.random((5000, 2)) * 100
    lonlat = (points * 1e-6 + [3.87, 43.53]).tolist()
    ring = [*lonlat, lonlat[0]]
    tangle = {"type": "Polygon", "coordinates": [ring]}
    yield "tangle", ".geojson", as_json(tangle)
    yield "two-tangles", ".geojson", as_json({"type": "MultiPolygon", "coordinates": [[ring]] * 2})
    small = [[*lonlat[k : k + 150], lonlat[k]] for k in range(0, 4500, 150)]
    many = {"type": "MultiPolygon", "coordinates": [[one] for one in small] * 4}
    yield "many-tangles", ".geojson", as_json(many)
    comb = [[k % 2 * 1e-3, k * 1e-9] for k in range(40_000)]
    comb += [[5e-4, 1e-2], [0, 0]]
    yield "comb", ".geojson", as_json({"type": "Polygon", "coordinates": [comb]})
    vertices = [[float(x), float(y), 0.0] for x, y in points]
    surface = {"type": "MultiSurface", "lod": "0", "boundaries": [[list(range(5000))]]}
    city = {"type": "CityJSON", "version": "2.0", "vertices": vertices, "CityObjects": {}}
    city["CityObjects"]["a"] = {"type": "Building", "geometry": [surface]}
    yield "tangle", ".city.json", as_json(city)
    nodes = "".join(
        f'<node id="{k}" lat="{y:.9f}" lon="{x:.9f}"/>' for k, (x, y) in enumerate(lonlat, 1)
    )
    refs = "".join(f'<nd ref="{k}"/>' for k in [*range(1, 5001), 1])
    tag = '<tag k="building" v="yes"/>'
    way = f'<way id="1">{refs}{tag}</way>'
    yield "tangle", ".osm", f'<osm version="0.6">{nodes}{way}</osm>'.encode()
    relation = f'<relation id="1"><member type="way" ref="1" role="outer"/>{tag}'
    relation += '<tag k="type" v="multipolygon"/></relation>'
    way = f'<way id="1">{refs}</way>'
    yield "tangled-relation", ".osm", f'<osm version="0.6">{nodes}{way}{relation}</osm>'.encode()


def _texts(long: bool):
    yield "deep", ".geojson", b'{"type":"FeatureCollection","features":' + b"[" * 100_000
    collection = b'{"type":"GeometryCollection","geometries":[' * 20_000
    yield "deep-collection", ".geojson", collection + b"]}" * 20_000
    yield "lists", ".geojson", b'{"type":"FeatureCollection","features":[' + b"[]," * 300_000
    name = json.dumps("\x1b[31m" + "A" * 100_000)
    yield "name", ".geojson", f'{{"type": {name}}}'.encode()
    entity = b'<!DOCTYPE osm [<!ENTITY a "ha">]><osm version="0.6">&a;</osm>'
    yield "entity", ".osm", b"<!-- " + b" " * 5000 + b"-->" + entity
    for suffix, packer in ((".osm.gz", gzip), (".osm.bz2", bz2)):
        blanks = packer.compress(b" " * (1 << 24)) * (256 if long else 8)
        yield "blanks", suffix, packer.compress(b'<osm version="0.6">') + blanks


def _rasters(folder: Path, files, long: bool):
    png = next(one for one in files["map"] if one.suffix == ".png").read_bytes()
    first = len(b"\x89PNG\r\n\x1a\n") + 25
    packed = zlib.compress(bytes((1000 if long else 80) << 20), 1)
    for name, body in {"zTXt": b"a\0\0" + packed, "iTXt": b"a\0\1\0\0\0" + packed}.items():
        yield name, ".png", png[:first] + chunk(name.encode(), body) + png[first:]
    many = chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(1 << 20))) * 200
    yield "many-texts", ".png", png[:first] + many + png[first:]
    profile = chunk(b"iCCP", b"a\0\0" + packed)
    yield "profile", ".png", png[:first] + profile + png[first:]
    for side in (60_000, 2**31 - 1):
        head = side.to_bytes(4, "big") * 2 + b"\x10\0\0\0\0"
        yield f"pixels-{side}", ".png", png[:8] + chunk(b"IHDR", head) + png[first:]
    tif = folder / "made.tif"
    for name, transform in {
        "transform-1e-320": (1e-320, 0, 770000, 0, -1e-320, 6270128),
        "transform-nan": (np.nan, 0, 770000, 0, np.nan, 6270128),
        "transform-0": (0, 0, 770000, 0, 0, 6270128),
        "transform-1e300": (1e300, 0, 770000, 0, -1e300, 6270128),
        "transform-flat": (2, 2, 770000, 2, 2, 6270128),
        "transform-corner": (2, 0, np.inf, 0, -2, np.nan),
    }.items():
        for system in ("EPSG:2154", "EPSG:4326"):
            _tif(tif, 64, np.float32, system, rasterio.Affine(*transform))
            yield f"{name}-{system[5:]}", ".tif", tif.read_bytes()
    for side, kind in ((11_500, np.float64),) if long else ((3_000, np.float64),):
        for system in ("EPSG:2154", "EPSG:4326"):
            where = rasterio.Affine(2, 0, 770000, 0, -2, 6270128)
            if system == "EPSG:4326":
                where = rasterio.Affine(1e-6, 0, 3.8, 0, -1e-6, 43.5)
            _tif(tif, side, kind, system, where)
            yield f"zeros-{side}-{system[5:]}", ".tif", tif.read_bytes(), side**2
    for shape in ((100_000, 100_000), (1 << 40, 1 << 40), (-1, 5), (3,) * 100_000):
        head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
        for size in (2, 4):
            if len(head) < 1 << 16 or size == 4:
                version = bytes([size // 2, 0])
                content = b"\x93NUMPY" + version + len(head).to_bytes(size, "little") + head
                yield f"shape-{len(shape)}-{shape[0]}-{size}", ".npy", content
    deep = b"{'descr': " + b"(" * 100_000
    yield "deep", ".npy", b"\x93NUMPY\2\0" + len(deep).to_bytes(4, "little") + deep


def _tif(path: Path, side: int, kind, system: str, transform) -> None:
    with rasterio.open(
        path, "w", driver="GTiff", height=side, width=side, count=1, dtype=kind, crs=system,
        transform=transform, compress="deflate", tiled=False, SPARSE_OK=True,
    ) as tif:  # fmt: skip
        if side < 1000:
            tif.write(np.ones((side, side), kind), 1)


def _genomes(folder: Path, whole: Path, long: bool):
    table, target = pq.read_table(whole), folder / "made.parquet"
    about = json.loads(table.schema.metadata[b"evocity.genome"])
    changes = {
        f"crs-{k}": {"crs": crs}
        for k, crs in enumerate(
            ["EPSG:999999", "", "\x1b[31m", "A" * 100_000, "PROJCS[", "+init=/etc/passwd",
             "+proj=merc +nadgrids=/dev/zero", "urn:x", "PROJCRS" + "[" * 50_000, "IGNF:LAMB93"]
        )
    }  # fmt: skip
    changes |= {
        "huge": {"height": 1 << 20, "width": 1 << 20},
        "cities": {"cities": ["\x1b[31m\u202e" * 1000]},
        "attribution": {"attribution": "\x1b]0;x\x07" * 100_000},
        "origin": {"origin": [1e308, -1e308]},
        "pixel": {"metres_per_pixel": 1e-320},
        "made": {"made": {"operator": "growth", "corner": [1 << 70, -1]}},
    }
    for name, change in changes.items():
        metadata = {"evocity.genome": json.dumps(about | change)}
        pq.write_table(table.replace_schema_metadata(metadata), target)
        yield name, target.read_bytes()
    rows = 1 << (26 if long else 20)
    same = pa.table(
        {
            name: pa.DictionaryArray.from_arrays(
                pa.array(np.zeros(rows, np.int8)), table.column(name).combine_chunks()[:1]
            ).cast(table.schema.field(name).type)
            for name in table.column_names[:2]
        }
    )
    for name in table.column_names[2:]:
        same = same.append_column(name, same.column(0).cast(pa.int64()).cast(pa.float32()))
    pq.write_table(same.replace_schema_metadata(table.schema.metadata), target)
    yield "rows", target.read_bytes()


def _parts(folder: Path, run: Path, long: bool):
    births = str(max((run / "births").iterdir()).relative_to(run))  # status looks at the last
    table, target = pq.read_table(run / births), folder / "made.parquet"
    at = table.column_names.index("error")
    rows, field = len(table), table.schema.field(at)

    def made(found: pa.Table) -> bytes:
        pq.write_table(found, target, compression="zstd", row_group_size=len(found))
        return target.read_bytes()

    text = "x\x1b[31m" * ((1 << 30 if long else 7 << 24) // rows // 6)
    each = pa.array([f"{k}{text}" for k in range(rows)])
    yield "error-texts", births, made(table.set_column(at, field, each))
    one = pa.array([text[: 8 << 20]] * rows)
    yield "error-text", births, made(table.set_column(at, field, one))
    del each, one
    many = pa.concat_tables([table.slice(0, 1)] * 1).take(pa.array(np.zeros(1 << 21, np.int32)[:4]))
    yield "rows-twice", births, made(many)
    operator = table.column_names.index("operator")
    word = pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), ["o" * (70 << 20)])
    field = table.schema.field(operator)
    yield "operator", births, made(table.set_column(operator, field, word))
    about = unsealed(run / "provenance.json")
    name = "\x1b[31m\u202e=cmd|" * 100
    for key in ("cities", "measures"):
        named = about["header"] | {key: [name]}
        yield key, "provenance.json", as_json(about | {"header": named})
    yield "deep", "provenance.json", b'{"schema_version": 3, "header": ' + b"[" * 100_000
    yield "deep", "events.jsonl", b"[" * 100_000 + b"\n" + b'{"event": "' + b"\x1b" * 1000 + b'"}\n'
    yield "lines", "events.jsonl", b'{"event":"x"}\n' * 200_000
    yield "blank", "commands.jsonl", b"\n" * (1 << 20)
    yield "asked", "commands.jsonl", b'{"command":"reweight","weights":{"\\u001b[31m":1e999}}\n'
    sources = sorted(one for one in (run / "sources").glob("*.npy"))
    head = b"{'descr': '<f4', 'fortran_order': False, 'shape': (100000, 100000), }"
    array = b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head
    yield "array", f"sources/{sources[0].name}", array
