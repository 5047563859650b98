"""Wanted densities from files: a raster, points in GeoJSON, or a table of places, on a map."""

import math
import os
from pathlib import Path

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import MapError, is_number
from evocity.formats.geojson_lines import read_document
from evocity.io.geojson import parse_crs_member
from evocity.io.map_reader import data_of
from evocity.io.projection import transform_points
from evocity.io.rasterization import crs_of
from evocity.io.reader_types import Grid, Request
from evocity.io.resampling import placement_errors
from evocity.views.wanted_density import WantedDensity, read_places

#: The most pixels of a raster that are places of a field.
MOST_PIXELS = 625


def read_wanted_density(
    path: str | os.PathLike, city: CityMap, radius: float = 100.0, density: str = "fsi"
) -> WantedDensity:
    """Read a wanted density from a file, for the places that lie on the map ``city``.

    Parameters
    ----------
    path : a raster (GeoTIFF, ASCII grid, NPY), whose values are wanted around the centres of its
        pixels; a GeoJSON file of points with the properties gsi, fsi or both; or a CSV file with
        the columns x, y and gsi, fsi or both, in the coordinates of ``city.outline``. A raster
        without a reference system covers the whole map. A raster of more than 625 pixels on the
        map wants values around every k-th pixel along both sides only.
    radius : radius of the disc in which densities count, metres.
    density : the density that a raster holds, "gsi" or "fsi".

    Raises `MapError` for a file that cannot be read, for wrong values, for a field without a place
    on the map, and for a placed field on a map without a reference system.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        columns = read_places(path)
        places, wishes = np.stack([columns["x"], columns["y"]], axis=1), columns
    elif suffix in (".geojson", ".json"):
        places, wishes = _points(path, city)
    else:
        places, values = _raster(path, city)
        unknown = np.full(len(values), np.nan)
        wishes = {"gsi": unknown, "fsi": unknown} | {density: values}
    left, bottom = city.south_west
    height, width = (side * city.metres_per_pixel for side in city.shape)
    offsets = places - (left, bottom)
    inside = ((offsets >= 0) & (offsets <= (width, height))).all(axis=1)  # NaN is not
    if not inside.any():
        raise MapError(
            f"{path.name}: none of the {len(places)} places of the field lies on the map "
            f"{city.name}",
            f"places with x from {left:g} to {left + width:g} and y from {bottom:g} to "
            f"{bottom + height:g}, in the reference system of the map",
            "draw the field on this map, or choose a window around the field",
        )
    return WantedDensity(offsets[inside], wishes["gsi"][inside], wishes["fsi"][inside], radius)


def _raster(path: Path, city: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """Read the centres of a raster's pixels, in the coordinates of the map, and their values."""
    grid, name = data_of(path, Request())
    if not isinstance(grid, Grid):
        raise MapError(
            f"{path.name} holds footprints of buildings, not a field",
            "a raster, points in GeoJSON, or a CSV file with x, y, gsi and fsi",
            "export the field as a raster or as points",
        )
    rows, columns = np.mgrid[: grid.heights.shape[0], : grid.heights.shape[1]]
    values = np.asarray(grid.heights, np.float64)
    if grid.crs is None:
        x, y = _cells_of_whole(path, grid, city, np.asarray(rows), np.asarray(columns))
    else:
        with placement_errors(name):
            step, down, along = grid.transform, rows.ravel() + 0.5, columns.ravel() + 0.5
            x = step.a * along + step.b * down + step.c
            y = step.d * along + step.e * down + step.f
            x, y = transform_points(x, y, grid.crs, crs_of(city, name))
        x, y = x.reshape(values.shape), y.reshape(values.shape)
    (left, bottom), pixel = city.south_west, city.metres_per_pixel
    inside = (abs((x - left) / pixel / city.shape[1] - 0.5) <= 0.5) & ~np.isnan(values)
    inside &= abs((y - bottom) / pixel / city.shape[0] - 0.5) <= 0.5
    every = max(1, math.ceil(math.sqrt(np.count_nonzero(inside) / MOST_PIXELS)))
    thin = slice(every // 2, None, every), slice(every // 2, None, every)
    return np.column_stack([x[thin].ravel(), y[thin].ravel()]), values[thin].ravel()


def _cells_of_whole(
    path: Path, grid: Grid, city: CityMap, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Place the pixels of a raster without a reference system, which covers the whole map."""
    (high, wide), (height, width) = grid.heights.shape, city.shape
    if high * width != wide * height:
        raise MapError(
            f"{path.name} has {high} × {wide} px and no reference system, but {city.name} has "
            f"{height} × {width} px",
            "a raster with a reference system, or one of the same proportions as the map",
            "give the raster a reference system, or write it for the whole map",
        )
    (left, bottom), side = city.south_west, height * city.metres_per_pixel / high
    return left + (columns + 0.5) * side, bottom + (high - rows - 0.5) * side


def _points(path: Path, city: CityMap) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Read the points of a GeoJSON file, in the coordinates of the map, and their wishes."""
    document = read_document(path)
    features = document.get("features")
    features = features if isinstance(features, list) else []
    rows = [_point(path, number, one) for number, one in enumerate(features, 1)]
    rows = [row for row in rows if row is not None]
    if not rows:
        raise MapError(
            f"{path.name} has no point with a wish",
            "points with the properties gsi, fsi or both",
            "draw points, and give each a value, for example in QGIS",
        )
    x, y, gsi, fsi = np.array(rows, np.float64).T
    if document.get("window") is True:  # metres from the south-west corner
        x, y = x + city.south_west[0], y + city.south_west[1]
    else:
        source = parse_crs_member(path, document.get("crs"))
        x, y = transform_points(x, y, source, crs_of(city, path.name))
    return np.column_stack([x, y]), {"gsi": gsi, "fsi": fsi}


def _point(path: Path, number: int, feature: object) -> tuple[float, ...] | None:
    if not isinstance(feature, dict):
        return None
    geometry, properties = feature.get("geometry"), feature.get("properties")
    if not (isinstance(geometry, dict) and geometry.get("type") == "Point"):
        return None
    wishes = properties if isinstance(properties, dict) else {}
    values = [wishes.get(name) for name in ("gsi", "fsi")]
    pair = geometry.get("coordinates")
    if values == [None, None]:
        return None
    numbers = [*(pair if isinstance(pair, list) else ())][:2]
    known = len(numbers) == 2
    numbers += [value for value in values if value is not None]
    if not known or not all(is_number(one) and math.isfinite(one) for one in numbers):
        raise MapError(
            f"{path.name}: feature {number} has the coordinates {pair!r:.60} and the wishes "
            f"{wishes!r:.60}",
            "a point [x, y] of finite numbers, and numbers for gsi and fsi",
            "correct this point, or remove it",
        )
    return (*map(float, numbers[:2]), *(math.nan if v is None else float(v) for v in values))
