"""Cutting of surfaces at the borders of tiles, so that tiles meet exactly."""

from collections.abc import Sequence

import numpy as np
import shapely

from evocity.views.surfaces import polygons_of

# Least area of a piece, m².
_LEAST = 1e-9
# Least distance of a point from the corners of its wall, metres: the grid of the ground.
_APART = 0.01


def cut_surfaces(
    polygons: np.ndarray, across: Sequence[float], down: Sequence[float]
) -> dict[tuple[int, int], tuple[np.ndarray, np.ndarray]]:
    """Cut ``polygons``, objects ``(n,)``, at the lines x = ``across`` and y = ``down``, both
    rising.

    Returns the pieces by (row, column) of their tile, from the first ``down`` and ``across`` on:
    objects ``(k,)``, and int ``(k,)``, the polygon of each. Two polygons that share an edge, and
    two tiles that share a border, have the same points there, bit for bit.
    """
    noded = _noded(polygons, np.asarray(across, float), np.asarray(down, float))
    tree = shapely.STRtree(noded)
    pieces = {}
    for row in range(len(down) - 1):
        for column in range(len(across) - 1):
            box = shapely.box(across[column], down[row], across[column + 1], down[row + 1])
            chosen = np.sort(tree.query(box, predicate="intersects"))
            parts, of = polygons_of(shapely.intersection(noded[chosen], box), _LEAST)
            pieces[row, column] = parts, chosen[of]
    return pieces


def cut_at_grid(
    polygons: np.ndarray, across: np.ndarray, down: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cut ``polygons``, objects ``(n,)``, at many lines x = ``across`` and y = ``down``, both
    rising.

    Returns the pieces, objects ``(m,)``, and the polygon of each, int ``(m,)``, rising. Two
    polygons that share an edge have the same points there, bit for bit.
    """
    pieces, of = _noded(polygons, across, down), np.arange(len(polygons))
    low, high = min(across[0], down[0]) - 1, max(across[-1], down[-1]) + 1
    for axis, lines in ((0, across), (1, down)):
        first, last = shapely.bounds(pieces).reshape(-1, 4)[:, [axis, axis + 2]].T
        begin = np.maximum(np.searchsorted(lines, first, side="right") - 1, 0)
        end = np.minimum(np.searchsorted(lines, last), len(lines) - 1)
        counts = np.maximum(end - begin, 0)
        row = np.repeat(np.arange(len(pieces)), counts)
        strip = begin[row] + np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        sides = [lines[strip], low, lines[strip + 1], high]
        order = [0, 1, 2, 3] if axis == 0 else [1, 0, 3, 2]
        boxes = shapely.box(*(sides[k] for k in order))
        parts, cut = pieces[row], counts[row] > 1
        parts[counts[row] < 1] = None
        parts[cut] = shapely.intersection(pieces[row[cut]], boxes[cut])
        pieces, chosen = polygons_of(parts, _LEAST)
        of = of[row[chosen]]
    return pieces, of


def with_crossings(
    polygons: np.ndarray, across: Sequence[float], down: Sequence[float]
) -> np.ndarray:
    """Add the points to ``polygons``, objects ``(n,)``, at which their edges cross the lines: the
    same points, bit for bit, as those of the surfaces beside them after `cut_surfaces`. A point
    within 1 cm of a corner is left out, because shorter edges are not valid in CityJSON."""
    return _noded(polygons, np.asarray(across, float), np.asarray(down, float), _APART)


def _noded(
    polygons: np.ndarray, across: np.ndarray, down: np.ndarray, apart: float = 0.0
) -> np.ndarray:
    """Add the points at which edges of the polygons cross the lines, if they are farther than
    ``apart`` from the corners of the edges, metres."""
    rings, owner = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    if not len(points):
        return polygons
    begin = np.flatnonzero(ring[1:] == ring[:-1])
    a, b = points[begin], points[begin + 1]
    # an edge has the same crossings in both directions
    swap = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    low, high = np.where(swap[:, None], b, a), np.where(swap[:, None], a, b)
    found_at, found = [begin[:0]], [points[:0]]
    for axis, lines in ((0, across), (1, down)):
        for line in lines.tolist():
            before, after = low[:, axis] - line, high[:, axis] - line
            crossing = np.flatnonzero(before * after < 0)
            own, end = low[crossing], high[crossing]
            share = (line - own[:, axis]) / (end[:, axis] - own[:, axis])
            point = own + (end - own) * share[:, None]
            point[:, axis] = line
            if apart:
                away = np.minimum(np.hypot(*(point - own).T), np.hypot(*(end - point).T))
                crossing, point = crossing[away > apart], point[away > apart]
            found_at.append(begin[crossing])
            found.append(point)
    at, extra = np.concatenate(found_at), np.concatenate(found)
    along = ((extra - points[at]) ** 2).sum(axis=1)
    order = np.lexsort((along, at))
    at, extra = at[order], extra[order]
    points, ring = np.insert(points, at + 1, extra, axis=0), np.insert(ring, at + 1, ring[at])
    rings = shapely.linearrings(points, indices=ring)
    # rings of a polygon: the shell first
    first = np.r_[True, owner[1:] != owner[:-1]]
    shells, holes = rings[first], rings[~first]
    of_hole = owner[~first]
    made = np.empty(len(polygons), object)
    counts = np.bincount(of_hole, minlength=len(polygons))
    parts = np.split(holes, np.cumsum(counts)[:-1])
    for k, (shell, inner) in enumerate(zip(shells, parts, strict=True)):
        made[k] = shapely.Polygon(shell, list(inner))
    return shapely.remove_repeated_points(made)
