"""Open ground: the width of streets, connectivity, courtyards, and the view of the sky."""

import math
from functools import lru_cache

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness._kernels import sky_seen
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.views.ground import WIDEST

#: Distance beyond which walls do not hide the sky, metres.
HORIZON = 200.0
#: Step between the viewpoints on open ground, pixels, across and down.
EVERY = 4


@fitness(unit="m", range=(0, WIDEST))
def street_width(city: CityMap) -> float:
    """Mean width of streets, weighted by length.

    Formula: Σ w l / Σ l over the middle lines of streets, with w the width from wall to wall and l
    the length. `CityMap.streets` has these lines: those of all open ground, alleys and courtyards
    included. Ground wider than 60 m, or nearer to the map's border than to a wall, does not count.
    Quarter turns and mirrors move the mean by about 1 %, because either of two middle pixels may
    stay. Other angles and coarse pixels move it more: a street of 6 m reads 5.8 at 10° and 1 m/px,
    about 7 at 45° and 2 m/px.
    Unit: metres. Range: above 0, to 60. Empty map: NaN, as on any map without streets.
    Source: the profile of Araldi & Fusco 2019 (EPB 46:1243-1263), on the raster's skeleton.

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
    """Share of the open ground that its largest piece has.

    Formula: max A / Σ A over the areas A of the ground components (`CityMap.open_space`). Pixels
    that touch by sides or corners are one component.
    Unit: none. Range: above 0, to 1. Empty map: 1. NaN where the whole map is built.
    Source: ours, the share of the largest cluster as in percolation.

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

    Formula: Σ C / B, with B the footprint of all buildings. C is the ground within the outer
    boundary of a built component, without the courtyards of components that stand in it. Ground
    that the map's border cuts is not a courtyard.
    Unit: none. Range: 0 upwards. Empty map: NaN (nothing is built).
    Source: the courtyard index of Steadman, Bruhns & Gakovic 2000 (EPB 27:73-91), which momepy
    follows, for a whole map.

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

    Formula: mean of cos² γ over 16 directions and over every 4th pixel of open ground, across
    and down, counted from the nearer border; over all open pixels if no 4th pixel is open. γ is
    the angle of the horizon: tan γ = max (h − h₀)/d over the pixels that a ray passes, with d the
    distance at which it enters a pixel, up to 200 m. Beyond the map the ground is flat.
    Unit: none. Range: above 0 (a deep shaft) to 1 (open land). Empty map: 1. NaN where the whole
    map is built.
    Source: Oke 1987, Boundary Layer Climates; by horizons, Dozier & Frew 1990 (IEEE TGRS
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
    starts, down, along, distance = _rays(limit)
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
def _rays(limit: float) -> tuple[np.ndarray, ...]:
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
    table = starts, pixels[:, 0].astype(np.intp), pixels[:, 1].astype(np.intp), pixels[:, 2].copy()
    for array in table:
        array.setflags(write=False)
    return table
