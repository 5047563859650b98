"""Writers of footprints in FlatGeobuf and GeoParquet, with the columns of a GeoPackage."""

import json
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS

from evocity.citymap import CityMap
from evocity.io.export.layers import write_layer
from evocity.io.footprint_files import LAYER, TAGS, Footprints, footprints_of

# GeoParquet, the version with a column of bounds.
_VERSION, _EDGES = "1.1.0", ("xmin", "ymin", "xmax", "ymax")


def write_flatgeobuf(city: CityMap, path: Path, **how) -> None:
    """Write one layer of footprints with a spatial index; ``how`` as of `footprints_of`. Raises
    `OSError` if GDAL cannot write."""
    polygons, fields, tags, system = footprints_of(city, path.name, **how)
    write_layer(
        path,
        polygons,
        fields,
        tags,
        layer=LAYER,
        driver="FlatGeobuf",
        geometry_type="Polygon",
        crs=system,
        layer_options={"TITLE": city.name, "DESCRIPTION": city.attribution},
    )


def write_geoparquet(city: CityMap, path: Path, **how) -> None:
    """Write GeoParquet 1.1: WKB, with the bounds of each row; ``how`` as of `footprints_of`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = footprints_of(city, path.name, **how)
    bounds = shapely.bounds(found.polygons).reshape(-1, 4)
    edges = [pa.array(column) for column in bounds.T]
    columns = {name: pa.array(values.tolist()) for name, values in found.fields.items()}
    columns["geometry"] = pa.array(shapely.to_wkb(found.polygons).tolist(), pa.binary())
    columns["bbox"] = pa.StructArray.from_arrays(edges, list(_EDGES))
    about = {b"geo": json.dumps(_describe(found, bounds)).encode(), TAGS: _to_json(found.tags)}
    table = pa.table(columns).replace_schema_metadata(about)
    try:
        pq.write_table(table, path, compression="zstd")
    except pa.ArrowException as error:
        raise OSError(str(error)) from error


def _describe(found: Footprints, bounds: np.ndarray) -> dict:
    """The metadata ``geo`` of GeoParquet. Source: geoparquet.org, specification 1.1.0."""
    own: dict = {
        "encoding": "WKB",
        "geometry_types": sorted({one.geom_type for one in found.polygons}),
        "orientation": "counterclockwise",
        "covering": {"bbox": {edge: ["bbox", edge] for edge in _EDGES}},
        "crs": None if found.system is None else CRS(found.system).to_json_dict(),
    }
    if len(bounds):
        own["bbox"] = [*bounds[:, :2].min(axis=0).tolist(), *bounds[:, 2:].max(axis=0).tolist()]
    return {"version": _VERSION, "primary_column": "geometry", "columns": {"geometry": own}}


def _to_json(tags: dict[str, str]) -> bytes:
    return json.dumps({key: text for key, text in tags.items() if text}).encode()
