"""A window of a large file beside a file of the window only: python benchmarks/national_file.py

300 000 polygons of 10 × 10 m, 25 m apart in EPSG:2154, sorted in space, as GeoPackage, FlatGeobuf
and GeoParquet with an index or bounds of its rows, and without; and as GeoJSONSeq. `evocity encode
--center` of each, and of the same window in a file of its own, each in a process of its own:
seconds of the processor and the most memory, the least of several runs.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import shapely
from _machine import description
from pyproj import Transformer

COUNT, STEP, SIDE, RUNS = 300_000, 25.0, 10.0, 3
CORNER = np.array([830_000.0, 6_505_000.0])
KINDS = (
    "gpkg",
    "fgb",
    "parquet",
    "gpkg without index",
    "fgb without index",
    "parquet without bounds",
    "geojsonl",
)

# A small process starts the command: a process first counts the memory of its parent.
_MEASURE = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss)
"""


def polygons() -> np.ndarray:
    """The squares, in tiles of 10 × 10 so that neighbours stand near each other in the file."""
    wide = 1000
    number = np.arange(COUNT)
    tile, inside = number // 100, number % 100
    x = tile % (wide // 10) * 10 + inside % 10
    y = tile // (wide // 10) * 10 + inside // 10
    corners = np.column_stack([x, y]) * STEP + CORNER
    return shapely.box(*corners.T, *(corners + SIDE).T)


def write(path: Path, shapes: np.ndarray, kind: str) -> None:
    heights = np.resize(np.arange(6.0, 30.0, 3.0), len(shapes))
    if kind == "geojsonl":
        lambert = Transformer.from_crs(2154, 4326, always_xy=True)
        shapes = shapely.transform(
            shapes, lambda points: np.column_stack(lambert.transform(*points.T))
        )
        with open(path, "w") as file:
            for shape, height in zip(shapes, heights, strict=True):
                geometry = shapely.geometry.mapping(shape)
                feature = {"type": "Feature", "properties": {"height": height}}
                file.write(json.dumps(feature | {"geometry": geometry}) + "\n")
    elif kind.startswith("parquet"):
        table = {"geometry": pa.array(shapely.to_wkb(shapes).tolist(), pa.binary())}
        table["height"] = pa.array(heights)
        about = {"encoding": "WKB", "geometry_types": ["Polygon"], "crs": "EPSG:2154"}
        if kind == "parquet":
            edges = ("xmin", "ymin", "xmax", "ymax")
            bounds = [pa.array(one) for one in shapely.bounds(shapes).T]
            table["bbox"] = pa.StructArray.from_arrays(bounds, edges)
            about["covering"] = {"bbox": {edge: ["bbox", edge] for edge in edges}}
        document = {"version": "1.1.0", "primary_column": "geometry"}
        document["columns"] = {"geometry": about}
        made = pa.table(table).replace_schema_metadata({"geo": json.dumps(document)})
        pq.write_table(made, path, row_group_size=10_000)
    else:
        driver = {"gpkg": "GPKG", "fgb": "FlatGeobuf"}[kind.split()[0]]
        pyogrio.raw.write(
            path,
            shapely.to_wkb(shapes),
            [heights],
            ["height"],
            geometry_type="Polygon",
            crs="EPSG:2154",
            driver=driver,
            layer_options={"SPATIAL_INDEX": "NO" if "without" in kind else "YES"},
        )


def encode(path: Path, center: tuple[float, float]) -> tuple[float, float, str]:
    """Encode a window; return seconds of the processor, megabytes and the note."""
    words = [sys.executable, "-m", "evocity", "encode", str(path), "--center", *map(str, center)]
    genome = path.with_name("genome.parquet")
    genome.unlink(missing_ok=True)
    words += ["-o", str(genome)]
    run = subprocess.run(
        [sys.executable, "-S", "-c", _MEASURE, *words], capture_output=True, text=True, check=True
    )
    seconds, kilobytes = map(float, run.stdout.split())
    return seconds, kilobytes / 1024, run.stderr


def main() -> None:
    print(description())
    shapes = polygons()
    middle = CORNER + np.array((12_000.0, 3_500.0))
    center = Transformer.from_crs(2154, 4326, always_xy=True).transform(*middle)
    bounds = shapely.bounds(shapes)
    reach = np.abs((bounds[:, :2] + bounds[:, 2:]) / 2 - middle).max(axis=1)
    near = shapes[reach < 280]
    print(f"{len(shapes)} polygons, {len(near)} of them near the window")
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            suffix = kind.split()[0]
            paths = [Path(folder, f"{name}.{suffix}") for name in ("whole", "window")]
            write(paths[0], shapes, kind)
            write(paths[1], near, kind)
            runs = [[encode(path, center)[:2] for _ in range(RUNS)] for path in paths]
            (whole, most), (own, least) = (np.min(each, axis=0) for each in runs)
            size = paths[0].stat().st_size / 1e6
            print(
                f"{kind:22} {size:5.0f} MB  {whole:6.2f} s {most:5.0f} MB  own file {own:5.2f} s "
                f"{least:4.0f} MB  more {whole - own:+6.2f} s {most - least:+5.0f} MB",
                flush=True,
            )
            if kind in KINDS[3:]:
                print("    " + encode(paths[0], center)[2].strip().splitlines()[0].split("; ")[-1])


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.partition("\n\n")[0]).parse_args()
    main()
