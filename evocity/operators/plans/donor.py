"""A source city as a donor of buildings: straight walls at half a metre, frames and places."""

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from evocity.citymap import CityMap
from evocity.operators.plans.plan import walls_square
from evocity.views.limit_tables import read_only

#: Side of the pixels in which straight walls are drawn, metres: at least a quarter of the map's
#: pixels. Maps with smaller pixels need no straight walls.
FINE = 0.5


@dataclass(frozen=True, eq=False)
class Donor:
    """The buildings of a source city with straight walls. Arrays are read-only.

    city : the map of the source city.
    numbers : int32 ``(h, w)``, fine pixels: 0 on ground, 1…n on the n polygons of `CityMap.walls`.
    step : side of the fine pixels, metres.
    heights : float32 ``(n + 1,)``, metres, 0 for ground.
    areas : float64 ``(n + 1,)``, m², 0 for ground.
    middles : float64 ``(n, 2)``, row and column of the middle of each polygon, px of the map.
    directions : complex128 ``(H + 1, W + 1)``, sums of the fourfold directions of walls over all
        pixels to the north-west.
    """

    city: CityMap
    numbers: np.ndarray
    step: float
    heights: np.ndarray
    areas: np.ndarray
    middles: np.ndarray
    directions: np.ndarray

    @cached_property
    def built(self) -> np.ndarray:
        """Fine pixels with a building: bool ``(h, w)``."""
        return self.numbers > 0

    def frames(self, places: np.ndarray, radius: float) -> np.ndarray:
        """Find the direction of the walls around ``places``, row and column ``(n, 2)``, in a square
        of half the side ``radius``, px. Returns float64 ``(n,)``, radians from east towards
        south."""
        from evocity.operators.plans._kernels import sum_squares

        total = np.empty(len(places), complex)
        sum_squares(np.ascontiguousarray(places, np.float64), float(radius), self.directions, total)
        return np.angle(total) / 4

    def numbers_at(self, down: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Look up the polygon at each point, metres from the north-west corner: int32, 0 for
        ground, −1 beyond the map."""
        rows = np.floor(down / self.step).astype(np.int64)
        columns = np.floor(along / self.step).astype(np.int64)
        height, width = self.numbers.shape
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        flat = np.where(inside, rows * width + columns, 0)
        return np.where(inside, self.numbers.ravel()[flat], -1)


_cache: WeakKeyDictionary[CityMap, Donor] = WeakKeyDictionary()


def donor_of(city: CityMap) -> Donor:
    """Prepare a source city as a `Donor`; a cache keeps the donor as long as the map lives. About
    60 ms at 256², with the straight walls."""
    if city not in _cache:
        _cache[city] = _prepare(city)
    return _cache[city]


def _prepare(city: CityMap) -> Donor:
    fine = city.metres_per_pixel < FINE  # pixels are finer than straight walls would be
    numbers, step, heights, areas, places = _pixels(city) if fine else _straight(city)
    sums = np.zeros((city.shape[0] + 1, city.shape[1] + 1), complex)
    sums[1:, 1:] = walls_square(city).astype(complex).cumsum(axis=0).cumsum(axis=1)
    arrays = {
        "numbers": numbers,
        "heights": np.concatenate([[0], heights]).astype(np.float32),
        "areas": np.concatenate([[0], areas]),
        "middles": places,
        "directions": sums,
    }
    return Donor(city, step=step, **{name: read_only(array) for name, array in arrays.items()})


def _pixels(city: CityMap) -> tuple:
    """Take the buildings of a map as they are: numbers, side of pixels, heights, areas, middles."""
    buildings, pixel = city.buildings, city.metres_per_pixel
    places = np.column_stack([buildings.y, buildings.x]) / pixel
    return buildings.labels, pixel, buildings.height, buildings.area, places


def _straight(city: CityMap) -> tuple:
    """Draw the straight walls of a map: numbers, side of pixels, heights, areas, middles."""
    import shapely
    from affine import Affine
    from rasterio.features import rasterize

    walls, pixel = city.walls, city.metres_per_pixel
    step = min(max(FINE, pixel / 4), pixel)
    shape = tuple(max(1, round(side * pixel / step)) for side in city.shape)
    if not len(walls):
        return np.zeros(shape, np.int32), step, np.empty(0), np.empty(0), np.empty((0, 2))
    left, top = city.north_west
    numbers = rasterize(
        zip(walls.polygons, range(1, len(walls) + 1), strict=True),
        out_shape=shape,
        transform=Affine(step, 0, left, 0, -step, top),
        fill=0,
        dtype="int32",
    )
    polygons = np.array(walls.polygons, dtype=object)
    middles = shapely.centroid(polygons)
    rows = (top - shapely.get_y(middles)) / pixel
    places = np.column_stack([rows, (shapely.get_x(middles) - left) / pixel])
    return numbers, step, walls.heights, shapely.area(polygons), places


__all__ = ["FINE", "Donor", "donor_of"]
