"""Alignment of façades, pixel by pixel, by the structure tensor of the heights' gradient."""

import math
from functools import lru_cache

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness._kernels import fourfold, pool_rows
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: σ of the Gaussian neighbourhood in which façades are compared, metres.
NEIGHBOURHOOD = 24.0
#: Reach of the Gaussian window, in σ.
_CUT = 2.0
#: Least gradient of a façade, metres per metre.
_FLAT = 1e-3


@fitness(goal="max", range=(0, 1), any_site=True)
def alignment(city: CityMap) -> float:
    """Share of façades that are parallel or square to those around them.

    Formula: R4 local, Σ \\|G ∗ (w e^{4iθ})\\| / Σ G ∗ w over the map. θ is the angle of the
    gradient of heights, w = \\|∇h\\|² its weight, and G a Gaussian window of σ = 24 m, cut
    at 2σ. The factor 4 makes directions a quarter turn apart equal. A raster's façades are
    staircases. So the gradient is smoothed (binomial, σ = √2 px), then its square w e^{2iθ}
    (the same filter), whose length and half angle are w and θ.
    Unit: none. Range: 0 (façades in all directions everywhere) to 1 (one frame of directions
    in every neighbourhood). The frame may turn from one neighbourhood to the next. Corners and
    the raster keep a regular grid near .8; coarser pixels lower it a little.
    Empty map: NaN, as on any map without height steps: there are no façades.
    Source: Marsault 2002 asks for this parameter without a formula. The formula is ours, a
    circular mean of fourfold symmetry over the structure tensor of Bigün & Granlund (1987).

    >>> y, x = np.mgrid[:64, :64]
    >>> walls, tower = 9 * (x // 8 % 2), 9 * (np.hypot(x - 32, y - 32) < 15)
    >>> round(alignment(CityMap(walls, 2.0)), 2), alignment(CityMap(tower, 2.0)) < 0.1
    (1.0, True)
    """
    fields = _fourfold(city)
    if fields is None:
        return Undefined("no height steps, so no façades")
    height, width = city.shape
    sigma = NEIGHBOURHOOD / city.metres_per_pixel
    down = _pool(fields, _window(height, sigma))
    cosine, sine, weight = _pool(down.swapaxes(1, 2), _window(width, sigma))
    lengths = np.hypot(cosine, sine)
    if city.site is not None:
        shares = _site_pixels(city.site.T, weight.shape)  # the axes were swapped
        lengths, weight = lengths * shares, weight * shares
    return float(min(1.0, lengths.sum() / weight.sum()))


@fitness(goal="max", range=(0, 1), any_site=True)
def alignment_global(city: CityMap) -> float:
    """Share of façades that are parallel or square to all others of the map.

    Formula: R4, \\|Σ w e^{4iθ}\\| / Σ w over the map, with θ and w as in `alignment`, without its
    neighbourhoods. A fabric that turns little by little has a high `alignment` and a low value
    here.
    Unit: none. Range: 0 (façades in all directions) to 1 (one frame of directions everywhere).
    Empty map: NaN, as on any map without height steps: there are no façades.
    Source: ours, see `alignment`; the mean resultant length of directional statistics (Mardia &
    Jupp 2000, §2.3), of angles times four.

    >>> y, x = np.mgrid[:64, :64]
    >>> walls, tower = 9 * (x // 8 % 2), 9 * (np.hypot(x - 32, y - 32) < 15)
    >>> round(alignment_global(CityMap(walls, 2.0)), 2)
    1.0
    >>> alignment_global(CityMap(tower, 2.0)) < 0.1
    True
    """
    fields = _fourfold(city)
    if fields is None:
        return Undefined("no height steps, so no façades")
    cosine, sine, weight = fields.sum(axis=(1, 2), dtype=np.float64)
    return min(1.0, math.hypot(cosine, sine) / weight)


def _fourfold(city: CityMap) -> np.ndarray | None:
    """Compute w cos 4θ, w sin 4θ and w of a map's façades: float32 ``(3, H, W)``; None without
    façades."""
    fields = np.empty((3, *city.shape), np.float32)
    steepest = fourfold(city.structure, fields)
    if city.site is not None:
        fields[:, ~city.site] = 0
        steepest = fields[2].max()
    return fields if steepest > _FLAT**2 else None


def _site_pixels(site: np.ndarray, samples: tuple[int, int]) -> np.ndarray:
    """Count the pixels of the ``site`` about each centre of the windows of `_window`, an array of
    shape ``samples``; windows centred elsewhere do not belong to the map."""
    rows, columns = np.nonzero(site)
    (height, width), (down, along) = site.shape, samples
    cells = rows * down // height * along + columns * along // width
    return np.bincount(cells, minlength=down * along).reshape(samples)


def _pool(fields: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Sum the rows of ``fields`` ``(n, H, W)`` under each ``window``: ``(n, samples, W)``."""
    count, _, columns = fields.shape
    pooled = np.zeros((count, len(window), columns), np.float32)
    pool_rows(np.ascontiguousarray(fields), window, pooled)
    return pooled


@lru_cache(maxsize=32)
def _window(size: int, sigma: float) -> np.ndarray:
    """Make Gaussian windows along an axis of ``size`` px: float32 ``(samples, size)``, one row for
    each centre.

    The pooled fields vary slowly, so centres a third of σ apart are enough. They lie symmetrically.
    """
    samples = int(np.ceil(size / max(1.0, sigma / 3)))
    centres = (np.arange(samples) + 0.5) * (size / samples) - 0.5
    distance = np.abs(np.arange(size) - centres[:, None]) / sigma
    window = np.where(distance <= _CUT, np.exp(-0.5 * distance**2), 0).astype(np.float32)
    window.setflags(write=False)
    return window
