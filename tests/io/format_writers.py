"""Writers of small maps in every format that evocity reads, for tests.

Each writer takes a path, shapes in a projected reference system, and a row of attributes for each
shape. A row may also have these keys: ``solid`` (metres from the lowest to the highest point of the
geometry), and ``parts``, a list of pairs (shape, row).
"""

import json
import warnings
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import osmium
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import rasterio
import shapely
from affine import Affine
from PIL import Image
from pyproj import CRS
from rasterio.features import rasterize

from evocity.io.projection import WGS84, transform_polygons

CORNERS = {2154: (842_000.0, 6_519_000.0), 2263: (983_000.0, 206_000.0)}
FOOT = 170.0  # metres above sea level, of solids
KEYS = ("solid", "low", "lod", "parts")  # keys of a row that are no attributes

Shapes = Sequence[shapely.Geometry]
Rows = Sequence[dict]
Writer = Callable[..., Path]


def box(east=0.0, north=0.0, wide=20.0, deep=None, code=2154):
    """Make a rectangle, in metres or feet from the corner of the town."""
    x, y = CORNERS[code]
    deep = wide if deep is None else deep
    return shapely.box(x + east, y + north, x + east + wide, y + north + deep)


def degrees(shapes: Shapes, code=2154) -> np.ndarray:
    """Convert shapes to longitude and latitude."""
    made = np.empty(len(shapes), dtype=object)
    made[:] = list(shapes)
    return transform_polygons(made, CRS.from_epsg(code), WGS84)


def columns(rows: Rows) -> dict[str, np.ndarray]:
    """Gather the attributes of rows as columns for GDAL; a missing number is NaN."""
    names = dict.fromkeys(name for row in rows for name in row if name not in KEYS)
    found = {}
    for name in names:
        values = [row.get(name) for row in rows]
        texts = any(isinstance(value, str) for value in values)
        kind = object if texts else float
        found[name] = np.array([np.nan if not texts and v is None else v for v in values], kind)
    return found


def polygons_of(shape: shapely.Geometry) -> list[shapely.Polygon]:
    """List the polygons of a polygon, multipolygon or collection."""
    parts = getattr(shape, "geoms", [shape])
    return [part for part in parts if isinstance(part, shapely.Polygon)]


def surfaces(shape: shapely.Geometry, low: float, high: float) -> list[list[list[tuple]]]:
    """List the faces of a solid over a shape, each a list of rings: floors, roofs and walls."""
    faces = []
    for polygon in polygons_of(shape):
        rings = [list(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
        faces += [[[(x, y, z) for x, y in ring] for ring in rings] for z in (low, high)]
        for ring in rings:
            for (x, y), (to_x, to_y) in zip(ring, ring[1:] + ring[:1], strict=True):
                faces.append([[(x, y, low), (to_x, to_y, low), (to_x, to_y, high), (x, y, high)]])
    return faces


def flat_faces(shape: shapely.Geometry) -> list[list[list[tuple]]]:
    """List the faces of a shape on the ground."""
    return [
        [[(x, y, FOOT) for x, y in list(ring.coords)[:-1]] for ring in (p.exterior, *p.interiors)]
        for p in polygons_of(shape)
    ]


def polyhedral(shape: shapely.Geometry, high: float) -> bytes:
    """Make the WKB of a PolyhedralSurface Z over a shape."""
    faces = surfaces(shape, FOOT, FOOT + high)
    text = [np.array([1], "u1").tobytes(), np.array([1015, len(faces)], "<u4").tobytes()]
    for rings in faces:
        text += [b"\x01", np.array([1003, len(rings)], "<u4").tobytes()]
        for ring in rings:
            points = np.array([*ring, ring[0]], "<f8")
            text += [np.array([len(points)], "<u4").tobytes(), points.tobytes()]
    return b"".join(text)


def wkb(shapes: Shapes, rows: Rows) -> list[bytes | None]:
    return [
        None
        if shape is None
        else shape
        if isinstance(shape, bytes)
        else polyhedral(shape, row["solid"])
        if "solid" in row
        else shapely.to_wkb(shape)
        for shape, row in zip(shapes, rows, strict=True)
    ]


# ---------------------------------------------------------------- layers


DRIVERS = {
    ".gpkg": "GPKG",
    ".shp": "ESRI Shapefile",
    ".fgb": "FlatGeobuf",
    ".gdb": "OpenFileGDB",
    ".gml": "GML",
    ".kml": "KML",
}


def write_layer(
    path: Path, shapes: Shapes, rows: Rows, code=2154, layer=None, kind=None, encoding=None
) -> Path:
    """Write a layer with GDAL; the suffix chooses the driver."""
    kinds = {".shp": "Polygon", ".gdb": "MultiPolygon"}
    fields = columns(rows)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL warns of solids in a GeoPackage
        pyogrio.raw.write(
            path,
            np.array(wkb(shapes, rows), dtype=object),
            list(fields.values()),
            list(fields),
            geometry_type=kind or kinds.get(path.suffix, "Unknown"),
            crs=f"EPSG:{code}",
            driver=DRIVERS[path.suffix],
            encoding=encoding,
            **({"layer": layer} if layer else {}),
            **({"SPATIAL_INDEX": "NO"} if path.suffix == ".fgb" else {}),
        )
    return path


def write_geoparquet(path: Path, shapes: Shapes, rows: Rows, code=2154, **about) -> Path:
    table = {"geometry": pa.array(wkb(shapes, rows), pa.binary())}
    for name, values in columns(rows).items():
        table[name] = pa.array(values.tolist(), from_pandas=True)
    own = {"encoding": "WKB", "geometry_types": [], "crs": f"EPSG:{code}"} | about
    document = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": own}}
    made = pa.table(table).replace_schema_metadata({"geo": json.dumps(document)})
    pq.write_table(made, path)
    return path


def features(shapes: Shapes, rows: Rows) -> list[dict]:
    return [
        {
            "type": "Feature",
            "properties": row,
            "geometry": shape if isinstance(shape, dict) else shapely.geometry.mapping(shape),
        }
        for shape, row in zip(shapes, rows, strict=True)
    ]


def write_geojson(path: Path, shapes: Shapes, rows: Rows, code=None, **members) -> Path:
    """Write GeoJSON in degrees; with a ``code``, in this system, as older GeoJSON."""
    listed = features(degrees(shapes) if code is None else shapes, rows)
    document = {"type": "FeatureCollection", "features": listed, **members}
    if code is not None:
        document["crs"] = {"type": "name", "properties": {"name": f"EPSG:{code}"}}
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def write_sequence(path: Path, shapes: Shapes, rows: Rows, mark="") -> Path:
    lines = (mark + json.dumps(feature) for feature in features(degrees(shapes), rows))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_zip(path: Path, shapes: Shapes, rows: Rows, code=2154, encoding=None, cpg=None) -> Path:
    """Write a zipped Shapefile; ``cpg`` replaces the text of its ``.cpg``."""
    folder = path.with_suffix(".files")
    folder.mkdir()
    write_layer(folder / "a.shp", shapes, rows, code, encoding=encoding)
    if cpg is not None:
        (folder / "a.cpg").write_text(cpg)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, file.name)
    return path


# ---------------------------------------------------------------- solids


class _CityModel:
    """Objects and vertices of CityJSON."""

    def __init__(self):
        self.objects, self.vertices = {}, []

    def add(self, name: str, shape: shapely.Geometry, row: dict, parent: str | None) -> None:
        own = {key: value for key, value in row.items() if key not in KEYS}
        item = {"type": "BuildingPart" if parent else "Building", "attributes": own}
        if parent:
            item["parents"] = [parent]
        for number, (inner, more) in enumerate(row.get("parts", ())):
            item.setdefault("children", []).append(f"{name}-{number}")
            self.add(f"{name}-{number}", inner, more, name)
        if shape is not None:
            high = row.get("solid", 0.0)
            low = FOOT + row.get("low", 0.0)
            faces = surfaces(shape, low, low + high) if high else flat_faces(shape)
            lod = f"{row.get('lod', 1)}.2" if high else "0"
            kind = "Solid" if high else "MultiSurface"
            listed = [[self._ring(ring) for ring in rings] for rings in faces]
            boundaries = [listed] if high else listed
            item["geometry"] = [{"type": kind, "lod": lod, "boundaries": boundaries}]
        self.objects[name] = item

    def _ring(self, ring: list[tuple]) -> list[int]:
        first = len(self.vertices)
        self.vertices += [list(point) for point in ring]
        return list(range(first, first + len(ring)))


def _head(code: int | None) -> dict:
    head: dict = {"type": "CityJSON", "version": "2.0"}
    if code is not None:
        head["metadata"] = {"referenceSystem": f"https://www.opengis.net/def/crs/EPSG/0/{code}"}
    return head


def write_cityjson(path: Path, shapes: Shapes, rows: Rows, code: int | None = 2154) -> Path:
    model = _CityModel()
    for number, (shape, row) in enumerate(zip(shapes, rows, strict=True)):
        model.add(f"b{number}", shape, row, None)
    document = _head(code) | {"CityObjects": model.objects, "vertices": model.vertices}
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def write_cityjson_lines(path: Path, shapes: Shapes, rows: Rows, code: int | None = 2154) -> Path:
    packing = {"scale": [1.0, 1.0, 1.0], "translate": [0.0, 0.0, 0.0]}
    head = _head(code) | {"CityObjects": {}, "vertices": [], "transform": packing}
    lines = [json.dumps(head)]
    for number, (shape, row) in enumerate(zip(shapes, rows, strict=True)):
        model = _CityModel()
        model.add(f"b{number}", shape, row, None)
        own = {"type": "CityJSONFeature", "id": f"b{number}"}
        lines.append(json.dumps(own | {"CityObjects": model.objects, "vertices": model.vertices}))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def gml_polygon(rings: list[list[tuple]], swapped=False) -> str:
    """Make a polygon of GML from rings without their last points."""
    parts = []
    for number, ring in enumerate(rings):
        kind = "interior" if number else "exterior"
        points = [(point[1], point[0], *point[2:]) if swapped else point for point in ring]
        text = " ".join(f"{value!r}" for point in [*points, points[0]] for value in point)
        parts.append(
            f"<gml:{kind}><gml:LinearRing><gml:posList>{text}</gml:posList></gml:LinearRing>"
            f"</gml:{kind}>"
        )
    return f"<gml:Polygon>{''.join(parts)}</gml:Polygon>"


def _citygml_body(shape: shapely.Geometry | None, row: dict) -> str:
    text = ""
    for key, value in row.items():
        if key in KEYS:
            continue
        number, _, unit = str(value).partition(" ")
        uom = f' uom="{unit}"' if unit else ""
        text += f"<b:{key}{uom}>{number}</b:{key}>"
    if shape is not None:
        high, low = row.get("solid", 0.0), FOOT + row.get("low", 0.0)
        faces = surfaces(shape, low, low + high)
        if high:
            members = "".join(
                f"<gml:surfaceMember>{gml_polygon(face)}</gml:surfaceMember>" for face in faces
            )
            text += (
                f"<b:lod{row.get('lod', 1)}Solid><gml:Solid><gml:exterior><gml:CompositeSurface>"
                f"{members}</gml:CompositeSurface></gml:exterior></gml:Solid>"
                f"</b:lod{row.get('lod', 1)}Solid>"
            )
        else:
            members = "".join(
                f"<gml:surfaceMember>{gml_polygon(face)}</gml:surfaceMember>"
                for face in flat_faces(shape)
            )
            text += (
                f"<b:lod0FootPrint><gml:MultiSurface>{members}</gml:MultiSurface></b:lod0FootPrint>"
            )
    for inner, more in row.get("parts", ()):
        text += (
            "<b:consistsOfBuildingPart><b:BuildingPart>"
            f"{_citygml_body(inner, more)}</b:BuildingPart></b:consistsOfBuildingPart>"
        )
    return text


def write_citygml(path: Path, shapes: Shapes, rows: Rows, code: int | None = 2154) -> Path:
    members = "".join(
        f"<cityObjectMember><b:Building>{_citygml_body(shape, row)}</b:Building></cityObjectMember>"
        for shape, row in zip(shapes, rows, strict=True)
    )
    srs = f' srsName="EPSG:{code}"' if code else ""
    path.write_text(
        '<?xml version="1.0"?><CityModel xmlns="http://www.opengis.net/citygml/2.0" '
        'xmlns:b="http://www.opengis.net/citygml/building/2.0" '
        'xmlns:gml="http://www.opengis.net/gml"><gml:boundedBy><gml:Envelope'
        f'{srs} srsDimension="3"/></gml:boundedBy>{members}</CityModel>',
        encoding="utf-8",
    )
    return path


def write_gml(
    path: Path, shapes: Shapes, rows: Rows, code: int | None = 2154, srs=None, swapped=False
) -> Path:
    """Write GML as a WFS does; ``swapped``: the coordinate to the north comes first."""
    members = ""
    srs = srs or (f"EPSG:{code}" if code else "")
    named = f' srsName="{srs}"' if srs else ""
    for shape, row in zip(shapes, rows, strict=True):
        text = ""
        for key, value in row.items():
            number, _, unit = str(value).partition(" ")
            uom = f' uom="{unit}"' if unit else ""
            text += f"<app:{key}{uom}>{number}</app:{key}>"
        faces = [
            [list(ring.coords)[:-1] for ring in (p.exterior, *p.interiors)]
            for p in polygons_of(shape)
        ]
        surfaces_ = "".join(
            f"<gml:surfaceMember>{gml_polygon(face, swapped)}</gml:surfaceMember>" for face in faces
        )
        geometry = f"<gml:MultiSurface{named}>{surfaces_}</gml:MultiSurface>"
        members += (
            f"<gml:featureMember><app:buildings>{text}<app:geom>{geometry}</app:geom>"
            "</app:buildings></gml:featureMember>"
        )
    path.write_text(
        '<?xml version="1.0"?><gml:FeatureCollection xmlns:gml="http://www.opengis.net/gml" '
        f'xmlns:app="http://a.b">{members}</gml:FeatureCollection>',
        encoding="utf-8",
    )
    return path


def write_kml(path: Path, shapes: Shapes, rows: Rows, mode="relativeToGround") -> Path:
    """Write KML; the key ``altitude`` of a row is the altitude of its points."""
    marks = ""
    for shape, row in zip(degrees(shapes), rows, strict=True):
        data = "".join(
            f'<Data name="{key}"><value>{value}</value></Data>'
            for key, value in row.items()
            if key != "altitude" and value is not None
        )
        text = ""
        for polygon in polygons_of(shape):
            inner = ""
            for number, ring in enumerate((polygon.exterior, *polygon.interiors)):
                kind = "inner" if number else "outer"
                points = " ".join(f"{x!r},{y!r},{row.get('altitude') or 0}" for x, y in ring.coords)
                inner += (
                    f"<{kind}BoundaryIs><LinearRing><coordinates>{points}</coordinates>"
                    f"</LinearRing></{kind}BoundaryIs>"
                )
            text += f"<Polygon><altitudeMode>{mode}</altitudeMode>{inner}</Polygon>"
        marks += (
            f"<Placemark><ExtendedData>{data}</ExtendedData><MultiGeometry>{text}"
            "</MultiGeometry></Placemark>"
        )
    path.write_text(
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder><name>Houses</name>'
        f"{marks}</Folder></Document></kml>",
        encoding="utf-8",
    )
    return path


def write_kmz(path: Path, shapes: Shapes, rows: Rows, **more) -> Path:
    inner = write_kml(path.with_name("doc.kml"), shapes, rows, **more)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(inner, "doc.kml")
    return path


def write_dxf(path: Path, shapes: Shapes, rows: Rows, unit=6, scale=1.0, closed=True) -> Path:
    """Write closed polylines around the corner of the town; the keys ``thickness`` and
    ``elevation`` of a row are codes of the polylines."""
    x0, y0 = CORNERS[2154]
    lines: list[object] = [0, "SECTION", 2, "HEADER", 9, "$INSUNITS", 70, unit, 0, "ENDSEC"]
    lines += [0, "SECTION", 2, "ENTITIES"]
    for shape, row in zip(shapes, rows, strict=True):
        for polygon in polygons_of(shape):
            for ring in (polygon.exterior, *polygon.interiors):
                lines += [0, "LWPOLYLINE", 8, "BUILDINGS", 70, int(closed)]
                for code, key in ((39, "thickness"), (38, "elevation")):
                    if key in row:
                        lines += [code, row[key] * scale]
                for x, y in list(ring.coords)[:-1]:
                    lines += [10, (x - x0) * scale, 20, (y - y0) * scale]
    path.write_text("\n".join(map(str, [*lines, 0, "ENDSEC", 0, "EOF", ""])), encoding="utf-8")
    return path


# ---------------------------------------------------------------- OpenStreetMap


class _Extract:
    """Nodes, ways and relations of a town."""

    def __init__(self, shapes: Shapes, rows: Rows):
        self.nodes: list[tuple[float, float]] = []
        self.ways: list[tuple[list[int], dict]] = []
        self.relations: list[tuple[list[tuple[int, str]], dict]] = []
        for shape, row in zip(shapes, rows, strict=True):
            own = {key: str(value) for key, value in row.items() if key not in KEYS}
            if shape is not None:
                self.add(shape, {"building": "yes"} | own)
            for inner, more in row.get("parts", ()):
                self.add(inner, {"building:part": "yes"} | {k: str(v) for k, v in more.items()})

    def add(self, shape: shapely.Geometry, tags: dict) -> None:
        (shape,) = degrees([shape])
        polygons = polygons_of(shape)
        if len(polygons) == 1 and not polygons[0].interiors:
            self.way(polygons[0].exterior, tags)
            return
        members = []
        for polygon in polygons:
            members.append((self.way(polygon.exterior, {}), "outer"))
            members += [(self.way(ring, {}), "inner") for ring in polygon.interiors]
        self.relations.append((members, {"type": "multipolygon"} | tags))

    def way(self, ring, tags: dict) -> int:
        first = len(self.nodes) + 1
        self.nodes += list(ring.coords)[:-1]
        ids = [*range(first, len(self.nodes) + 1), first]
        self.ways.append((ids, tags))
        return len(self.ways)


def write_osm(path: Path, shapes: Shapes, rows: Rows, missing=()) -> Path:
    """Write an extract with pyosmium: XML or PBF, packed or not, by the suffix. It lacks the
    ``missing`` nodes."""
    extract = _Extract(shapes, rows)
    with osmium.SimpleWriter(str(path)) as writer:
        for number, place in enumerate(extract.nodes, 1):
            if number not in missing:
                writer.add_node(osmium.osm.mutable.Node(id=number, location=place, version=1))
        for number, (ids, tags) in enumerate(extract.ways, 1):
            writer.add_way(osmium.osm.mutable.Way(id=number, nodes=ids, tags=tags, version=1))
        for number, (members, tags) in enumerate(extract.relations, 1):
            listed = [("w", way, role) for way, role in members]
            writer.add_relation(
                osmium.osm.mutable.Relation(id=number, members=listed, tags=tags, version=1)
            )
    return path


def write_overpass(path: Path, shapes: Shapes, rows: Rows) -> Path:
    """Write an answer of Overpass with ``out geom``: JSON or XML, by the suffix."""
    extract = _Extract(shapes, rows)
    at = [{"lon": x, "lat": y} for x, y in extract.nodes]
    if path.suffix == ".json":
        elements: list[dict] = [
            {
                "type": "way",
                "id": number,
                "nodes": ids,
                "tags": tags,
                "geometry": [at[i - 1] for i in ids],
            }
            for number, (ids, tags) in enumerate(extract.ways, 1)
        ]
        for number, (members, tags) in enumerate(extract.relations, 1):
            listed = [
                {
                    "type": "way",
                    "ref": way,
                    "role": role,
                    "geometry": [at[i - 1] for i in extract.ways[way - 1][0]],
                }
                for way, role in members
            ]
            elements.append({"type": "relation", "id": number, "members": listed, "tags": tags})
        path.write_text(json.dumps({"version": 0.6, "elements": elements}), encoding="utf-8")
        return path

    def marks(tags: dict) -> str:
        return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())

    def places(ids: list[int], named: bool) -> str:
        listed = ""
        for i in ids:
            place, ref = at[i - 1], f'ref="{i}" ' if named else ""
            listed += f'<nd {ref}lon="{place["lon"]}" lat="{place["lat"]}"/>'
        return listed

    text = "".join(
        f'<way id="{number}">{places(ids, True)}{marks(tags)}</way>'
        for number, (ids, tags) in enumerate(extract.ways, 1)
    )
    for number, (members, tags) in enumerate(extract.relations, 1):
        listed = "".join(
            f'<member type="way" ref="{way}" role="{role}">'
            f"{places(extract.ways[way - 1][0], False)}</member>"
            for way, role in members
        )
        text += f'<relation id="{number}">{listed}{marks(tags)}</relation>'
    path.write_text(f'<osm version="0.6">{text}</osm>', encoding="utf-8")
    return path


# ---------------------------------------------------------------- rasters


SIDE = 128  # pixels of a raster
MARGIN = 16  # metres around the town


def raster_of(shapes: Shapes, rows: Rows, code=2154) -> tuple[np.ndarray, Affine]:
    """Return heights on pixels of 1 m, from the key ``height`` of each row, and the transform."""
    x, y = CORNERS[code]
    transform = Affine(1, 0, x - MARGIN, 0, -1, y - MARGIN + SIDE)
    burned = [(shape, row["height"]) for shape, row in zip(shapes, rows, strict=True)]
    heights = rasterize(burned, (SIDE, SIDE), transform=transform, dtype="float32")
    return heights, transform


def write_geotiff(path: Path, shapes: Shapes, rows: Rows, code=2154, values=None, **more) -> Path:
    """Write a GeoTIFF; ``values`` replaces the heights, ``unit`` names the unit of its band."""
    heights, transform = raster_of(shapes, rows, code)
    heights = heights if values is None else values
    bands, unit = more.pop("bands", 1), more.pop("unit", None)
    profile = {"driver": "GTiff", "count": bands, "dtype": heights.dtype, "crs": f"EPSG:{code}"}
    profile |= {"height": SIDE, "width": SIDE, "transform": transform} | more
    with rasterio.open(path, "w", **profile) as target:
        for band in range(bands):
            target.write(heights, band + 1)
        if unit:
            target.units = (unit,) * bands
    return path


def write_asc(path: Path, shapes: Shapes, rows: Rows, code=2154, values=None, nodata=None) -> Path:
    """Write an ASCII grid with its ``.prj``; with ``code`` None, without it."""
    heights, transform = raster_of(shapes, rows)
    heights = heights if values is None else values
    head = {"ncols": SIDE, "nrows": SIDE, "xllcorner": transform.c}
    head |= {"yllcorner": transform.f - SIDE, "cellsize": 1}
    if nodata is not None:
        head["NODATA_value"] = nodata
    lines = [f"{key} {value}" for key, value in head.items()]
    lines += [" ".join(map(str, row)) for row in heights.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if code is not None:
        path.with_suffix(".prj").write_text(CRS.from_epsg(code).to_wkt("WKT1_ESRI"))
    return path


def write_png(path: Path, shapes: Shapes, rows: Rows, values=None, alpha=None) -> Path:
    """Write grey levels, one a metre."""
    heights = raster_of(shapes, rows)[0] if values is None else values
    levels = heights.astype(np.uint8)
    if alpha is None:
        Image.fromarray(levels).save(path)
    else:
        Image.fromarray(np.dstack([levels, alpha]), "LA").save(path)
    return path


def write_npy(path: Path, shapes: Shapes, rows: Rows, values=None) -> Path:
    np.save(path, raster_of(shapes, rows)[0] if values is None else values)
    return path
