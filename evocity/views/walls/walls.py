"""Straight walls of a map's buildings, as a valid coverage of polygons: parameters and result."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evocity.errors import MapError, check_number
from evocity.views.limit_tables import read_only
from evocity.views.walls.arcs import Arcs, trace_arcs
from evocity.views.walls.coverage import build_coverage
from evocity.views.walls.fitting.lines import fit_lines

if TYPE_CHECKING:
    import shapely

#: Shortest run of a wall that is a significant geometric detail, metres.
DETAIL = 2.2


@dataclass(frozen=True, eq=False)
class Walls:
    """Buildings as polygons with straight walls: a valid coverage.

    polygons : n valid shapely polygons without overlaps. Both sides of a party wall have the same
        points; courtyards are holes.
    buildings : int32 ``(n,)``, rising: the building of each, its label in `CityMap.buildings`. A
        building that touches itself at a pixel's corner, and cannot be filled there, has two
        polygons.
    heights : float64 ``(n,)``, metres.
    fitted, simplified, stairs : number of walls, each between two nodes, that are fitted lines;
        edges of pixels simplified by Douglas and Peucker; and edges of pixels, where lines would
        cross. Walls along the map's border do not count.
    changed : number of pixels filled, taken or given up so that no building touches itself at a
        corner.
    dropped : number of buildings under the least area without a neighbour to join, left out.
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
    edges of pixels divide into straight runs (Douglas and Peucker on their middles, each break then
    moved to the least error). A line is fitted to each run (total least squares). Façades that go
    on straight over a party wall become one line. The middles of pixels decide which building has
    them. So a range of lines leaves the middles of one building on one side and all others on the
    other. The mean of the range counts, or the line along the building's common directions if that
    lies in the range. A courtyard of a few pixels becomes a rectangle along its building's walls if
    it is nearly one. Lines that cross, or bound a polygon that is not valid or unlike its pixels,
    fall back to simpler walls.

    labels : int32 ``(H, W)``: 0 on open ground, 1…n on the buildings, each of pixels that touch by
        sides (`Buildings.labels`).
    heights, directions : float64 ``(n,)``, metres, and degrees counter-clockwise from east (NaN for
        no direction), of each building (`Buildings.height`, `Buildings.direction`).
    corner : (x, y) of the north-west corner, x to the east, y to the north, metres.
    detail : shortest run of a wall, metres, 0 or more. A raster shows nothing below a pixel.
    relative : the same as a share of the smaller building's size, the root of its area, 0…1; the
        larger of both counts. The papers draw 1/20.
    squared : whether walls turn to the one or two main directions of their building, or square to
        them, by small angles. Some pixels' middles may then change sides.
    storeys : height of a storey, metres: heights are rounded to whole storeys, at least one; None
        keeps heights.
    least_area : area below which a building joins the neighbour with which it shares the longest
        wall, m²; without a neighbour it is left out.
    site : bool ``(H, W)``: the map's own pixels, None for all. Walls along its edge follow the
        pixels.

    Raises `MapError` for a parameter that is not a number in its range.

    Sources: the scale of detail and common angles, Marsault 2002 (§6.2) and 2005 (§3.2, fig. 11);
    the method is ours. About 30 ms for a dense map of 256²."""
    runs = "metres, 0 to 20: longer runs are walls of whole houses"
    check_number("detail", detail, 0, 20, runs, MapError)
    check_number("relative", relative, 0, 1, "a share, 0…1", MapError)
    check_number("least_area", least_area, 0, np.inf, "m², 0 or more", MapError)
    if storeys is not None:
        check_number("storeys", storeys, 0.1, 100, "metres, 0.1 to 100, or None", MapError)
    pixel = float(metres_per_pixel)
    count = int(labels.max(initial=0))
    kept, dropped = _remove_specks(labels, count, least_area / pixel**2)
    arcs = trace_arcs(kept, site)
    turned = -np.radians(directions)
    lines = fit_lines(arcs, _details(arcs, detail / pixel, relative), squared, turned)
    coverage = build_coverage(arcs, lines, pixel, corner)
    order = np.argsort(coverage.labels, kind="stable")
    buildings = coverage.labels[order]
    own = heights[buildings - 1].astype(np.float64)
    if storeys is not None:
        own = np.maximum(np.floor(own / storeys + 0.5), 1) * storeys
    levels = np.bincount(coverage.levels[~arcs.beyond], minlength=3).tolist()
    polygons = tuple(coverage.polygons[order])
    columns = read_only(buildings), read_only(own)
    return Walls(polygons, *columns, *levels, arcs.changed, dropped)


def _details(arcs: Arcs, detail: float, relative: float) -> np.ndarray:
    """Compute the shortest run of each arc, px."""
    if not relative:
        return np.full(len(arcs), detail)
    areas = np.bincount(arcs.labels.ravel()).astype(np.float64)
    areas[0] = np.inf  # ground is no building
    beside = [np.where(side > 0, areas[side], np.inf) for side in (arcs.left, arcs.right)]
    return np.maximum(detail, relative * np.sqrt(np.minimum(*beside)))


def _remove_specks(labels: np.ndarray, count: int, least: float) -> tuple[np.ndarray, int]:
    """Remove labels of fewer than ``least`` pixels: the new labels, and the number left out."""
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    small = sizes < least
    small[0] = False
    small &= sizes > 0
    if not small.any():
        return labels, 0
    # pairs of neighbouring pixels of a small and a large building
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
