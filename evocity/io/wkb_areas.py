"""Areas of any geometry in WKB, as they look from above: collections, polyhedral surfaces, TIN.

GEOS reads neither surfaces of solids nor rings of less than four points; this module reads both. A
degenerate ring costs only itself.
"""

import struct

import numpy as np
import shapely

from evocity.io.account import DEGENERATE, EMPTY, NO_POLYGON, Account

_POLYGON, _COLLECTIONS, _SURFACES, _TRIANGLE = 3, (4, 5, 6, 7), (15, 16), 17
# Circular strings, compound curves, curve polygons, collections of them, and their supertypes.
_CURVES = (8, 9, 10, 11, 12, 13, 14)
_DEEPEST = 32


class CurveError(ValueError):
    """An outline with arcs, which neither GEOS nor this module reads."""


def read_areas(shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Convert WKB to areas seen from above. Return them, the number of degenerate rings of each,
    and the extent in z of each solid, else 0. A damaged geometry costs only itself. Raises
    `CurveError` for outlines with arcs."""
    try:
        polygons = shapely.from_wkb(shapes, on_invalid="ignore")
    except NotImplementedError as error:
        raise CurveError("an outline of the file has arcs") from error
    rings, extents = np.zeros(len(shapes), np.int64), np.zeros(len(shapes))
    kinds = shapely.get_type_id(polygons)
    for at in np.flatnonzero(shapely.is_missing(polygons) | (kinds == 7)):
        if shapes[at] is None:
            continue
        try:
            areas = Areas(bytes(shapes[at]))
        except CurveError:
            raise
        except ValueError:
            polygons[at] = None
            continue
        rings[at] = areas.degenerate
        if areas.faces:
            polygons[at], extents[at] = areas.area, areas.extent
        elif areas.degenerate:
            polygons[at] = None
    return shapely.force_2d(polygons), rings, extents


def choose_areas(polygons: np.ndarray, rings: np.ndarray, account: Account) -> np.ndarray:
    """Choose the features with areas, and count the others and the degenerate ``rings``, as
    `read_areas` returns them, in the ``account``. Return the numbers of the chosen."""
    areas = np.isin(shapely.get_type_id(polygons), (3, 6))  # polygons and multipolygons
    lost = ~areas & (rings > 0)
    empty = ~areas & ~lost & shapely.is_empty(polygons)
    account.remark("degenerate rings left out", int(rings[areas].sum()))
    account.drop(DEGENERATE, int(lost.sum()))
    account.drop(EMPTY, int(empty.sum()))
    account.drop(NO_POLYGON, int((~areas & ~lost & ~empty).sum()))
    return np.flatnonzero(areas)


class Areas:
    """Areas of one geometry: ``faces``, the number of ``degenerate`` rings, and for surfaces of
    solids the ``extent`` of z, else 0."""

    def __init__(self, content: bytes):
        self._content, self._at = content, 0
        self.faces: list[shapely.Polygon] = []
        self.degenerate = 0
        self.is_solid = False
        self._low, self._high = np.inf, -np.inf
        try:
            self._read(0)
        except struct.error:
            raise ValueError("a geometry is cut off") from None

    @property
    def extent(self) -> float:
        return float(self._high - self._low) if self.is_solid and self._high > self._low else 0.0

    @property
    def area(self) -> shapely.Geometry:
        """All faces as one geometry; the union of the faces of a solid."""
        if self.is_solid:
            flat = [face for face in self.faces if face.area > 0]
            return shapely.union_all(flat)
        return self.faces[0] if len(self.faces) == 1 else shapely.MultiPolygon(self.faces)

    def _number(self, order: str) -> int:
        (value,) = struct.unpack_from(order + "I", self._content, self._at)
        self._at += 4
        return value

    def _read(self, depth: int) -> None:
        if depth > _DEEPEST:
            raise ValueError("collections that are nested too deeply")
        (flag,) = struct.unpack_from("B", self._content, self._at)
        self._at += 1
        order = "<" if flag else ">"
        code = self._number(order)
        plain = code & 0x0FFFFFFF
        kind, own = plain % 1000, plain // 1000
        axes = 2 + (own in (1, 3) or bool(code & 0x80000000))
        axes += own in (2, 3) or bool(code & 0x40000000)
        has_z = own in (1, 3) or bool(code & 0x80000000)
        if code & 0x20000000:
            self._number(order)
        if kind in (_POLYGON, _TRIANGLE):
            self._polygon(order, axes, has_z)
            return
        if kind == 1:
            self._at += 8 * axes
            return
        count = self._number(order)
        if kind == 2:
            self._at += 8 * axes * count
        elif kind in _COLLECTIONS + _SURFACES:
            self.is_solid |= kind in _SURFACES
            for _ in range(count):
                self._read(depth + 1)
        elif kind in _CURVES:
            raise CurveError("an outline of the file has arcs")
        else:
            raise ValueError(f"a geometry of the type {kind}")

    def _polygon(self, order: str, axes: int, has_z: bool) -> None:
        rings: list[np.ndarray | None] = []
        for _ in range(self._number(order)):
            count = self._number(order)
            end = self._at + 8 * axes * count
            if end > len(self._content):
                raise struct.error("cut off")
            points = np.frombuffer(self._content, order + "f8", axes * count, self._at)
            points = points.reshape(-1, axes).astype(float)
            self._at = end
            if has_z and count:
                self._low = min(self._low, points[:, 2].min())
                self._high = max(self._high, points[:, 2].max())
            flat = np.unique(points[:, :2], axis=0) if count else points
            rings.append(points[:, :2] if len(flat) >= 3 else None)
        if not rings:
            return
        # a wall of a solid is a line from above, and no degenerate ring
        self.degenerate += 0 if self.is_solid else sum(ring is None for ring in rings)
        if rings[0] is not None:
            holes = [ring for ring in rings[1:] if ring is not None]
            self.faces.append(shapely.Polygon(rings[0], holes))
