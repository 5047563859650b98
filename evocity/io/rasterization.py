"""Rasterization of footprints to a `CityMap`: window, projection, heights, pixels."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import ProjError
from rasterio.features import rasterize

from evocity.citymap import CityMap
from evocity.errors import MapError, keyword
from evocity.io.account import OUTSIDE, Account
from evocity.io.building_choice import choose_buildings
from evocity.io.heights import RULES, HeightRules, check_requested
from evocity.io.polygon_repair import geometry_errors, repair_polygons
from evocity.io.projection import (
    KEPT_TOLERANCE,
    WGS84,
    can_keep,
    code_of,
    is_metric,
    is_true_to_scale,
    local_metres,
    scale_error,
    transform_points,
    transform_polygons,
    true_lengths,
)
from evocity.io.reader_types import Footprints, Request, check_size, north_up, refuse_center
from evocity.io.roof_shapes import roof_shapes_of

#: Defaults of a map of footprints.
PIXELS, METRES_PER_PIXEL = 256, 2.0
# The search for a fuller window takes so many steps a side; it has so many more buildings.
_STEPS, _FEW = 4, 20


def rasterize_footprints(footprints: Footprints, request: Request, name: str) -> CityMap:
    """Rasterize the square window of ``request`` as a map of heights: a pixel has the height of the
    footprint at its centre, the highest of several, 0 without one. ``height_rules`` counts the
    buildings that meet the window. A file that names its own window and has nothing in it gives an
    empty map."""
    pixels = request.pixels or PIXELS
    side = request.metres_per_pixel or METRES_PER_PIXEL
    check_size(name, pixels, pixels)
    with geometry_errors(name):
        return _rasterize_window(footprints, request, name, pixels, side)


def _rasterize_window(
    footprints: Footprints, request: Request, name: str, pixels: int, side: float
) -> CityMap:
    or_none = footprints.bare and request.center is None
    polygons, tags, account = choose_buildings(footprints, name, or_none)
    rules = _height_rules(footprints, request, name)
    strayed = ""
    if footprints.crs.is_engineering:
        crs, named, (x, y) = None, None, local_center(polygons, footprints, request, name)
    else:
        places = _places(polygons, footprints, name) if tags else None
        named = request.center or footprints.center
        center = named or places.middle
        crs, strayed = _choose_projection(footprints, center, pixels * side)
        x, y = transform_points(*center, WGS84, crs)
        polygons = transform_polygons(polygons, footprints.crs, crs)
    half = pixels * side / 2
    window = shapely.box(x - half, y - half, x + half, y + half)
    whole, count = shapely.total_bounds(polygons) if tags else np.zeros(4), len(tags)
    middles = shapely.centroid(polygons)
    polygons, tags = _within_window(polygons, tags, window)
    if count and not tags:
        if crs is None:
            raise _nothing_about(name, (x, y), 2 * half)
        raise _nothing_there(name, center, 2 * half, places, account)
    heights = np.array([rules.apply(each) for each in tags])
    painted = np.zeros((pixels, pixels), np.float32)
    if count:
        painted = _paint(polygons, heights, painted.shape, side, (x - half, y + half))
    roofs = None if crs is None else roof_shapes_of(polygons, tags)
    return CityMap(
        painted,
        side,
        name=name,
        attribution=footprints.attribution,
        origin=None if crs is None else (x - half, y + half),
        crs=None if crs is None else code_of(crs),
        height_rules={rule: rules.used[rule] for rule in RULES if rule in rules.used},
        taken=_describe_window(pixels, side, len(tags), count, whole, footprints.side, account)
        + (f"; heights: {rules.note}" if rules.note else "")
        + ("" if roofs is None else f"; roofs: {len(roofs)} from roof:shape")
        + strayed
        + (_suggest_window(middles, crs, 2 * half, len(tags)) if crs and not named else "")
        + footprints.note,
        roof_shapes=roofs,
    )


def _choose_projection(
    footprints: Footprints, center: tuple[float, float], side: float
) -> tuple[CRS, str]:
    """Choose the projection of a window of ``side`` metres: the one that the file names for its
    window, the file's own, or a local one. Also return a note if the file's own is too far from
    true lengths."""
    named, own = footprints.projection, footprints.crs
    if named is not None and is_true_to_scale(named, *center):
        return named, ""
    if can_keep(own, *center, side):
        return own, ""
    if not own.is_projected:
        return local_metres(*center), ""
    note = f"; the map has a transverse Mercator projection about its centre, and not {own.name}"
    error = scale_error(own, *center)
    if is_metric(own) and KEPT_TOLERANCE < error < math.inf:
        lengths = true_lengths(own, *center)
        worse = max(lengths, key=lambda length: abs(length - 1))
        note += f", in which a length of 100 m has {100 / worse:.2f} m here"
    return local_metres(*center), note


def _height_rules(footprints: Footprints, request: Request, name: str) -> HeightRules:
    """Make the rules for heights of a request. Raises `MapError` if a column is missing."""
    for option in ("height_column", "levels_column"):
        column = getattr(request, option)
        if column is not None and len(footprints.tags):
            columns = set().union(*footprints.tags)
            check_requested(name, columns, option, column)
    return HeightRules(
        request.default_height,
        request.height_column,
        request.levels_column,
        footprints.height_unit,
    )


def _describe_window(
    pixels: int,
    side: float,
    inside: int,
    count: int,
    whole: np.ndarray,
    named: float | None,
    account: Account,
) -> str:
    """Describe a window of ``pixels`` of ``side`` metres, which meets ``inside`` of ``count``
    buildings with the bounds ``whole``; the file names a window of ``named`` metres. The
    ``account`` of the file's features is added if some of them are no buildings."""
    metres, wide, tall = pixels * side, whole[2] - whole[0], whole[3] - whole[1]
    text = f"a window of {metres:g} × {metres:g} m, with {inside}"
    if account.dropped[OUTSIDE]:
        text += " buildings"
    else:
        text += f" of the file's {count} buildings"
        if count:
            text += f", which extend over {wide:.0f} × {tall:.0f} m"
    if account.note:
        text += (
            f"; buildings: {account.buildings} of the file's {account.features} features; "
            f"left out: {account.note}"
        )
    if account.remarks:
        told = ", ".join(f"{number} {remark}" for remark, number in account.remarks.items())
        text += f"; kept: {told}"
    if named is not None and not math.isclose(named, metres, rel_tol=1e-6):
        text += f"; the file names a window of {named:g} × {named:g} m"
    return text


def _suggest_window(middles: np.ndarray, crs: CRS, metres: float, inside: int) -> str:
    """Describe a window of ``metres`` a side that meets far more buildings, with these ``middles``
    in ``crs``, than the ``inside`` of the chosen window; "" if no window does."""
    x, y = shapely.get_x(middles), shapely.get_y(middles)
    there = np.isfinite(x) & np.isfinite(y)
    if not there.any():
        return ""
    # each building counts for all windows of _STEPS² steps that contain its step
    step = metres / _STEPS
    column, row = (np.floor(axis[there] / step).astype(np.int64) for axis in (x, y))
    left, low = column.min() - _STEPS, row.min() - _STEPS
    wide = row.max() - low + 1
    steps, counts = np.unique((column - left) * wide + row - low, return_counts=True)
    back = np.add.outer(np.arange(_STEPS) * wide, np.arange(_STEPS)).ravel()
    corners, window = np.unique(np.subtract.outer(steps, back).ravel(), return_inverse=True)
    held = np.bincount(window, np.repeat(counts, len(back)))
    best = int(held.argmax())
    if held[best] < max(2 * inside, inside + _FEW):
        return ""
    corner = np.array([corners[best] // wide + left, corners[best] % wide + low])
    lon, lat = transform_points(*((corner + _STEPS / 2) * step), crs, WGS84)
    return f"; a window about the centre {lon:.5f} {lat:.5f} has {held[best]:.0f}"


def rasterize_onto(
    city: CityMap, footprints: Footprints, name: str, default_height: float = 6.0
) -> np.ndarray:
    """Rasterize all polygons of ``footprints`` on the grid of ``city``: float32 ``(H, W)``, metres
    as in `rasterize_footprints`, NaN outside polygons. Raises `MapError` if the city has no place
    on Earth, or no pixel in a polygon."""
    crs = crs_of(city, name)
    if footprints.crs.is_engineering:
        raise MapError(
            f"{name} has no coordinate reference system, but the map {city.name} has one",
            "footprints with a coordinate reference system",
            "assign a reference system to the footprints, for example with ogr2ogr -a_srs EPSG:…",
        )
    _check_polygons(footprints.polygons, f"{name} has no polygon")
    with geometry_errors(name):
        return _rasterize_onto(city, crs, footprints, name, default_height)


def _rasterize_onto(
    city: CityMap, crs: CRS, footprints: Footprints, name: str, default_height: float
) -> np.ndarray:
    places = _places(footprints.polygons, footprints, name)
    (rows, columns), side, (left, top) = city.shape, city.metres_per_pixel, city.origin
    window = shapely.box(left, top - rows * side, left + columns * side, top)
    polygons, tags = _within_window(
        transform_polygons(footprints.polygons, footprints.crs, crs), footprints.tags, window
    )
    rules = HeightRules(default_height, unit=footprints.height_unit)
    heights = np.array([rules.apply(each) for each in tags])
    painted = np.full(city.shape, np.nan, np.float32)
    if tags:
        painted = _paint(polygons, heights, city.shape, side, (left, top), np.nan)
    if np.isnan(painted).all():
        west, south, east, north = places.bounds
        lon, lat = transform_points(left + columns * side / 2, top - rows * side / 2, crs, WGS84)
        raise MapError(
            f"{name}: the footprints ({len(footprints.polygons)} in all) cover no pixel of "
            f"{city.name}",
            f"footprints within {columns * side:g} × {rows * side:g} m around longitude {lon:.5f}, "
            f"latitude {lat:.5f}; the file's footprints lie from longitude {west:.5f} to "
            f"{east:.5f} and latitude {south:.5f} to {north:.5f}",
            "draw the footprints on this map, or choose a window around them",
        )
    return painted


def crs_of(city: CityMap, name: str) -> CRS:
    """Return the reference system of a city's grid; raises `MapError` for a city without a place on
    Earth, on which ``name`` cannot lie."""
    if city.crs is None or city.origin is None:
        raise MapError(
            f"{city.name} has no position in a coordinate reference system, but {name} needs a "
            "position",
            "a map with a reference system and an origin, or a raster of the map's own pixels",
            "give a raster of the whole map, without a reference system, instead",
        )
    try:
        return CRS.from_user_input(city.crs)
    except ProjError as error:
        raise MapError(
            f"{city.name}: the reference system {city.crs[:80]!r} is unknown",
            "a code that PROJ knows, or WKT",
            "read the map from a file with a valid reference system",
        ) from error


def _check_polygons(polygons: np.ndarray, found: str) -> None:
    """Raise `MapError` with the text ``found`` if all ``polygons`` are empty."""
    if not len(polygons) or shapely.is_empty(polygons).all():
        expected = "polygons of building footprints"
        raise MapError(found, expected, "check that the right file or layer was exported")


class _Places:
    """Bounds of buildings: ``boxes`` is float64 ``(n, 4)`` in degrees."""

    def __init__(self, boxes: np.ndarray):
        self.boxes = boxes
        west, south = np.nanmin(boxes[:, :2], axis=0)
        east, north = np.nanmax(boxes[:, 2:], axis=0)
        self.bounds = tuple(float(edge) for edge in (west, south, east, north))

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of the buildings' bounds, without outliers that would push the window off the
        town: boxes further than 1.5 interquartile ranges beyond the quartiles (Tukey's fence).
        """
        low, high = np.nanquantile(self.boxes, (0.25, 0.75), axis=0)
        fence = 1.5 * (high - low)
        near = ((self.boxes >= low - fence) & (self.boxes <= high + fence)).all(axis=1)
        kept = self.boxes[near] if near.any() else self.boxes
        lon, lat = (np.nanmin(kept[:, :2], axis=0) + np.nanmax(kept[:, 2:], axis=0)) / 2
        return round(float(lon), 7), round(float(lat), 7)

    @property
    def dense(self) -> tuple[float, float]:
        """The building nearest to the median of all."""
        centers = (self.boxes[:, :2] + self.boxes[:, 2:]) / 2
        centers = centers[~np.isnan(centers).any(axis=1)]
        distances = np.abs(centers - np.median(centers, axis=0)).sum(axis=1)
        lon, lat = centers[distances.argmin()]
        return round(float(lon), 6), round(float(lat), 6)


def _places(polygons: np.ndarray, footprints: Footprints, name: str) -> _Places:
    boxes, crs = shapely.bounds(polygons), footprints.crs
    degrees, beyond = boxes, np.zeros(len(boxes), dtype=bool)
    if crs != WGS84:
        corners = boxes[:, :2], boxes[:, 2:]
        degrees = np.hstack(
            [np.column_stack(transform_points(*corner.T, crs, WGS84)) for corner in corners]
        )
        for corner, there in zip(corners, (degrees[:, :2], degrees[:, 2:]), strict=True):
            # outside its range a projection may convert, but not back
            back = np.column_stack(transform_points(*there.T, WGS84, crs))
            with np.errstate(invalid="ignore"):
                beyond |= (np.abs(back - corner) > 1.0).any(axis=1)
    beyond |= (np.abs(degrees) > [180, 90, 180, 90]).any(axis=1)
    if beyond.any():
        example = ", ".join(f"{edge:g}" for edge in boxes[beyond.argmax()][:2])
        limits = " (longitude ±180, latitude ±90)" if crs == WGS84 else ""
        raise MapError(
            f"{name}: {beyond.sum()} of {len(boxes)} footprints are out of range, for example "
            f"({example})",
            f"coordinates in {crs.name}{limits}",
            "state the right reference system in the file (in GeoJSON the member 'crs'), "
            "or repair the coordinates",
        )
    return _Places(degrees)


def _within_window(
    polygons: np.ndarray, tags: Sequence[Mapping], window: shapely.Polygon
) -> tuple[np.ndarray, list[Mapping]]:
    """Select the footprints that meet the window, and repair outlines that cross themselves."""
    west, south, east, north = window.bounds
    boxes = shapely.bounds(polygons)
    near = np.flatnonzero(
        (boxes[:, 0] < east) & (boxes[:, 2] > west) & (boxes[:, 1] < north) & (boxes[:, 3] > south)
    )
    polygons, tangled = repair_polygons(polygons[near])
    # outlines too tangled to repair are painted as they are, by the even-odd rule
    meets = tangled | (shapely.intersects(polygons, window) & (shapely.area(polygons) > 0))
    return polygons[meets], [tags[i] for i in near[meets]]


def _paint(
    polygons: np.ndarray,
    heights: np.ndarray,
    shape: tuple[int, int],
    side: float,
    corner: tuple[float, float],
    ground: float = 0.0,
) -> np.ndarray:
    """Paint float32 of ``shape`` on the ``ground``, from the lowest to the highest."""
    order = np.argsort(heights, kind="stable")
    return rasterize(
        zip(polygons[order], heights[order].tolist(), strict=True),
        out_shape=shape,
        fill=ground,
        transform=north_up(*corner, side),
        all_touched=False,  # the pixel-centre rule
        dtype="float32",
    )


def local_center(
    polygons: np.ndarray, footprints: Footprints, request: Request, name: str
) -> tuple[float, float]:
    """Return the middle of the window of ``footprints`` without a place on Earth, in their own
    metres: the one that the file names, or the middle of the buildings."""
    refuse_center(request, name)
    if any(axis.unit_conversion_factor != 1.0 for axis in footprints.crs.axis_info):
        raise MapError(
            f"{name}: its local coordinates are in {footprints.crs.axis_info[0].unit_name}",
            "local coordinates in metres, or a coordinate reference system",
            "assign a reference system, for example with ogr2ogr -a_srs EPSG:…",
        )
    return footprints.center or _Places(shapely.bounds(polygons)).middle


def _nothing_about(name: str, center: tuple[float, float], side: float) -> MapError:
    return MapError(
        f"{name}: no building lies in the window of {side:g} m about x = {center[0]:g}, y = "
        f"{center[1]:g}",
        "a window with buildings in it",
        f"use more {keyword('pixels')}, or a larger {keyword('metres_per_pixel')}",
    )


def _nothing_there(
    name: str, center: tuple[float, float], side: float, places: _Places, account: Account
) -> MapError:
    found = f"{name}: no building in the {side:g} m about {center[0]:g}, {center[1]:g}"
    if account.dropped[OUTSIDE]:  # the reader knows only the buildings near the window
        return MapError(
            found,
            f"a window among the {account.features} features of the file",
            f"give another {keyword('center')}, or leave it out",
        )
    west, south, east, north = places.bounds
    lon, lat = places.dense
    remedy = f"pass another {keyword('center')}, for example {keyword('center', (lon, lat))}"
    if west <= center[1] <= east and south <= center[0] <= north:
        swapped = keyword("center", (center[1], center[0]))
        remedy = f"give longitude first: {swapped}"
    return MapError(
        found,
        f"a window among its {len(places.boxes)} buildings, from longitude {west:.5f} "
        f"to {east:.5f} and latitude {south:.5f} to {north:.5f}",
        remedy,
    )
