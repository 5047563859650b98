"""What every registered measure promises, whichever it is."""

import doctest
import functools
import importlib
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
# Thinning goes pixel by pixel, which moves a street's line by some of them (width in metres).
UNDER_ISOMETRIES = {
    "autosimilarity": 0.02,
    "frontage": 0.05,
    "picture_likeness": 0.1,  # the gradients of the map turn, those of the reference do not
    "street_distance": 0.1,
    "street_width": 0.2,
    "walk_distance": 30,  # a house goes to the other end of its street
}
# A genome does not turn with the map, so its places of origin lie elsewhere on a turned map.
BOUND_TO_A_GENOME = {"integrity_along_fronts"}
# What directions are compared with does not turn with the map; a quarter turn is all the same.
DIRECTED = {"fabric_distance.direction"}
# The sun does not turn with the map.
UNDER_THE_SUN = {"winter_sun"}
ROUNDING = 1e-5

# value(map of pixels k times larger) / value, for the same raster: power of k.
POWER_OF_PIXEL_SIZE = {
    "gsi": 0,
    "fsi": 0,
    "osr": 0,
    "storeys": 0,
    "mean_height": 0,
    "height_deviation": 0,
    "height_entropy": 0,
    "roof_flatness": 0,
    "autosimilarity": 0,
}


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
AGAIN = [CityMap(city.heights, city.metres_per_pixel) for city in MAPS]
TURNED = [MAPS[1].replace(isometries.apply(iso, MAPS[1].heights)) for iso in range(8)]
REFERENCE = evocity.fitness.Reference.of(draw_town(3, side=128, buildings=150))


@functools.cache
def coded(side):
    """A town of the size of a map, and its code."""
    town = draw_town(1, side=side)
    return town, evocity.encode(town).genome


def measured(measure, city):
    """What ``measure`` says of ``city``; of the code of one town, if it asks for genome, parents or
    sources; beside one town, if it compares."""
    given = {"reference": REFERENCE}
    if "genome" in measure.needs:
        town, code = coded(city.shape[0])
        given |= {"genome": code, "parents": [code], "sources": [town]}
    return measure(city, **{need: given[need] for need in measure.needs})


every_measure = pytest.mark.parametrize("measure", PACKAGED, ids=lambda m: m.name)


def test_the_package_has_the_measures_of_the_papers_and_the_wider_set():
    assert [m.name for m in PACKAGED] == [
        "alignment",
        "alignment_global",
        "alignment_momepy",
        "alignment_neighbours",
        "autosimilarity",
        "box_dimension",
        "building_density",
        "building_types.courtyard_block",
        "building_types.detached",
        "building_types.hall",
        "building_types.row",
        "building_types.shed",
        "building_types.slab",
        "building_types.tower",
        "compactness",
        "component_density",
        "convexity",
        "correlation_dimension",
        "courtyard_index",
        "crumbs",
        "daylight",
        "elongation",
        "eri",
        "fabric_distance",
        "fabric_distance.direction",
        "fabric_distance.height",
        "fabric_distance.roughness",
        "frontage",
        "fsi",
        "gsi",
        "height_context",
        "height_deviation",
        "height_entropy",
        "integrity",
        "integrity_along_fronts",
        "lacunarity",
        "mean_height",
        "object_classes.building",
        "object_classes.fountain",
        "object_classes.furniture",
        "object_classes.ground",
        "object_classes.post",
        "object_classes.shelter",
        "object_classes.tree",
        "object_counts.building",
        "object_counts.fountain",
        "object_counts.furniture",
        "object_counts.ground",
        "object_counts.post",
        "object_counts.shelter",
        "object_counts.tree",
        "open_space_connectivity",
        "orientation_order",
        "osr",
        "party_wall_ratio",
        "picture_likeness",
        "picture_likeness.floor",
        "rectangularity",
        "repeated_footprints",
        "repetition",
        "roof_flatness",
        "salingaros",
        "salingaros_buildings",
        "salingaros_law",
        "salingaros_law.exponent",
        "salingaros_law.largest",
        "salingaros_law.p",
        "salingaros_law.share",
        "salingaros_law.sizes",
        "salingaros_law.smallest",
        "shape_index",
        "sky_view_factor",
        "slivers",
        "small_buildings",
        "smallest_share",
        "storeys",
        "street_distance",
        "street_width",
        "type_distance",
        "walk_distance",
        "winter_sun",
    ]


@every_measure
def test_one_number_in_range_the_same_once_more_and_the_map_untouched(measure):
    low, high = measure.range
    for city, again in zip(MAPS, AGAIN, strict=True):
        if "genome" in measure.needs and city.shape not in ((64, 64), (128, 128)):
            continue  # no code has a map of odd sides
        heights = city.heights.copy()
        value, second = measured(measure, city), measured(measure, again)
        assert isinstance(value, float), city.name
        if math.isnan(value):
            assert value.reason, city.name  # NaN says why
            assert math.isnan(second), city.name
        else:
            assert math.isfinite(value), city.name
            assert low <= value <= high, city.name
            assert value == second, city.name
        assert np.array_equal(city.heights, heights), city.name


@every_measure
def test_turning_and_mirroring_the_city_changes_nothing(measure):
    if measure.name in BOUND_TO_A_GENOME:
        pytest.skip("the genome does not turn")
    if measure.name in UNDER_THE_SUN:
        pytest.skip("the sun does not turn")
    tolerance = UNDER_ISOMETRIES.get(measure.name, ROUNDING)
    turns = range(4 if measure.name in DIRECTED else 8)  # a mirrored city has other directions
    values = [measured(measure, TURNED[iso]) for iso in turns]
    assert values == pytest.approx([values[0]] * len(values), abs=tolerance, nan_ok=True)


@pytest.mark.parametrize("name", POWER_OF_PIXEL_SIZE)
def test_what_does_not_depend_on_the_size_of_a_pixel(name):
    city = draw_town(7, side=128, buildings=150)
    larger = city.replace(city.heights, metres_per_pixel=2 * city.metres_per_pixel)
    measure = evocity.fitness.get(name)
    assert measure(larger) == measure(city)


@pytest.mark.parametrize(
    "name",
    [
        "gsi",
        "fsi",
        "osr",
        "storeys",
        "mean_height",
        "height_deviation",
        "height_entropy",
        "salingaros",
        "salingaros_buildings",
        "crumbs",
    ],
)
def test_a_finer_raster_of_the_same_city_measures_the_same(name):
    city = draw_town(7, side=128, buildings=150)
    finer = city.replace(np.kron(city.heights, np.ones((2, 2))), metres_per_pixel=1.0)
    measure = evocity.fitness.get(name)
    assert measure(finer) == pytest.approx(measure(city), rel=1e-9, nan_ok=True)


@every_measure
def test_the_documentation_is_whole_and_its_example_runs(measure):
    for part in ("Formula:", "Unit:", "Range:", "Empty map:", "Source:"):
        assert part in measure.doc
    name = measure.name.partition(".")[0]
    names = {"np": np, "CityMap": CityMap, "evocity": evocity}
    names[name] = getattr(evocity.fitness, name)
    example = doctest.DocTestParser().get_doctest(
        measure.doc, names, measure.name, measure.file, measure.line
    )
    assert example.examples
    assert doctest.DocTestRunner(verbose=False).run(example).failed == 0


@pytest.mark.parametrize(
    "module", ["fitness", "fitness.measure", "fitness.goals", "fitness.check.trial"]
)
def test_the_examples_of_the_room_run(module):
    results = doctest.testmod(importlib.import_module(f"evocity.{module}"))
    assert results.attempted > 0
    assert results.failed == 0
