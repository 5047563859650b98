"""Coordinate reference systems: parsing, local projections in metres, and transformation."""

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

#: Footprints keep a projection whose lengths in the window are right within this share.
KEPT_TOLERANCE = 0.001


def local_metres(lon: float, lat: float) -> CRS:
    """Make the transverse Mercator projection with its origin at a place and scale 1 there."""
    return ProjectedCRS(
        TransverseMercatorConversion(
            latitude_natural_origin=lat,
            longitude_natural_origin=lon,
            scale_factor_natural_origin=1,
        ),
        name=f"transverse Mercator at {lon:.7g}, {lat:.7g}",
    )


def plane() -> CRS:
    """Make a system of metres without a place on Earth, x to the east and y to the north."""
    return CRS.from_wkt('LOCAL_CS["plane",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]')


def parse_crs(text: object, where: str) -> CRS:
    """Parse the reference system that a file names, made two-dimensional; see `parse_whole_crs`."""
    return flat(parse_whole_crs(text, where))


def parse_whole_crs(text: object, where: str) -> CRS:
    """Parse the reference system that a file names: codes (``EPSG:2154``, OGC names and addresses)
    and plain PROJ strings only, since other PROJ strings may name files."""
    try:
        if not isinstance(text, str):
            raise ProjError("not a text")
        if match := re.fullmatch(r"https?://www\.opengis\.net/def/crs/(\w+)/[\w.]*/(\w+)", text):
            text = f"{match[1]}:{match[2]}"
        if not re.fullmatch(r"[A-Za-z]+:[\w.:]+|\+proj=[\w\s+=.,-]+", text):
            raise ProjError("neither a code nor a plain PROJ string")
        crs = CRS.from_user_input(text)
        flat(crs)  # which may fail
        return crs
    except ProjError as error:
        raise MapError(
            f"{where}: the reference system {str(text)[:80]!r} is unknown",
            "a code that PROJ knows, for example EPSG:2154; or no entry if the coordinates are "
            "longitude and latitude",
            "correct the entry, or convert the file with ogr2ogr -t_srs EPSG:4326",
        ) from error


def flat(crs: CRS) -> CRS:
    """Return the horizontal part of a reference system."""
    return flat(crs.sub_crs_list[0]) if crs.is_compound else crs.to_2d()


def identify(crs: CRS) -> CRS:
    """Return a projected reference system under the EPSG code that PROJ finds for its parameters,
    as programs may write a system without its code; ``crs`` itself if PROJ finds no code."""
    if not crs.is_projected or "id" in crs.to_json_dict():
        return crs
    code = crs.to_epsg()  # of the same parameters, with the same or another name
    return crs if code is None else CRS.from_epsg(code)


def code_of(crs: CRS) -> str:
    """Return the authority code of a reference system, or its WKT if it has no code."""
    code = crs.to_json_dict().get("id")
    return f"{code['authority']}:{code['code']}" if code else crs.to_wkt()


def portable_code(crs: CRS) -> str | None:
    """Return the code or plain PROJ string from which `parse_crs` makes a metric reference system
    again; None if it has none."""
    text = code_of(crs)
    if text.startswith("PROJCRS"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a PROJ string may lose details
            text = crs.to_proj4().removesuffix(" +type=crs")
    try:
        return text if is_metric(parse_crs(text, "portable_code")) else None
    except MapError:
        return None


def is_metric(crs: CRS) -> bool:
    """Tell whether x and y are lengths in metres (not whether the lengths are true)."""
    return crs.is_projected and all(
        math.isclose(axis.unit_conversion_factor, 1.0) for axis in crs.axis_info[:2]
    )


def is_true_to_scale(crs: CRS, lon: float, lat: float, tolerance: float = SCALE_TOLERANCE) -> bool:
    """Tell whether lengths are right within a ``tolerance`` at a place, along x and along y, by
    geodesics of 100 m. EPSG:3857 is wrong everywhere; UTM and national grids are right."""
    return scale_error(crs, lon, lat) <= tolerance


def scale_error(crs: CRS, lon: float, lat: float) -> float:
    """Measure by which share lengths of 100 m are wrong at a place, the worse of x and y; infinite
    beyond the range of the projection."""
    return max(abs(length - 1) for length in true_lengths(crs, lon, lat))


def true_lengths(crs: CRS, lon: float, lat: float) -> tuple[float, float]:
    """Return the true lengths of a metre of x and of a metre of y at a place, metres; infinite
    beyond the range of the projection."""
    x, y = transform_points(lon, lat, WGS84, crs)
    if not (math.isfinite(x) and math.isfinite(y)):
        return math.inf, math.inf
    lons, lats = transform_points([x, x + 100, x], [y, y, y + 100], crs, WGS84)
    if not np.isfinite([lons, lats]).all():
        return math.inf, math.inf
    _, _, lengths = WGS84.get_geod().inv([lons[0]] * 2, [lats[0]] * 2, lons[1:], lats[1:])
    return lengths[0] / 100, lengths[1] / 100


def can_keep(crs: CRS, lon: float, lat: float, side: float) -> bool:
    """Tell whether a window of ``side`` metres about a place can keep a reference system: it has
    metres, x to the east and y to the north, a code or a plain PROJ string, and lengths right
    within `KEPT_TOLERANCE` in all of the window."""
    if not is_metric(crs) or {axis.direction for axis in crs.axis_info[:2]} != {"east", "north"}:
        return False
    if portable_code(crs) is None:
        return False
    x, y = transform_points(lon, lat, WGS84, crs)
    if not (math.isfinite(x) and math.isfinite(y)):
        return False
    steps = np.array([-0.5, 0, 0.5]) * side
    places = transform_points(
        *(axis.ravel() for axis in np.meshgrid(x + steps, y + steps)), crs, WGS84
    )
    return all(is_true_to_scale(crs, *place, KEPT_TOLERANCE) for place in zip(*places, strict=True))


def vertical_unit(crs: CRS) -> float:
    """Return the metres of a unit of height in a reference system: of its vertical axis; without
    one that of its horizontal axes; 1 for degrees."""
    for part in reversed(crs.sub_crs_list if crs.is_compound else [crs]):
        if part.is_bound:
            part = part.source_crs
        axes = part.axis_info
        upwards = [axis for axis in axes if axis.direction in ("up", "down")]
        if upwards or part.is_projected:
            return float((upwards or axes)[0].unit_conversion_factor)
    return 1.0


def transform_points(x, y, source: CRS, target: CRS):
    """Convert coordinates (x, y) of ``source`` to ``target``; infinite where that is impossible."""
    return _transformer(source, target).transform(x, y)


def transform_polygons(polygons: np.ndarray, source: CRS, target: CRS) -> np.ndarray:
    """Convert ``polygons`` of ``source`` to ``target``."""
    if source == target:
        return polygons
    transformer = _transformer(source, target)
    return shapely.transform(
        polygons, lambda points: np.column_stack(transformer.transform(*points.T))
    )


@lru_cache(maxsize=16)  # making one takes longer than most uses of it
def _transformer(source: CRS, target: CRS) -> Transformer:
    return Transformer.from_crs(source, target, always_xy=True)
