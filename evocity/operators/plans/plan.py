"""The plan of a map: faces between streets, with lots, frames, fronts and neighbours."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.views.buildings import outlines
from evocity.views.connected_components import pieces
from evocity.views.limit_tables import read_only

if TYPE_CHECKING:
    import shapely

#: Version of the rules that make a plan. Other rules get another number.
PLAN_VERSION = 1

#: Least width of a street that divides faces, metres. Streets of old towns are narrower than those
#: of `CityMap.street_graph`.
LEAST_WIDTH = 4.0

#: A lot spans gaps between buildings of up to twice this distance, metres.
CLOSED = 10.0
#: Depth of the strip along a lot's outline in which fronts stand, px.
STRIP = 3.0
#: A face with a smaller share of built ground is open: a square, water or a field.
OPEN_BELOW = 0.02


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a map: the faces of its street graph. Arrays are read-only.

    The axes of streets cut a map into faces. Each building component lies within one face. The lot
    of a face is its ground between the building lines: the built ground, the gaps between
    buildings, and courts.

    heights : float32 ``(H, W)``, heights of the map, metres.
    metres_per_pixel : length of a pixel's side, metres. corner : (x, y) of the north-west corner.
    name, attribution : those of the map.
    labels : int32 ``(H, W)``: the face of each pixel, 1…n; 0 on the axes between faces. Large faces
        have low numbers. Where an isometry of the square turns the street graph with the map, each
        face keeps its number, unless it equals another face in all counts.
    lots : int32 ``(H, W)``: the face of each pixel that belongs to a lot; 0 elsewhere.
    windows : ``(top, left, bottom, right)`` of each face, int32 ``(n, 4)``, px.
    area, lot_area : float64 ``(n,)``, m², of the face and of its lot.
    coverage : float64 ``(n,)``, the built share of the lot, 0…1; 0 without a lot.
    front : float64 ``(n,)``, the built share of a strip of 3 px along the outline of the lot, 0…1.
    angle : float64 ``(n,)``, the direction of the face's walls, from 0 to below π/2, from east
        towards south, by the structure tensor.
    order : float64 ``(n,)``, 0…1, the agreement of the directions of the walls; 1 for equal ones.
    centre : float64 ``(n, 2)``, row and column of the centroid of the lot, or else of the face, px.
    open : bool ``(n,)``, whether a face is open: less than 2 % of its area is built.
    at_frame : bool ``(n,)``, whether a face reaches the map's frame.
    neighbours : int32 ``(m, 2)``, pairs of faces that have a street axis between them; the lower
        number comes first.
    changes : the changes that made the plan from the plan of a map, as JSON-able data; see
        `evocity.operators.plans.apply_changes`.
    """

    heights: np.ndarray
    metres_per_pixel: float
    corner: tuple[float, float]
    name: str
    attribution: str
    labels: np.ndarray
    lots: np.ndarray
    windows: np.ndarray
    area: np.ndarray
    lot_area: np.ndarray
    coverage: np.ndarray
    front: np.ndarray
    angle: np.ndarray
    order: np.ndarray
    centre: np.ndarray
    open: np.ndarray
    at_frame: np.ndarray
    neighbours: np.ndarray
    version: int = PLAN_VERSION
    changes: tuple[dict[str, Any], ...] = ()

    def __len__(self) -> int:
        """Count the faces."""
        return self.area.size

    def window(self, face: int) -> tuple[slice, slice]:
        """Return the rows and columns of the smallest rectangle around a ``face``, 1…n."""
        top, left, bottom, right = self.windows[face - 1].tolist()
        return slice(top, bottom), slice(left, right)

    @cached_property
    def outline(self) -> "tuple[shapely.Geometry, ...]":
        """Polygons of the faces along pixels' edges, in the coordinates of `CityMap.outline`. About
        5 ms at 256²."""
        return tuple(outlines(self.labels, self.metres_per_pixel, self.corner))

    def summary(self) -> dict[str, Any]:
        """Summarize the plan as JSON-able data: its version, size and a row for each face.

        Angles are in degrees, areas in m², centres in metres from the north-west corner (down,
        along).
        """
        columns = {
            "area": self.area,
            "lot_area": self.lot_area,
            "coverage": self.coverage,
            "front": self.front,
            "angle": np.degrees(self.angle),
            "order": self.order,
        }
        rows = []
        for k in range(len(self)):
            row = {name: round(float(values[k]), 3) for name, values in columns.items()}
            row["centre"] = [round(float(at) * self.metres_per_pixel, 1) for at in self.centre[k]]
            pairs = self.neighbours[(self.neighbours == k + 1).any(axis=1)]
            neighbours = sorted(set(pairs.ravel().tolist()) - {k + 1})
            flags = {"open": bool(self.open[k]), "at_frame": bool(self.at_frame[k])}
            rows.append({"face": k + 1, **row, **flags, "neighbours": neighbours})
        return {
            "version": self.version,
            "name": self.name,
            "pixels": list(self.labels.shape),
            "metres_per_pixel": self.metres_per_pixel,
            "faces": rows,
        }


_cache: WeakKeyDictionary[CityMap, Plan] = WeakKeyDictionary()


def plan_of(city: CityMap) -> Plan:
    """Find the plan of a map: the faces of its street graph, with streets of 4 m and more.

    The plan is a pure function of the map. A cache keeps the plan as long as the map lives. A map
    without streets has a plan of one face. About 60 ms at 256², with the street graph.

    Source: the plan comes from evocity.
    """
    if city not in _cache:
        axes = city.street_graph_of(least_width=LEAST_WIDTH).lines
        _cache[city] = build_plan(city, axes)
    return _cache[city]


def walls_square(city: CityMap) -> np.ndarray:
    """Compute the fourfold directions of a map's walls: complex64 ``(H, W)``, w e^{4iθ}.

    Walls at right angles to each other have one direction; w is the squared gradient. The sum over
    an area has four times the direction of its walls as its angle, from east towards south.
    """
    twice = city.structure[0] + 1j * city.structure[1]
    size = np.abs(twice)
    # the square of less is 0 as a float32, and dividing by it overflows
    return (twice * twice / np.where(size > 1e-30, size, 1)).astype(np.complex64)


def build_plan(city: CityMap, axes: np.ndarray) -> Plan:
    """Build the plan of a map from the ``axes`` of its streets, bool ``(H, W)``, on open ground."""
    own = np.ones(city.shape, bool) if city.site is None else city.site
    labels = _cut(own, axes)
    count, pixel = int(labels.max(initial=0)), city.metres_per_pixel
    lots, strips = np.zeros(city.shape, np.int32), np.zeros(city.shape, bool)
    for face, window in enumerate(scipy.ndimage.find_objects(labels), start=1):
        _find_lot(labels, city.built, own, face, window, CLOSED / pixel, lots, strips)
    counts = {
        "area": np.bincount(labels.ravel(), minlength=count + 1),
        "built": np.bincount(labels[city.built], minlength=count + 1),
        "lot": np.bincount(lots.ravel(), minlength=count + 1),
        "strip": np.bincount(lots[strips], minlength=count + 1),
        "front": np.bincount(lots[strips & city.built], minlength=count + 1),
        "volume": _sums(labels, np.rint(city.heights * 100)),
        "moment": _sums(labels, _from_middle(city.shape)),
    }
    # large faces first: counts do not change when the map is turned
    keys = [-values[1:] for values in counts.values()]
    rank = np.zeros(count + 1, np.int32)
    rank[np.lexsort(keys[::-1]) + 1] = np.arange(1, count + 1)
    counts = {key: values[1:][np.argsort(rank[1:])] for key, values in counts.items()}
    labels, lots = rank[labels], rank[lots]
    windows = [
        (rows.start, columns.start, rows.stop, columns.stop)
        for rows, columns in scipy.ndimage.find_objects(labels)
    ]
    fourfold = walls_square(city)
    whole = np.zeros(count + 1, complex)
    for part, unit in ((fourfold.real, 1), (fourfold.imag, 1j)):
        whole += unit * np.bincount(labels.ravel(), part.ravel(), count + 1)
    strength = np.bincount(labels.ravel(), np.abs(fourfold).ravel(), count + 1)
    frame = np.concatenate([labels[[0, -1]].ravel(), labels[:, [0, -1]].ravel(), labels[~own]])
    at_frame = np.isin(np.arange(1, count + 1), frame)
    arrays = {
        "labels": labels,
        "lots": lots,
        "windows": np.array(windows, np.int32).reshape(-1, 4),
        "area": counts["area"] * pixel**2,
        "lot_area": counts["lot"] * pixel**2,
        "coverage": counts["built"] / np.maximum(counts["lot"], 1),
        "front": counts["front"] / np.maximum(counts["strip"], 1),
        "angle": np.mod(np.angle(whole[1:]) / 4, np.pi / 2),
        "order": np.abs(whole[1:]) / np.maximum(strength[1:], 1e-12),
        "centre": centres_of(labels, lots, count),
        "open": counts["built"] < OPEN_BELOW * counts["area"],
        "at_frame": at_frame,
        "neighbours": neighbours_of(labels),
    }
    arrays = {name: read_only(np.ascontiguousarray(array)) for name, array in arrays.items()}
    described = {"name": city.name, "attribution": city.attribution, "corner": city.north_west}
    return Plan(heights=city.heights, metres_per_pixel=pixel, **described, **arrays)


def _sums(labels: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sum whole ``values`` over each label, without an error of rounding: int64 ``(n + 1,)``."""
    return np.bincount(labels.ravel(), values.ravel(), int(labels.max(initial=0)) + 1).astype(
        np.int64
    )


def _from_middle(shape: tuple[int, int]) -> np.ndarray:
    """Compute four times the squared distances of pixels from the middle of a map, whole px."""
    down, along = (2 * np.arange(side) - (side - 1) for side in shape)
    return down[:, None] ** 2 + along**2


def _cut(own: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Label the faces between ``axes``; axes that end within a face belong to the face."""
    labels, _ = pieces(own & ~axes)
    around = around_of(labels)
    most = around.max(axis=0)
    least = np.where(around > 0, around, np.iinfo(np.int32).max).min(axis=0)
    inner = axes & own & (most > 0) & (least == most)
    return np.where(inner, most, labels)


def around_of(labels: np.ndarray, where: np.ndarray | None = None) -> np.ndarray:
    """Stack the labels of the eight neighbours of each pixel, ``(8, H, W)``; 0 beyond the map. Of
    the n pixels ``where``, bool ``(H, W)``: ``(8, n)``."""
    padded = np.pad(labels, 1)
    height, width = labels.shape
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    if where is None:
        return np.stack([padded[i : i + height, j : j + width] for i, j in shifts])
    rows, columns = np.nonzero(where)
    flat, at = padded.ravel(), rows * (width + 2) + columns
    return np.stack([flat[at + i * (width + 2) + j] for i, j in shifts])


def _find_lot(labels, built, own, face, window, radius, lots, strips) -> None:
    """Find the lot of a face: its built ground, closed with a disc of ``radius`` px, and all that
    is enclosed. Writes the lot and its strip along the outline."""
    beside = int(radius) + 2
    rows, columns = (slice(max(one.start - beside, 0), one.stop + beside) for one in window)
    here = labels[rows, columns] == face
    solid = here & built[rows, columns]
    if not solid.any():
        return
    distance = scipy.ndimage.distance_transform_edt
    near = distance(~solid) <= radius
    closed = solid | (near if near.all() else distance(near) > radius)
    lot = scipy.ndimage.binary_fill_holes(closed & here) & here
    lots[rows, columns][lot] = face
    beyond = own[rows, columns] & ~lot
    strip = lot & (distance(~beyond) <= STRIP) if beyond.any() else np.zeros_like(lot)
    strips[rows, columns] |= strip


def rank_faces(labels: np.ndarray, lots: np.ndarray, count: int) -> np.ndarray:
    """Number the faces of a changed plan, large ones first: int32 ``(count + 1,)``, 0 for 0."""
    keys = [
        np.bincount(labels.ravel(), minlength=count + 1),
        np.bincount(lots.ravel(), minlength=count + 1),
        _sums(labels, _from_middle(labels.shape)),
    ]
    rank = np.zeros(count + 1, np.int32)
    rank[np.lexsort([-values[1:] for values in keys][::-1]) + 1] = np.arange(1, count + 1)
    return rank


def centres_of(labels: np.ndarray, lots: np.ndarray, count: int) -> np.ndarray:
    """Find the centroid of each lot, or else of the face: float64 ``(count, 2)``, px."""
    centres = np.zeros((count, 2))
    sizes = np.bincount(lots.ravel(), minlength=count + 1)
    grids = np.indices(labels.shape)
    for axis, grid in enumerate(grids):
        for of, which in ((labels, sizes == 0), (lots, sizes > 0)):
            total = np.bincount(of.ravel(), grid.ravel(), count + 1)
            many = np.bincount(of.ravel(), minlength=count + 1)
            mean = total / np.maximum(many, 1)
            centres[:, axis][which[1:]] = mean[1:][which[1:]]
    return centres


def neighbours_of(labels: np.ndarray) -> np.ndarray:
    """List the pairs of faces that touch the same pixel of an axis."""
    around = np.sort(around_of(labels, labels == 0), axis=0).astype(np.int64)
    many = int(labels.max(initial=0)) + 1
    met = np.zeros(many * many, bool)
    for i in range(8):
        for j in range(i + 1, 8):
            met[around[i] * many + around[j]] = True
    first, second = np.divmod(np.flatnonzero(met), many)
    apart = (first > 0) & (first < second)
    return np.column_stack([first[apart], second[apart]]).astype(np.int32)


__all__ = [
    "PLAN_VERSION",
    "Plan",
    "around_of",
    "build_plan",
    "centres_of",
    "neighbours_of",
    "plan_of",
    "rank_faces",
    "walls_square",
]
