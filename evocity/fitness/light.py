"""Light: sun on open ground on the shortest day, and light from the sky on façades."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from evocity.citymap import BUILT_ABOVE, STOREY, CityMap
from evocity.fitness import _kernels
from evocity.fitness.measure import Undefined
from evocity.fitness.openness import HORIZON, cast_rays
from evocity.fitness.registry import fitness
from evocity.views.limit_tables import read_only

#: Latitude of a map without a place, degrees north: Lyon, Bordeaux, Turin, Minneapolis.
LATITUDE = 45.0
#: Declination of the sun at a solstice, degrees.
TILT = 23.436
#: Positions of the sun on the shortest day, in the middles of equal intervals.
POSITIONS = 16
#: Distance between the measured lines of façades, pixels.
EVERY = 6
#: Largest vertical sky component, of a wall without anything before it.
FULL_SKY = 6 / (7 * math.pi) * (math.pi / 4 + 2 / 3)

# The four sides of a pixel, rows and columns.
_SIDES = ((0, 1), (1, 0), (0, -1), (-1, 0))


@fitness(goal="max", unit="h", range=(0, 12), any_site=True)
def winter_sun(city: CityMap, sources: Sequence[CityMap] | None = None) -> float:
    """Mean hours of sun on open ground on the shortest day of the year.

    The time from sunrise to sunset has 16 equal intervals. In the middle of each interval, a pixel
    of open ground is in the shade if the ray to the sun meets a higher pixel. The sky is clear, and
    the ground beyond the map is flat. North of the equator, the shortest day is the solstice of
    December, and south of it the solstice of June. Row 0 of the map is in the north.

    The latitude is that of the map's place. A map that was bred from cities in several places has
    no place of its own. Then the latitude is that of the first source city with a place. Without
    any place, and for a part of a map without a place, the latitude is 45° north.

    Formula: D · Σ s / (16 n), with n the open pixels, s the sunny ones of them in each interval,
    and D the hours from sunrise to sunset. D = 2 arccos(−tan φ tan δ) / 15°, with φ the latitude
    and δ = ∓23.436° the declination of the sun. Unit: hours. Range: 0 to D (8.6 at 45°).
    Empty map: D. A map without open ground has the value NaN. The value is NaN, too, beyond the
    polar circles, where the sun does not rise. Source: the hours of sun on gardens and squares in
    Littlefair, King, Howlett, Ticleanu & Longfield 2022 (Site layout planning for daylight and
    sunlight, BRE 209), for the shortest day. Positions of the sun: Iqbal 1983, An Introduction to
    Solar Radiation.

    >>> round(winter_sun(CityMap(np.zeros((20, 20)), 2.0)), 2)
    8.57
    >>> heights = np.zeros((20, 20))
    >>> heights[15:] = 12  # in the south
    >>> round(winter_sun(CityMap(heights, 2.0)), 2)
    2.2
    """
    if city.site is not None:
        city = city.within(city.site)
    pixels = np.count_nonzero(city.open_ground)
    if not pixels:
        return Undefined("there is no open ground")
    latitude = find_latitude(city, sources)
    hours, suns = shortest_day(latitude)
    if not hours:
        return Undefined(f"the sun does not rise on the shortest day at {latitude:.1f}°")
    sunny = sum(count_sunny(city, azimuth, height) for azimuth, height in suns)
    return hours * sunny / (len(suns) * pixels)


def find_latitude(city: CityMap, sources: Sequence[CityMap] | None = None) -> float:
    """Find the latitude of a map's middle, degrees: of the map, or of the first of its ``sources``
    that has a place; `LATITUDE` without any."""
    for one in (city, *(sources or ())):
        if one.origin is not None and one.crs is not None:
            (x, y), (height, width) = one.origin, one.shape
            half = one.metres_per_pixel / 2
            latitude = _latitude(one.crs, x + width * half, y - height * half)
            if latitude is not None:
                return latitude
    return LATITUDE


@lru_cache(maxsize=64)
def _latitude(crs: str, x: float, y: float) -> float | None:
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        latitude = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(x, y)[1]
    except ProjError:  # a plane without a place on Earth
        return None
    return latitude if math.isfinite(latitude) else None


@lru_cache(maxsize=64)
def shortest_day(latitude: float) -> tuple[float, tuple[tuple[float, float], ...]]:
    """Compute the hours from sunrise to sunset on the shortest day at a ``latitude``, and the
    positions of the sun: azimuth, clockwise from north, and height, both in degrees. The hours are
    0, without positions, where the sun does not rise."""
    place, tilt = math.radians(latitude), math.radians(-math.copysign(TILT, latitude))
    cosine = -math.tan(place) * math.tan(tilt)
    if cosine >= 1:
        return 0.0, ()
    noon = math.acos(cosine)  # from sunrise, as an angle
    suns = []
    for k in range(POSITIONS):
        turn = noon * ((2 * k + 1) / POSITIONS - 1)
        east = -math.cos(tilt) * math.sin(turn)
        north = math.cos(place) * math.sin(tilt)
        north -= math.sin(place) * math.cos(tilt) * math.cos(turn)
        up = math.sin(place) * math.sin(tilt)
        up += math.cos(place) * math.cos(tilt) * math.cos(turn)
        azimuth = math.degrees(math.atan2(east, north)) % 360
        suns.append((azimuth, math.degrees(math.atan2(up, math.hypot(east, north)))))
    return 2 * math.degrees(noon) / 15, tuple(suns)


def count_sunny(city: CityMap, azimuth: float, height: float) -> int:
    """Count the pixels of open ground that the sun reaches from an ``azimuth``, degrees clockwise
    from north, at a ``height`` above the horizon, degrees. About .1 ms at 256²."""
    heights, ground = city.heights, city.open_ground
    down, along = -math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))
    if abs(along) > abs(down):
        heights, ground, down, along = heights.T, ground.T, along, down
    if down > 0:  # the sun stands beyond the last row
        heights, ground = heights[::-1], ground[::-1]
    rise = city.metres_per_pixel * math.tan(math.radians(height)) / abs(down)
    return _kernels.count_sunny(
        np.ascontiguousarray(heights),
        np.ascontiguousarray(ground),
        along / abs(down),
        np.float32(rise),
        np.empty(sum(heights.shape), np.float32),
    )


@fitness(goal="max", range=(0, 0.4), any_site=True)
def daylight(city: CityMap) -> float:
    """Mean vertical sky component of façades: the light from an overcast sky that reaches them.

    The vertical sky component of a point on a wall is the light from the sky on the wall, divided
    by the light on open ground. The sky is the overcast sky of the CIE. A wall with nothing before
    it has .396. A street whose roofs stand 25° above a window gives it .27, which Littlefair calls
    enough; below .15, ordinary windows make a room too dark.

    A façade is a side of a built pixel that is more than 1.5 m higher than the pixel before it.
    Façades between pixels of one row count in every 6th row, and those between pixels of one
    column in every 6th column, both counted from the nearer border. If these lines cross no
    façade, every façade counts. A façade has strips of about 3 m, one for each storey, and each
    strip is seen from its middle. The direction of a wall comes from the slopes of heights around
    it, so walls that cross the raster obliquely do not count as stairs.

    Formula: Σ a v / Σ a over the façades, with a the area of a façade, and v the mean of its
    strips. For a strip, v = 6 / (7 π) · Σ c g / Σ c over those of 16 directions that lie before
    the wall, with c the cosine of the angle between direction and normal. In each direction, g =
    π/4 − γ/2 − sin 2γ / 4 + 2/3 cos³ γ, with γ the angle of the horizon above the middle of the
    strip. Rays are 200 m long, and the ground beyond the map counts as flat. Light that walls
    reflect does not count. Unit: none. Range: 0 to .396. Empty map: NaN, like every map without
    façades. Source: Littlefair, King, Howlett, Ticleanu & Longfield 2022 (Site layout planning
    for daylight and sunlight, BRE 209); the overcast sky is by Moon & Spencer 1942 (Illumination
    Engineering 37:707-726).

    >>> heights = np.zeros((40, 40))
    >>> heights[16:24, 16:24] = 9
    >>> round(daylight(CityMap(heights, 2.0)), 3)
    0.396
    >>> heights[28:] = 9
    >>> round(daylight(CityMap(heights, 2.0)), 3)
    0.352
    """
    if city.site is not None:
        city = city.within(city.site)
    walls, normals, facing = find_facades(city)
    if not facing.size:
        return Undefined("there are no façades")
    before, wall = city.heights[*walls[:2]], city.heights[*walls[2:]]
    area = facing * (wall - before)
    if not area.sum() > 0:
        return Undefined("there are no façades")
    return min(
        FULL_SKY, float((area * light_walls(city, walls, normals, facing)).sum() / area.sum())
    )


def find_facades(city: CityMap, every: int = EVERY) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the façades on every ``every``-th line of a map without a site, or all façades if these
    lines cross none.

    Returns the rows and columns of the pixels before them and of the walls, int64 ``(4, n)``; the
    directions out of the walls in rows and columns, unit vectors ``(2, n)``; and the cosine of the
    angle between wall and side of the pixel ``(n,)``, which is the length of the wall in px."""
    walls = np.concatenate([_pairs_across(city, *side, every) for side in _SIDES], axis=1)
    if every > 1 and not walls.size:
        return find_facades(city, 1)
    out = (walls[:2] - walls[2:]).astype(np.float64)
    doubled = city.structure[:, *walls[:2]] + city.structure[:, *walls[2:]]
    turn = np.arctan2(doubled[1], doubled[0]).astype(np.float64) / 2
    normals = np.where(doubled.any(axis=0), np.stack([np.sin(turn), np.cos(turn)]), out)
    facing = (normals * out).sum(axis=0)
    return walls, normals * np.where(facing < 0, -1.0, 1.0), abs(facing)


def _pairs_across(city: CityMap, down: int, along: int, every: int) -> np.ndarray:
    """List the pixels before façades that face one way, and the pixels of the walls: rows and
    columns of both, int64 ``(4, n)``, on every ``every``-th line that way."""
    heights, ground = city.heights, city.site
    if down:
        heights, ground = heights.T, None if ground is None else ground.T
    lines, size = np.arange(len(heights)), heights.shape[1]
    if every > 1:
        lines = lines[np.minimum(lines, lines[::-1]) % every == 1]
    step, chosen = down or along, heights[lines]
    walls = slice(max(-step, 0), size - max(step, 0))
    before = slice(max(step, 0), size - max(-step, 0))
    high = chosen[:, walls] - chosen[:, before] > BUILT_ABOVE  # so the wall is built, too
    if ground is not None:
        high &= ground[lines, walls] & ground[lines, before]
    y, x = np.nonzero(high)
    y, x = lines[y], x + walls.start
    return np.stack([x + step, y, x, y] if down else [y, x + step, y, x])


def light_walls(
    city: CityMap, walls: np.ndarray, normals: np.ndarray, facing: np.ndarray
) -> np.ndarray:
    """Compute the vertical sky component of n façades as `find_facades` returns them: float64
    ``(n,)``, the mean of each façade's strips. See `daylight`."""
    limit = min(HORIZON / city.metres_per_pixel, math.hypot(*city.shape))
    sky = np.empty(facing.size)
    _kernels.light_facades(
        city.heights,
        walls,
        normals,
        facing / 2,
        STOREY,
        *_directed_rays(limit),
        city.metres_per_pixel,
        float(city.heights.max()),
        sky,
    )
    return sky


@lru_cache(maxsize=16)
def _directed_rays(limit: float) -> tuple[np.ndarray, ...]:
    """List the rays of `cast_rays` with their directions, unit vectors ``(2, 16)`` in rows and
    columns, after where each starts."""
    starts, *pixels = cast_rays(limit)
    ways = []
    for angle in (0, math.pi / 4, math.pi / 8, 3 * math.pi / 8):
        down, along = math.sin(angle), math.cos(angle)
        for _ in range(4):
            ways.append((down, along))
            down, along = along, -down
    return starts, read_only(np.ascontiguousarray(np.array(ways).T)), *pixels
