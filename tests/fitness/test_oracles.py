"""Other programs' answers, computed in the same test: momepy, GeoPandas and powerlaw."""

import math
from functools import cache

import geopandas
import momepy
import numpy as np
import powerlaw
import pytest
import shapely
from districts import HEIGHTS, burnt, simulated, turned
from libpysal.graph import Graph

from evocity.citymap import CityMap
from evocity.fitness import (
    alignment_momepy,
    alignment_neighbours,
    fit_sizes,
    fsi,
    gsi,
    height_deviation,
    mean_height,
    orientation_order,
    osr,
    storeys,
)


@cache
def frame() -> geopandas.GeoDataFrame:
    """Momepy's sample district, with the heights it lacks."""
    buildings = geopandas.read_file(momepy.datasets.get_path("bubenec"), layer="buildings")
    return buildings.assign(height=HEIGHTS)


@cache
def coloured(degrees: float = 0, seed: int = 0) -> tuple[geopandas.GeoDataFrame, CityMap]:
    """Bubeneč, jittered, with heights that differ by storeys wherever buildings touch, so that
    each is one; and its raster at 1 m."""
    buildings = frame().set_geometry(turned(degrees, seed), crs=frame().crs)
    colours = np.zeros(len(buildings), int)
    for i, polygon in enumerate(buildings.geometry):
        near = np.flatnonzero(shapely.dwithin(buildings.geometry[:i], polygon, 3.0))
        colours[i] = min(set(range(10)) - set(colours[near]))
    buildings = buildings.assign(height=9.0 + 6 * colours)
    city = burnt(buildings.geometry, buildings.height, 1.0, buildings.total_bounds)
    return buildings, city


@pytest.mark.parametrize("lowered", [0, 1.5])
def test_densities_of_bubenec(lowered):
    """Momepy counts whole floors below the roof, we round: half a floor less is the same."""
    buildings = frame()
    west, south, east, north = buildings.total_bounds
    ground = (east - west) * (north - south)
    covered = buildings.area.sum()
    floors = momepy.floor_area(buildings.area, buildings.height - lowered + 1.5, 3).sum()
    if lowered:
        published = (0.25738, 1.43091, 0.51899, 5.55962)
        truth = (covered / ground, floors / ground, (ground - covered) / floors, floors / covered)
        assert truth == pytest.approx(published, abs=1e-5)
    city = burnt(buildings.geometry, buildings.height - lowered, 1.0, buildings.total_bounds)
    assert gsi(city) == pytest.approx(covered / ground, rel=2e-3)
    assert fsi(city) == pytest.approx(floors / ground, rel=2e-3)
    assert osr(city) == pytest.approx((ground - covered) / floors, rel=2e-3)
    assert storeys(city) == pytest.approx(floors / covered, rel=2e-3)


def test_volume_and_spread_of_bubenecs_heights():
    buildings = frame()
    city = burnt(buildings.geometry, buildings.height, 1.0, buildings.total_bounds)
    volume = momepy.volume(buildings.area, buildings.height).sum()
    assert volume == pytest.approx(1_902_431.23, abs=0.01)
    assert mean_height(city) == pytest.approx(volume / buildings.area.sum(), rel=2e-3)
    spread = np.cov(buildings.height, aweights=buildings.area, ddof=0)
    assert height_deviation(city) == pytest.approx(math.sqrt(spread), rel=2e-3)


@pytest.mark.parametrize("degrees", [0, 10])
def test_directions_and_neighbours_of_bubenec(degrees):
    buildings, city = coloured(degrees)
    assert len(city.buildings.area) == 144
    orientation = momepy.orientation(buildings)
    nearest = Graph.build_knn(buildings.set_geometry(buildings.centroid), 6)
    momepys = momepy.alignment(orientation, nearest).mean()
    rectangles = shapely.get_coordinates(shapely.minimum_rotated_rectangle(buildings.geometry))
    along = rectangles[1::5] - rectangles[::5]
    theta = np.degrees(np.arctan2(along[:, 1], along[:, 0])) % 90
    pairs = nearest.adjacency.index.to_frame().to_numpy()
    gaps = np.abs(theta[pairs[:, 0]] - theta[pairs[:, 1]])
    neighbours = np.minimum(gaps, 90 - gaps).mean()
    if degrees == 0:
        assert orientation.mean() == pytest.approx(20.98390, abs=1e-4)
        assert momepys == pytest.approx(3.11338, abs=1e-4)
        assert neighbours == pytest.approx(4.13, abs=0.005)
    folded = np.abs((city.buildings.direction + 45) % 90 - 45)
    assert folded.mean() == pytest.approx(orientation.mean(), abs=0.5)
    # turned buildings run into each other: on the raster one hides a part of the other
    slack = 0.4 if degrees == 0 else 0.1 * neighbours
    assert alignment_neighbours(city) == pytest.approx(neighbours, abs=slack)
    assert alignment_momepy(city) == pytest.approx(momepys, abs=slack)


@pytest.mark.parametrize("degrees", [0, 5, 10, 20])
def test_order_is_that_of_the_walls_of_the_polygons(degrees):
    """Boeing's φ of the 36 bins of all walls to open ground, both ways, weighted by length."""
    buildings, city = coloured(degrees)
    walls = shapely.get_parts(shapely.boundary(buildings.union_all()))
    steps = np.concatenate([np.diff(shapely.get_coordinates(wall), axis=0) for wall in walls])
    angles = np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
    bins = np.rint(np.concatenate([angles, angles + 180]) / 10).astype(int) % 36
    share = np.bincount(bins, np.tile(np.hypot(*steps.T), 2), 36)
    share = share[share > 0] / share.sum()
    excess = -(share * np.log(share)).sum() - math.log(4)
    expected = 1 - (excess / (math.log(36) - math.log(4))) ** 2
    assert orientation_order(city) == pytest.approx(expected, abs=0.02 if degrees == 0 else 0.08)


@pytest.mark.parametrize("count", [40, 100, 2000])
@pytest.mark.parametrize("m", [0.3, 0.5, 1.0, 1.5, 2.0])
def test_exponents_of_simulated_sizes_are_powerlaws(m, count):
    """α of the density is m + 1. Powerlaw takes the closed form of an unbounded law for many α;
    only its numerical fit heeds the upper bound."""
    sizes = simulated(m, count, np.random.default_rng(int(10 * m) + count))
    law = powerlaw.Power_Law(
        data=sizes,
        xmin=1.0,
        xmax=math.e**4,
        force_numerical_fit=True,
        parameter_ranges={"alpha": [0, 6]},
    )
    fit = fit_sizes(sizes, 1, math.e**4)
    assert fit.m == pytest.approx(law.alpha - 1, abs=1e-3)
    # its distance is taken on one side of each step of the sample only, so up to 1/n less
    distance = law.D * math.sqrt(count)
    assert distance - 0.01 <= fit.ks <= distance + 1 / math.sqrt(count) + 0.01
