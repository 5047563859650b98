"""How façades lie to each other, pixel by pixel: from the structure of the heights' gradient."""

import math
from functools import lru_cache

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness._kernels import fourfold, pool_rows
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Reach of the neighbourhood in which façades are compared: its Gaussian's σ, metres.
NEIGHBOURHOOD = 24.0
#: The Gaussian window ends at so many σ.
_CUT = 2.0
#: A map nowhere steeper than this (metres a metre) has no façades.
_FLAT = 1e-3


@fitness(goal="max", range=(0, 1), any_site=True)
def alignment(city: CityMap) -> float:
    """Share of façades that lie parallel or square to those around them.

    Formula: R4 local, Σ \\|G ∗ (w e^{4iθ})\\| / Σ G ∗ w over the map, θ the angle of the
    gradient of heights and w = \\|∇h\\|² its weight; G a Gaussian window of σ = 24 m, cut
    at 2σ. The factor 4 makes directions a quarter turn apart one. A raster's façades are
    staircases: their angles are found by smoothing the gradient (binomial, σ = √2 px), then
    its square w e^{2iθ} (the same), whose length and half angle are w and θ.
    Unit: none. Range: 0 (façades in all directions everywhere) to 1 (one frame of directions
    in every neighbourhood, though it may turn from one to the next). Corners and the raster
    keep a regular grid near .8; it falls a little with coarser pixels.
    Empty map: NaN, and on any other map without height steps: there are no façades.
    Source: Marsault 2002 asks for such a parameter without a formula; this one is ours, a
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
    down = _pooled(fields, _window(height, sigma))
    cosine, sine, weight = _pooled(down.swapaxes(1, 2), _window(width, sigma))
    lengths = np.hypot(cosine, sine)
    if city.site is not None:
        shares = _about(city.site.T, weight.shape)  # the axes were swapped
        lengths, weight = lengths * shares, weight * shares
    return float(min(1.0, lengths.sum() / weight.sum()))


@fitness(goal="max", range=(0, 1), any_site=True)
def alignment_global(city: CityMap) -> float:
    """Share of façades that lie parallel or square to all others of the map.

    Formula: R4, \\|Σ w e^{4iθ}\\| / Σ w over the map, θ and w as in `alignment`, without its
    neighbourhoods: a fabric that turns little by little has much of `alignment`, little of this.
    Unit: none. Range: 0 (façades in all directions) to 1 (one frame of directions everywhere).
    Empty map: NaN, and on any other map without height steps: there are no façades.
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
    """Float32 ``(3, H, W)``: w cos 4θ, w sin 4θ and w of a map's façades; None if it has none."""
    fields = np.empty((3, *city.shape), np.float32)
    steepest = fourfold(city.structure, fields)
    if city.site is not None:
        fields[:, ~city.site] = 0
        steepest = fields[2].max()
    return fields if steepest > _FLAT**2 else None


def _about(site: np.ndarray, samples: tuple[int, int]) -> np.ndarray:
    """``samples``: the pixels of the ``site`` that lie about each centre of the windows of
    `_window`; windows centred elsewhere are not of the map."""
    rows, columns = np.nonzero(site)
    (height, width), (down, along) = site.shape, samples
    cells = rows * down // height * along + columns * along // width
    return np.bincount(cells, minlength=down * along).reshape(samples)


def _pooled(fields: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Float32 ``(n, samples, W)``: the rows of ``fields`` ``(n, H, W)`` under each ``window``."""
    count, _, columns = fields.shape
    pooled = np.zeros((count, len(window), columns), np.float32)
    pool_rows(np.ascontiguousarray(fields), window, pooled)
    return pooled


@lru_cache(maxsize=32)
def _window(size: int, sigma: float) -> np.ndarray:
    """Gaussian windows along an axis of ``size`` px: float32 ``(samples, size)``, a row a centre.

    What is pooled varies slowly, so centres a third of σ apart do; they lie symmetrically.
    """
    samples = int(np.ceil(size / max(1.0, sigma / 3)))
    centres = (np.arange(samples) + 0.5) * (size / samples) - 0.5
    distance = np.abs(np.arange(size) - centres[:, None]) / sigma
    window = np.where(distance <= _CUT, np.exp(-0.5 * distance**2), 0).astype(np.float32)
    window.setflags(write=False)
    return window
