"""Where on Earth, in metres: reference systems and the way between them."""

import math
import re
import warnings
from functools import lru_cache

import numpy as np
import shapely
from pyproj import CRS, Transformer
from pyproj.crs import ProjectedCRS
from pyproj.crs.coordinate_operation import TransverseMercatorConversion
from pyproj.exceptions import ProjError

from evocity.errors import MapError

#: Longitude and latitude, degrees.
WGS84 = CRS.from_epsg(4326)

#: A projection is true to scale if its lengths are right within this share.
SCALE_TOLERANCE = 0.005


def local_metres(lon: float, lat: float) -> CRS:
    """The transverse Mercator projection with its origin at a place and scale 1 there."""
    return ProjectedCRS(
        TransverseMercatorConversion(
            latitude_natural_origin=lat,
            longitude_natural_origin=lon,
            scale_factor_natural_origin=1,
        ),
        name=f"transverse Mercator at {lon:.7g}, {lat:.7g}",
    )


def plane() -> CRS:
    """Metres that lie nowhere on Earth, x to the east and y to the north."""
    return CRS.from_wkt('LOCAL_CS["plane",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]')


def crs_named(text: object, where: str) -> CRS:
    """The reference system a stranger's file names, made two-dimensional.

    Only codes (``EPSG:2154``, OGC names and addresses) and plain PROJ strings are read: a
    PROJ string may name files.
    """
    try:
        if not isinstance(text, str):
            raise ProjError("no text")
        if match := re.fullmatch(r"https?://www\.opengis\.net/def/crs/(\w+)/[\w.]*/(\w+)", text):
            text = f"{match[1]}:{match[2]}"
        if not re.fullmatch(r"[A-Za-z]+:[\w.:]+|\+proj=[\w\s+=.,-]+", text):
            raise ProjError("neither a code nor a plain PROJ string")
        return flat(CRS.from_user_input(text))
    except ProjError as error:
        raise MapError(
            f"{where}: reference system {str(text)[:80]!r}",
            "a code PROJ knows, such as EPSG:2154, or no entry at all (longitude, latitude)",
            "correct it, or convert the file with ogr2ogr -t_srs EPSG:4326",
        ) from error


def flat(crs: CRS) -> CRS:
    """The horizontal part of a reference system."""
    return flat(crs.sub_crs_list[0]) if crs.is_compound else crs.to_2d()


def code_of(crs: CRS) -> str:
    """The authority code a reference system bears, or its WKT where it has none."""
    told = crs.to_json_dict().get("id")
    return f"{told['authority']}:{told['code']}" if told else crs.to_wkt()


def plainly(crs: CRS) -> str | None:
    """The code or plain PROJ string by which `crs_named` finds a reference system in metres again;
    None if it has none."""
    told = code_of(crs)
    if told.startswith("PROJCRS"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a PROJ string may tell less
            told = crs.to_proj4().removesuffix(" +type=crs")
    try:
        return told if is_metric(crs_named(told, "plainly")) else None
    except MapError:
        return None


def is_metric(crs: CRS) -> bool:
    """Whether x and y are lengths in metres (not whether the lengths are true)."""
    return crs.is_projected and all(
        math.isclose(axis.unit_conversion_factor, 1.0) for axis in crs.axis_info[:2]
    )


def is_true_to_scale(crs: CRS, lon: float, lat: float) -> bool:
    """Whether lengths are right within `SCALE_TOLERANCE` at a place, along x and along y.

    EPSG:3857 is nowhere; UTM and national grids are. Measured along geodesics, 100 m a side.
    """
    x, y = moved(lon, lat, WGS84, crs)
    if not (math.isfinite(x) and math.isfinite(y)):
        return False
    lons, lats = moved([x, x + 100, x], [y, y, y + 100], crs, WGS84)
    if not np.isfinite([lons, lats]).all():
        return False
    _, _, lengths = WGS84.get_geod().inv([lons[0]] * 2, [lats[0]] * 2, lons[1:], lats[1:])
    return bool(np.abs(np.array(lengths) / 100 - 1).max() <= SCALE_TOLERANCE)


def moved(x, y, source: CRS, target: CRS):
    """Coordinates (x, y) of ``source`` in ``target``; infinite where there is no way."""
    return _transformer(source, target).transform(x, y)


def moved_polygons(polygons: np.ndarray, source: CRS, target: CRS) -> np.ndarray:
    """``polygons`` of ``source`` in ``target``."""
    transformer = _transformer(source, target)
    return shapely.transform(
        polygons, lambda points: np.column_stack(transformer.transform(*points.T))
    )


@lru_cache(maxsize=16)  # making one takes longer than most uses of it
def _transformer(source: CRS, target: CRS) -> Transformer:
    return Transformer.from_crs(source, target, always_xy=True)


__all__ = [
    "SCALE_TOLERANCE",
    "WGS84",
    "code_of",
    "crs_named",
    "flat",
    "is_metric",
    "is_true_to_scale",
    "local_metres",
    "moved",
    "moved_polygons",
    "plainly",
    "plane",
]
