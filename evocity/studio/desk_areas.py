"""Areas of a map at the desk: the lock, and the boundary within which goals measure. A user draws
them on the map of a file, or brings them as a file of their own."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import rasterio.features
import shapely
from pydantic import Field
from pyproj import CRS

from evocity.citymap import CityMap
from evocity.errors import EvocityError, MapError
from evocity.fitness import Part
from evocity.io import read_mask
from evocity.io.map_reader import options_of
from evocity.io.projection import WGS84, transform_polygons
from evocity.io.reader_types import north_up
from evocity.studio.request_fields import Body, fault_of

#: The uses of an area, in words and as names of files in a recipe.
USES = {"lock": "locked", "within": "site"}
#: Shapes of an area, corners of a shape, rings that the page draws of a file; at most.
MOST_SHAPES, MOST_CORNERS, _MOST_RINGS = 64, 500, 400

Place = tuple[
    Annotated[float, Field(ge=-1e8, le=1e8)],
    Annotated[float, Field(ge=-1e8, le=1e8)],
]


class Area(Body):
    """An area of the map ``map``: ``shapes`` of corners in metres of the overview, or the number of
    a ``file``. ``map``: the first file of footprints or raster that it lies on."""

    map: Annotated[int, Field(ge=0, lt=2**31)]
    shapes: Annotated[
        tuple[Annotated[tuple[Place, ...], Field(min_length=3, max_length=MOST_CORNERS)], ...],
        Field(max_length=MOST_SHAPES),
    ] = ()
    file: Annotated[int, Field(ge=0, lt=2**31)] | None = None


def is_raster(path: Path) -> bool:
    """Whether the file of an area is a mask of pixels, and not polygons."""
    return "nodata" in options_of(path)


def mark_area(city: CityMap, at: Sequence[float], use: str, area: Mapping) -> dict[str, Any]:
    """Mark an ``area`` on a ``city`` whose window lies at ``at`` in the overview. Return the file
    that a recipe names, the marked share of the window, and rings to draw; or the fault.

    area : ``shapes`` and ``stem``, the path of the file to write without its suffix; or ``file``, a
        path, and its ``name``.
    """
    try:
        note = ""
        if area.get("file"):
            path = Path(area["file"])
        else:
            polygons = _polygons(area["shapes"], use)
            note = _outside(polygons, at, city)
            path = _write(polygons, Path(area["stem"]), at, city)
        mask = read_mask(path, [city])
        if use == "lock" and mask.all():
            raise MapError(
                "the lock covers the whole window",
                "some pixels that are not locked, so that births can change them",
                "make the lock smaller, or the window larger",
            )
    except EvocityError as error:
        fault = fault_of(error)
        if area.get("file"):  # its name on the disk says nothing to a user
            fault = {k: v.replace(path.name, area["name"]) for k, v in fault.items()}
        return {"fault": fault}
    return {
        "path": str(path),
        "share": float(mask.mean()),
        "rectangle": bool(Part(use, mask).is_rectangle),
        "note": note,
        "rings": _rings(mask, at, city.metres_per_pixel) if area.get("file") else [],
    }


def _polygons(shapes: list, use: str) -> np.ndarray:
    drawn = np.array([shapely.Polygon(shape) for shape in shapes], object)
    polygons = shapely.make_valid(drawn, method="structure", keep_collapsed=False)
    if not len(shapes) or (shapely.area(polygons) <= 0).any():
        raise MapError(
            f"a shape of the {'lock' if use == 'lock' else 'boundary'} is a line or a point",
            "a shape that encloses an area",
            "remove this shape, and draw another one",
        )
    return polygons


def _outside(polygons: np.ndarray, at: Sequence[float], city: CityMap) -> str:
    """Describe the part of ``polygons`` that lies outside the window."""
    half = city.shape[0] * city.metres_per_pixel / 2
    window = shapely.box(at[0] - half, at[1] - half, at[0] + half, at[1] + half)
    drawn = shapely.union_all(polygons)
    share = shapely.difference(drawn, window).area / drawn.area
    return f"{100 * share:.0f} % of it lies outside the window" if share > 0.005 else ""


def _write(polygons: np.ndarray, stem: Path, at: Sequence[float], city: CityMap) -> Path:
    """Write the file of an area: GeoJSON in degrees, or a mask of pixels where the ``city`` has no
    place on Earth."""
    side, (rows, columns) = city.metres_per_pixel, city.shape
    if city.crs is None or city.origin is None:
        corner = at[0] - columns * side / 2, at[1] + rows * side / 2
        mask = rasterio.features.rasterize(
            polygons, (rows, columns), transform=north_up(*corner, side), dtype="uint8"
        )
        if not mask.any():
            raise _no_pixel()
        np.save(stem.with_suffix(".npy"), mask)
        return stem.with_suffix(".npy")
    # lengths in the frame and in the city's system are the same, but their origins differ
    left, top = city.origin
    shift = np.array([left + columns * side / 2, top - rows * side / 2]) - np.array(at)
    placed = shapely.transform(polygons, lambda points: points + shift)
    window = shapely.box(left, top - rows * side, left + columns * side, top)
    if not shapely.intersects(placed, window).any():
        raise _no_pixel()
    on_earth = transform_polygons(placed, CRS.from_user_input(city.crs), WGS84)
    features = [
        {"type": "Feature", "properties": {}, "geometry": json.loads(text)}
        for text in shapely.to_geojson(on_earth)
    ]
    path = stem.with_suffix(".geojson")
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def _no_pixel() -> MapError:
    return MapError(
        "the drawn area has no pixel of the window",
        "an area that overlaps the window",
        "draw the area inside the window, or move the window",
    )


def _rings(mask: np.ndarray, at: Sequence[float], side: float) -> list:
    rows, columns = mask.shape
    transform = north_up(at[0] - columns * side / 2, at[1] + rows * side / 2, side)
    shapes = rasterio.features.shapes(mask.astype(np.uint8), mask, transform=transform)
    return [
        [[round(x, 1), round(y, 1)] for x, y in ring]
        for shape, _ in list(shapes)[:_MOST_RINGS]
        for ring in shape["coordinates"]
    ]
