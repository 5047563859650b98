"""A part of a map: what is within is measured as a map of its own, what lies beyond is nothing."""

import math
import pickle

import numpy as np
import pytest
from towns import draw_town

import evocity
from evocity import fitness, isometries
from evocity.citymap import CityMap
from evocity.errors import FitnessError, MapError
from evocity.fitness import Part
from evocity.fitness.part import own_name, part_name, within
from evocity.operators import make

CITY = draw_town(7, side=128, buildings=150)
REFERENCE = fitness.Reference.of(draw_town(3, side=128, buildings=150))
PACKAGED = [m for m in fitness.measures() if m.function.__module__.startswith("evocity.")]
ALONE = [m for m in PACKAGED if set(m.needs) <= {"reference"}]
ANY_SITE = [m for m in ALONE if m.any_site]

# The sky is looked at from every 4th pixel, and windows of `alignment` begin, from the border of
# the array: which lies elsewhere where there is room about the site.
ELSEWHERE = {"sky_view_factor": 0.02, "alignment": 0.01}
# Of two pixels that are nearest to one beyond a slanting edge either may be repeated there.
TURNED = {
    "alignment": 0.01,
    "alignment_global": 0.01,
    "alignment_momepy": 0.15,
    "alignment_neighbours": 0.15,
    "daylight": 0.001,
    "frontage": 0.05,
    "street_distance": 0.1,  # thinning goes pixel by pixel
    "walk_distance": 30,
}


def rectangle() -> np.ndarray:
    mask = np.zeros(CITY.shape, bool)
    mask[10:110, 20:121] = True
    return mask


def disc() -> np.ndarray:
    y, x = np.indices(CITY.shape)
    return (y - 60) ** 2 + (x - 70) ** 2 < 50**2


def of(measure, city):
    return measure(city, **({"reference": REFERENCE} if "reference" in measure.needs else {}))


@pytest.mark.parametrize("measure", ALONE, ids=lambda m: m.name)
def test_within_a_rectangle_it_is_the_measure_of_what_is_cut_out_by_hand(measure):
    cut = CityMap(CITY.heights[10:110, 20:121], 2.0)
    value = Part("middle", rectangle()).measured(measure, CITY, REFERENCE)
    assert value == of(measure, cut) or (math.isnan(value) and math.isnan(of(measure, cut)))


@pytest.mark.parametrize("measure", ANY_SITE, ids=lambda m: m.name)
def test_a_site_amid_nothing_measures_as_its_rectangle_alone(measure):
    """As many pixels beyond as there are within: a measure that took them for ground would tell."""
    whole = np.full((140, 160), 30.0)
    site = np.zeros(whole.shape, bool)
    whole[20:120, 30:131] = CITY.heights[10:110, 20:121]
    site[20:120, 30:131] = True
    value = of(measure, CityMap(whole, 2.0, site=site))
    expected = of(measure, CityMap(CITY.heights[10:110, 20:121], 2.0))
    tolerance = ELSEWHERE.get(measure.name, 1e-5)
    assert value == pytest.approx(expected, abs=tolerance, nan_ok=True)


@pytest.mark.parametrize("measure", ANY_SITE, ids=lambda m: m.name)
def test_what_lies_beyond_changes_nothing(measure):
    mask = disc()
    other = CITY.replace(np.where(mask, CITY.heights, draw_town(9, side=128).heights))
    part = Part("disc", mask)
    values = [part.measured(measure, city, REFERENCE) for city in (CITY, other)]
    assert values[0] == values[1] or all(map(math.isnan, values))


@pytest.mark.parametrize("measure", ANY_SITE, ids=lambda m: m.name)
@pytest.mark.parametrize("iso", [3, 5])
def test_turning_the_map_and_its_part_changes_nothing(measure, iso):
    if measure.name in ("fabric_distance.direction", "winter_sun"):
        pytest.skip("what it compares with, or the sun, does not turn")
    y, x = np.indices(CITY.shape)
    mask = (np.abs(y - 40) < 30) & (2 * x > y) & (x < 120)
    turned = CITY.replace(isometries.apply(iso, CITY.heights))
    value = Part("slanting", mask).measured(measure, CITY, REFERENCE)
    other = Part("slanting", isometries.apply(iso, mask)).measured(measure, turned, REFERENCE)
    assert value == pytest.approx(other, abs=TURNED.get(measure.name, 1e-5), nan_ok=True)


def test_densities_of_any_shape_are_those_of_its_pixels():
    mask = disc()
    heights = CITY.heights[mask]
    built = heights > 1.5
    floors = np.floor(heights / 3 + 0.5)[built].sum()
    part = Part("disc", mask)
    assert part.measured(fitness.gsi, CITY) == built.mean()
    assert part.measured(fitness.fsi, CITY) == pytest.approx(floors / mask.sum())
    assert part.measured(fitness.osr, CITY) == pytest.approx((~built).sum() / floors)
    assert part.measured(fitness.mean_height, CITY) == pytest.approx(heights[built].mean())
    cut = CITY.within(mask)
    assert cut.area == mask.sum() * 4
    count = np.count_nonzero(cut.areas >= 24)
    density = part.measured(fitness.component_density, CITY)
    assert density == pytest.approx(count / (mask.sum() * 4 / 1e4))


def test_ground_ends_where_the_part_ends():
    """A yard that the part cuts is none; two streets that meet beyond it are two pieces."""
    heights = np.zeros((24, 24))
    heights[4:20, 4:20] = 9
    heights[8:16, 8:16] = 0
    city = CityMap(heights, 2.0)
    whole, half = np.ones((24, 24), bool), np.ones((24, 24), bool)
    half[8:12, 8:12] = False
    assert fitness.courtyard_index(city.within(whole)) == 64 / (256 - 64)
    assert fitness.courtyard_index(city.within(half)) == 0
    heights[:] = 9
    heights[:, 4:6] = heights[:, 18:20] = heights[20:22] = 0
    mask = np.ones((24, 24), bool)
    mask[18:, 8:] = False
    space = CityMap(heights, 2.0).within(mask).open_space
    assert sorted(space.area / 4) == [18 * 2, 24 * 2 + 2 * 6]
    assert set(space.enclosed_by) == {-1}


def test_facades_that_a_part_cuts_are_no_facades():
    """Within a roof without an edge there are none, whatever the shape of the part."""
    city = CityMap(np.full((64, 64), 12.0), 2.0)
    y, x = np.indices(city.shape)
    value = Part("slanting", x > y).measured(fitness.alignment, city)
    assert value.reason == "no height steps, so no façades"


def test_what_a_part_knows_of_its_place():
    city = CityMap(CITY.heights, 2.0, name="town", origin=(1000.0, 5000.0), crs="EPSG:2154")
    cut = city.within(disc())
    top, left = np.flatnonzero(disc().any(1))[0], np.flatnonzero(disc().any(0))[0]
    assert cut.corner == (top, left)
    assert cut.origin == (1000.0 + 2 * left, 5000.0 - 2 * top)
    assert (cut.name, cut.crs) == ("town", "EPSG:2154")
    assert np.array_equal(cut.of_whole(city.heights)[cut.site], cut.heights[cut.site])
    assert not cut.heights[~cut.site].any()
    again = pickle.loads(pickle.dumps(cut))
    assert np.array_equal(again.site, cut.site)
    assert again.corner == cut.corner
    assert city.within(rectangle()).site is None
    inner = cut.within(np.indices(cut.shape)[0] > 20)
    assert inner.corner == (top + 21, inner.corner[1])
    assert inner.pixels < cut.pixels


def test_the_genome_tells_what_of_the_part_comes_from_where():
    towns = [draw_town(1, side=64), draw_town(2, side=64)]
    towns = [one.replace(one.heights, name=name) for one, name in zip(towns, "ab", strict=True)]
    codes = [evocity.encode(one, block=4, fit=False).genome for one in towns]
    fuse = make("pavement_fusion", side_min=8.0, side_max=32.0)
    child = fuse(codes, np.random.default_rng(1))
    city = evocity.decode(child).city
    reference = fitness.Reference.sources(towns)
    mask = np.zeros(city.shape, bool)
    mask[:20, 30:] = True
    mask[0, 30] = False
    shares = reference.shares(city.within(mask), child)
    parents = child.pavement.raster(child.parent)[mask & city.built]
    names = [child.cities.index(name) for name in "ab"]
    assert shares == pytest.approx([(parents == name).mean() for name in names])


def test_a_part_is_cut_once_for_all_measures():
    part = Part("disc", disc())
    assert part.of(CITY) is part.of(CITY)
    assert Part("disc", disc()).of(CITY) is not part.of(CITY)


def test_names_tell_the_part():
    named = within(fitness.gsi, "west bank")
    assert (named.name, own_name(named.name), part_name(named.name)) == (
        "gsi@west bank",
        "gsi",
        "west bank",
    )
    assert named.source_hash == fitness.gsi.source_hash
    assert named(CITY) == fitness.gsi(CITY)
    assert (own_name("gsi"), part_name("gsi")) == ("gsi", "")


def test_measures_that_cannot_tell_a_part_are_refused():
    part = Part("disc", disc())
    assert Part("middle", rectangle()).is_rectangle
    assert not part.is_rectangle
    for measure in ALONE:
        if not measure.any_site:
            with pytest.raises(
                FitnessError, match="limited to disc: this part of the map is not a rectangle"
            ):
                part.measured(measure, CITY)
    with pytest.raises(
        FitnessError, match=r"integrity cannot be .* arguments describe the whole map: genome"
    ):
        Part("middle", rectangle()).measured(fitness.integrity, CITY)
    assert {m.name for m in ALONE if not m.any_site} == {
        "autosimilarity",
        "box_dimension",
        "correlation_dimension",
        "lacunarity",
        "picture_likeness",
        "picture_likeness.floor",
        "street_width",
    }


@pytest.mark.parametrize(
    ("mask", "says"),
    [
        (np.ones((64, 64), bool), "the type bool and the shape"),
        (np.ones((128, 128)), "the type float64"),
        (np.zeros((128, 128), bool), "marks no pixel"),
    ],
)
def test_parts_that_are_none(mask, says):
    with pytest.raises(MapError, match=says):
        CITY.within(mask)
    with pytest.raises(MapError, match=says):
        CityMap(CITY.heights, 2.0, site=mask)
