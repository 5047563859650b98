"""What stands on a map besides buildings, and how all of it is shaped."""

import numpy as np

from evocity.views.buildings import Buildings, measured, zones_of
from evocity.views.pieces import pieces, widened

#: An object stands higher than this, metres: less than a kerb. Heights of a raster may be a
#: centimetre off the ground anywhere.
LOW = 0.1
#: Low objects that touch are two where their heights differ by more, metres: a kerb and some.
LOW_STEP = 0.2
#: What is lower than a seat and smaller than a parked car is a trace and no object: metres, m². In
#: raw attractors nearly all free pieces of low ground are such, of the bundled cities none is.
TRACE = 0.3, 8.0
#: What is connected to a building counts where it holds a square of 2 × 2 pixels, and at most this
#: share of its outline faces what is higher; else it is the foot of a wall: mixed pixels of a laser
#: scan, the frayed eaves of a raw attractor. Of their 500 to 1150 pieces a bundled city so 0 to 60
#: are left. A terrace as deep as half its width has a third.
FRINGE = 0.4


def low_objects(
    heights: np.ndarray,
    built: np.ndarray,
    metres_per_pixel: float,
    site: np.ndarray | None = None,
) -> Buildings | None:
    """What stands on the ground and is lower than buildings: pools, lawns, benches, basins.

    Pixels higher than `LOW` that are not ``built``, bool ``(H, W)``, are told apart as buildings
    are, by gaps and by steps of height of more than `LOW_STEP`. Left out are traces (`TRACE`) and
    the feet of walls (`FRINGE`). Returns their table, None where there is none; the rest is as
    in `evocity.views.buildings.measured`.
    """
    low = (heights > LOW) & ~built
    if not low.any():
        return None
    labels, count = pieces(low)
    zones = zones_of(heights, labels, metres_per_pixel, LOW_STEP, 0.0)
    table = measured(heights, labels, zones, metres_per_pixel, site)
    kept = (table.height >= TRACE[0]) | (table.area >= TRACE[1])
    attached = np.zeros(count + 1, bool)
    attached[labels[low & widened(built, corners=True)]] = True
    foot = _without_square(zones, len(table))
    foot |= _facing_higher(zones, built, table.height) > FRINGE * table.sides
    kept &= ~(attached[table.component + 1] & foot)
    if not kept.any():
        return None
    zones = np.concatenate([[0], np.where(kept, np.cumsum(kept), 0)]).astype(np.int32)[zones]
    return measured(heights, pieces(zones > 0)[0], zones, metres_per_pixel, site)


def _without_square(zones: np.ndarray, count: int) -> np.ndarray:
    """Bool ``(count,)``: which zones hold no square of 2 × 2 pixels."""
    first = zones[:-1, :-1]
    square = (first == zones[1:, :-1]) & (first == zones[:-1, 1:]) & (first == zones[1:, 1:])
    return np.bincount(first[square], minlength=count + 1)[1:] == 0


def _facing_higher(zones: np.ndarray, built: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Int64 ``(count,)``: of each zone, sides of pixels that face a higher zone or what is
    ``built``; ``heights``, ``(count,)``, are the zones' own."""
    level = np.where(built, np.inf, np.concatenate([[0.0], heights])[zones])
    found = np.zeros(len(heights) + 1, np.int64)
    for one, other in (
        (np.s_[1:], np.s_[:-1]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:, 1:], np.s_[:, :-1]),
        (np.s_[:, :-1], np.s_[:, 1:]),
    ):
        found += np.bincount(zones[one][level[other] > level[one]], minlength=len(found))
    return found[1:]


def features(table: Buildings) -> np.ndarray:
    """Float64 ``(4, n)``: what a table of classes may ask of the n objects of a ``table``, rows as
    in `table.FEATURES`.

    Area in m²; mean height in m; roundness, the area, but at most the π/4 of its smallest
    rectangle that a disc fills, by that of the smallest circle about it: a disc has 1, a regular
    hexagon .83, a square .5, a rectangle twice as long as wide .4; slenderness, height by the root
    of the area. A raster shows a disc round, .6 and more, from five pixels across; smaller ones
    cannot be told from squares.
    """
    long, short = table.box.T
    disc = np.minimum(table.area, np.pi / 4 * long * short)
    round_ = np.minimum(disc / (np.pi / 4 * table.circle**2), 1.0)
    return np.stack([table.area, table.height, round_, table.height / np.sqrt(table.area)])
