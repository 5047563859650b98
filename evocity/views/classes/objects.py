"""Objects on a map: those lower than buildings, and the features of all."""

import numpy as np

from evocity.views.buildings import Buildings, measured, zones_of
from evocity.views.connected_components import dilate, pieces

#: Least height of an object, metres: less than a kerb. Ground on a raster may be a centimetre high
#: anywhere.
LOW = 0.1
#: Step of height between two low objects that touch, metres: a little more than a kerb.
LOW_STEP = 0.2
#: Height and area below which low ground is a trace, not an object: a seat, a parked car; metres,
#: m². In raw attractors nearly all free pieces of low ground are traces, in the bundled cities
#: none is.
TRACE = 0.3, 8.0
#: Greatest share of its outline with which an object connected to a building may face higher
#: ground; it must also hold a square of 2 × 2 pixels. Other pieces are feet of walls: mixed pixels
#: of a laser scan, or frayed eaves of a raw attractor. Bundled cities have 500 to 1150 pieces, and
#: keep 0 to 60. A terrace with a depth of half its width has a third.
FRINGE = 0.4


def low_objects(
    heights: np.ndarray,
    built: np.ndarray,
    metres_per_pixel: float,
    site: np.ndarray | None = None,
) -> Buildings | None:
    """Find objects lower than buildings: pools, lawns, benches, basins.

    The pixels are those higher than `LOW` that are not ``built``, bool ``(H, W)``. Gaps and steps
    of height of more than `LOW_STEP` separate objects. Traces (`TRACE`) and feet of walls
    (`FRINGE`) do not count. Returns the table of the objects, None without any. Other parameters
    are those of `evocity.views.buildings.measured`.
    """
    low = (heights > LOW) & ~built
    if not low.any():
        return None
    labels, count = pieces(low)
    zones = zones_of(heights, labels, metres_per_pixel, LOW_STEP, 0.0)
    table = measured(heights, labels, zones, metres_per_pixel, site)
    kept = (table.height >= TRACE[0]) | (table.area >= TRACE[1])
    attached = np.zeros(count + 1, bool)
    attached[labels[low & dilate(built, corners=True)]] = True
    foot = _without_square(zones, len(table))
    foot |= _facing_higher(zones, built, table.height) > FRINGE * table.sides
    kept &= ~(attached[table.component + 1] & foot)
    if not kept.any():
        return None
    zones = np.concatenate([[0], np.where(kept, np.cumsum(kept), 0)]).astype(np.int32)[zones]
    return measured(heights, pieces(zones > 0)[0], zones, metres_per_pixel, site)


def _without_square(zones: np.ndarray, count: int) -> np.ndarray:
    """Select the zones that hold no square of 2 × 2 pixels: bool ``(count,)``."""
    first = zones[:-1, :-1]
    square = (first == zones[1:, :-1]) & (first == zones[:-1, 1:]) & (first == zones[1:, 1:])
    return np.bincount(first[square], minlength=count + 1)[1:] == 0


def _facing_higher(zones: np.ndarray, built: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Count the sides of pixels of each zone that face a higher zone or a ``built`` pixel: int64
    ``(count,)``; ``heights``, ``(count,)``, are those of the zones."""
    level = np.where(built, np.inf, np.concatenate([[0.0], heights])[zones])
    counts = np.zeros(len(heights) + 1, np.int64)
    for here, there in (
        (np.s_[1:], np.s_[:-1]),
        (np.s_[:-1], np.s_[1:]),
        (np.s_[:, 1:], np.s_[:, :-1]),
        (np.s_[:, :-1], np.s_[:, 1:]),
    ):
        counts += np.bincount(zones[here][level[there] > level[here]], minlength=len(counts))
    return counts[1:]


def features(table: Buildings) -> np.ndarray:
    """Compute the features of the n objects of a ``table`` that a table of classes may limit:
    float64 ``(4, n)``, rows as in `table.FEATURES`.

    Area in m². Mean height in m. Roundness: area divided by that of the smallest circle; the area
    counts at most π/4 of the smallest rectangle, as for a disc. A disc has 1, a regular hexagon
    .83, a square .5, a rectangle twice as long as wide .4. Slenderness: height divided by the root
    of the area. On a raster a disc of five pixels across or more has .6 and more; a smaller disc
    looks like a square.
    """
    long, short = table.box.T
    disc = np.minimum(table.area, np.pi / 4 * long * short)
    round_ = np.minimum(disc / (np.pi / 4 * table.circle**2), 1.0)
    return np.stack([table.area, table.height, round_, table.height / np.sqrt(table.area)])
