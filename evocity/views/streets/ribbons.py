"""Surfaces of streets: ribbons of discs along the middle lines, cut at walls."""

import numpy as np
import scipy

# Step between discs along the points of a line; number of points over which widths are smoothed.
_EVERY, _EVEN = 3, 9


def make_ribbons(
    edges, halves: np.ndarray, pixel: float, solid: np.ndarray, window: tuple[float, ...]
) -> np.ndarray:
    """Make a polygon or multipolygon for each line: the area of discs that move along it.

    edges : m shapely lines. halves : half the width at each of their points, line after line, m.
    pixel : side of a pixel, m. solid : polygons to cut out. window : left, bottom, right, top of
    the result, m.
    """
    import shapely

    tree = shapely.STRtree(solid)
    surfaces = np.empty(len(edges), dtype=object)
    begin = 0
    for k, edge in enumerate(edges):
        points = shapely.get_coordinates(edge)
        own = scipy.ndimage.uniform_filter1d(
            halves[begin : begin + len(points)].astype(np.float64), _EVEN, mode="nearest"
        )
        begin += len(points)
        at = np.unique(np.append(np.arange(0, len(points), _EVERY), len(points) - 1))
        discs = shapely.buffer(shapely.points(points[at]), np.maximum(own[at], pixel / 4))
        pairs = shapely.multipolygons(np.column_stack([discs[:-1], discs[1:]]))
        surface = shapely.union_all(shapely.convex_hull(pairs))
        near = solid[tree.query(surface, predicate="intersects")]
        if len(near):
            surface = shapely.difference(surface, shapely.union_all(near))
        surfaces[k] = shapely.buffer(shapely.clip_by_rect(surface, *window), 0)
    return surfaces
