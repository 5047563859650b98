"""Surfaces of streets: discs that move along the edges of a street graph."""

import numpy as np
import scipy

# Step between discs along the points of a line; number of points over which widths are smoothed.
_EVERY, _EVEN = 3, 9


def sweep_discs(edges, halves: np.ndarray, pixel: float, corners: int = 16) -> np.ndarray:
    """Make a polygon for each line: the area of discs that move along it.

    edges : m shapely lines. halves : half the width at each of their points, line after line, m.
    pixel : side of a pixel, m. corners : number of corners of a quarter of a disc.
    """
    import shapely

    surfaces = np.empty(len(edges), dtype=object)
    begin = 0
    for k, edge in enumerate(edges):
        points = shapely.get_coordinates(edge)
        own = scipy.ndimage.uniform_filter1d(
            halves[begin : begin + len(points)].astype(np.float64), _EVEN, mode="nearest"
        )
        begin += len(points)
        at = np.unique(np.append(np.arange(0, len(points), _EVERY), len(points) - 1))
        radius = np.maximum(own[at], pixel / 4)
        discs = shapely.buffer(shapely.points(points[at]), radius, quad_segs=corners)
        pairs = shapely.multipolygons(np.column_stack([discs[:-1], discs[1:]]))
        surfaces[k] = shapely.union_all(shapely.convex_hull(pairs))
    return surfaces


def cut_ribbons(surfaces: np.ndarray, solid: np.ndarray, window: tuple[float, ...]) -> np.ndarray:
    """Cut each of the ``surfaces`` at ``solid`` polygons, and at the ``window``: left, bottom,
    right, top, m."""
    import shapely

    tree = shapely.STRtree(solid)
    ribbons = np.empty(len(surfaces), dtype=object)
    for k, surface in enumerate(surfaces):
        near = solid[tree.query(surface, predicate="intersects")]
        if len(near):
            surface = shapely.difference(surface, shapely.union_all(near))
        ribbons[k] = shapely.buffer(shapely.clip_by_rect(surface, *window), 0)
    return ribbons
