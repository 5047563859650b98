"""Places: squares and other open ground that is wide and compact, not a street."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from evocity.views.buildings import outlines
from evocity.views.connected_components import pieces
from evocity.views.ground.space import nearest_built
from evocity.views.limit_tables import read_only
from evocity.views.streets.kinds import StreetKinds
from evocity.views.streets.skeleton import Ground

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True, eq=False)
class Places:
    """Squares, and other ground as wide and compact.

    polygons : n valid shapely polygons, along pixels' edges, rounded where no wall is, with
    buildings and courtyards as holes. area : float64 ``(n,)``, m². width : float64 ``(n,)``,
    metres, the diameter of the widest disc within each.
    """

    polygons: "tuple[shapely.Polygon, ...]"
    area: np.ndarray
    width: np.ndarray

    def __len__(self) -> int:
        return len(self.polygons)


def make_places(
    ground: Ground,
    kept: np.ndarray,
    kinds: StreetKinds,
    pixel: float,
    corner: tuple[float, float],
) -> tuple[Places, np.ndarray]:
    """Make the places around those ``middles`` of a ground that are ``kept``.

    Returns them, and int32 ``(H, W)``, the place of each pixel, from 0, −1 for none. A place is the
    area of all discs with centres in its middle, each as wide as the walls allow. Where two places
    meet, each pixel belongs to the nearer one. Ground that reaches an open frame is not a place,
    because its end is not on the map.
    """
    shape = tuple(side - 2 for side in ground.open.shape)
    middles, count = ground.middles, len(ground.hubs) - 1
    if not (kept.any() and count):
        none = read_only(np.empty(0))
        return Places((), none, none), np.full(shape, -1, np.int32)
    import shapely

    own = np.concatenate([[0], np.arange(1, count + 1) * kept])[middles]
    squares, nearest = nearest_built(own > 0)
    radius = kinds.place_width / pixel / 2
    near = (ground.open | (middles > 0)) & (squares < radius**2)
    whose = np.where(near, own[nearest[0], nearest[1]], 0)[1:-1, 1:-1]
    number = np.zeros(count + 1, np.int32)
    present = np.flatnonzero(kept) + 1
    number[present] = np.arange(1, len(present) + 1)
    whose = _largest_pieces(number[whose])
    stairs = np.array(outlines(whose, pixel, corner), dtype=object)
    cores = np.array(outlines(number[middles[1:-1, 1:-1]], pixel, corner), dtype=object)
    rounded = shapely.intersection(stairs, shapely.buffer(cores, kinds.place_width / 2))
    polygons = np.array([_largest(polygon) for polygon in rounded], dtype=object)
    sides = np.array([_sides(box) for box in shapely.minimum_rotated_rectangle(polygons)])
    area = shapely.area(polygons)
    fits = sides[:, 1] <= kinds.place_longest * sides[:, 0]
    fits &= area >= kinds.place_filled * sides.prod(axis=1)
    widest = np.zeros(count + 1)
    np.maximum.at(widest, middles.ravel(), 2 * np.sqrt(ground.room.ravel()))
    became = np.where(fits, np.cumsum(fits) - 1, -1)
    where = np.concatenate([[-1], became]).astype(np.int32)[whose]
    columns = map(read_only, (area[fits], widest[present][fits] * pixel))
    return Places(tuple(polygons[fits]), *columns), where


def _largest_pieces(numbers: np.ndarray) -> np.ndarray:
    """Keep of each of the ``numbers`` the largest piece that connects by pixels' sides: a corner of
    a building may cut off parts of a place."""
    kept = np.zeros_like(numbers)
    for number, window in enumerate(scipy.ndimage.find_objects(numbers), start=1):
        parts, _ = pieces(numbers[window] == number)
        largest = np.bincount(parts.ravel())[1:].argmax() + 1
        kept[window][parts == largest] = number
    return kept


def _largest(polygon: "shapely.Geometry") -> "shapely.Geometry":
    parts = getattr(polygon, "geoms", (polygon,))
    return max(parts, key=lambda part: part.area)


def _sides(box: "shapely.Polygon") -> tuple[float, float]:
    """Measure the shorter and the longer side of a rectangle."""
    (x0, y0), (x1, y1), (x2, y2) = box.exterior.coords[:3]
    return tuple(sorted((np.hypot(x1 - x0, y1 - y0), np.hypot(x2 - x1, y2 - y1))))
