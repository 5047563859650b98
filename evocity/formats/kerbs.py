"""Kerbs: the low walls between carriageways and the higher ground beside them."""

import numpy as np
import shapely

#: Depth of a carriageway below pavements and other ground, metres.
KERB = 0.12
# Farthest an edge with a kerb may lie from the kerb's line, metres.
_NEAR = 2e-3


def kerb_edges(points: np.ndarray, after: np.ndarray, kerbs: shapely.Geometry | None) -> np.ndarray:
    """Find the edges of rings that lie on the lines ``kerbs``: int64 ``(k,)``, their first points.
    Edges may be parts of a line, where a surface is cut.

    points : float64 ``(p, 2)``, metres. after : int64 ``(p,)``, the next point of the same ring.
    """
    middles = (points + points[after]) / 2
    lines = np.empty(0, object) if kerbs is None else shapely.get_parts(kerbs)
    if not (len(lines) and len(middles)):
        return np.empty(0, np.int64)
    tree = shapely.STRtree(lines)
    point, _ = tree.query(shapely.points(middles), predicate="dwithin", distance=_NEAR)
    return np.unique(point)


def kerbs_near(kerbs: shapely.Geometry, box: np.ndarray) -> shapely.Geometry:
    """Return the lines of ``kerbs`` that meet a ``box``, (west, south, east, north), metres."""
    lines = shapely.get_parts(kerbs)
    west, south, east, north = shapely.bounds(lines).reshape(-1, 4).T
    meets = (west <= box[2] + _NEAR) & (east >= box[0] - _NEAR)
    meets &= (south <= box[3] + _NEAR) & (north >= box[1] - _NEAR)
    return shapely.geometrycollections(lines[meets])
