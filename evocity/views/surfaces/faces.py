"""Faces: polygons that may overlap, cut into one valid coverage on a grid."""

from dataclasses import dataclass

import numpy as np
import shapely

from evocity.views.walls.coverage import find_pinched

#: Most of a building's area that `widen_necks` removes, as a share.
_SLIVER = 0.01


@dataclass(frozen=True, eq=False)
class Faces:
    """The faces between lines on a grid: a valid coverage.

    polygons : objects ``(n,)``. inside : float64 ``(n, 2)``, a point in each. first, second : int64
    ``(e,)``, the faces on both sides of each edge between two faces; length : float64 ``(e,)``,
    metres.
    """

    polygons: np.ndarray
    inside: np.ndarray
    first: np.ndarray
    second: np.ndarray
    length: np.ndarray

    def __len__(self) -> int:
        return len(self.polygons)


def cut_into_faces(areas: np.ndarray, grid: float) -> Faces:
    """Cut the plane along the outlines of ``areas``, polygons or multipolygons, on a ``grid``,
    metres. All corners lie on the grid (snap rounding), so that no edge is shorter. What no area
    encloses has no face."""
    lines = shapely.get_parts(shapely.boundary(shapely.get_parts(areas)))
    noded = shapely.union_all(lines, grid_size=grid)
    polygons = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    inside = shapely.get_coordinates(shapely.point_on_surface(polygons))
    return Faces(polygons, inside, *_neighbours(polygons))


def widen_necks(buildings: np.ndarray, grid: float) -> np.ndarray:
    """Widen the necks of buildings that would touch themselves on a ``grid``, metres, by squares
    of six steps. Neighbours give way. Where squares do not suffice, as on a long spike, the
    building loses the parts that the grid cuts off, at most a hundredth of its area."""
    if not len(buildings):
        return buildings
    snapped = shapely.set_precision(buildings, grid)
    broken = np.flatnonzero((shapely.get_type_id(snapped) != 3) | find_pinched(snapped))
    if not len(broken):
        return buildings
    buildings = buildings.copy()
    tree = shapely.STRtree(buildings)
    for k in broken.tolist():
        rings, ring = shapely.get_coordinates(
            shapely.get_rings(shapely.get_parts(snapped[k])), return_index=True
        )
        first = np.r_[True, ring[1:] != ring[:-1]]  # a ring repeats its first point
        points, often = np.unique(rings[~first], axis=0, return_counts=True)
        x, y = points[often > 1].T
        squares = shapely.box(x - 3 * grid, y - 3 * grid, x + 3 * grid, y + 3 * grid)
        whole = shapely.union_all([buildings[k], *squares])
        if not len(squares) or shapely.get_type_id(whole) != 3:
            continue
        near = tree.query(whole, predicate="intersects")
        near = near[near != k]
        cut = shapely.difference(buildings[near], shapely.union_all(squares))
        if (shapely.get_type_id(cut) == 3).all():
            buildings[near], buildings[k] = cut, _without_slivers(whole, grid)
    return buildings


def _without_slivers(building: shapely.Polygon, grid: float) -> shapely.Polygon:
    """Remove the small parts of a ``building`` that hang on necks without width on a ``grid``."""
    snapped = shapely.set_precision(building, grid)
    if shapely.get_type_id(snapped) == 3:
        return building
    parts = shapely.get_parts(snapped)
    largest = parts[np.argmax(shapely.area(parts))]
    return largest if largest.area >= (1 - _SLIVER) * building.area else building


def _neighbours(polygons: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    bits, owner = segments_of(polygons)
    one, other = shared_segments(bits)
    length = np.hypot(*(bits[one, 1] - bits[one, 0]).T)
    return owner[one], owner[other], length


def segments_of(polygons: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the edges of polygons in the direction of their rings, float64 ``(k, 2, 2)``, and the
    polygon of each, int64 ``(k,)``."""
    rings, of = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    bits = np.stack([points[:-1], points[1:]], axis=1)[same]
    return bits, of[ring[1:][same]]


def shared_segments(bits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the edges that two polygons of a coverage share, among edges ``(k, 2, 2)``: the index of
    the edge on each side, int64 ``(e,)``."""
    number, _ = pair_segments(bits)
    order = np.argsort(number, kind="stable")
    twice = np.flatnonzero(number[order][1:] == number[order][:-1])
    return order[twice], order[twice + 1]


def pair_segments(bits: np.ndarray) -> tuple[np.ndarray, int]:
    """Number edges ``(k, 2, 2)`` so that equal edges, in either direction, have the same number:
    int64 ``(k,)``, and how many numbers there are."""
    backwards = (bits[:, 0, 0] > bits[:, 1, 0]) | (
        (bits[:, 0, 0] == bits[:, 1, 0]) & (bits[:, 0, 1] > bits[:, 1, 1])
    )
    rows = np.where(backwards[:, None, None], bits[:, ::-1], bits).reshape(-1, 4)
    order = np.lexsort(rows.T)
    number = np.zeros(len(rows), np.int64)
    number[order[1:]] = np.cumsum((rows[order[1:]] != rows[order[:-1]]).any(axis=1))
    return number, int(number.max(initial=-1)) + 1


def join_small(
    faces: Faces, labels: np.ndarray, fixed: np.ndarray, least: float, thin: float
) -> np.ndarray:
    """Give small faces the label of the neighbour with the longest common edge: the new labels.

    labels : int64 ``(n,)``. fixed : bool ``(n,)``, faces that keep their label and give it to no
    other. A patch of faces with one label is small below ``least`` m², or if it is narrower than
    ``thin`` metres on average.
    """
    labels = labels.copy()
    area, length = shapely.area(faces.polygons), shapely.length(faces.polygons)
    free = ~fixed[faces.first] & ~fixed[faces.second]
    one, other, edge = faces.first[free], faces.second[free], faces.length[free]
    for _ in range(8):
        patch = _patches(one, other, labels)
        count = int(patch.max(initial=-1)) + 1
        within = patch[one] == patch[other]
        areas = np.bincount(patch, area, minlength=count)
        lengths = np.bincount(patch, length, minlength=count)
        lengths -= 2 * np.bincount(patch[one[within]], edge[within], minlength=count)
        small = (areas < least) | (areas < thin / 2 * lengths)
        small[patch[fixed]] = False
        meeting = ~within & (small[patch[one]] | small[patch[other]])
        if not meeting.any():
            break
        a, b, along = patch[one[meeting]], patch[other[meeting]], edge[meeting]
        ends = np.concatenate([np.stack([a, b]), np.stack([b, a])], axis=1)
        pairs, which = np.unique(ends, axis=1, return_inverse=True)
        shared = np.bincount(which.ravel(), np.concatenate([along, along]))
        # the smallest patches go first, and only into larger ones: none moves twice in a round
        giving = small[pairs[0]] & (
            (areas[pairs[0]] < areas[pairs[1]])
            | ((areas[pairs[0]] == areas[pairs[1]]) & (pairs[0] < pairs[1]))
        )
        if not giving.any():
            break
        order = np.argsort(shared[giving], kind="stable")
        target = np.arange(count)
        target[pairs[0][giving][order]] = pairs[1][giving][order]  # the longest is written last
        of_patch = np.zeros(count, labels.dtype)
        of_patch[patch] = labels
        labels = np.where(target[patch] != patch, of_patch[target[patch]], labels)
    return labels


def _patches(one: np.ndarray, other: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Number the patches of neighbouring faces with the same label: int64 ``(n,)``."""
    import scipy

    same = labels[one] == labels[other]
    links = np.ones(np.count_nonzero(same), bool), (one[same], other[same])
    graph = scipy.sparse.coo_array(links, shape=(len(labels), len(labels)))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1].astype(np.int64)


def dissolve(faces: Faces, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join the faces with the same label: polygons, and the label of each, rising."""
    polygons, of = [np.empty(0, object)], [np.empty(0, np.int64)]
    order = np.argsort(labels, kind="stable")
    present, first = np.unique(labels[order], return_index=True)
    for label, members in zip(present.tolist(), np.split(order, first[1:]), strict=True):
        own = faces.polygons[members]
        parts = own if len(own) == 1 else shapely.get_parts(shapely.coverage_union_all(own))
        parts = shapely.get_parts(parts)
        polygons.append(parts)
        of.append(np.full(len(parts), label))
    return np.concatenate(polygons), np.concatenate(of)
