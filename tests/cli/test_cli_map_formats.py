"""Maps of many formats by the command line: refused with a way out, or read with their options."""

import json
import os
import shutil
import struct
import zipfile

import numpy as np
import pyarrow.parquet as pq
import pyogrio
import pytest
import rasterio
import shapely
from cli_tools import call, refused, write_recipe
from test_io_formats import BOXES, CORNER, dxf, kml, lod, squares, write_layer, write_parquet
from test_io_surfaces import Affine, town, write

from evocity import decode
from evocity.io import read_map
from evocity.store import RunLog

SMALL = ("--pixels", "64", "--metres-per-pixel", "2", "--block", "4", "--no-fit")
POINTS = shapely.points(np.tile(CORNER, (3, 1)))


@pytest.fixture
def no_map(tmp_path):
    """Check that `evocity encode` refuses a file: what arrived, and a remedy."""
    (tmp_path / "out").mkdir()

    def check(path, says, remedy, *options):
        genome = tmp_path / "out" / "a.parquet"
        message = refused(tmp_path / "out", "encode", path, *options, "-o", genome, says=says)
        assert remedy in message.partition("what to do:")[2], message
        assert len(message) < 1200
        return message

    return check


# -- refused --------------------------------------------------------------------------------------


def packed(path, *entries):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return path


def changed(path, change):
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)
    return path


def test_zips(tmp_path, no_map):
    def lock(content):
        for mark, flags in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
            content[content.index(mark) + flags] |= 1

    def lie(content):  # the sizes of 100 million zeros
        for mark, size in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
            struct.pack_into("<I", content, content.index(mark) + size, 1000)

    encrypted = changed(packed(tmp_path / "a.zip", ("a.geojson", "{}")), lock)
    no_map(encrypted, "is encrypted ('a.geojson')", "with its password")
    nested = packed(tmp_path / "b.zip", ("inner.zip", "PK"))
    no_map(nested, "holds another archive: inner.zip", "unpack the zip once")
    for number, name in enumerate(("../a.geojson", "/a.geojson", "a\\b.geojson", "C:a.geojson")):
        path = packed(tmp_path / f"c{number}.zip", (name, "{}"))
        no_map(path, "a path that leaves the zip", "pack the map again")
    link = zipfile.ZipInfo("a.geojson")
    link.external_attr = 0o120777 << 16
    no_map(packed(tmp_path / "d.zip", (link, "/etc/passwd")), "a path that leaves", "pack the map")
    bomb = packed(tmp_path / "e.zip", ("a.geojson", bytes(100_000_000)))
    no_map(bomb, "100 MB when unpacked", "unpack the zip")
    no_map(changed(bomb, lie), "cannot be unpacked", "download the file again")
    no_map(packed(tmp_path / "g.zip", ("a.txt", "a")), "holds no map: a.txt", "convert its data")
    no_map(packed(tmp_path / "h.zip", ("a.kml", "<kml>")), "a.kml", "")


def test_geoparquet(tmp_path, no_map):
    plain = write_parquet(tmp_path / "a.parquet", geo=False)
    no_map(plain, "has no metadata of GeoParquet", "write it as GeoParquet with geopandas")
    lines = shapely.linestrings(np.stack([np.tile(CORNER, (3, 1)), np.tile(CORNER + 9, (3, 1))], 1))
    for number, shapes in enumerate((POINTS, lines)):
        path = write_parquet(tmp_path / f"b{number}.parquet", shapes)
        no_map(path, "3 rows, but no polygon", "not their middles or lines")
    native = write_parquet(tmp_path / "c.parquet", encoding="point")
    no_map(native, "writes outlines as 'point'", "GEOMETRY_ENCODING=WKB")
    table = pq.read_table(write_parquet(tmp_path / "d.parquet"))
    texts = table.set_column(0, "geometry", [["no outline"] * len(table)])
    pq.write_table(texts.replace_schema_metadata(table.schema.metadata), tmp_path / "d.parquet")
    no_map(tmp_path / "d.parquet", "the column 'geometry' holds texts", "geopandas")
    broken = table.set_column(0, "geometry", [[b"\1\3\0\0\0\xff\xff\xff\xff"] * len(table)])
    pq.write_table(broken.replace_schema_metadata(table.schema.metadata), tmp_path / "e.parquet")
    no_map(tmp_path / "e.parquet", "cannot be read as GeoParquet", "download or export")


def test_citygml_of_2_gb(tmp_path, no_map):
    (tmp_path / "a.gml").write_text(lod(BOXES))
    os.truncate(tmp_path / "a.gml", 2_000_000_000)
    no_map(tmp_path / "a.gml", "2 GB of XML", "cut")


def test_drawings_without_closed_polylines(tmp_path, no_map):
    (tmp_path / "a.dxf").write_text(dxf(BOXES, flags=0))
    no_map(tmp_path / "a.dxf", "no closed polyline", "close")
    (tmp_path / "b.dxf").write_text(dxf(BOXES))
    no_map(tmp_path / "b.dxf", "no layer 'roofs'", "--layer", "--layer", "roofs")
    (tmp_path / "c.dxf").write_bytes(b"AutoCAD Binary DXF\r\n\x1a\x00" + bytes(90))
    no_map(tmp_path / "c.dxf", "holds binary DXF", "export the file again")


@pytest.mark.parametrize(
    ("terrain", "says", "remedy"),
    [
        ({"transform": Affine(2, 0, 842064, 0, -2, 6519128)}, "50 % of the pixels", "larger"),
        ({"transform": Affine(2, 0, 900000, 0, -2, 6519128)}, "0 % of the pixels", "larger"),
        ({"crs": "EPSG:32631"}, "has WGS 84 / UTM zone 31N, and a has", "gdalwarp -t_srs"),
        ({"crs": None}, "no reference system", "gdalwarp"),
    ],
)
def test_terrains_of_another_place(tmp_path, no_map, terrain, says, remedy):
    path = write(tmp_path / "a.tif", town() + 170)
    shape = (32, 32) if terrain.get("crs", "") is None else (64, 64)
    ground = write(tmp_path / "dtm.tif", np.full(shape, 170, np.float32), **terrain)
    no_map(path, says, remedy, "--terrain", ground)


def test_terrains_that_are_not_rasters(tmp_path, no_map):
    path = write(tmp_path / "a.tif", town() + 170)
    no_map(path, "elevations above sea level", "--terrain")
    layer = write_layer(tmp_path / "b.gpkg", "GPKG")
    no_map(path, "b.gpkg is not a raster", "GeoTIFF", "--terrain", layer)
    no_map(path, "no file", "check the path", "--terrain", tmp_path / "none.tif")
    no_map(layer, "--terrain does not apply to .gpkg", "leave --terrain out", "--terrain", path)
    no_map(layer, "--nodata does not apply to .gpkg", "leave --nodata out", "--nodata", "0")


def test_two_columns_of_heights(tmp_path, no_map):
    heights = [np.array([9.0, 12.0, 15.0])] * 2
    for suffix, driver in ((".fgb", "FlatGeobuf"), (".geojson", "GeoJSON")):
        path = tmp_path / f"a{suffix}"
        names = ["height", "HEIGHT"]
        pyogrio.raw.write(
            path,
            shapely.to_wkb(squares()),
            heights,
            names,
            geometry_type="Polygon",
            crs="EPSG:2154",
            driver=driver,
        )
        no_map(path, "two columns of heights", "--height-column")
        genome = tmp_path / f"b{suffix}.parquet"
        call("encode", path, "--height-column", "HEIGHT", *SMALL, "-o", genome)
    no_map(
        path, "no column for --height-column 'h'", "correct --height-column", "--height-column=h"
    )


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".shp", ".geojson", ".kml", ".gdb", ".gml"])
def test_layers_of_points(tmp_path, no_map, suffix):
    path = tmp_path / f"a{suffix}"
    drivers = {".gpkg": "GPKG", ".fgb": "FlatGeobuf", ".shp": "ESRI Shapefile"}
    drivers |= {".geojson": "GeoJSON", ".gdb": "OpenFileGDB"}
    if suffix in drivers:
        write_layer(path, drivers[suffix], POINTS, kind="Point")
    elif suffix == ".kml":
        mark = "<Placemark><Point><coordinates>4.8,45.7,0</coordinates></Point></Placemark>"
        path.write_text(kml([]).replace("</Folder>", f"{mark}</Folder>"))
    else:
        path.write_text(
            '<wfs:FeatureCollection xmlns:wfs="http://www.opengis.net/wfs" '
            'xmlns:gml="http://www.opengis.net/gml"><gml:featureMember><t><geom>'
            '<gml:Point srsName="EPSG:2154"><gml:pos>842000 6519000</gml:pos></gml:Point>'
            "</geom></t></gml:featureMember></wfs:FeatureCollection>"
        )
    assert "polygon" in no_map(path, "a", "")


# -- read -----------------------------------------------------------------------------------------


def heights_of(genome, tmp_path):
    """The heights of a genome, and what `evocity encode` said is in the genome's own map."""
    call("decode", genome, "-o", tmp_path / "decoded.tif")
    with rasterio.open(tmp_path / "decoded.tif") as source:
        return source.read(1)


def surface(folder, **more):
    """Elevations of a town on a hill of 170 m, with -9999 in a corner, and the hill."""
    high = town() + np.float32(170)
    high[:5, :5] = -9999
    path = write(folder / "dsm.tif", high, **more)
    ground = write(folder / "dtm.tif", np.full((64, 64), 170, np.float32))
    return path, ground


@pytest.mark.parametrize("is_packed", [False, True])
@pytest.mark.parametrize("is_flat", [False, True])
def test_elevations_less_their_ground(tmp_path, no_map, is_packed, is_flat):
    path, ground = surface(tmp_path)
    if is_packed:
        with zipfile.ZipFile(tmp_path / "dsm.zip", "w") as archive:
            archive.write(path, "data/dsm.tif")
        path = tmp_path / "dsm.zip"
    if is_flat:
        ground = 170
    no_map(path, "have the value -9999", "--nodata", "--terrain", ground)
    genome = tmp_path / "a.parquet"
    result = call("encode", path, "--terrain", ground, "--nodata", -9999, "-o", genome)
    assert "25 pixels without a value are ground" in result.stderr
    assert "heights less" in result.stderr
    found = heights_of(genome, tmp_path)
    assert abs(found - town()).mean() < 0.2
    assert found[:5, :5].max() < 0.5


def test_a_zip_of_a_surface_and_its_ground(tmp_path, no_map):
    path, ground = surface(tmp_path)
    both = tmp_path / "both.zip"
    with zipfile.ZipFile(both, "w") as archive:
        for each in (path, ground):
            archive.write(each, each.name)
    options = ("--terrain", ground, "--nodata", -9999)
    no_map(both, "several maps", "--layer", *options)
    genome = tmp_path / "a.parquet"
    call("encode", both, "--layer", "dsm", *options, "-o", genome)
    assert heights_of(genome, tmp_path).max() == pytest.approx(30, abs=0.5)


def test_columns_that_the_user_names(tmp_path):
    columns = [np.array([3.0, np.nan, 0.0]), np.array([7, 8, 9])]
    path = tmp_path / "a.gpkg"
    pyogrio.raw.write(
        path,
        shapely.to_wkb(squares()),
        columns,
        ["roof", "floors"],
        geometry_type="Polygon",
        crs="EPSG:2154",
    )
    options = ("--height-column", "roof", "--levels-column", "floors", *SMALL)
    result = call("encode", path, *options, "-o", tmp_path / "a.parquet")
    assert "1 from roof, 2 from floors" in result.stderr
    assert heights_of(tmp_path / "a.parquet", tmp_path).max() == pytest.approx(27, abs=2)


# -- recipes --------------------------------------------------------------------------------------


def parents(terrain="dtm.tif"):
    lines = ['map = "dsm.tif"', "nodata = -9999", f"terrain = {json.dumps(terrain)}"]
    lines += ["[[parents]]", 'map = "a.gpkg"', 'height_column = "roof"', 'levels_column = "floors"']
    return "\n".join(lines)


@pytest.mark.slow
def test_options_of_parents_in_a_recipe(tmp_path):
    _, ground = surface(tmp_path)
    columns = [np.array([3.0, np.nan, 0.0]), np.array([7, 8, 9])]
    outlines = shapely.to_wkb(squares())
    fields = ["roof", "floors"]
    pyogrio.raw.write(
        tmp_path / "a.gpkg", outlines, columns, fields, geometry_type="Polygon", crs="EPSG:2154"
    )
    window = "pixels = 32\nmetres_per_pixel = 4"
    recipe = write_recipe(tmp_path, parents=parents(), map=window)
    result = call("run", recipe, "--out", tmp_path / "run")
    assert "less the terrain dtm.tif" in result.stderr
    assert "1 from roof, 2 from floors" in result.stderr
    expected = read_map(
        tmp_path / "dsm.tif", terrain=ground, nodata=-9999, pixels=32, metres_per_pixel=4
    )
    maps = json.loads((tmp_path / "run" / "provenance.json").read_text())["maps"]
    assert maps[0]["terrain"] == "dtm.tif"
    assert len(maps[0]["terrain_file"]) == 32
    first = RunLog(tmp_path / "run").genome(0)
    assert abs(decode(first).city.heights - expected.heights).mean() < 1
    call("resume", tmp_path / "run", "--generations", 3)
    write(ground, np.full((64, 64), 171, np.float32))
    resume = ("resume", tmp_path / "run", "--generations", 4)
    assert "the terrain dtm.tif" in refused(tmp_path, *resume, says="inputs have changed")
    call(*resume, "--accept-changes")


@pytest.mark.parametrize(
    ("terrain", "says"),
    [("none.tif", "none.tif"), (float("inf"), "terrain"), (True, "terrain"), ("", "terrain")],
)
def test_terrains_at_fault_in_a_recipe(tmp_path, terrain, says):
    surface(tmp_path)
    text = parents(terrain).replace("Infinity", "inf")
    recipe = write_recipe(
        tmp_path, parents=text.partition("\n[[")[0] + '\n[[parents]]\nmap = "left.npy"'
    )
    refused(tmp_path, "run", recipe, "--out", tmp_path / "run", says=says)


@pytest.mark.slow
def test_a_new_recipe_keeps_the_options_of_each_map(tmp_path):
    path, ground = surface(tmp_path)
    other = shutil.copy(path, tmp_path / "other.tif")
    words = ("--terrain", ground, "--nodata", -9999, "--pixels", 32, "--metres-per-pixel", 4)
    recipe = tmp_path / "new.toml"
    call("recipe", "new", path, other, *words, "--fitness", "gsi", "-o", recipe)
    text = recipe.read_text()
    assert text.count('terrain = "dtm.tif"') == text.count("nodata = -9999.0") == 2
