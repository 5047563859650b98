"""Table of formats in docs/maps.md: for each format and property, phrases and the check of each.

`docs/formats.py` writes the table on the page from `FORMATS`. The tests run the check of every
phrase of every cell.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import format_writers as w
import numpy as np
import pytest
import shapely
from pyproj import CRS

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.projection import WGS84, transform_points

COLUMNS = ("heights", "parts", "holes", "CRS", "units", "nodata")


@dataclass(frozen=True)
class Format:
    """A row of the table: its title, the suffix and writer of its tests, and its cells.

    ``heights``: key of a row of attributes with the height in metres, for cells that test other
    things; ``options``: arguments of `read_map`.
    """

    title: str
    suffix: str
    write: w.Writer
    cells: dict[str, tuple[str, ...]]
    heights: str = "height"
    options: dict = field(default_factory=dict)

    def path(self, folder: Path) -> Path:
        return folder / f"a{self.suffix}"

    def read(self, path: Path, **options) -> CityMap:
        return read_map(path, **self.options | options)

    def areas(self, path: Path, **options) -> dict[float, object]:
        """Square metres by height, to compare within 6 %."""
        found = self.read(path, **options)
        size = found.metres_per_pixel**2
        heights, counts = np.unique(found.heights[found.heights > 0].round(1), return_counts=True)
        pairs = zip(heights.tolist(), (counts * size).tolist(), strict=True)
        return {round(height, 1): pytest.approx(area, rel=0.06) for height, area in pairs}


FOOTPRINTS = {"pixels": 256, "metres_per_pixel": 1.0}
BOXES = [w.box(), w.box(40), w.box(0, 40)]
HIGH = [9.0, 12.0, 15.0]
RIGHT = {9.0: 400, 12.0: 400, 15.0: 400}


def write_town(kind: Format, folder: Path, shapes=None, heights=None, **more) -> Path:
    """Write a town of boxes, or other shapes, with heights by the usual key of the format."""
    shapes = BOXES if shapes is None else shapes
    rows = [{kind.heights: high} for high in heights or HIGH[: len(shapes)]]
    return kind.write(kind.path(folder), shapes, rows, **more)


# ---------------------------------------------------------------- heights


def _heights(key: str, factor: float = 1.0) -> Callable[[Format, Path], None]:
    def check(kind: Format, folder: Path) -> None:
        rows = [{key: high * factor} for high in HIGH]
        assert kind.areas(kind.write(kind.path(folder), BOXES, rows)) == RIGHT

    return check


def _pixels(kind: Format, folder: Path) -> None:
    assert kind.areas(write_town(kind, folder)) == RIGHT


def _grey_levels(kind: Format, folder: Path) -> None:
    path = write_town(kind, folder)
    found = kind.areas(path, height_scale=0.5)
    assert found == {high / 2: area for high, area in RIGHT.items()}
    with pytest.raises(MapError, match="no height scale"):
        read_map(path, metres_per_pixel=1.0)


# ---------------------------------------------------------------- parts


def _multipolygon(kind: Format, folder: Path) -> None:
    both = shapely.MultiPolygon([w.box(), w.box(40)])
    path = write_town(kind, folder, [both, w.box(0, 40)], [9.0, 12.0])
    assert kind.areas(path) == {9: 800, 12: 400}


def _collection(kind: Format, folder: Path) -> None:
    point = shapely.Point(*w.CORNERS[2154])
    both = shapely.GeometryCollection([w.box(), point, w.box(40)])
    path = write_town(kind, folder, [both, w.box(0, 40)], [9.0, 12.0])
    assert kind.areas(path) == {9: 800, 12: 400}


def _building_parts(kind: Format, folder: Path) -> None:
    key = kind.heights
    parts = [(w.box(), {key: 9.0}), (w.box(20), {key: 15.0})]
    rows = [{"parts": parts}, {key: 12.0}]
    path = kind.write(kind.path(folder), [None, w.box(0, 40)], rows)
    assert kind.areas(path) == {9: 400, 15: 400, 12: 400}


def _simple_buildings(kind: Format, folder: Path) -> None:
    parts = [(w.box(0, 0, 40, 20), {"height": 9.0}), (w.box(0, 0, 20, 20), {"height": 30.0})]
    rows = [{"height": 30.0, "parts": parts}]
    path = kind.write(kind.path(folder), [w.box(0, 0, 40, 40)], rows)
    assert kind.areas(path) == {9: 400, 30: 400}


def _polylines(kind: Format, folder: Path) -> None:
    assert kind.areas(write_town(kind, folder)) == RIGHT
    with pytest.raises(MapError, match="no closed polyline"):
        kind.read(write_town(kind, folder, closed=False))


def _bands(kind: Format, folder: Path) -> None:
    with pytest.raises(MapError, match="2 bands"):
        kind.read(write_town(kind, folder, bands=2))


def _one_grid(kind: Format, folder: Path) -> None:
    path = write_town(kind, folder)
    with open(path, "a", encoding="utf-8") as file:
        file.write("1 2 3\n")
    with pytest.raises(MapError, match="numbers, of"):
        kind.read(path)


def _axes(kind: Format, folder: Path) -> None:
    np.save(kind.path(folder), np.zeros((2, 8, 8)))
    with pytest.raises(MapError, match=r"\(2, 8, 8\)"):
        kind.read(kind.path(folder))


def _grey(kind: Format, folder: Path) -> None:
    from PIL import Image

    Image.new("RGB", (8, 8)).save(kind.path(folder))
    with pytest.raises(MapError, match="picture in colour"):
        kind.read(kind.path(folder))


# ---------------------------------------------------------------- holes


def _holes(area: float) -> Callable[[Format, Path], None]:
    ring = w.box(0, 0, 60).difference(w.box(20, 20, 20))

    def check(kind: Format, folder: Path) -> None:
        assert kind.areas(write_town(kind, folder, [ring], [9.0])) == {9: area}

    return check


# ---------------------------------------------------------------- reference systems


def middle_of(city: CityMap) -> tuple[float, float]:
    """Longitude and latitude of the middle of a map's buildings."""
    rows, columns = np.nonzero(city.heights)
    x = city.origin[0] + (columns.mean() + 0.5) * city.metres_per_pixel
    y = city.origin[1] - (rows.mean() + 0.5) * city.metres_per_pixel
    return transform_points(x, y, CRS.from_user_input(city.crs), WGS84)


def is_placed(city: CityMap, shapes=BOXES) -> bool:
    """Whether the buildings of a map stand within about 2 m of the ``shapes``."""
    (right,) = w.degrees([shapely.MultiPolygon(shapes).centroid])
    return middle_of(city) == pytest.approx((right.x, right.y), abs=2e-5)


def _own_system(**more) -> Callable[[Format, Path], None]:
    def check(kind: Format, folder: Path) -> None:
        city = kind.read(write_town(kind, folder, **more))
        assert city.crs == "EPSG:2154"
        assert is_placed(city)

    return check


def _degrees(**more) -> Callable[[Format, Path], None]:
    def check(kind: Format, folder: Path) -> None:
        city = kind.read(write_town(kind, folder, **more))
        assert "tmerc" in city.crs or "transverse Mercator" in city.crs
        assert is_placed(city)

    return check


def _no_place(**more) -> Callable[[Format, Path], None]:
    def check(kind: Format, folder: Path) -> None:
        path = write_town(kind, folder, **more)
        assert kind.read(path).crs is None or not kind.read(path).crs.startswith("EPSG")
        assert kind.areas(path) == RIGHT

    return check


def _asc_system(kind: Format, folder: Path) -> None:
    _own_system()(kind, folder)
    prj = kind.path(folder).with_suffix(".prj")
    notes = kind.path(folder).with_name("a.asc.aux.xml")
    notes.write_text(f"<PAMDataset><SRS>{prj.read_text()}</SRS></PAMDataset>")
    prj.unlink()
    city = kind.read(kind.path(folder))
    assert city.crs == "EPSG:2154"
    assert is_placed(city)


# ---------------------------------------------------------------- units


def _feet_of_system(kind: Format, folder: Path) -> None:
    shape = w.box(0, 0, 100, code=2263)
    path = write_town(kind, folder, [shape], [100.0], code=2263)
    assert kind.areas(path) == {30.5: 30.48**2}


def _feet_in_texts(kind: Format, folder: Path) -> None:
    rows = [{"height": "36 ft"}, {"height": "11' 6"}, {"height": "15 m"}]
    assert kind.areas(kind.write(kind.path(folder), BOXES, rows)) == {11: 400, 3.5: 400, 15: 400}


def _uom(key: str) -> Callable[[Format, Path], None]:
    def check(kind: Format, folder: Path) -> None:
        rows = [{key: "100 ft"}, {key: "12 m"}]
        assert kind.areas(kind.write(kind.path(folder), BOXES[:2], rows)) == {30.5: 400, 12: 400}

    return check


def _metres(kind: Format, folder: Path) -> None:
    assert kind.areas(write_town(kind, folder)) == RIGHT


def _insunits(kind: Format, folder: Path) -> None:
    for unit, scale in ((4, 1000.0), (2, 1 / 0.3048), (6, 1.0)):
        assert kind.areas(write_town(kind, folder, unit=unit, scale=scale)) == RIGHT


def _unit_of_band(kind: Format, folder: Path) -> None:
    path = write_town(kind, folder, heights=[10.0, 20.0, 30.0], unit="ft")
    assert kind.areas(path) == {3.0: 400, 6.1: 400, 9.1: 400}


def _height_scale(kind: Format, folder: Path) -> None:
    found = kind.areas(write_town(kind, folder), height_scale=0.5)
    assert found == {high / 2: area for high, area in RIGHT.items()}


# ---------------------------------------------------------------- values that are missing


def _unknown(*values) -> Callable[[Format, Path], None]:
    def check(kind: Format, folder: Path) -> None:
        rows = [{kind.heights: 9.0}, *({kind.heights: value} for value in values)]
        path = kind.write(kind.path(folder), BOXES[: len(rows)], rows)
        assert kind.areas(path) == {9: 400, 6: 400 * len(values)}
        assert kind.areas(path, default_height=4) == {9: 400, 4: 400 * len(values)}

    return check


def _filled(value: float) -> np.ndarray:
    """The heights of the town, and missing pixels of a ``value`` in a corner."""
    heights = w.raster_of(BOXES, [{"height": high} for high in HIGH])[0].copy()
    heights[:10, :10] = value
    return heights


def _declared(kind: Format, folder: Path) -> None:
    path = write_town(kind, folder, values=_filled(-9999), nodata=-9999)
    assert kind.areas(path) == RIGHT


def _option(kind: Format, folder: Path) -> None:
    value = 77 if kind.suffix == ".png" else -9999.0
    path = write_town(kind, folder, values=_filled(value))
    assert kind.areas(path, nodata=value) == RIGHT


def _sidecar(kind: Format, folder: Path) -> None:
    path = write_town(kind, folder, values=_filled(777))
    note = '<PAMRasterBand band="1"><NoDataValue>777</NoDataValue></PAMRasterBand>'
    path.with_name(path.name + ".aux.xml").write_text(f"<PAMDataset>{note}</PAMDataset>")
    assert kind.areas(path) == RIGHT


def _mask(kind: Format, folder: Path) -> None:
    path = write_town(kind, folder, values=_filled(777))
    mask = np.where(_filled(777) == 777, 0, 255).astype(np.uint8)
    w.write_geotiff(folder / "m.tif", BOXES, [{"height": 1}] * 3, values=mask)
    (folder / "m.tif").rename(path.with_name(path.name + ".msk"))
    assert kind.areas(path) == RIGHT


def _alpha(kind: Format, folder: Path) -> None:
    alpha = np.where(_filled(77) == 77, 0, 255).astype(np.uint8)
    assert kind.areas(write_town(kind, folder, values=_filled(77), alpha=alpha)) == RIGHT


# ---------------------------------------------------------------- the table

OPEN = "stay open"
FEET = "of the CRS"
NUMBERS = "0 is unknown"
NULLS = "0 and null are unknown"

#: For each property, the phrases of its cells with their checks.
CHECKS: dict[str, dict[str, Callable[[Format, Path], None]]] = {
    "heights": {
        "columns": _heights("height"),
        "tags `height`": _heights("height"),
        "`building:levels`": _heights("building:levels", 1 / 3),
        "solids": _heights("solid"),
        "`measuredHeight`": _heights("measuredHeight"),
        "`storeysAboveGround`": _heights("storeysAboveGround", 1 / 3),
        "altitudes above ground": _heights("altitude"),
        "`ExtendedData`": _heights("height"),
        "thickness": _heights("thickness"),
        "elevation": _heights("elevation"),
        "elements": _heights("height"),
        "pixels": _pixels,
        "grey levels × `height_scale`": _grey_levels,
    },
    "parts": {
        "every polygon of a feature": _multipolygon,
        "every polygon of a row": _multipolygon,
        "every polygon of a placemark": _multipolygon,
        "every ring of a relation": _multipolygon,
        "collections": _collection,
        "every part of a building": _building_parts,
        "`building:part` replaces the outline": _simple_buildings,
        "every closed polyline": _polylines,
        "one band": _bands,
        "one grid": _one_grid,
        "one array of two axes": _axes,
        "one grey channel": _grey,
    },
    "holes": {OPEN: _holes(3200), "are filled": _holes(3600)},
    "CRS": {
        "WGS84": _degrees(),
        "the member `crs`": _own_system(code=2154),
        "of the layer": _own_system(),
        "of the `.prj`": _own_system(),
        "of the file": _own_system(),
        "of the column": _own_system(),
        "`referenceSystem`": _own_system(),
        "`srsName`": _own_system(),
        "without it no location": _no_place(code=None),
        "no location": _no_place(),
        "`.prj` or `.aux.xml`": _asc_system,
    },
    "units": {
        "metres": _metres,
        FEET: _feet_of_system,
        "texts such as `36 ft`": _feet_in_texts,
        "`uom`": _uom("height"),
        "`uom` of `measuredHeight`": _uom("measuredHeight"),
        "`$INSUNITS`": _insunits,
        "of the band": _unit_of_band,
        "`height_scale`": _height_scale,
    },
    "nodata": {
        NULLS: _unknown(0.0, None),
        NUMBERS: _unknown(0.0),
        "declared": _declared,
        "`.aux.xml`": _sidecar,
        "`.msk`": _mask,
        "`nodata`": _option,
        "alpha": _alpha,
    },
}


def _cells(*cells: str) -> dict[str, tuple[str, ...]]:
    return {name: tuple(cell.split("; ")) for name, cell in zip(COLUMNS, cells, strict=True)}


_FEATURES = "every polygon of a feature; collections"
_LAYER = (_FEATURES, OPEN, "of the layer", f"{FEET}; texts such as `36 ft`", NULLS)
_ROWS = ("every polygon of a row", *_LAYER[1:])
_TEXTS = "metres; texts such as `36 ft`"
_OSM = ("tags `height`; `building:levels`",)
_OSM += ("every ring of a relation; `building:part` replaces the outline", OPEN, "WGS84", _TEXTS)
_OSM += (NUMBERS,)
_CITY = ("solids; `measuredHeight`; `storeysAboveGround`", "every part of a building", OPEN)
_RASTER = ("one band", OPEN)

#: The rows of the table.
FORMATS = [
    Format(
        "GeoJSON",
        ".geojson",
        w.write_geojson,
        _cells(
            "columns", _FEATURES, OPEN, "WGS84; the member `crs`",
            f"{FEET}; texts such as `36 ft`", NULLS,
        ),
        options=FOOTPRINTS,
    ),
    Format(
        "GeoJSONSeq",
        ".geojsonl",
        w.write_sequence,
        _cells("columns", _FEATURES, OPEN, "WGS84", _TEXTS, NULLS),
        options=FOOTPRINTS,
    ),
    Format(
        "CityJSON",
        ".city.json",
        w.write_cityjson,
        _cells(*_CITY, "`referenceSystem`; without it no location", FEET, NUMBERS),
        "solid",
        FOOTPRINTS,
    ),
    Format(
        "CityJSONSeq",
        ".city.jsonl",
        w.write_cityjson_lines,
        _cells(*_CITY, "`referenceSystem`; without it no location", FEET, NUMBERS),
        "solid",
        FOOTPRINTS,
    ),
    Format(
        "GeoPackage", ".gpkg", w.write_layer, _cells("columns; solids", *_LAYER), options=FOOTPRINTS
    ),
    Format(
        "Shapefile",
        ".shp",
        w.write_layer,
        _cells("columns", _ROWS[0], OPEN, "of the `.prj`", *_ROWS[3:]),
        options=FOOTPRINTS,
    ),
    Format(
        "zip of a Shapefile",
        ".zip",
        w.write_zip,
        _cells("columns", _ROWS[0], OPEN, "of the `.prj`", *_ROWS[3:]),
        options=FOOTPRINTS,
    ),
    Format(
        "FlatGeobuf", ".fgb", w.write_layer, _cells("columns", *_LAYER), options=FOOTPRINTS
    ),
    Format("File GDB", ".gdb", w.write_layer, _cells("columns", *_ROWS), options=FOOTPRINTS),
    Format(
        "GeoParquet",
        ".parquet",
        w.write_geoparquet,
        _cells("columns; solids", _FEATURES, OPEN, "of the column", *_LAYER[3:]),
        options=FOOTPRINTS,
    ),
    Format(
        "CityGML",
        ".gml",
        w.write_citygml,
        _cells(
            *_CITY, "`srsName`; without it no location", f"{FEET}; `uom` of `measuredHeight`",
            NUMBERS,
        ),
        "solid",
        FOOTPRINTS,
    ),
    Format(
        "GML",
        ".gml",
        w.write_gml,
        _cells(
            "elements", "every polygon of a feature", OPEN, "`srsName`; without it no location",
            f"{FEET}; `uom`", NUMBERS,
        ),
        options=FOOTPRINTS,
    ),
    Format(
        "KML",
        ".kml",
        w.write_kml,
        _cells(
            "altitudes above ground; `ExtendedData`", "every polygon of a placemark", OPEN,
            "WGS84", _TEXTS, NULLS,
        ),
        "altitude",
        FOOTPRINTS,
    ),
    Format(
        "DXF",
        ".dxf",
        w.write_dxf,
        _cells(
            "thickness; elevation", "every closed polyline", "are filled", "no location",
            "`$INSUNITS`", NUMBERS,
        ),
        "thickness",
        FOOTPRINTS,
    ),
    Format("OpenStreetMap XML", ".osm", w.write_osm, _cells(*_OSM), options=FOOTPRINTS),
    Format("OpenStreetMap PBF", ".osm.pbf", w.write_osm, _cells(*_OSM), options=FOOTPRINTS),
    Format("Overpass XML", ".osm", w.write_overpass, _cells(*_OSM), options=FOOTPRINTS),
    Format("Overpass JSON", ".json", w.write_overpass, _cells(*_OSM), options=FOOTPRINTS),
    Format(
        "GeoTIFF",
        ".tif",
        w.write_geotiff,
        _cells(
            "pixels", *_RASTER, "of the file", f"of the band; {FEET}; `height_scale`",
            "declared; `.aux.xml`; `.msk`; `nodata`",
        ),
    ),
    Format(
        "ESRI ASCII grid",
        ".asc",
        w.write_asc,
        _cells(
            "pixels", "one grid", OPEN, "`.prj` or `.aux.xml`", "metres; `height_scale`",
            "declared; `.aux.xml`; `nodata`",
        ),
    ),
    Format(
        "PNG",
        ".png",
        w.write_png,
        _cells(
            "grey levels × `height_scale`", "one grey channel", OPEN, "no location",
            "`height_scale`", "alpha; `nodata`",
        ),
        options={"metres_per_pixel": 1.0, "height_scale": 1.0},
    ),
    Format(
        "NPY",
        ".npy",
        w.write_npy,
        _cells(
            "pixels", "one array of two axes", OPEN, "no location", "metres; `height_scale`",
            "`nodata`",
        ),
        options={"metres_per_pixel": 1.0},
    ),
]  # fmt: skip

#: The parameters of the test: format, property and phrase.
CELLS = [
    pytest.param(kind, column, phrase, id=f"{kind.title}-{column}-{phrase}")
    for kind in FORMATS
    for column in COLUMNS
    for phrase in kind.cells[column]
]


def table() -> str:
    """The table in Markdown. Formats with the same cells, one after the other, share a row."""
    lines = [f"| format | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    titles = {
        kind.title: tuple("; ".join(kind.cells[column]) for column in COLUMNS) for kind in FORMATS
    }
    for cells, group in groupby(titles, titles.__getitem__):
        lines.append(f"| {', '.join(group)} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
