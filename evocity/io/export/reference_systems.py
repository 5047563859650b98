"""Reference systems of exported files: checks of a requested one, and the names of those without a
code."""

import json
import math
import re
import warnings
from functools import lru_cache

import numpy as np
from pyproj import CRS

from evocity.errors import MapError, keyword
from evocity.io.projection import (
    WGS84,
    code_of,
    is_metric,
    parse_crs,
    transform_points,
)
from evocity.io.rasterization import crs_of

#: The system of files of a map without a place on Earth: metres from its south-west corner. QGIS
#: compares texts, so this is the text that GDAL reads from a GeoTIFF: its datum has no name.
LOCAL = (
    'ENGCRS["Metres from the south-west corner",EDATUM[""],CS[Cartesian,2],'
    'AXIS["(E)",east,ORDER[1],LENGTHUNIT["metre",1,ID["EPSG",9001]]],'
    'AXIS["(N)",north,ORDER[2],LENGTHUNIT["metre",1,ID["EPSG",9001]]]]'
)
#: The datum that PROJ gives to a projection of the ellipsoid of WGS 84.
_UNNAMED_DATUM = "Unknown based on WGS 84 ellipsoid"
# Degrees beyond the border of an area of use that still belong to it: a map on the border of two
# zones fits both.
_SLACK = 0.5


def export_system(city, text: str | None, *, metres: bool) -> CRS | None:
    """Return the reference system ``text`` for a file with the map ``city``; None without a text.

    city : a `CityMap`, or another map with ``crs``, ``origin``, ``shape`` and ``metres_per_pixel``.
    text : a code such as ``EPSG:2154``, or a plain PROJ string.
    metres : whether the format needs metres, as formats with heights in space do.

    Raises `MapError` for an unknown ``text``, for a map without a place on Earth, for degrees or
    feet where the format needs metres, and where the system is not defined.
    """
    if text is None:
        return None
    check_placed(city, text)
    target = parse_requested(text)
    if metres and not is_metric(target):
        unit = "degrees" if target.is_geographic else target.axis_info[0].unit_name
        raise _unfit(text, f"has {unit}", "a reference system in metres, as this format needs")
    _check_area(city, target, text)
    return target


def check_placed(city, text: str | None) -> None:
    """Raise `MapError` for a system ``text`` of a map or genome ``city`` without a place."""
    if text is not None and (city.crs is None or city.origin is None):
        name = getattr(city, "name", None) or "the map"
        raise MapError(
            f"{name} has no place on Earth, so it cannot be converted to {str(text)[:80]}",
            "a map with a reference system and an origin",
            f"give a child the place of a source city with {keyword('at')}, or leave "
            f"{keyword('crs')} out",
        )


def parse_requested(text: str) -> CRS:
    """Parse the reference system that a user requests. Raises `MapError` for an unknown one, and
    for one that is not of longitude and latitude or of a plane."""
    try:
        target = parse_crs(text, "crs")
    except MapError as error:
        raise MapError(
            f"the reference system {str(text)[:80]!r} is unknown",
            "a code that PROJ knows, for example EPSG:2154, or a plain PROJ string",
            "look the code up at https://epsg.io",
        ) from error
    if not (target.is_projected or target.is_geographic):
        raise _unfit(text, f"is {target.type_name.lower()}", "longitude and latitude, or a plane")
    return target


def corners(city) -> np.ndarray:
    """Return the corners and the middle of a map in its reference system, float64 ``(5, 2)``."""
    (rows, columns), side = city.shape, city.metres_per_pixel
    left, top = city.origin
    right, low = left + columns * side, top - rows * side
    middle = [(left + right) / 2, (top + low) / 2]
    return np.array([[left, top], [right, top], [right, low], [left, low], middle])


def _check_area(city, target: CRS, text: str) -> None:
    own, points = crs_of(city, city.name), corners(city)
    x, y = points.T
    lon, lat = transform_points(x, y, own, WGS84)
    placed = np.column_stack(transform_points(x, y, own, target))
    back = np.column_stack(transform_points(placed[:, 0], placed[:, 1], target, own))
    inside = np.isfinite(placed).all() and np.allclose(back, points, rtol=0, atol=0.01)
    area = target.area_of_use
    if inside and area is not None:
        wide = area.east - area.west if area.east >= area.west else area.east + 360 - area.west
        inside = bool(
            ((lon - area.west + _SLACK) % 360 <= wide + 2 * _SLACK).all()
            and (lat >= area.south - _SLACK).all()
            and (lat <= area.north + _SLACK).all()
        )
    if not inside:
        where = "" if area is None else f", which covers {area.name[:60].rstrip('. ')}"
        raise MapError(
            f"{city.name} lies at {lon[-1]:.4f} {lat[-1]:.4f}, outside the area of {text}{where}",
            "a reference system that is defined where the map lies",
            f"use for example {keyword('crs', utm_code(float(lon[-1]), float(lat[-1])))}",
        )


def utm_code(lon: float, lat: float) -> str:
    """Return the EPSG code of the UTM zone of a place, degrees; WGS 84 beyond 84° of latitude."""
    if not (math.isfinite(lon) and abs(lat) <= 84):
        return "EPSG:4326"
    return f"EPSG:{(32600 if lat >= 0 else 32700) + int((lon + 180) // 6) % 60 + 1}"


def _unfit(text: str, found: str, expected: str) -> MapError:
    return MapError(
        f"{keyword('crs', text)} {found}",
        expected,
        "use for example the UTM zone of the map or its national grid, such as EPSG:2154",
    )


def is_code(text: str) -> bool:
    """Tell whether ``text`` is a code such as ``EPSG:2154``."""
    return re.fullmatch(r"\w+:\w+", text) is not None


@lru_cache(maxsize=16)
def file_system(text: str) -> str:
    """Return the text of a reference system for a file: a code; else WKT with a name, on WGS 84 if
    PROJ calls its datum unknown."""
    crs = CRS.from_user_input(text)
    if not (code := code_of(crs)).startswith("PROJCRS"):
        return code
    about = crs.to_json_dict()
    base, conversion = about.get("base_crs", {}), about.get("conversion", {})
    datum = base.get("datum") or base.get("datum_ensemble") or {}
    if datum.get("name") == _UNNAMED_DATUM:
        about["base_crs"] = CRS.from_epsg(32631).to_json_dict()["base_crs"]
    method = conversion.get("method", {}).get("name", "unnamed")
    conversion["name"] = method
    if about["name"] in ("unknown", "unnamed", ""):
        about["name"] = _describe(method, conversion.get("parameters", []))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return CRS.from_json(json.dumps(about)).to_wkt()


def _describe(method: str, parameters: list[dict]) -> str:
    values = {one["name"]: one["value"] for one in parameters}
    place = [values.get(f"{axis} of natural origin") for axis in ("Longitude", "Latitude")]
    if not all(isinstance(one, int | float) for one in place):
        return method
    return f"{method[:1].lower()}{method[1:]} at {place[0]:.7g}, {place[1]:.7g}"


@lru_cache(maxsize=16)
def geotiff_text(text: str) -> str:
    """Return the WKT that GDAL reads from a GeoTIFF with the system ``text``.

    QGIS compares systems without a code as texts. So a GeoPackage has the text of the GeoTIFF.
    """
    from rasterio.io import MemoryFile

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the file lies nowhere
        with MemoryFile() as memory:
            layout = {"driver": "GTiff", "height": 1, "width": 1, "count": 1, "dtype": "uint8"}
            with memory.open(crs=text, **layout):
                pass
            with memory.open() as file:
                wkt = file.crs.to_wkt(version="WKT2_2019")
    # rasterio loses the conversion's name, and GDAL gives it the name of its method
    return re.sub(r'CONVERSION\["[^"]*",METHOD\[("[^"]*")', r"CONVERSION[\1,METHOD[\1", wkt)
