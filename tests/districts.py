"""Districts burnt from polygons: momepy's Bubeneč, buildings turned at random, lattices."""

import math
from collections.abc import Callable, Sequence
from functools import cache

import momepy
import numpy as np
import pyogrio
import shapely
from affine import Affine
from rasterio import features
from shapely import affinity

from evocity.citymap import CityMap

#: Heights of Bubeneč's buildings, which the sample lacks, metres.
HEIGHTS = np.linspace(10, 30, 144)


@cache
def bubenec() -> np.ndarray:
    """Polygons of momepy's sample district, in the stretched metres of its EPSG:3857."""
    path = momepy.datasets.get_path("bubenec")
    return shapely.from_wkb(pyogrio.raw.read(path, layer="buildings", columns=[])[2])


def burnt(polygons, heights: Sequence[float], pixel: float, bounds: Sequence[float]) -> CityMap:
    west, south, east, north = bounds
    shape = (math.ceil((north - south) / pixel), math.ceil((east - west) / pixel))
    raster = features.rasterize(
        sorted(zip(polygons, heights, strict=True), key=lambda pair: pair[1]),
        out_shape=shape,
        transform=Affine(pixel, 0, west, 0, -pixel, north),
        dtype="float32",
    )
    return CityMap(raster, pixel)


def turned(degrees: float, seed: int) -> np.ndarray:
    """Bubeneč's polygons, each turned about its centroid by up to ± ``degrees``."""
    turns = np.random.default_rng(seed).uniform(-degrees, degrees, 144)
    return np.array(
        [affinity.rotate(p, t, origin="centroid") for p, t in zip(bubenec(), turns, strict=True)]
    )


def jittered(degrees: float, seed: int, pixel: float = 1.0) -> CityMap:
    """Bubeneč with each building turned about its centroid by up to ± ``degrees``."""
    polygons = turned(degrees, seed)
    return burnt(polygons, HEIGHTS, pixel, shapely.total_bounds(polygons))


def grid(degrees: float, side: int = 20, step: int = 30) -> CityMap:
    """A regular grid of square buildings, turned as a whole; 512 m at 1 m."""
    return lattice(lambda b: affinity.rotate(b, degrees, origin=(0, 0)), side, step)


def lattice(turn: Callable, side: int = 20, step: int = 30) -> CityMap:
    """Square buildings of ``side`` m, one each ``step`` m, each as ``turn`` lays it."""
    steps = range(-480, 481, step)
    buildings = [turn(shapely.box(x, y, x + side, y + side)) for x in steps for y in steps]
    return burnt(buildings, [15.0] * len(buildings), 1.0, (-256, -256, 256, 256))


def simulated(m: float, count: int, rng: np.random.Generator, span: float = 4.0) -> np.ndarray:
    """Sizes with density ∝ x^{−(m+1)} on [1, e^span], by inversion."""
    u = rng.uniform(size=count)
    return np.exp(-np.log1p(u * np.expm1(-m * span)) / m)
