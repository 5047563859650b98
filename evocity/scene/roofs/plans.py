"""Sides of plans of buildings: façades, party walls, and edges that the map cuts."""

from dataclasses import dataclass

import numpy as np

from evocity.formats.solids import Rings
from evocity.scene.roofs import _kernels
from evocity.views.surfaces import shared_segments

#: Edges that deviate less from the first edge of a side belong to it, degrees.
SPREAD = 15.0
#: A side is a party wall if it shares more than this length with a neighbour, metres.
TOUCH = 0.05
#: A neighbour whose eaves are lower by more than this leaves a façade above itself, metres.
BELOW = 3.0


@dataclass(frozen=True, eq=False)
class Sides:
    """Sides of buildings: the edges of each wall.

    of_edge : int64 ``(p,)``, the side of each edge; edge k goes from point k of the rings to the
        next.
    owner : int64 ``(r,)``, rising: the building of each side.
    lengths : float64 ``(r,)``, metres.
    party : bool ``(r,)``: sides on a neighbour's wall or on the map's border.
    high : bool ``(r,)``: sides on the wall of a neighbour higher by a storey.
    ends : bool ``(r,)``: free sides across the end of a wing: convex at both corners, shorter than
        the sides beside, which face each other.
    ways : float64 ``(r, 2)``, the direction from the start to the end.
    before, after : int64 ``(r,)``: the sides beside it in its ring.
    """

    of_edge: np.ndarray
    owner: np.ndarray
    lengths: np.ndarray
    party: np.ndarray
    high: np.ndarray
    ends: np.ndarray
    ways: np.ndarray
    before: np.ndarray
    after: np.ndarray


def sides_of(
    rings: Rings,
    heights: np.ndarray,
    size: tuple[float, float],
    widest: float,
    own: np.ndarray | None = None,
) -> Sides:
    """Return the sides of buildings.

    rings : the rings of all buildings of a map, a valid coverage, metres.
    heights : float64 ``(n,)``, of the eaves, metres.
    size : width and depth of the map, metres.
    widest : most length of the end of a wing, metres.
    own : float64 ``(p, 2)``, the points of each building in metres from a point of its own; None
        means those of the rings.
    """
    points, after, owner = rings.points, rings.after, rings.owner
    own = points if own is None else own
    of_edge, count = _kernels.sides(own, rings.starts, np.cos(np.radians(SPREAD)))
    length = np.hypot(*(own[after] - own).T)
    beside = neighbours(points, points[after], owner)
    shared = beside >= 0
    level = np.where(shared, heights[beside], -np.inf)
    whole = np.bincount(of_edge, length, minlength=count)
    border = np.zeros(len(points), bool)
    for axis in range(2):
        for line in (0.0, size[axis]):
            on = np.abs(points[:, axis] - line) < 1e-6
            border |= on & on[after]
    reaching = (level >= heights[owner] - BELOW) | border
    party = np.bincount(of_edge, length * reaching, minlength=count) > TOUCH
    above = level >= heights[owner] + BELOW
    high = np.bincount(of_edge, length * above, minlength=count) > whole / 2
    first, last = np.full(count, -1), np.full(count, -1)
    # the edge before the first of a side belongs to another side, or the ring has one side
    back = np.empty_like(after)
    back[after] = np.arange(len(after))
    opens = of_edge[back] != of_edge
    first[of_edge[opens]] = np.flatnonzero(opens)
    last[of_edge[back][opens]] = back[opens]
    lone = first < 0
    edges = np.arange(len(points))[::-1]
    some = np.empty(count, np.int64)
    some[of_edge[edges]] = edges
    first[lone], last[lone] = some[lone], some[lone]
    ways = own[after[last]] - own[first]
    ways /= np.maximum(np.hypot(*ways.T), 1e-9)[:, None]
    previous, following = of_edge[back[first]], of_edge[after[last]]
    inner, outer = ways[previous], ways[following]
    turns = [
        one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0] for one, two in ((inner, ways), (ways, outer))
    ]
    ends = ~party & ~lone & (turns[0] > 0.7) & (turns[1] > 0.7) & (whole <= widest)
    ends &= (inner * outer).sum(axis=1) < -0.85
    ends &= whole < np.minimum(whole[previous], whole[following])
    of_side = np.zeros(count, np.int64)
    of_side[of_edge] = owner
    return Sides(of_edge, of_side, whole, party, high, ends, ways, previous, following)


def neighbours(starts: np.ndarray, ends: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Return the other building on each edge, int64 ``(p,)``, -1 without one. Edges of a coverage
    are the same on both sides."""
    one, other = shared_segments(np.stack([starts, ends], axis=1))
    beside = np.full(len(owner), -1)
    beside[one], beside[other] = owner[other], owner[one]
    return beside
