"""What every registered measure promises, whichever it is."""

import doctest
import math

import numpy as np
import pytest
from towns import draw_town

import evocity.fitness
from evocity import isometries
from evocity.citymap import CityMap

PACKAGED = [m for m in evocity.fitness.measures() if m.function.__module__.startswith("evocity.")]

# How far a measure may move under the 8 isometries. Blocks reach for domains from their
# north-west corner, so the neighbourhood autosimilarity looks at is not quite symmetric.
UNDER_ISOMETRIES = {"autosimilarity": 0.02}
ROUNDING = 1e-5

# value(map of pixels k times larger) / value, for the same raster: power of k.
POWER_OF_PIXEL_SIZE = {"gsi": 0, "fsi": 0, "mean_height": 0, "autosimilarity": 0}


def one_building():
    heights = np.zeros((64, 64))
    heights[20:30, 24:40] = 12
    return CityMap(heights, 2.0, name="one building")


def noise():
    return CityMap(np.random.default_rng(3).gamma(1, 8, (64, 64)), 2.0, name="noise")


MAPS = [
    draw_town(1),
    draw_town(7, side=128, buildings=150),
    CityMap(np.zeros((64, 64)), 2.0, name="empty"),
    CityMap(np.full((64, 64), 9.0), 2.0, name="full"),
    one_building(),
    noise(),
    CityMap(draw_town(5).heights[:61, :38], 0.5, name="odd sides, fine pixels"),
    CityMap(draw_town(5).heights, 60.0, name="pixels larger than any neighbourhood"),
    CityMap(np.full((3, 2), 9.0), 2.0, name="smaller than a block"),
    CityMap(np.full((1, 1), 9.0), 2.0, name="one pixel"),
]
every_measure = pytest.mark.parametrize("measure", PACKAGED, ids=lambda m: m.name)
every_map = pytest.mark.parametrize("city", MAPS, ids=lambda city: city.name)


def test_the_package_has_the_measures_of_the_papers_and_the_densities():
    assert [m.name for m in PACKAGED] == [
        "alignment",
        "autosimilarity",
        "crumbs",
        "fsi",
        "gsi",
        "mean_height",
        "salingaros",
    ]


@every_measure
@every_map
def test_one_number_in_range_and_the_map_untouched(measure, city):
    heights = city.heights.copy()
    value = measure(city)
    assert isinstance(value, float)
    low, high = measure.range
    if math.isnan(value):
        assert value.reason  # NaN says why
    else:
        assert math.isfinite(value)
        assert low <= value <= high
    assert np.array_equal(city.heights, heights)


@every_measure
@every_map
def test_the_same_map_gives_the_same_bits(measure, city):
    again = CityMap(city.heights, city.metres_per_pixel)
    first, second = measure(city), measure(again)
    assert first == second or (math.isnan(first) and math.isnan(second))


@every_measure
@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_and_mirroring_the_city_changes_nothing(measure, iso):
    city = draw_town(7, side=128, buildings=150)
    turned = city.replace(isometries.apply(iso, city.heights))
    tolerance = UNDER_ISOMETRIES.get(measure.name, ROUNDING)
    assert measure(turned) == pytest.approx(measure(city), abs=tolerance, nan_ok=True)


@pytest.mark.parametrize("name", POWER_OF_PIXEL_SIZE)
def test_what_does_not_depend_on_the_size_of_a_pixel(name):
    city = draw_town(7, side=128, buildings=150)
    larger = city.replace(city.heights, metres_per_pixel=2 * city.metres_per_pixel)
    measure = evocity.fitness.get(name)
    assert measure(larger) == measure(city)


@pytest.mark.parametrize("name", ["gsi", "fsi", "mean_height", "salingaros", "crumbs"])
def test_a_finer_raster_of_the_same_city_measures_the_same(name):
    city = draw_town(7, side=128, buildings=150)
    finer = city.replace(np.kron(city.heights, np.ones((2, 2))), metres_per_pixel=1.0)
    measure = evocity.fitness.get(name)
    assert measure(finer) == pytest.approx(measure(city), rel=1e-9, nan_ok=True)


@every_measure
def test_the_documentation_is_whole_and_its_example_runs(measure):
    for part in ("Formula:", "Unit:", "Range:", "Empty map:", "Source:"):
        assert part in measure.doc
    names = {"np": np, "CityMap": CityMap, measure.name: measure}
    example = doctest.DocTestParser().get_doctest(
        measure.doc, names, measure.name, measure.file, measure.line
    )
    assert example.examples
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0


@pytest.mark.parametrize("module", ["__init__", "registry", "goals"])
def test_the_examples_of_the_room_run(module):
    room = __import__(f"evocity.fitness.{module}", fromlist=["*"])
    if module == "__init__":
        room = evocity.fitness
    results = doctest.testmod(room)
    assert results.attempted > 0
    assert results.failed == 0
