"""Local density: GSI and FSI of the ground within a radius around places of a map.

Marsault 2002 (§6.2) asks for a computation of built density, on which kinds of streets may depend,
and gives no formula. The disc is ours.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from evocity.errors import MapError, check_number
from evocity.views.limit_tables import read_only

# Rows of discs that are summed at a time.
_AT_A_TIME = 1 << 18


@dataclass(frozen=True, eq=False)
class LocalDensity:
    """Densities of the ground around each pixel of a map.

    A disc counts the pixels of the map whose centres lie within ``radius`` of the place. Ground
    beyond the map counts neither as built nor as open.

    radius : metres. gsi : float64 ``(H, W)``, the built share of each disc. fsi : float64
    ``(H, W)``, floors by the ground of each disc. Both are NaN outside the map's site.
    """

    radius: float
    gsi: np.ndarray
    fsi: np.ndarray


class _Map(Protocol):
    """What the functions below read of a `CityMap`."""

    metres_per_pixel: float
    name: str
    site: np.ndarray | None

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def north_west(self) -> tuple[float, float]: ...

    @property
    def south_west(self) -> tuple[float, float]: ...

    @property
    def built(self) -> np.ndarray: ...

    @property
    def floors(self) -> np.ndarray: ...


def count_floors(heights: np.ndarray, built: np.ndarray, storey: float) -> np.ndarray:
    """Count the floors of each pixel, int64 ``(H, W)``: its height divided by that of a ``storey``,
    rounded, halves up; 0 where nothing is ``built``."""
    # np.rint would round 7.5 m, two floors and a half, down but 4.5 m up
    floors = np.floor(heights / np.float32(storey) + np.float32(0.5))
    return np.where(built, floors, 0).astype(np.int64)


def density_around_pixels(city: _Map, radius: float = 100.0) -> LocalDensity:
    """Compute GSI and FSI of the ground within ``radius`` metres around each pixel of ``city``.
    About 20 ms at 256² and 2 m. The map keeps the result for each radius.

    Raises `MapError` for a radius that is less than a pixel's side.
    """
    known = city.__dict__.setdefault("_local_densities", {})
    if radius not in known:
        _check_radius(city, radius)
        fields = density_field(city.built, city.floors, city.site, radius / city.metres_per_pixel)
        known[radius] = LocalDensity(float(radius), *fields)
    return known[radius]


def density_around_places(
    city: _Map, places: np.ndarray, radius: float = 100.0
) -> tuple[np.ndarray, np.ndarray]:
    """Compute GSI and FSI of the ground within ``radius`` metres around ``places``: two arrays
    float64 ``(n,)``. The places are pairs (x, y) ``(n, 2)`` in the coordinates of the map's
    `outline`.

    Raises `MapError` for places that are not such pairs, or that lie outside the map, and for a
    radius that is less than a pixel's side.
    """
    _check_radius(city, radius)
    array = np.asarray(places, np.float64)
    if array.ndim != 2 or array.shape[1] != 2 or not np.isfinite(array).all():
        raise MapError(
            f"{city.name}: the places have the shape {array.shape}, or contain NaN",
            "an array (n, 2) of finite numbers: x and y of each place",
            "give one row for each place",
        )
    (left, top), pixel = city.north_west, city.metres_per_pixel
    at = np.stack([top - array[:, 1], array[:, 0] - left], axis=1) / pixel
    outside = ((at < 0) | (at > city.shape)).any(axis=1)
    if outside.any():
        x, y = array[np.argmax(outside)]
        right, bottom = left + city.shape[1] * pixel, city.south_west[1]
        raise MapError(
            f"{city.name}: {np.count_nonzero(outside)} of {len(array)} places lie outside the map, "
            f"for example x = {x:g}, y = {y:g}",
            f"places with x from {left:g} to {right:g} and y from {bottom:g} to {top:g}",
            "leave these places out, or give coordinates in the reference system of the map",
        )
    return density_at(city.built, city.floors, city.site, at - 0.5, radius / pixel)


def _check_radius(city: _Map, radius: float) -> None:
    least, most = city.metres_per_pixel, 1e6
    expected = f"metres from {least:g}, the side of a pixel, to {most:g}"
    check_number("radius", radius, least, most, expected, MapError)


def density_field(
    built: np.ndarray, floors: np.ndarray, site: np.ndarray | None, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Compute GSI and FSI around the centres of all pixels, float64 ``(H, W)``, exact.

    built : bool ``(H, W)``. floors : whole numbers ``(H, W)``. site : the map's own pixels, bool
    ``(H, W)``, or None for all. radius : in pixels.
    """
    own = np.ones(built.shape, bool) if site is None else site
    count, footprint, total = (_disc_sums(one, radius) for one in (own, built & own, floors * own))
    with np.errstate(invalid="ignore"):
        gsi, fsi = footprint / count, total / count
    if site is not None:
        gsi[~site] = fsi[~site] = np.nan
    return read_only(gsi), read_only(fsi)


def density_at(
    built: np.ndarray,
    floors: np.ndarray,
    site: np.ndarray | None,
    places: np.ndarray,
    radius: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute GSI and FSI around ``places``, float64 ``(n, 2)``: row and column, with (0, 0) at the
    centre of the north-west pixel. The result is float64 ``(n,)`` each, NaN for a disc without any
    pixel of the map. Other parameters are those of `density_field`."""
    own = np.ones(built.shape, bool) if site is None else site
    summed = [_row_sums(one) for one in (own, built & own, floors * own)]
    steps = np.arange(int(2 * radius) + 2)
    together = max(1, _AT_A_TIME // len(steps))
    chunks = [places[at : at + together] for at in range(0, len(places), together)]
    sums = np.concatenate(
        [
            np.zeros((3, 0), np.int64),
            *(_disc_sums_at(summed, one, radius, steps) for one in chunks),
        ],
        axis=1,
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        return sums[1] / sums[0], sums[2] / sums[0]


def _disc_sums_at(
    summed: list[np.ndarray], places: np.ndarray, radius: float, steps: np.ndarray
) -> np.ndarray:
    """Sum over the discs around ``places``, from ``summed`` rows: int64 ``(k, n)``. ``steps``
    number the rows of a disc."""
    height, width = summed[0].shape[0], summed[0].shape[1] - 1
    row, column = places.T
    at = np.ceil(row - radius).astype(np.int64) + steps[:, None]
    reach = radius**2 - (at - row) ** 2
    low, high = _ends(column, np.maximum(reach, 0))
    low, high = np.clip(low, 0, width), np.clip(high + 1, 0, width)
    outside = (reach < 0) | (at < 0) | (at >= height) | (low >= high)
    high = np.where(outside, low, high)
    first = np.clip(at, 0, height - 1) * (width + 1)
    return np.stack([(one.take(first + high) - one.take(first + low)).sum(0) for one in summed])


def _ends(column: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the first and the last whole column whose squared distance from ``column`` is at most
    ``reach``; the root is corrected where rounding moves it over a column."""
    root = np.sqrt(reach)
    low, high = np.ceil(column - root), np.floor(column + root)
    low -= (low - 1 - column) ** 2 <= reach
    low += (low - column) ** 2 > reach
    high += (high + 1 - column) ** 2 <= reach
    high -= (high - column) ** 2 > reach
    return low.astype(np.int64), high.astype(np.int64)


def _row_sums(values: np.ndarray) -> np.ndarray:
    """Sum each row up to each column, int64 ``(H, W + 1)``."""
    sums = np.zeros((values.shape[0], values.shape[1] + 1), np.int64)
    np.cumsum(values, axis=1, out=sums[:, 1:])
    return sums


def _disc_sums(values: np.ndarray, radius: float) -> np.ndarray:
    """Sum whole numbers ``(H, W)`` over the disc around each pixel, int64 ``(H, W)``."""
    height, width = values.shape
    far = min(int(radius), width - 1)  # columns that a disc reaches to each side
    table = np.pad(_row_sums(values), ((0, 0), (far, far)), mode="edge")
    sums = np.zeros((height, width), np.int64)
    for step in range(min(int(radius), height - 1) + 1):
        reach = int(_ends(np.zeros(1), np.array([radius**2 - step**2], float))[1][0])
        low, high = max(far - reach, 0), min(far + reach, 2 * far) + 1
        rows = table[:, high : high + width] - table[:, low : low + width]
        sums[step:] += rows[: height - step]
        if step:
            sums[: height - step] += rows[step:]
    return sums
