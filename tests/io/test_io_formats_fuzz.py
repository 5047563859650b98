"""Damaged files of each format end in a map or in one error, in a process of their own."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import format_writers as w
import numpy as np
import pytest
from PIL import Image
from test_io_formats import BOXES, dxf, kml, lod, write_layer, write_parquet, write_zip

KINDS = (
    *(".parquet", ".fgb", ".gdb", ".geojsonl", ".zip", ".kml", ".kmz", ".gml", ".dxf"),
    *(".asc", ".city.jsonl", ".json", ".osm", ".tif.aux.xml", ".tif.msk"),
)
TOWN = {".asc": w.write_asc, ".city.jsonl": w.write_cityjson_lines}
TOWN |= {".json": w.write_overpass, ".osm": w.write_overpass}
SECONDS = 20

READ = """
import signal, sys
from pathlib import Path
from evocity.errors import MapError
from evocity.io import read_map
for folder in sys.argv[1:]:
    read = refused = 0
    for path in sorted(Path(folder).iterdir()):
        if path.name.endswith((".aux.xml", ".msk", ".prj")):
            continue  # beside a raster
        signal.alarm({seconds})  # ends the process
        try:
            read_map(path, pixels=32)
            read += 1
        except MapError as error:
            assert all(error.args), path
            refused += 1
        except BaseException as error:
            print(path, type(error).__name__, error)
    print("done", read, refused)
"""


def whole(folder: Path, suffix: str) -> Path:
    """Write a whole file of a format; for a sidecar, beside its raster."""
    path = folder / f"a{suffix}"
    if suffix in TOWN:
        rows = [{"height": high, "solid": high} for high in (9.0, 12.0)]
        return TOWN[suffix](path, [w.box(), w.box(40)], rows)
    if suffix in SIDECARS:
        return sidecar(path)
    if suffix == ".parquet":
        return write_parquet(path, covering=True)
    if suffix == ".fgb":
        return write_layer(path, "FlatGeobuf")
    if suffix == ".gdb":
        return write_layer(path, "OpenFileGDB", kind="MultiPolygon")
    if suffix == ".zip":
        write_layer(folder / "b.shp", "ESRI Shapefile")
        return write_zip(path, *sorted(folder.glob("b.*")))
    if suffix == ".kmz":
        (folder / "doc.kml").write_text(kml(BOXES))
        return write_zip(path, folder / "doc.kml")
    ring = "[[[0,0],[1e-4,0],[1e-4,1e-4],[0,0]]]"
    line = '{"type":"Feature","properties":{"height":9},"geometry":{"type":"Polygon",'
    texts = {
        ".geojsonl": f'{line}"coordinates":{ring}}}}}\n' * 3,
        ".kml": kml(BOXES),
        ".gml": lod(BOXES),
        ".dxf": dxf(BOXES),
    }
    path.write_text(texts[suffix])
    return path


SIDECARS = (".tif.aux.xml", ".tif.msk")


def sidecar(path: Path) -> Path:
    """Write a GeoTIFF without a value for its missing pixels, and the sidecar with them."""
    raster = path.with_name("a.tif")
    values = w.raster_of([w.box()], [{"height": 9.0}])[0]
    values[:5, :5] = 99.0
    w.write_geotiff(raster, [w.box()], [{"height": 9.0}], values=values)
    if path.suffix == ".msk":
        mask = np.where(values == 99.0, 0, 255).astype(np.uint8)
        Image.fromarray(mask).save(path, "TIFF")
    else:
        path.write_text(
            '<PAMDataset><PAMRasterBand band="1"><NoDataValue>99</NoDataValue>'
            "<UnitType>m</UnitType><Scale>1</Scale><Offset>0</Offset></PAMRasterBand></PAMDataset>"
        )
    return path


WORDS = (b"NaN", b"1e999", b"-1", b"", b"<a>", b"\xff\xff\xff\x7f", b"/etc/passwd", b"&a;", b"]]")


def damaged(rng: np.random.Generator, content: bytes) -> bytes:
    """Change, cut or repeat a few bytes."""
    found = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        at, way = int(rng.integers(0, len(found) + 1)), int(rng.integers(5))
        if way == 0 and found:
            found[at % len(found)] ^= 1 << int(rng.integers(8))
        elif way == 1:
            found[at : at + int(rng.integers(0, 9))] = WORDS[rng.integers(len(WORDS))]
        elif way == 2 and rng.random() < 0.3:
            del found[at:]
        elif way == 3:
            found[at:at] = found[at : at + int(rng.integers(0, 200))] * int(rng.integers(1, 20))
        else:
            found[at : at + 4] = rng.bytes(4)
    return bytes(found)


def fuzz(folder: Path, suffixes: Sequence[str], count: int) -> dict[str, list[int]]:
    """Read ``count`` damaged files of each format, one after another in one process; return how
    many were read, and how many refused."""
    places = [damage(folder / suffix.strip("."), suffix, count) for suffix in suffixes]
    before = [sorted(place.rglob("*")) for place in places]
    run = subprocess.run(
        [sys.executable, "-c", READ.format(seconds=SECONDS), *map(str, places)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert [sorted(place.rglob("*")) for place in places] == before
    assert run.returncode == 0, (run.returncode, run.stdout[-2000:], run.stderr[-2000:])
    told = [line.split() for line in run.stdout.splitlines()]
    assert [first for first, *_ in told] == ["done"] * len(places), run.stdout[-2000:]
    assert not run.stderr
    return {
        suffix: [*map(int, counts)] for suffix, (_, *counts) in zip(suffixes, told, strict=True)
    }


def damage(folder: Path, suffix: str, count: int) -> Path:
    """Write ``count`` damaged files of a format; return the folder of them alone."""
    (folder / "damaged").mkdir(parents=True)
    path = whole(folder, suffix)
    rng = np.random.default_rng([KINDS.index(suffix), count])
    for number in range(count):
        target = folder / "damaged" / f"{number:04}{suffix}"
        if path.is_dir():
            target.mkdir()
            parts = sorted(path.iterdir())
            chosen = parts[rng.integers(len(parts))]
            for part in parts:
                content = part.read_bytes()
                (target / part.name).write_bytes(
                    damaged(rng, content) if part == chosen else content
                )
        else:
            target.write_bytes(damaged(rng, path.read_bytes()))
            if suffix == ".asc":
                os.link(path.with_suffix(".prj"), target.with_suffix(".prj"))
            if suffix in SIDECARS:
                os.link(path.with_name("a.tif"), target.parent / f"{number:04}.tif")
    return folder / "damaged"


def test_twenty_damaged_files_of_each_format(tmp_path):
    counts = fuzz(tmp_path, KINDS, 20)
    assert {suffix: sum(found) for suffix, found in counts.items()} == dict.fromkeys(KINDS, 20)


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("suffix", KINDS)
def test_a_thousand_damaged_files(tmp_path, suffix):
    read, refused = fuzz(tmp_path, [suffix], 1000)[suffix]
    print(f"{suffix}: {read} read, {refused} refused")
    assert read + refused == 1000
    assert refused > 100
