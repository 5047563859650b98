"""The walls of a map's buildings: what is asked for, and what comes back."""

from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from evocity.errors import MapError, keyword, setting
from evocity.views.walls.arcs import Arcs, traced
from evocity.views.walls.coverage import covered
from evocity.views.walls.fitting.lines import fitted

if TYPE_CHECKING:
    import shapely

#: Shorter runs of a wall, metres, are no significant geometric detail.
DETAIL = 2.2


@dataclass(frozen=True, eq=False)
class Walls:
    """Buildings as polygons with straight walls: a valid coverage.

    polygons : n valid shapely polygons. None overlaps another; of a party wall both have the same
        points; courtyards are holes.
    buildings : int32 ``(n,)``, rising: the building each is, its label in `CityMap.buildings`. One
        that met itself at a pixel's corner, and could not be filled there, is two polygons.
    heights : float64 ``(n,)``, metres.
    fitted, simplified, stairs : how many walls, each between two nodes, are straight lines, what
        Douglas and Peucker leave of the pixels' edges, and these edges themselves, for lines would
        have crossed; what runs along the map's border is not counted.
    changed : pixels filled, taken or given up so that no building meets itself at a corner.
    dropped : buildings left out, under the least area and without a neighbour to join.
    """

    polygons: "tuple[shapely.Polygon, ...]"
    buildings: np.ndarray
    heights: np.ndarray
    fitted: int
    simplified: int
    stairs: int
    changed: int
    dropped: int

    def __len__(self) -> int:
        return len(self.polygons)


def walls_of(
    labels: np.ndarray,
    heights: np.ndarray,
    directions: np.ndarray,
    metres_per_pixel: float,
    corner: tuple[float, float],
    *,
    detail: float = DETAIL,
    relative: float = 0.0,
    squared: bool = False,
    storeys: float | None = None,
    least_area: float = 0.0,
    site: np.ndarray | None = None,
) -> Walls:
    """Fit straight walls to buildings.

    Each wall is traced once, between nodes where three buildings, or two and the ground, meet. Its
    pixels' edges are parted into straight runs (Douglas and Peucker on their middles, each break
    then moved to where it leaves the least error), a line is fitted to each (total least squares),
    façades that go on straight over a party wall become one line. A map is burnt by the middles of
    its pixels: where lines leave those of one building on one side and all others on the other, the
    mean of these is taken, or that along its building's common directions, if it is one of them.
    Corners lie where lines cross. A courtyard of some pixels is a rectangle along its building's
    walls, if it is nearly one. What crosses, bounds no valid polygon, or one unlike its pixels,
    falls back.

    Parameters
    ----------
    labels : int32 ``(H, W)``: 0 on open ground, 1…n on the buildings, each of pixels that touch by
        sides (`Buildings.labels`).
    heights, directions : float64 ``(n,)``, metres, and degrees counter-clockwise from east, NaN for
        none, of each building (`Buildings.height`, `Buildings.direction`).
    metres_per_pixel : side of a pixel, metres.
    corner : (x, y) of the north-west corner, x to the east, y to the north, metres.
    detail : shorter runs are left out, metres, 0 or more. What is under a pixel cannot be seen.
    relative : the same as a share of the smaller building's size, the root of its area, 0…1; the
        larger of both counts. The papers draw 1/20.
    squared : whether walls are turned to the one or two directions that most of their building's
        have, with what is square to them, also where some pixels' middles change sides: where they
        are near, and no end moves by much over a pixel.
    storeys : height of a storey, metres, to whole numbers of which heights are rounded, one at
        least; None leaves them.
    least_area : a smaller building, m², joins the neighbour with which it shares the longest wall,
        or is dropped if it has none.
    site : bool ``(H, W)``: where the map's own pixels are, None for everywhere. Walls along its
        edge are left as the pixels are.

    Raises
    ------
    MapError : a parameter is no such number.

    Sources: the scale of detail and common angles, Marsault 2002 (§6.2) and 2005 (§3.2, fig. 11);
    how they are found, ours. About 30 ms for a dense map of 256².
    """
    _check("detail", detail, 0, 20, "metres, 0 to 20: longer ones are walls of whole houses")
    _check("relative", relative, 0, 1, "a share, 0…1")
    _check("least_area", least_area, 0, np.inf, "m², 0 or more")
    if storeys is not None:
        _check("storeys", storeys, 0.1, 100, "metres, 0.1 to 100, or None")
    pixel = float(metres_per_pixel)
    count = int(labels.max(initial=0))
    kept, dropped = _without_specks(labels, count, least_area / pixel**2)
    arcs = traced(kept, site)
    turned = -np.radians(directions)
    lines = fitted(arcs, _details(arcs, detail / pixel, relative), squared, turned)
    found = covered(arcs, lines, pixel, corner)
    order = np.argsort(found.labels, kind="stable")
    buildings = found.labels[order]
    own = heights[buildings - 1].astype(np.float64)
    if storeys is not None:
        own = np.maximum(np.floor(own / storeys + 0.5), 1) * storeys
    levels = np.bincount(found.levels[~arcs.beyond], minlength=3).tolist()
    own.setflags(write=False)
    buildings.setflags(write=False)
    return Walls(tuple(found.polygons[order]), buildings, own, *levels, arcs.changed, dropped)


def _check(name: str, value: object, low: float, high: float, wanted: str) -> None:
    if not (isinstance(value, Real) and low <= value <= high and np.isfinite(value)):
        raise MapError(setting(name, value), wanted, f"correct {keyword(name)}, or leave it out")


def _details(arcs: Arcs, detail: float, relative: float) -> np.ndarray:
    """Of each arc how long a run must be, px."""
    if not relative:
        return np.full(len(arcs), detail)
    areas = np.bincount(arcs.labels.ravel()).astype(np.float64)
    areas[0] = np.inf  # ground is no building
    beside = [np.where(side > 0, areas[side], np.inf) for side in (arcs.left, arcs.right)]
    return np.maximum(detail, relative * np.sqrt(np.minimum(*beside)))


def _without_specks(labels: np.ndarray, count: int, least: float) -> tuple[np.ndarray, int]:
    """The labels without those of fewer than ``least`` pixels, and how many were dropped."""
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    small = sizes < least
    small[0] = False
    small &= sizes > 0
    if not small.any():
        return labels, 0
    # pairs of pixels side by side, of a small one and one that is not
    one = np.concatenate([labels[1:].ravel(), labels[:, 1:].ravel()])
    other = np.concatenate([labels[:-1].ravel(), labels[:, :-1].ravel()])
    one, other = np.concatenate([one, other]), np.concatenate([other, one])
    beside = small[one] & ~small[other] & (other > 0)
    pairs, sides = np.unique(
        one[beside].astype(np.int64) * (count + 1) + other[beside], return_counts=True
    )
    becomes = np.where(small, 0, np.arange(count + 1)).astype(np.int32)
    for at in np.argsort(sides, kind="stable"):  # the longest shared wall is written last
        becomes[pairs[at] // (count + 1)] = pairs[at] % (count + 1)
    return becomes[labels], int(np.count_nonzero(small & (becomes == 0)))
