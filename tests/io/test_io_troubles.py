"""The files of shared/data/troubles, and for each kind of trouble three more inputs, made here."""

import gzip
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import format_writers as w
import numpy as np
import pytest
import shapely
from affine import Affine
from format_table import middle_of
from pyproj import CRS

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.projection import WGS84, transform_polygons

TROUBLES = Path(__file__).parents[3] / "shared" / "data" / "troubles"

with_troubles = pytest.mark.skipif(not TROUBLES.is_dir(), reason=f"there is no {TROUBLES}")


def areas_of(city):
    """Square metres by height, to the centimetre."""
    heights, counts = np.unique(city.heights[city.heights > 0].round(2), return_counts=True)
    size = city.metres_per_pixel**2
    pairs = zip(heights.tolist(), counts.tolist(), strict=True)
    return {round(high, 2): count * size for high, count in pairs}


def near(areas):
    return {high: pytest.approx(area, rel=0.06) for high, area in areas.items()}


# ---------------------------------------------------------------- the files


TWO, THREE = {9: 400, 12: 400}, {9: 400, 12: 400, 15: 400}
ROOFS = {12: 400, 30: 400}

#: The areas by height of each file, as the README of the folder says, and words of the note.
RIGHT = {
    "s3db.osm": ({10: 1500, 100: 100}, "1 replaced by building parts"),
    "under.osm": ({9: 800}, "2 underground"),
    "josm.osm": ({9: 400}, "1 deleted"),
    "missing.osm": ({9: 400}, "1 with missing corners"),
    "outgeom.osm": ({9: 808}, "2 of the file's 2 buildings"),
    "texts.geojson": ({3.45: 400, 12: 800}, "1 from height, 2 from levels, 1 of them in feet"),
    "gc.gpkg": (TWO, "2 of the file's 2 buildings"),
    "part.geojson": (THREE, "2 without a value of 'building'"),
    "ovt.geojson": ({6: 400, 15: 400}, "1 underground; heights: 1 from levels, 1 by default"),
    "st.city.json": ({15: 400}, "1 from levels"),
    "bdtopo3.geojson": ({12: 400, 15: 400}, "1 from HAUTEUR, 1 from levels"),
    "degen.geojson": ({9: 400}, "left out: 1 with a degenerate outline"),
    "degenhole.geojson": ({9: 800}, "1 degenerate rings left out"),
    "l1.shp": (THREE, "3 with texts in another encoding"),
    "phs.gpkg": (TWO, "2 of the file's 2 buildings"),
    "seq.geojson": (THREE, "3 of the file's 3 buildings"),
    "seq.city.json": ({12: 400}, "1 from solid"),
    "epsg2154.shp": (TWO, "2 from height"),
    "bag.city.json": ({3: 400, 12: 400}, "2 of the file's 2 buildings"),
    "stack.city.json": ({20: 1200, 60: 400}, "2 from solid"),
    "inh.city.json": ({5: 400, 30: 400}, "2 from solid"),
    "feet.city.json": ({30.48: 334}, "transverse Mercator"),
    "degrees.city.json": ({12: 603}, "1 from solid"),
    "su.tif": (ROOFS, "64 × 64 px"),
    "aux.tif": (ROOFS, "25 pixels without a value"),
    "xmask.tif": ({12: 400}, "100 pixels without a value"),
    "lcrs.tif": (ROOFS, "64 × 64 px"),
}

#: The words of the refusal of each file that is refused.
REFUSED = {
    "fill-9999.tif": r"25 of 4096 pixels \(0.61 %\) have the value 9999.*nodata",
    "fill-3.4e38.tif": r"have the value 3\.4028235e\+38.*nodata",
    "dsm.tif": r"elevations above sea level.*terrain",
}

# Files beside others.
_BESIDE = (".cpg", ".dbf", ".prj", ".shx", ".xml", ".msk", ".md")


@with_troubles
@pytest.mark.parametrize("name", RIGHT)
def test_a_troublesome_file_is_read_right(name):
    areas, note = RIGHT[name]
    exact = {"feet.city.json", "degrees.city.json"}  # a few pixels: read finely
    options = {"pixels": 256, "metres_per_pixel": 0.25} if name in exact else {}
    city = read_map(TROUBLES / name, **options)
    assert areas_of(city) == near(areas)
    assert note in city.taken


@with_troubles
@pytest.mark.parametrize("name", REFUSED)
def test_a_troublesome_file_is_refused_with_the_way_out(name):
    with pytest.raises(MapError) as fault:
        read_map(TROUBLES / name)
    assert re.search(REFUSED[name], str(fault.value), re.S)


@with_troubles
def test_every_troublesome_file_has_a_test():
    files = {path.name for path in TROUBLES.iterdir() if path.suffix not in _BESIDE}
    assert files == RIGHT.keys() | REFUSED.keys()


@with_troubles
def test_the_reference_system_of_a_file_stays():
    assert read_map(TROUBLES / "epsg2154.shp").crs == "EPSG:2154"
    assert read_map(TROUBLES / "lcrs.tif").crs is None
    assert read_map(TROUBLES / "dsm.tif", terrain=170).height_rules == {}
    assert areas_of(read_map(TROUBLES / "dsm.tif", terrain=170)) == ROOFS
    assert areas_of(read_map(TROUBLES / "fill-9999.tif", nodata=9999)) == ROOFS
    assert areas_of(read_map(TROUBLES / "fill-3.4e38.tif", nodata=3.4e38)) == ROOFS


# ---------------------------------------------------------------- more inputs of each kind


@dataclass
class Case:
    """An input made by code: the file of the trouble, the name and writer of the input, and the
    areas by height, or the words of a refusal."""

    kind: str
    name: str
    write: object
    right: object
    note: str = ""
    crs: str | None = None
    options: dict = field(default_factory=dict)

    def __str__(self):
        return f"{self.kind}-{self.name}"


FINE = {"pixels": 256, "metres_per_pixel": 1.0}
CASES: list[Case] = []


def add(kind, name, write, right, note="", crs=None, **options):
    raster = name.rpartition(".")[2] in ("tif", "asc", "png", "npy")
    CASES.append(Case(kind, name, write, right, note, crs, options if raster else FINE | options))


def town(writer, shapes, rows, **more):
    return lambda path: writer(path, shapes, rows, **more)


A, B, C = w.box(), w.box(40), w.box(0, 40)
HOUSE = {"height": 9.0}
LAYERS = {
    "a.gpkg": w.write_layer,
    "a.fgb": w.write_layer,
    "a.parquet": w.write_geoparquet,
    "a.geojsonl": w.write_sequence,
}
OSM = {
    "a.osm.pbf": w.write_osm,
    "a.osm.bz2": w.write_osm,
    "a.osm": w.write_overpass,
    "a.json": w.write_overpass,
}

_parts = [(w.box(0, 0, 40, 20), {"height": 10}), (w.box(10, 5, 10), {"height": 100})]
for _name, _write in OSM.items():
    _rows = [{"height": 100, "parts": _parts}]
    add("s3db.osm", _name, town(_write, [w.box(0, 0, 40, 20)], _rows), {10: 700, 100: 100})

for _name, _tags in {
    "a.osm.pbf": {"location": "underground", "height": 9},
    "b.osm.pbf": {"layer": -1, "tunnel": "yes"},
    "c.osm.pbf": {"building:levels": 0, "building:levels:underground": 2},
}.items():
    add("under.osm", _name, town(w.write_osm, [A, B], [HOUSE, _tags]), {9: 400}, "1 underground")
for _name in ("a.gpkg", "a.parquet"):
    _rows = [HOUSE | {"is_underground": "no"}, HOUSE | {"is_underground": "true"}]
    add("under.osm", _name, town(LAYERS[_name], [A, B], _rows), {9: 400}, "1 underground")


def edited(path, old, new, shapes=(A, B)):
    """Write an extract in which the first match of ``old`` is replaced."""
    plain = path.with_suffix("") if path.suffix == ".gz" else path
    w.write_osm(plain, shapes, [HOUSE] * len(shapes))
    text, count = re.subn(old, new, plain.read_text(encoding="utf-8"), count=1)
    assert count == 1
    plain.write_text(text, encoding="utf-8")
    if path.suffix == ".gz":
        path.write_bytes(gzip.compress(text.encode()))
    return path


_court = w.box(0, 0, 60).difference(w.box(20, 20, 20))
_deletions = {
    "a.osm": ('<way id="1"', '<way action="delete" id="1"', (A, B)),
    "b.osm": ('<way id="1"', "<way visible='false' id='1'", (A, B)),
    "c.osm.gz": ('<way id="1"', "<way action='delete' visible='true' id='1'", (A, B)),
    "d.osm": ('<relation id="1"', '<relation action="delete" id="1"', (_court, w.box(80))),
}
for _name, (_old, _new, _shapes) in _deletions.items():
    add(
        "josm.osm",
        _name,
        lambda path, old=_old, new=_new, shapes=_shapes: edited(path, old, new, shapes),
        {9: 400},
        "1 deleted",
    )

for _name in ("a.osm", "a.osm.pbf", "a.osm.gz"):
    _write = town(w.write_osm, [A, B], [HOUSE] * 2, missing=[2])
    add("missing.osm", _name, _write, {9: 400}, "1 with missing corners")
add(
    "missing.osm",
    "b.osm",
    lambda path: edited(path, '<node id="3"', '<node action="delete" id="3"'),
    {9: 400},
)

for _name in ("a.osm", "a.json"):
    _write = town(
        w.write_overpass, [A, w.box(40, 0, 60).difference(w.box(60, 20, 20))], [HOUSE] * 2
    )
    add("outgeom.osm", _name, _write, {9: 3600})
_write = town(w.write_overpass, [shapely.MultiPolygon([A, B]), C], [HOUSE, {"height": 12}])
add("outgeom.osm", "b.osm", _write, {9: 800, 12: 400})

_texts = [{"height": "36 ft"}, {"height": "12,5"}, {"building:levels": "2;5"}]
for _name, _write in (LAYERS | OSM | {"a.kml": w.write_kml}).items():
    _rows = [{key.replace(":", "_"): v for key, v in row.items()} for row in _texts]
    _rows = _texts if _name in OSM else _rows
    _right = {10.97: 400, 12.5: 400, 15: 400}
    add("texts.geojson", _name, town(_write, [A, B, C], _rows), _right, "1 of them in feet")

_both = shapely.GeometryCollection([A, shapely.Point(w.CORNERS[2154]), B])
for _name, _write in LAYERS.items():
    add("gc.gpkg", _name, town(_write, [_both, C], [HOUSE, {"height": 12.0}]), {9: 800, 12: 400})

for _name, _write in LAYERS.items():
    _rows = [HOUSE | {"building": "yes"}, {"height": 12.0, "building": None}]
    _rows.append({"height": 15.0, "building": None})
    _note = "2 without a value of 'building'"
    add("part.geojson", _name, town(_write, [A, B, C], _rows), THREE, _note)

for _kind, _column in (("ovt.geojson", "num_floors"), ("bdtopo3.geojson", "nombre_d_etages")):
    _more = {"a.shp": w.write_layer, "a.gdb": w.write_layer, "a.gml": w.write_gml}
    for _name, _write in (LAYERS | _more).items():
        _rows = [{_column: 5.0}, {_column: 2.0}]
        add(_kind, _name, town(_write, [A, B], _rows), {15: 400, 6: 400}, "2 from levels")

CITIES = {
    "a.city.json": w.write_cityjson,
    "a.city.jsonl": w.write_cityjson_lines,
    "a.gml": w.write_citygml,
}
for _name, _write in CITIES.items():
    _rows = [{"storeysAboveGround": 5}, {"storeysAboveGround": 2}]
    add("st.city.json", _name, town(_write, [A, B], _rows), {15: 400, 6: 400}, "2 from levels")
    _rows = [{"parts": [(A, {"solid": 3.0})]}, {"parts": [(B, {"solid": 12.0})]}]
    add("bag.city.json", _name, town(_write, [A, B], _rows), {3: 400, 12: 400}, "2 replaced")
    _tower = (w.box(0, 0, 20), {"solid": 40.0, "low": 20.0})
    _rows = [{"parts": [(w.box(0, 0, 40), {"solid": 20.0}), _tower]}]
    add("stack.city.json", _name, town(_write, [None], _rows), {20: 1200, 60: 400})
    # a part that repeats its own extent as an attribute
    _low = (w.box(0, 0, 40), {"solid": 20.0, "measuredHeight": 20})
    _rows = [{"parts": [_low, (_tower[0], _tower[1] | {"measuredHeight": 40})]}]
    add("stack.city.json", f"b{_name[1:]}", town(_write, [None], _rows), {20: 1200, 60: 400})
    # a parent of LoD 0 that is larger than its part
    _rows = [{"measuredHeight": 9, "parts": [(A, {"solid": 3.0})]}]
    add("bag.city.json", f"b{_name[1:]}", town(_write, [w.box(0, 0, 40)], _rows), {9: 1200, 3: 400})
    # a parent with less detail than its part
    _rows = [{"solid": 30.0, "parts": [(A, {"solid": 5.0, "lod": 2})]}]
    add(
        "inh.city.json", f"b{_name[1:]}", town(_write, [w.box(0, 0, 40)], _rows), {30: 1200, 5: 400}
    )
    _rows = [{"measuredHeight": 30, "solid": 30.0, "parts": [(B, {"solid": 5.0})]}]
    add("inh.city.json", _name, town(_write, [A], _rows), {30: 400, 5: 400})

_start, _end = (np.add(w.CORNERS[2154], at) for at in ((0, 0), (18, 9)))
_line = shapely.Polygon([_start, _end, _start, _start])
_spot = np.add(w.CORNERS[2154], (10, 10))
_hole = shapely.Polygon(A.exterior, [[_spot, _spot + 1, _spot, _spot]])
_others = {
    "a.shp": w.write_layer,
    "a.gdb": w.write_layer,
    "a.gml": w.write_gml,
    "a.kml": w.write_kml,
}
for _name, _write in (LAYERS | _others | {"a.osm.pbf": w.write_osm}).items():
    _note = "1 with a degenerate outline"
    add("degen.geojson", _name, town(_write, [_line, B], [HOUSE] * 2), {9: 400}, _note)
for _name, _write in (LAYERS | _others).items():
    add("degenhole.geojson", _name, town(_write, [_hole, B], [HOUSE] * 2), {9: 800})


def lying(path, cpg, packed=False):
    """Write a Shapefile with texts in ISO 8859-1 whose .cpg says ``cpg``."""
    rows = [HOUSE | {"name": "Hôtel"}, HOUSE | {"name": "Café"}]
    if packed:
        return w.write_zip(path, [A, B], rows, encoding="ISO-8859-1", cpg=cpg)
    w.write_layer(path, [A, B], rows, encoding="ISO-8859-1")
    path.with_suffix(".cpg").write_text(cpg)
    return path


for _number, _cpg in enumerate(("UTF-8", "CP936", "nonsense", "")):
    add("l1.shp", f"{_number}.shp", lambda path, cpg=_cpg: lying(path, cpg), {9: 800})
add("l1.shp", "a.zip", lambda path: lying(path, "UTF-8", packed=True), {9: 800})

_angle = w.box(0, 0, 40).difference(w.box(20, 20, 20))
for _name, _write in {"a.gpkg": w.write_layer, "a.parquet": w.write_geoparquet}.items():
    for _shape, _area in ((_angle, 1200), (_court, 3200)):
        _write_ = town(_write, [_shape, w.box(80)], [{"solid": 8.0}, {"solid": 30.0}])
        add("phs.gpkg", f"{_area}{_name}", _write_, {8: _area, 30: 400}, "2 from solid")

for _name, _mark in {
    "a.geojson": "",
    "b.geojson": "\x1e",
    "a.ndjson": "",
    "a.geojsons": "\x1e",
}.items():
    _rows = [{"height": high} for high in (9.0, 12.0, 15.0)]
    add("seq.geojson", _name, town(w.write_sequence, [A, B, C], _rows, mark=_mark), THREE)
for _name in ("a.city.json", "a.jsonl", "a.json"):
    _rows = [{"solid": high} for high in (9.0, 12.0, 15.0)]
    add("seq.city.json", _name, town(w.write_cityjson_lines, [A, B, C], _rows), THREE)


def placed(code, lon, lat):
    """Make a square of 20 m in the reference system ``code``."""
    there = transform_polygons(np.array([shapely.Point(lon, lat)]), WGS84, CRS.from_epsg(code))[0]
    return shapely.box(there.x, there.y, there.x + 20, there.y + 20)


for _code, _at in {25832: (9.0, 48.0), 27700: (-0.1, 51.5), 2056: (8.5, 47.4)}.items():
    for _suffix, _write in {
        "shp": w.write_layer,
        "fgb": w.write_layer,
        "gml": w.write_gml,
        "parquet": w.write_geoparquet,
    }.items():
        _write_ = town(_write, [placed(_code, *_at)], [HOUSE], code=_code)
        add("epsg2154.shp", f"{_code}.{_suffix}", _write_, {9: 400}, crs=f"EPSG:{_code}")

_feet = w.box(0, 0, 100, code=2263)
for _name, _write in CITIES.items():
    add("feet.city.json", _name, town(_write, [_feet], [{"solid": 100.0}], code=2263), {30.48: 929})
for _name in ("a.gpkg", "a.fgb", "a.gdb", "a.parquet"):
    _write = town(LAYERS.get(_name, w.write_layer), [_feet], [{"height": 100.0}], code=2263)
    add("feet.city.json", _name, _write, {30.48: 929})

for _name, _write in CITIES.items():
    _write_ = town(_write, list(w.degrees([A, B])), [{"solid": 12.0}] * 2, code=4979)
    add("degrees.city.json", _name, _write_, {12: 800})
SHAPES, HIGH = [A, B], [{"height": 12.0}, {"height": 30.0}]
HEIGHTS, NORTH_UP = w.raster_of(SHAPES, HIGH)
_x, _y = NORTH_UP.c, NORTH_UP.f
_turned = {
    "a": (HEIGHTS[::-1], Affine(1, 0, _x, 0, 1, _y - w.SIDE)),
    "b": (HEIGHTS[:, ::-1], Affine(-1, 0, _x + w.SIDE, 0, -1, _y)),
    "c": (HEIGHTS.T, Affine(0, 1, _x, -1, 0, _y)),
    "d": (HEIGHTS[::-1, ::-1], Affine(-1, 0, _x + w.SIDE, 0, 1, _y - w.SIDE)),
}
for _name, (_values, _transform) in _turned.items():
    _more = {"values": np.ascontiguousarray(_values), "transform": _transform}
    add("su.tif", f"{_name}.tif", town(w.write_geotiff, SHAPES, HIGH, **_more), ROOFS, "128 × 128")


def noted(path, writer, values, notes):
    """Write a raster with notes of its band in ``.aux.xml``."""
    writer(path, SHAPES, HIGH, values=values)
    text = f'<PAMDataset><PAMRasterBand band="1">{notes}</PAMRasterBand></PAMDataset>'
    path.with_name(path.name + ".aux.xml").write_text(text)
    return path


_lost = HEIGHTS.copy()
_lost[:5, :5] = 9999
for _suffix, _writer in {"tif": w.write_geotiff, "asc": w.write_asc}.items():
    for _number, (_values, _notes) in enumerate(
        [
            (_lost, "<NoDataValue>9999</NoDataValue>"),
            (HEIGHTS * 4, "<Scale>0.25</Scale>"),
            (HEIGHTS + 7, "<Offset>-7</Offset>"),
        ]
    ):
        _arguments = (_writer, _values, _notes)
        add(
            "aux.tif",
            f"{_number}.{_suffix}",
            lambda path, more=_arguments: noted(path, *more),
            ROOFS,
        )


def masked(path, kind):
    """Write a raster whose mask ``.msk`` leaves out the roof of 30 m."""
    w.write_geotiff(path, SHAPES, HIGH, values=HEIGHTS.astype(kind))
    mask = np.where(HEIGHTS == 30, 0, 255).astype(np.uint8)
    made = w.write_geotiff(path.with_name("m.tif"), SHAPES, HIGH, values=mask)
    made.rename(path.with_name(path.name + ".msk"))
    return path


for _kind in ("float32", "uint16", "uint8"):
    add("xmask.tif", f"{_kind}.tif", lambda path, kind=_kind: masked(path, kind), {12: 400})
_alpha = np.where(HEIGHTS == 30, 0, 255).astype(np.uint8)
_write = town(w.write_png, SHAPES, HIGH, alpha=_alpha)
add("xmask.tif", "a.png", _write, {12: 400}, metres_per_pixel=1.0, height_scale=1.0)


def filled(value, kind="float32"):
    values = HEIGHTS.astype(kind)
    values[:5, :5] = value
    return values


for _name, _writer, _values in (
    ("a.tif", w.write_geotiff, filled(65535, "uint16")),
    ("b.tif", w.write_geotiff, filled(-32768, "int16")),
    ("c.tif", w.write_geotiff, filled(-9999)),
    ("a.asc", w.write_asc, filled(9999)),
    ("a.npy", w.write_npy, filled(9999)),
):
    for _kind in ("fill-9999.tif", "fill-3.4e38.tif"):
        _value = float(_values[0, 0])
        _more = {"metres_per_pixel": 1.0} if _name.endswith("npy") else {}
        _write = town(_writer, SHAPES, HIGH, values=_values)
        if _kind == "fill-9999.tif":
            _words = rf"25 of 16384 pixels.* have the value {_value:.5g}.*nodata"
            add(_kind, _name, _write, _words, **_more)
        else:
            add(_kind, _name, _write, ROOFS, nodata=_value, **_more)

for _name, _writer in {
    "a.tif": w.write_geotiff,
    "a.asc": w.write_asc,
    "a.npy": w.write_npy,
}.items():
    _more = {"metres_per_pixel": 1.0} if _name.endswith("npy") else {}
    _write = town(_writer, SHAPES, HIGH, values=HEIGHTS + 170)
    add("dsm.tif", _name, _write, r"elevations above sea level.*terrain", **_more)
    add("dsm.tif", "ground-" + _name, _write, ROOFS, terrain=170.0, **_more)

_LOCAL = 'LOCAL_CS["site",UNIT["{}",{}],AXIS["x",EAST],AXIS["y",NORTH]]'
for _unit, _metres in {"metre": 1.0, "decimetre": 0.1, "kilometre": 1000.0}.items():
    _transform = Affine(1 / _metres, 0, 50, 0, -1 / _metres, 90)
    _more = {"crs": _LOCAL.format(_unit, _metres), "transform": _transform}
    add("lcrs.tif", f"{_unit}.tif", town(w.write_geotiff, SHAPES, HIGH, **_more), ROOFS)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_an_input_of_the_same_kind(tmp_path, case):
    path = case.write(tmp_path / case.name)
    if isinstance(case.right, str):
        with pytest.raises(MapError) as fault:
            read_map(path, **case.options)
        assert re.search(case.right, str(fault.value), re.S)
        return
    city = read_map(path, **case.options)
    assert areas_of(city) == near(case.right)
    assert case.note in city.taken
    assert case.crs is None or city.crs == case.crs


def test_each_kind_has_three_more_inputs():
    counts = Counter(case.kind for case in CASES)
    assert counts.keys() == RIGHT.keys() | REFUSED.keys()
    assert min(counts.values()) >= 3


@pytest.mark.parametrize(
    ("code", "lon", "lat"), [(2154, 4.8, 45.7), (31467, 9.2, 48.7), (2180, 19.0, 52.2)]
)
def test_a_reference_system_without_its_code_gets_it(tmp_path, code, lon, lat):
    (x, y, *_) = placed(code, lon, lat).bounds
    shape = shapely.transform(placed(code, lon, lat), lambda at: at - (x, y) + w.CORNERS[2154])
    path = w.write_asc(tmp_path / "a.asc", [shape], [HOUSE])
    head = {"xllcorner": x - w.MARGIN, "yllcorner": y - w.MARGIN}
    text = path.read_text()
    for key, value in head.items():
        text = re.sub(rf"{key} .*", f"{key} {value!r}", text)
    path.write_text(text)
    named = CRS.from_epsg(code).to_wkt("WKT1_ESRI")
    assert "EPSG" not in named
    path.with_suffix(".prj").write_text(named)
    city = read_map(path)
    assert city.crs == f"EPSG:{code}"
    assert middle_of(city) == pytest.approx((lon, lat), abs=1e-3)


# ---------------------------------------------------------------- the order of axes in GML


@pytest.mark.parametrize(
    ("srs", "is_swapped"),
    [
        ("urn:ogc:def:crs:EPSG::4326", True),
        ("urn:x-ogc:def:crs:EPSG:4326", True),
        ("http://www.opengis.net/def/crs/EPSG/0/4326", True),
        ("http://www.opengis.net/gml/srs/epsg.xml#4326", False),
        ("EPSG:4326", False),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", False),
        ("urn:ogc:def:crs:EPSG::2154", False),
        ("urn:ogc:def:crs:EPSG::31467", True),
        ("EPSG:31467", False),
        ("urn:ogc:def:crs:EPSG::31467", False),  # wrong, but nothing lies there
    ],
)
def test_the_order_of_axes_in_gml(tmp_path, srs, is_swapped):
    code = int(re.findall(r"\d{4,}", srs)[0]) if "CRS84" not in srs else 4326
    lon, lat = (9.2, 48.7) if code == 31467 else (4.827, 45.756)
    metric = 25832 if code == 31467 else 2154
    shape = placed(metric, lon, lat)
    made = transform_polygons(np.array([shape]), CRS.from_epsg(metric), CRS.from_epsg(code))
    path = w.write_gml(tmp_path / "a.gml", made, [HOUSE], srs=srs, swapped=is_swapped)
    city = read_map(path, **FINE)
    assert areas_of(city) == near({9: 400})
    assert middle_of(city) == pytest.approx((lon, lat), abs=1e-3)
