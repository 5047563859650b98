"""Formats beside GeoJSON and GeoPackage: what is read of each, and what is refused."""

import json
import os
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import pytest
import shapely

from evocity.errors import MapError
from evocity.io import geoparquet, read_map

CORNER = np.array([842000.0, 6519000.0])  # EPSG:2154, in Lyon
BOXES = [(0, 0, 20, 20, 9.0), (40, 0, 60, 20, 12.0), (0, 40, 20, 60, 15.0)]
RIGHT = {9.0: 400.0, 12.0: 400.0, 15.0: 400.0}


def squares(count=3):
    return np.array([shapely.box(*(np.tile(CORNER, 2) + box[:4])) for box in BOXES[:count]])


def areas(path, **options):
    """Square metres by height, of a map of pixels of 1 m."""
    city = read_map(path, pixels=256, metres_per_pixel=1.0, **options)
    heights, counts = np.unique(city.heights[city.heights > 0].round(2), return_counts=True)
    return dict(zip(heights.tolist(), counts.tolist(), strict=True))


def is_right(found, expected=RIGHT):
    return found.keys() == expected.keys() and all(
        found[height] == pytest.approx(area, rel=0.06) for height, area in expected.items()
    )


def write_layer(
    path, driver, polygons=None, crs="EPSG:2154", layer=None, kind="Polygon", index=True
):
    polygons = squares() if polygons is None else polygons
    heights = np.array([box[4] for box in BOXES])
    heights = np.resize(heights, len(polygons))
    options = {"layer": layer} if layer else {}
    if not index:
        options["layer_options"] = {"SPATIAL_INDEX": "NO"}
    pyogrio.raw.write(
        path,
        shapely.to_wkb(polygons),
        [heights],
        ["height"],
        geometry_type=kind,
        crs=crs,
        driver=driver,
        **options,
    )
    return path


def write_parquet(path, polygons=None, geo=True, covering=False, rows=None, **column):
    polygons = squares() if polygons is None else polygons
    heights = np.resize(np.array([box[4] for box in BOXES]), len(polygons))
    table = {"geometry": pa.array(shapely.to_wkb(polygons).tolist(), pa.binary())}
    table["height"] = pa.array(heights)
    table["names"] = pa.array([{"primary": "a"}] * len(polygons))
    about = {"encoding": "WKB", "geometry_types": [], "crs": "EPSG:2154"} | column
    if covering:
        edges = ("xmin", "ymin", "xmax", "ymax")
        bounds = shapely.bounds(polygons)
        table["bbox"] = pa.StructArray.from_arrays([pa.array(one) for one in bounds.T], edges)
        about["covering"] = {"bbox": {edge: ["bbox", edge] for edge in edges}}
    made = pa.table(table)
    if geo:
        document = {"version": "1.1.0", "primary_column": "geometry"}
        document["columns"] = {"geometry": about}
        made = made.replace_schema_metadata({"geo": json.dumps(document)})
    pq.write_table(made, path, row_group_size=rows)
    return path


def write_zip(path, *files, folder=""):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, folder + file.name)
    return path


def lod(boxes, srs="EPSG:2154", level=1, foot=170.0, measured="", parts=False):
    """CityGML with a solid for each box."""
    members = []
    for west, south, east, north, height in boxes:
        (x, y), (to_x, to_y) = np.add(CORNER, (west, south)), np.add(CORNER, (east, north))
        ring = [(x, y), (to_x, y), (to_x, to_y), (x, to_y), (x, y)]
        faces = [[(*at, z) for at in ring] for z in (foot, foot + height)]
        faces.append([(x, y, foot), (to_x, y, foot), (to_x, y, foot + height), (x, y, foot)])
        rings = "".join(
            "<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>"
            + " ".join(f"{n:.3f}" for at in face for n in at)
            + "</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
            for face in faces
        )
        body = (
            f"{measured}<b:lod{level}Solid><gml:Solid><gml:exterior><gml:CompositeSurface>{rings}"
            f"</gml:CompositeSurface></gml:exterior></gml:Solid></b:lod{level}Solid>"
        )
        if parts:
            body = f"<b:consistsOfBuildingPart><b:BuildingPart>{body}</b:BuildingPart>"
            body += "</b:consistsOfBuildingPart>"
        members.append(f"<cityObjectMember><b:Building>{body}</b:Building></cityObjectMember>")
    return (
        '<?xml version="1.0"?><CityModel xmlns="http://www.opengis.net/citygml/2.0" '
        'xmlns:b="http://www.opengis.net/citygml/building/2.0" '
        'xmlns:gml="http://www.opengis.net/gml"><gml:boundedBy><gml:Envelope '
        f'srsName="{srs}" srsDimension="3"/></gml:boundedBy>{"".join(members)}</CityModel>'
    )


def dxf(boxes, unit=6, layer="BUILDINGS", flags=1, code=39, scale=1.0):
    lines = ["0", "SECTION", "2", "HEADER", "9", "$INSUNITS", "70", str(unit), "0", "ENDSEC"]
    lines += ["0", "SECTION", "2", "ENTITIES"]
    for west, south, east, north, height in boxes:
        lines += ["0", "LWPOLYLINE", "8", layer, str(code), str(height * scale), "70", str(flags)]
        for x, y in ((west, south), (east, south), (east, north), (west, north)):
            lines += ["10", str(x * scale), "20", str(y * scale)]
    return "\n".join([*lines, "0", "TEXT", "8", layer, "1", "a", "0", "ENDSEC", "0", "EOF", ""])


def kml(boxes, mode="relativeToGround", name="Houses"):
    marks = ""
    for west, south, east, north, height in boxes:
        ring = ((west, south), (east, south), (east, north), (west, north), (west, south))
        text = " ".join(f"{x / 1e5:.7f},{y / 1e5:.7f},{height}" for x, y in ring)
        marks += (
            f"<Placemark><Polygon><extrude>1</extrude><altitudeMode>{mode}</altitudeMode>"
            f"<outerBoundaryIs><LinearRing><coordinates>{text}</coordinates></LinearRing>"
            "</outerBoundaryIs></Polygon></Placemark>"
        )
    return (
        f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Folder><name>{name}</name>{marks}'
        "</Folder></Document></kml>"
    )


# ---------------------------------------------------------------- what is read


def test_geoparquet(tmp_path):
    assert is_right(areas(write_parquet(tmp_path / "a.parquet")))
    assert is_right(areas(write_parquet(tmp_path / "b.geoparquet", covering=True)))
    projjson = {"type": "ProjectedCRS", "id": {"authority": "EPSG", "code": 2154}}
    assert is_right(areas(write_parquet(tmp_path / "c.parquet", crs=projjson)))


@pytest.mark.parametrize(("name", "driver"), [("a.fgb", "FlatGeobuf"), ("a.gdb", "OpenFileGDB")])
def test_drivers_of_gdal(tmp_path, name, driver):
    kind = "MultiPolygon" if name == "a.gdb" else "Polygon"
    assert is_right(areas(write_layer(tmp_path / name, driver, kind=kind)))


def test_zips(tmp_path):
    write_layer(tmp_path / "a.shp", "ESRI Shapefile")
    write_layer(tmp_path / "b.gdb", "OpenFileGDB", kind="MultiPolygon")
    write_layer(tmp_path / "c.gpkg", "GPKG", layer="one")
    shape = sorted(tmp_path.glob("a.*"))
    assert is_right(areas(write_zip(tmp_path / "shape.zip", *shape, folder="data/")))
    base = sorted((tmp_path / "b.gdb").iterdir())
    assert is_right(areas(write_zip(tmp_path / "base.zip", *base, folder="b.gdb/")))
    both = write_zip(tmp_path / "both.zip", *shape, tmp_path / "c.gpkg")
    with pytest.raises(MapError, match="several maps"):
        read_map(both)
    assert is_right(areas(both, layer="a"))
    assert is_right(areas(write_zip(tmp_path / "l.zip", tmp_path / "c.gpkg"), layer="one"))


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"level": 2},
        {"parts": True},
        {"measured": "<b:measuredHeight>42890</b:measuredHeight>"},
        {"measured": "<b:measuredHeight>0</b:measuredHeight>"},
        {"srs": "urn:ogc:def:crs,crs:EPSG:6.12:2154,crs:EPSG:6.12:5720"},
    ],
)
def test_citygml(tmp_path, options):
    (tmp_path / "a.gml").write_text(lod(BOXES, **options))
    assert is_right(areas(tmp_path / "a.gml"))


def test_drawings(tmp_path):
    (tmp_path / "a.dxf").write_text(dxf(BOXES))
    assert is_right(areas(tmp_path / "a.dxf"))
    (tmp_path / "a.dxf").write_text(dxf(BOXES, unit=4, scale=1000.0))
    assert is_right(areas(tmp_path / "a.dxf"))
    (tmp_path / "a.dxf").write_text(dxf(BOXES, code=38))
    assert is_right(areas(tmp_path / "a.dxf", layer="BUILDINGS"))


def test_placemarks(tmp_path):
    boxes = [(*box[:4], box[4]) for box in BOXES]
    (tmp_path / "a.kml").write_text(kml(boxes))
    expected = {height: area * 1.2321 for height, area in RIGHT.items()}  # 1.11 m a step
    assert is_right(areas(tmp_path / "a.kml"), expected)
    (tmp_path / "doc.kml").write_text(kml(boxes, mode="clampToGround"))
    write_zip(tmp_path / "b.kmz", tmp_path / "doc.kml")
    assert list(areas(tmp_path / "b.kmz")) == [6.0]
    assert is_right(areas(tmp_path / "a.kml", layer="Houses"), expected)


@pytest.mark.parametrize("mark", ["", "\x1e"])
def test_sequences(tmp_path, mark):
    ring = [[0, 0], [0.0002, 0], [0.0002, 0.0002], [0, 0.0002], [0, 0]]
    lines = [
        mark
        + json.dumps(
            {
                "type": "Feature",
                "properties": {"height": 9 + k},
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [[[x + k * 4e-4, y] for x, y in ring]],
                },
            }
        )
        for k in range(3)
    ]
    for name in ("a.geojson", "a.geojsonl", "a.ndjson"):
        (tmp_path / name).write_text("\n".join(lines) + "\n")
        assert list(areas(tmp_path / name)) == [9.0, 10.0, 11.0]


# ---------------------------------------------------------------- a town out of a national file


@pytest.mark.parametrize("kind", ["gpkg", "fgb", "parquet", "covered", "gpkg bare", "fgb bare"])
def test_a_window_of_a_large_file(tmp_path, kind):
    at = np.stack(np.meshgrid(np.arange(90) * 100, np.arange(90) * 100), -1).reshape(-1, 2)
    corners = at + CORNER
    polygons = shapely.box(*corners.T, *(corners + 20).T)
    lon, lat = 4.8270, 45.7558
    suffix, _, bare = kind.partition(" ")
    if suffix in ("gpkg", "fgb"):
        driver = {"gpkg": "GPKG", "fgb": "FlatGeobuf"}[suffix]
        path = write_layer(tmp_path / f"a.{suffix}", driver, polygons, index=not bare)
    else:
        path = write_parquet(tmp_path / "a.parquet", polygons, covering=kind == "covered", rows=500)
    from pyproj import Transformer

    to_degrees = Transformer.from_crs("EPSG:2154", 4326, always_xy=True)
    lon, lat = to_degrees.transform(*(CORNER + 4500))
    city = read_map(path, center=(lon, lat), pixels=200)
    assert city.built.mean() == pytest.approx(0.04, abs=0.005)
    assert ("all 8100" in city.taken) == (kind == "parquet" or bool(bare))
    with pytest.raises(MapError, match="no building in the") as fault:
        read_map(path, center=(lon + 1, lat))
    assert "8100 features" in str(fault.value)


# ---------------------------------------------------------------- what is refused


def refused(path, found, **options):
    with pytest.raises(MapError, match=found) as fault:
        read_map(path, **options)
    assert len(fault.value.args) == 3
    assert all(fault.value.args)


def test_geoparquet_that_is_not_one(tmp_path):
    points = shapely.points(np.tile(CORNER, (3, 1)))
    refused(write_parquet(tmp_path / "a.parquet", points), "no polygon")
    refused(write_parquet(tmp_path / "b.parquet", geo=False), "no metadata of GeoParquet")
    refused(write_parquet(tmp_path / "c.parquet", encoding="polygon"), "writes outlines as")
    refused(write_parquet(tmp_path / "d.parquet", crs=None), "no reference system")


def test_geoparquet_of_too_many_bytes(tmp_path, monkeypatch):
    path = write_parquet(tmp_path / "a.parquet")
    monkeypatch.setattr(geoparquet, "MOST_BYTES", 900)
    refused(path, "more than 0.9 kB of outlines")


@pytest.mark.slow
def test_geoparquet_that_fills_the_memory(tmp_path):
    path = write_parquet(tmp_path / "a.parquet")
    kinds = {"compression": "zstd", "use_dictionary": False, "data_page_size": 1 << 30}
    table = pq.read_table(path).slice(0, 1)
    outline = pa.array([bytes(60 << 20)], pa.binary())
    whole = table.set_column(0, "geometry", outline).replace_schema_metadata(table.schema.metadata)
    pq.write_table(pa.concat_tables([whole] * 10), path, write_batch_size=8, **kinds)
    assert path.stat().st_size < 1_000_000
    refused(path, "of outlines and attributes")


def test_zips_that_harm(tmp_path):
    def made(name, *entries, **options):
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as archive:
            for entry, content in entries:
                archive.writestr(entry, content)
        return tmp_path / name

    link = zipfile.ZipInfo("a.geojson")
    link.external_attr = 0o120777 << 16
    refused(made("a.zip", ("../a.geojson", "{}")), "path that leaves")
    refused(made("b.zip", ("/a.geojson", "{}")), "path that leaves")
    refused(made("c.zip", (link, "/etc/passwd")), "path that leaves")
    refused(made("d.zip", ("b.zip", "PK")), "another archive")
    refused(made("e.zip", ("a.geojson", bytes(200_000_000))), "when unpacked")
    refused(made("f.zip", ("a.txt", "a")), "no map")
    content = bytearray(made("g.zip", ("a.geojson", "{}")).read_bytes())
    content[content.index(b"PK\x01\x02") + 8] |= 1
    (tmp_path / "g.zip").write_bytes(content)
    refused(tmp_path / "g.zip", "encrypted")
    assert not (tmp_path.parent / "a.geojson").exists()


def test_xml_with_a_document_type_or_too_large(tmp_path):
    bomb = '<!DOCTYPE CityModel [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>'
    for name, text in (("a.gml", lod(BOXES)), ("a.kml", kml(BOXES))):
        body = text.partition("?>")[2] if text.startswith("<?xml") else text
        (tmp_path / name).write_text(f"<!--{'x' * 5000}-->" + bomb + body)
        refused(tmp_path / name, "unknown format|document type|holds XML")
        (tmp_path / name).write_text(text[:200].replace("<kml", "<kml ") + "-" * 9000)
        refused(tmp_path / name, "cannot be read|holds")
    (tmp_path / "b.gml").write_text(lod(BOXES))
    os.truncate(tmp_path / "b.gml", 2_000_000_000)
    refused(tmp_path / "b.gml", "2 GB of XML")


def test_drawings_without_buildings(tmp_path):
    (tmp_path / "a.dxf").write_text(dxf(BOXES, flags=0))
    refused(tmp_path / "a.dxf", "no closed polyline")
    (tmp_path / "a.dxf").write_text(dxf(BOXES)[:-20])
    refused(tmp_path / "a.dxf", "cut off|EOF")
    (tmp_path / "a.dxf").write_text(dxf(BOXES))
    refused(tmp_path / "a.dxf", "no layer 'b'", layer="b")


def test_geodatabases_with_links(tmp_path):
    path = write_layer(tmp_path / "a.gdb", "OpenFileGDB", kind="MultiPolygon")
    (path / "link").symlink_to("/etc/passwd")
    refused(path, "holds a link")
    (tmp_path / "b.gdb").mkdir()
    refused(tmp_path / "b.gdb", "without a geodatabase")


@pytest.mark.parametrize("text", ["https://a.b/c.gml", "s3://a/b.parquet", "/vsicurl/http://a.fgb"])
def test_addresses(text):
    refused(text, "address on the network")
