"""Open ground: the width of streets, connectivity, courtyards, and the view of the sky."""

import math
from functools import lru_cache

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness._kernels import sky_seen
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.views.ground import WIDEST
from evocity.views.limit_tables import read_only

#: Distance beyond which walls do not hide the sky, metres.
HORIZON = 200.0
#: Step between the viewpoints on open ground, pixels, across and down.
EVERY = 4


@fitness(unit="m", range=(0, WIDEST))
def street_width(city: CityMap) -> float:
    """Mean width of streets, weighted by length.

    Formula: Σ w l / Σ l over the middle lines of streets, with w the width of a street from wall to
    wall and l the length of its middle line. The middle lines come from `CityMap.streets`, and
    include those of alleys and courtyards. Open ground does not count as a street if it is wider
    than 60 m, or nearer to the map's border than to a wall. Turning the map by a quarter, or
    mirroring it, changes the mean by about 1 %, because a middle line may follow either of two
    middle pixels. Coarse pixels, and rotations by other angles than quarter turns, change the mean
    by more than 1 %. In a map at 1 m/px, turned by 10°, the measured width of a street of 6 m is
    5.8 m. In a map at 2 m/px, turned by 45°, the measured width of a street of 6 m is about 7 m.
    Unit: metres. Range: above 0, to 60. Empty map: NaN, like every map without streets. Source: the
    street profile of Araldi & Fusco 2019 (EPB 46:1243-1263), applied to the middle lines of a
    raster.

    >>> heights = np.full((40, 40), 9.0)
    >>> heights[12:18] = 0
    >>> street_width(CityMap(heights, 2.0))
    12.0
    """
    streets = city.streets
    if not streets.length > 0:
        return Undefined("no ground between walls, so no street")
    lengths = streets.lengths.astype(np.float64)
    return min(WIDEST, float((lengths * streets.widths).sum() / lengths.sum()))


@fitness(range=(0, 1), any_site=True)
def open_space_connectivity(city: CityMap) -> float:
    """Share of the open ground that belongs to its largest connected piece.

    Formula: max A / Σ A over the connected pieces of open ground, with A the area of each piece
    (`CityMap.open_space`). Pixels that share a side or a corner belong to one piece. Unit: none.
    Range: above 0, to 1. Empty map: 1. A map without open ground has the value NaN. Source: our
    own, after the share of the largest cluster in percolation theory.

    >>> heights = np.zeros((10, 10))
    >>> heights[:, 4] = heights[:, 9] = 9
    >>> open_space_connectivity(CityMap(heights, 2.0))
    0.5
    """
    areas = city.open_space.area
    if not areas.size:
        return Undefined("there is no open ground")
    return float(areas.max() / areas.sum())


@fitness(range=(0, math.inf), any_site=True)
def courtyard_index(city: CityMap) -> float:
    """Area of courtyards per unit of built ground.

    Formula: Σ C / B, with B the total footprint of all buildings, and C the open ground inside the
    outer boundary of a built component. If a building stands in a larger courtyard, the courtyards
    of this building do not count again. Open ground that touches the map's border is not a
    courtyard.
    Unit: none.
    Range: 0 upwards. Empty map: NaN (nothing is built). Source: the courtyard index of Steadman,
    Bruhns & Gakovic 2000 (EPB 27:73-91), as in momepy, but for a whole map.

    >>> heights = np.zeros((10, 10))
    >>> heights[2:8, 2:8] = 9
    >>> heights[4:6, 3:7] = 0
    >>> round(courtyard_index(CityMap(heights, 2.0)), 4)  # 8 / 28
    0.2857
    """
    built = np.count_nonzero(city.built)
    if not built:
        return Undefined("nothing is built")
    space = city.open_space
    return float(space.area[space.enclosed_by >= 0].sum()) / (built * city.metres_per_pixel**2)


@fitness(range=(0, 1), any_site=True)
def sky_view_factor(city: CityMap) -> float:
    """Mean share of the sky that is visible from open ground.

    Formula: mean of cos² γ over 16 directions and over the viewpoints, with γ the angle of the
    horizon above the viewpoint. Viewpoints are the pixels of open ground in every 4th row and
    column, counted from the border that is closer to the pixel. If all these pixels are built on,
    every pixel of open ground is a viewpoint. Along a ray, tan γ = max (h − h₀)/d, with h the
    height of a pixel, h₀ the height of the viewpoint, and d the distance at which the ray enters
    the pixel. Each ray from a viewpoint is 200 m long. The ground beyond the map counts as flat.
    Unit: none. Range: above 0 (a
    deep shaft) to 1 (open land). Empty map: 1. A map without open ground has the value NaN. Source:
    Oke 1987, Boundary Layer Climates; the method of horizons is by Dozier & Frew 1990 (IEEE TGRS
    28:963-969).

    >>> sky_view_factor(CityMap(np.zeros((20, 20)), 2.0))
    1.0
    """
    y, x = _viewpoints(city.open_ground)
    if not y.size:
        return Undefined("there is no open ground")
    return float(sky_view(city, y, x).mean())


def sky_view(city: CityMap, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Compute the share of the sky seen at each of n pixels, rows ``y``, columns ``x``, from the
    height of that pixel: float64 ``(n,)``, 0…1. See `sky_view_factor`."""
    heights = city.heights
    limit = min(HORIZON / city.metres_per_pixel, math.hypot(*heights.shape))
    starts, down, along, distance = cast_rays(limit)
    slopes = (1 / (distance * city.metres_per_pixel)).astype(np.float32)
    seen = np.empty(np.size(y))
    sky_seen(heights, y, x, starts, down, along, slopes, heights.max(), seen)
    return seen


def _viewpoints(ground: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Counted from both sides, so that turning the map picks the same pixels.
    rows, columns = (np.arange(size) for size in ground.shape)
    rows = rows[np.minimum(rows, rows[::-1]) % EVERY == 1]
    columns = columns[np.minimum(columns, columns[::-1]) % EVERY == 1]
    i, j = np.nonzero(ground[np.ix_(rows, columns)])
    return (rows[i], columns[j]) if i.size else np.nonzero(ground)


@lru_cache(maxsize=16)
def cast_rays(limit: float) -> tuple[np.ndarray, ...]:
    """List the pixels that rays in 16 directions pass before ``limit`` px: where each ray starts
    in the list; rows and columns from its origin; the distance, px, at which it enters each."""
    far = np.arange(math.ceil(limit)) + 0.5
    straight = [(0, k + 1, d) for k, d in enumerate(far.tolist())]
    corners = [(k + 1, k + 1, d) for k, d in enumerate((far * math.sqrt(2)).tolist())]
    # At 22.5°, between them, a ray crosses sides of pixels in the order of their distance.
    across = [(d, 0, 1) for d in (far / math.cos(math.pi / 8)).tolist()]
    up = [(d, 1, 0) for d in (far / math.sin(math.pi / 8)).tolist()]
    crossed = sorted(across + up)
    steps = np.cumsum([side[1:] for side in crossed], axis=0).tolist()
    slanting = [(i, j, side[0]) for (i, j), side in zip(steps, crossed, strict=True)]
    rays = []
    for ray in (straight, corners, slanting, [(j, i, d) for i, j, d in slanting]):
        turned = [pixel for pixel in ray if pixel[2] < limit]
        for _ in range(4):
            rays.append(turned)
            turned = [(j, -i, d) for i, j, d in turned]
    starts = np.cumsum([0] + [len(ray) for ray in rays])
    pixels = np.array([pixel for ray in rays for pixel in ray]).reshape(-1, 3)
    steps = pixels[:, :2].astype(np.intp).T
    return tuple(map(read_only, (starts, *map(np.ascontiguousarray, steps), pixels[:, 2].copy())))
