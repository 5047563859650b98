"""Matching of library objects to buildings: candidates by shape, and their placings."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from weakref import WeakKeyDictionary

import numpy as np
import shapely

from evocity.scene._kernels import shared, tried
from evocity.scene.library import Library

#: The greatest scaling of each axis of an object, as a share.
SCALE = 0.15
#: Points a side of the grid on which shapes are compared, each in its own frame.
GRID = 16
#: Cells a side of the grid about a building on which placings are measured.
BOARD = 48

# After scaling, a side may still differ from the building's by this share: a corner may enlarge a
# building's box.
_OFF = 0.35
# The eight ways to lay a frame on itself: quarter turns, after an optional mirror.
_WAYS = [(turns, mirrored) for mirrored in (False, True) for turns in range(4)]


@dataclass(frozen=True, eq=False)
class Placing:
    """Objects laid on buildings: n rows.

    building, object : int ``(n,)``. mirrored : bool ``(n,)``: mirrored first, across its y axis.
    numbers : float64 ``(n, 5)``: radians of its turn, which comes last; scale along its frame's
    long side and short side; x, y of its frame's middle, metres.
    frame : float64 ``(n, 3)``: radians of its own frame's long side, x, y of its middle.
    """

    building: np.ndarray
    object: np.ndarray
    mirrored: np.ndarray
    numbers: np.ndarray
    frame: np.ndarray

    def __len__(self) -> int:
        return len(self.building)

    def select(self, chosen: np.ndarray) -> "Placing":
        """Select rows."""
        return Placing(*(getattr(self, column.name)[chosen] for column in fields(self)))

    def join(self, other: "Placing") -> "Placing":
        """Join the rows of two placings."""
        names = (column.name for column in fields(self))
        return Placing(*(np.concatenate([getattr(self, k), getattr(other, k)]) for k in names))

    def shift(self, column: int, by: float) -> "Placing":
        """Add to one of the ``numbers``, and keep scales within `SCALE`."""
        numbers = self.numbers.copy()
        numbers[:, column] += by
        numbers[:, 1:3] = np.clip(numbers[:, 1:3], 1 - SCALE, 1 + SCALE)
        return replace(self, numbers=numbers)

    def where(self, chosen: np.ndarray, other: "Placing") -> "Placing":
        """Take the numbers of ``other`` in the rows ``chosen``, bool ``(n,)``."""
        return replace(self, numbers=np.where(chosen[:, None], other.numbers, self.numbers))

    def assign(self, rows: np.ndarray, other: "Placing") -> "Placing":
        """Put all numbers of ``other`` into ``rows``."""
        numbers = self.numbers.copy()
        numbers[rows] = other.numbers
        return replace(self, numbers=numbers)

    def shrink(self, by: float, metres: float, library: Library) -> "Placing":
        """Multiply both scales, and make the objects shorter and narrower by so many metres."""
        sides = _frames(library.polygons[self.object], self.frame[:, 0])[:, 3:]
        numbers = self.numbers * [1, by, by, 1, 1]
        numbers[:, 1:3] -= metres / sides
        return replace(self, numbers=numbers)

    @property
    def within_scale(self) -> np.ndarray:
        """Bool ``(n,)``: which scales are within `SCALE`, with room for a millimetre."""
        return (self.numbers[:, 1:3] >= 1 - SCALE + 2e-3).all(axis=1)

    @property
    def matrices(self) -> np.ndarray:
        """Float64 ``(n, 2, 3)``: x' = a x + b y + c."""
        angle, along, across, x, y = self.numbers.T
        own, left, low = self.frame.T
        flip = np.where(self.mirrored, -1.0, 1.0)
        c, s, oc, os = np.cos(angle), np.sin(angle), np.cos(own), np.sin(own)
        # into the frame, mirrored across its short side, scaled, turned
        first = np.stack([np.stack([oc, os], -1), np.stack([-os, oc], -1)], axis=1)
        first *= np.stack([along * flip, across], -1)[:, :, None]
        turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], axis=1)
        linear = turn @ first
        middle = np.stack([left, low], -1)[:, :, None]
        shift = np.stack([x, y], -1)[:, :, None] - linear @ middle
        return np.concatenate([linear, shift], axis=2)


def place_objects(placing: Placing, polygons: np.ndarray) -> np.ndarray:
    """Transform the objects' ``polygons`` to their places."""
    shapes = polygons[placing.object]
    counts = shapely.get_num_coordinates(shapes)
    matrix = np.repeat(placing.matrices, counts, axis=0)

    def moved(points: np.ndarray) -> np.ndarray:
        return (matrix[:, :, :2] @ points[:, :, None])[:, :, 0] + matrix[:, :, 2]

    return shapely.transform(shapes, moved)


class Sides:
    """Sides of polygons: float64 ``(e, 4)`` = x, y, x', y', shells counterclockwise and holes
    clockwise; polygon k has those from ``starts[k]`` to ``starts[k + 1]``."""

    def __init__(self, polygons: np.ndarray):
        parts, whose = shapely.get_parts(polygons, return_index=True)
        flat = shapely.get_type_id(parts) == 3
        rings, of = shapely.get_rings(shapely.orient_polygons(parts[flat]), return_index=True)
        points, ring = shapely.get_coordinates(rings, return_index=True)
        same = ring[1:] == ring[:-1]
        self.edges = np.concatenate([points[:-1][same], points[1:][same]], axis=1)
        self.starts = np.searchsorted(whose[flat][of][ring[1:][same]], range(len(polygons) + 1))

    def shared_areas(self, placing: "Placing", grounds: "Sides") -> np.ndarray:
        """Compute m² ``(n,)`` that the objects of a placing, whose sides these are, share with the
        ``grounds`` of their buildings."""
        return shared(
            *(placing.matrices, placing.object, placing.building),
            *(self.edges, self.starts, grounds.edges, grounds.starts),
        )


class Boards:
    """Grids about buildings, of `BOARD` cells a side: buildings, allowed ground, other ground.

    They measure placings to some hundredths of the IoU of polygons, and much faster.
    """

    def __init__(self, polygons: np.ndarray, allowed: np.ndarray, library: Library):
        self.areas = shapely.area(polygons)
        self.sizes = shapely.area(library.polygons)
        self.frames, self.inside = _library_frames(library)
        bounds = shapely.bounds(shapely.union(polygons, allowed)).reshape(-1, 4)
        self.low = bounds[:, :2]
        self.step = np.maximum(bounds[:, 2:] - bounds[:, :2], 1e-6) / BOARD
        self.cells = np.empty((len(polygons), BOARD, BOARD), np.uint8)
        rows, columns = np.divmod(np.arange(BOARD * BOARD), BOARD)
        shapely.prepare(polygons)
        shapely.prepare(allowed)
        for k in range(len(polygons)):
            x = self.low[k, 0] + (columns + 0.5) * self.step[k, 0]
            y = self.low[k, 1] + (rows + 0.5) * self.step[k, 1]
            cells = shapely.contains_xy(allowed[k], x, y).astype(np.uint8)
            cells += shapely.contains_xy(polygons[k], x, y)
            self.cells[k] = cells.reshape(BOARD, BOARD)

    def measure(self, placing: "Placing") -> np.ndarray:
        """Compute the IoU of each placing, less four times the share of it on forbidden ground."""
        return tried(
            *(placing.numbers, np.where(placing.mirrored, -1.0, 1.0)),
            *map(np.ascontiguousarray, (placing.object, placing.building)),
            *(_POINTS, self.inside > 0),
            *(
                np.ascontiguousarray(self.frames[:, 3:]),
                self.sizes,
                self.cells,
                self.low,
                self.step,
                self.areas,
            ),
        )


def match_objects(
    polygons: np.ndarray,
    party: np.ndarray,
    heights: np.ndarray,
    classes: Sequence[str],
    library: Library,
    storey: float,
    most: int,
) -> Placing:
    """Place the ``most`` similar objects on each building, each in its most similar way.

    The comparison takes place in the frames of buildings and objects, the smallest rectangles about
    them, or along their ``party`` walls if these have a direction (radians, NaN for none), on a
    grid of `GRID` points a side: the IoU of the points within. Objects have the class of the
    building, differ in height by at most a ``storey``, and in sides by little more than `SCALE`.
    """
    frames, shapes = _frame_shapes(polygons, np.asarray(party))
    own, objects = _library_frames(library)
    sums, kinds = objects.sum(axis=1), np.array(library.classes, dtype=object)
    rows = []
    for k in range(len(polygons)):
        near = (np.abs(library.heights - heights[k]) <= storey) & (kinds == classes[k])
        if not near.any():
            continue
        near = np.flatnonzero(near)
        found = _ways(frames[k], shapes[k], own, objects, sums, near)
        best = found.argmax(axis=0)
        score = found[best, np.arange(len(near))]
        for j in np.lexsort((near, -score))[:most]:
            if score[j] > 0:
                rows.append((k, near[j], best[j]))
    return _make_placings(rows, frames, own)


def _ways(frame, shape, own, objects, sums, near) -> np.ndarray:
    """Compute the IoU of a building with the objects ``near`` (n,) in each of the `_WAYS`, float
    ``(8, n)``; 0 where their sides differ too much."""
    grid = shape.reshape(GRID, GRID)
    found = np.zeros((len(_WAYS), len(near)))
    for turned in (0, 1):
        ratio = (frame[[4, 3]] if turned else frame[[3, 4]]) / own[near, 3:]
        off = np.maximum(ratio / (1 + SCALE), (1 - SCALE) / ratio).clip(1)
        fits = np.flatnonzero((off <= 1 + _OFF).all(axis=1))
        if not len(fits):
            continue
        ways = [w for w, (turns, _) in enumerate(_WAYS) if turns % 2 == turned]
        views = np.stack([_turn_back(grid, *_WAYS[w]).ravel() for w in ways]).astype(np.float32)
        common = views @ objects[near[fits]].T
        union = views.sum(axis=1)[:, None] + sums[near[fits]] - common
        found[np.ix_(ways, fits)] = common / union / off[fits].prod(axis=1)
    return found


def _turn_back(grid: np.ndarray, turns: int, mirrored: bool) -> np.ndarray:
    """Turn a building's grid back, then mirror it, for an object that is mirrored, then turned
    counterclockwise. Rows run along y, columns along x."""
    back = np.rot90(grid, turns)
    return back[:, ::-1] if mirrored else back


def _make_placings(rows, frames: np.ndarray, own: np.ndarray) -> Placing:
    table = np.array(rows, int).reshape(-1, 3)
    building, number, way = table.T
    turns = np.array([turns for turns, _ in _WAYS])[way]
    mirrored = np.array([mirrored for _, mirrored in _WAYS])[way]
    frame, object_ = frames[building], own[number]
    sides = np.where((turns % 2 == 1)[:, None], frame[:, [4, 3]], frame[:, [3, 4]])
    scales = np.clip(sides / object_[:, 3:], 1 - SCALE, 1 + SCALE)
    angle = frame[:, 0] + turns * (np.pi / 2)
    numbers = np.column_stack([angle, scales, frame[:, 1:3]])
    return Placing(building, number, mirrored, numbers, object_[:, :3])


def frames_of(library: Library) -> np.ndarray:
    """Compute the frame of each object, along whose sides it is scaled, float64 ``(n, 3)``: radians
    of its long side, x and y of its middle, metres about the object's centroid."""
    return _library_frames(library)[0][:, :3]


def _library_frames(library: Library) -> tuple[np.ndarray, np.ndarray]:
    """Compute frames and grids of a library's objects, once for each library."""
    if library not in _framings:
        _framings[library] = _frame_shapes(library.polygons, np.full(len(library), np.nan))
    return _framings[library]


def _frame_shapes(polygons: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute frames, float64 ``(n, 5)``: radians of a side, x, y of the middle, length along it
    and across; and which points of a grid on them lie within, float32 ``(n, GRID²)``."""
    if not len(polygons):
        return np.empty((0, 5)), np.empty((0, GRID * GRID), np.float32)
    corners = shapely.get_coordinates(shapely.oriented_envelope(polygons)).reshape(-1, 5, 2)
    sides = np.diff(corners[:, :3], axis=1)
    long = np.hypot(*np.moveaxis(sides, -1, 0)).argmax(axis=1)
    x, y = sides[np.arange(len(sides)), long].T
    angles = np.where(np.isnan(directions), np.arctan2(y, x), directions)
    frames = _frames(polygons, angles)
    grids = np.empty((len(polygons), GRID * GRID), np.float32)
    shapely.prepare(polygons)
    for k, (angle, left, low, wide, deep) in enumerate(frames):
        u, v = _ALONG * wide, _ACROSS * deep
        c, s = np.cos(angle), np.sin(angle)
        grids[k] = shapely.contains_xy(polygons[k], left + c * u - s * v, low + s * u + c * v)
    return frames, grids


def _frames(polygons: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Float64 ``(n, 5)``: the rectangle about each polygon with a side at an angle: that angle, x,
    y of its middle, length along it and across."""
    if not len(polygons):
        return np.empty((0, 5))
    points, which = shapely.get_coordinates(polygons, return_index=True)
    c, s = np.cos(angles), np.sin(angles)
    u = points[:, 0] * c[which] + points[:, 1] * s[which]
    v = points[:, 1] * c[which] - points[:, 0] * s[which]
    starts = np.flatnonzero(np.r_[True, which[1:] != which[:-1]])
    low = np.stack([np.minimum.reduceat(one, starts) for one in (u, v)], axis=1)
    high = np.stack([np.maximum.reduceat(one, starts) for one in (u, v)], axis=1)
    middle, sides = (low + high) / 2, high - low
    x = middle[:, 0] * c - middle[:, 1] * s
    y = middle[:, 0] * s + middle[:, 1] * c
    return np.column_stack([angles, x, y, sides])


# Points of a frame's grid, in shares of its sides from its middle.
_LINE = ((np.arange(GRID) + 0.5) / GRID - 0.5).astype(np.float32)
_ACROSS, _ALONG = (one.ravel() for one in np.meshgrid(_LINE, _LINE, indexing="ij"))
_POINTS = np.stack([_ALONG, _ACROSS], axis=1).astype(np.float64)

_framings: WeakKeyDictionary[Library, tuple[np.ndarray, np.ndarray]] = WeakKeyDictionary()
