"""Overviews of map files for the desk: the extent of a file and its footprints, thinned, in metres.

An overview has a *frame*: a metric reference system, and an origin in it. All places on the page
are metres east and north of that origin. A file without a place on Earth has a frame of its own.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from affine import Affine
from pyproj import CRS

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io.building_choice import choose_buildings
from evocity.io.map_reader import above_ground_of, data_of, options_of, path_of_map
from evocity.io.projection import (
    WGS84,
    can_keep,
    code_of,
    local_metres,
    transform_points,
    transform_polygons,
)
from evocity.io.rasterization import local_center
from evocity.io.reader_types import Footprints, Grid, Request
from evocity.io.resampling import compose, map_of_grid
from evocity.io.vector import DRIVERS, layer_extent

#: Buildings and points of an overview, at most; a larger file shows those around the window.
MOST_BUILDINGS, MOST_POINTS = 30_000, 400_000
#: Features of a layer above which only its index is read.
LARGE = 100_000
# Pixels of a raster's longer side; cells of a density; steps of a coordinate; windows around.
_PIXELS, _CELLS, _STEPS, _AROUND = 768, 160, 65535, 4.0
# Options that change what a file shows; the size of pixels counts where a file has none.
_KEYS = ("layer", "nodata", "terrain", "height_scale", "metres_per_pixel")


def lon_lat(frame: Mapping, at: Sequence[float]) -> tuple[float, float] | None:
    """Return longitude and latitude of a place in a ``frame``; None without a place on Earth."""
    if frame["crs"] is None:
        return None
    x, y = (place + origin for place, origin in zip(at, frame["origin"], strict=True))
    lon, lat = transform_points(x, y, CRS.from_user_input(frame["crs"]), WGS84)
    return round(float(lon), 7), round(float(lat), 7)


def in_frame(frame: Mapping, x: float, y: float, crs: CRS) -> list[float]:
    """Return a place in ``crs`` as metres in the ``frame``."""
    own = crs if frame["crs"] is None else CRS.from_user_input(frame["crs"])
    x, y = transform_points(x, y, crs, own)
    return [round(float(x) - frame["origin"][0], 3), round(float(y) - frame["origin"][1], 3)]


class Overview:
    """The overview of the file ``source``, read with ``options`` of `read_map`. ``known``: facts of
    an earlier overview, whose frame stays."""

    def __init__(self, source: str, options: Mapping[str, Any], known: Mapping | None):
        self._source, self._known = source, known
        self._polygons = np.zeros(0, object)
        self._city: CityMap | None = None
        keys = _KEYS if "nodata" in options_of(source) else _KEYS[:1]
        named = {key: options[key] for key in keys if options.get(key) is not None}
        self.key = repr(sorted(named.items()))
        self.facts: dict[str, Any] = dict(known or {})
        self.is_new = known is None or known["key"] != self.key
        self._request = Request(**named)
        if not self.is_new:
            return
        extent = self._indexed()
        if extent is None:
            data, name = data_of(source, self._request)
            if isinstance(data, Grid):
                extent = self._grid(data, name)
            else:
                extent = self._footprints(data, name)
        self.facts |= {"key": self.key, "extent": [round(float(edge), 2) for edge in extent]}

    @property
    def frame(self) -> Mapping:
        return self.facts["frame"]

    def _set_frame(self, crs: CRS | None, corner: Any) -> np.ndarray:
        """Set the frame unless an earlier one is ``known``; return its origin."""
        if self._known is None:
            origin = [float(np.floor(edge)) for edge in corner]
            self.facts["frame"] = {"crs": None if crs is None else code_of(crs), "origin": origin}
        return np.array(self.frame["origin"])

    def _frame_crs(self, crs: CRS, box: np.ndarray) -> CRS:
        """Choose the system of a frame for what lies within a ``box`` in ``crs``."""
        if self._known is not None and self.frame["crs"] is not None:
            return CRS.from_user_input(self.frame["crs"])
        x, y = (box[:2] + box[2:]) / 2
        lon, lat = transform_points(x, y, crs, WGS84)
        side = float((box[2:] - box[:2]).max())
        return crs if can_keep(crs, lon, lat, side) else local_metres(round(lon, 4), round(lat, 4))

    def _indexed(self) -> np.ndarray | None:
        """Measure a large layer by its index; None for another file."""
        path = path_of_map(self._source)
        if path.suffix.lower() not in DRIVERS:
            return None
        count, bounds, crs, first = layer_extent(path, self._request.layer, LARGE)
        if bounds is None:
            return None
        own = self._frame_crs(crs, bounds)
        box = shapely.bounds(transform_polygons(np.array([shapely.box(*bounds)]), crs, own))[0]
        origin = self._set_frame(own, box[:2])
        place = transform_points(first[0], first[1], crs, WGS84)
        start = [float(degrees) for degrees in place]
        self.facts |= {"kind": "buildings", "count": count, "partial": True, "start": start}
        return box - np.tile(origin, 2)

    def _footprints(self, data: Footprints, name: str) -> np.ndarray:
        polygons, _, _ = choose_buildings(data, name, or_none=True)
        polygons = polygons[np.isfinite(shapely.bounds(polygons)).all(axis=1)]
        crs = None
        if not data.crs.is_engineering:
            box = shapely.total_bounds(polygons)
            crs = self._frame_crs(data.projection or data.crs, box) if len(polygons) else WGS84
            polygons = transform_polygons(polygons, data.crs, crs)
        box = shapely.total_bounds(polygons) if len(polygons) else np.zeros(4)
        origin = self._set_frame(crs, box[:2])
        self._polygons = shapely.transform(polygons, lambda points: points - origin)
        partial = len(polygons) > MOST_BUILDINGS
        self.facts |= {"kind": "buildings", "count": len(polygons), "partial": partial}
        if crs is None and len(polygons):
            middle = np.asarray(local_center(polygons, data, Request(), name), float)
            self.facts["middle"] = (middle - origin).tolist()
        return box - np.tile(origin, 2)

    def _grid(self, grid: Grid, name: str) -> np.ndarray:
        try:
            grid = above_ground_of(grid, self._request, name)
        except MapError:  # the map itself shows the fault
            grid = dataclasses.replace(grid, heights=np.zeros_like(grid.heights))
        step = -(-max(grid.heights.shape) // _PIXELS)
        side = None
        if grid.crs is None:
            side = step * (grid.metres_per_pixel or self._request.metres_per_pixel or 1.0)
        if step > 1:
            is_placed = grid.transform != Affine.identity()
            scaled = compose(grid.transform, Affine.scale(step)) if is_placed else grid.transform
            heights = np.ascontiguousarray(grid.heights[::step, ::step])
            grid = dataclasses.replace(grid, heights=heights, transform=scaled)
        grid = dataclasses.replace(grid, metres_per_pixel=side or grid.metres_per_pixel)
        self._city = city = map_of_grid(grid, Request(), name)
        rows, columns = city.shape
        wide, tall = columns * city.metres_per_pixel, rows * city.metres_per_pixel
        left, top = city.origin or (0.0, tall)
        crs = None if city.crs is None else CRS.from_user_input(city.crs)
        origin = self._set_frame(crs, (left, top - tall))
        if crs is not None and self._known is not None:
            own = CRS.from_user_input(self.frame["crs"])
            left, top = transform_points(left, top, crs, own)
        box = np.array([left, top - tall, left + wide, top]) - np.tile(origin, 2)
        self.facts |= {"kind": "raster", "count": None, "partial": False}
        return box

    # -- the window ----------------------------------------------------------------------------

    def window_of(self, city: CityMap) -> list[float]:
        """Return the middle of the window of a ``city``, as it was read, in the frame."""
        side = city.metres_per_pixel
        if city.crs is not None and city.origin is not None:
            (left, top), (rows, columns) = city.origin, city.shape
            x, y = left + columns * side / 2, top - rows * side / 2
            return in_frame(self.frame, x, y, CRS.from_user_input(city.crs))
        return self.middle

    @property
    def middle(self) -> list[float]:
        west, south, east, north = self.facts["extent"]
        return self.facts.get("middle") or [(west + east) / 2, (south + north) / 2]

    def check_window(self, at: Sequence[float] | None, side: float) -> None:
        """Raise the `MapError` for a window of ``side`` metres that the file cannot fill."""
        west, south, east, north = self.facts["extent"]
        x, y = at or self.middle
        beyond = max(west - x, x - east, south - y, y - north)
        if self.facts["kind"] == "raster":
            raise MapError(
                f"the window of {side:g} m leaves the raster by {beyond + side / 2:.0f} m",
                f"a window inside the raster of {east - west:.0f} × {north - south:.0f} m",
                "move the window inward, or choose fewer or smaller pixels",
            )
        if at is not None:
            far = beyond - side / 2
            raise MapError(
                f"the window lies outside the file, {far:.0f} m beyond its buildings"
                if far > 0
                else "the window has no building",
                "a window that has buildings of the file",
                "move the window onto the footprints",
            )

    # -- the content ---------------------------------------------------------------------------

    def write(self, path: Path, at: Sequence[float], side: float) -> None:
        """Write what the page draws: a grid of bytes; then polygon and end of each ring, uint32;
        then points, uint16. `facts` tells the sizes. A partial overview has the buildings around
        the window at ``at``."""
        if not self.is_new and not self.facts["partial"]:
            return
        extent, polygons, grid = np.array(self.facts["extent"]), self._polygons, None
        if self._city is not None:
            grid = np.clip(np.ceil(self._city.heights), 0, 255).astype(np.uint8)
        box = extent
        if self.facts["partial"]:
            half = _AROUND * side / 2
            box = np.array([at[0] - half, at[1] - half, at[0] + half, at[1] + half])
            if len(polygons):
                grid = _density(polygons, extent)
            else:
                polygons, sizes = self._around(at, side), self.facts.get("grid")
                if sizes and path.is_file():  # the density of the first reading stays
                    cells = np.frombuffer(path.read_bytes(), np.uint8, sizes[0] * sizes[1])
                    grid = cells.reshape(sizes)
            polygons = polygons[shapely.intersects(polygons, shapely.box(*box))][:MOST_BUILDINGS]
        size = max(float((box[2:] - box[:2]).max()), 1.0)
        polygon, ends, points = _outlines(polygons, box[:2], size)
        self.facts |= {
            "grid": None if grid is None else list(grid.shape),
            "rings": len(ends),
            "corner": box[:2].tolist(),
            "step": size / _STEPS,
        }
        parts = [] if grid is None else [grid.tobytes(), bytes(-grid.size % 4)]
        path.write_bytes(b"".join([*parts, polygon.tobytes(), ends.tobytes(), points.tobytes()]))

    def _around(self, at: Sequence[float], side: float) -> np.ndarray:
        """Read the buildings of a large layer around a place, by its index."""
        request = Request(
            center=lon_lat(self.frame, at),
            pixels=1,
            metres_per_pixel=_AROUND * side,
            layer=self._request.layer,
        )
        try:
            data, name = data_of(self._source, request)
        except MapError:  # the map itself shows the fault
            return self._polygons
        if isinstance(data, Grid):
            return self._polygons
        polygons, _, _ = choose_buildings(data, name, or_none=True)
        crs, origin = CRS.from_user_input(self.frame["crs"]), np.array(self.frame["origin"])
        polygons = transform_polygons(polygons, data.crs, crs)
        return shapely.transform(polygons, lambda points: points - origin)


def _outlines(polygons: np.ndarray, corner: np.ndarray, size: float):
    """Thin ``polygons``: return the polygon and the end of each ring, and the points in steps."""
    tolerance = size / 4000
    while True:
        thin = shapely.simplify(polygons, tolerance, preserve_topology=False)
        parts, of = shapely.get_parts(thin, return_index=True)
        parts = shapely.normalize(parts)  # holes run the other way round
        rings, part = shapely.get_rings(parts, return_index=True)
        points, ring = shapely.get_coordinates(rings, return_index=True)
        if len(points) <= MOST_POINTS:
            break
        tolerance *= 4
    ends = np.searchsorted(ring, np.arange(len(rings)), side="right")
    steps = np.clip(np.round((points - corner) * (_STEPS / size)), 0, _STEPS)
    return of[part].astype("<u4"), ends.astype("<u4"), steps.astype("<u2")


def _density(polygons: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """Return the built share of the cells of an ``extent``, 0 to 255, north first."""
    size = extent[2:] - extent[:2]
    cell = max(float(size.max()) / _CELLS, 1e-6)
    columns, rows = np.maximum(np.ceil(size / cell).astype(int), 1)
    middles = shapely.get_coordinates(shapely.centroid(polygons)) - extent[:2]
    edges = [np.arange(count + 1) * cell for count in (rows, columns)]
    built, _, _ = np.histogram2d(
        middles[:, 1], middles[:, 0], bins=edges, weights=shapely.area(polygons)
    )
    return np.clip(np.ceil(255 * built / cell**2), 0, 255).astype(np.uint8)[::-1].copy()
