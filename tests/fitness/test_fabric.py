"""How far fabrics are apart: laws, naive twins, and scipy's energy distance in one dimension."""

import pickle

import naive
import numpy as np
import pytest
from scipy import stats
from scipy.spatial.distance import cdist
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import Reference, _kernels, fabric_distance, get
from evocity.fitness.energy import mean_distance
from evocity.fitness.fabric import FEATURES, NUMBERS, features, left_out


def town(seed, side=128, buildings=150):
    return draw_town(seed, side=side, buildings=buildings)


@pytest.fixture(scope="module")
def towns():
    return [town(seed) for seed in range(4)]


@pytest.fixture(scope="module")
def districts():
    names = ("lyon-1er", "montpellier-pas-du-loup", "new-york-west-village")
    return [evocity.read_map(name) for name in names]


def scaled(cities):
    """Of each city the features in deviations of them all together, weighted alike."""
    found = [features(city) for city in cities]
    centre = np.mean([one.mean(axis=1) for one in found], axis=0)
    variance = np.mean([((one.T - centre) ** 2).mean(axis=0) for one in found], axis=0)
    variance[7:] = variance[7:].sum()
    kept = variance > 1e-12
    return [one[kept] / np.sqrt(variance[kept, None]) for one in found], kept


def mean(x, y):
    """Mean distance, of two different columns if they are one table."""
    sums = cdist(x.T, y.T)
    return sums.sum() / (x.shape[1] * (x.shape[1] - 1)) if x is y else sums.mean()


# -- twins and oracles ---------------------------------------------------------------------


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 7), (13, 30)])
def test_sums_of_distances_as_their_naive_twin(n, m):
    rng = np.random.default_rng(n)
    x, y = rng.normal(size=(5, n)).astype(np.float32), rng.normal(size=(5, m)).astype(np.float32)
    ends = np.array([2, 2, 3, 5])
    for other, same in ((y, False), (x, True)):
        sums = np.zeros(4)
        _kernels.distances(x, other, ends, same, sums)
        rows = [[0, 1], [0, 1], [0, 1, 2], [0, 1, 3, 4]]
        expected = [naive.distances(x[r], other[r], same) for r in rows]
        np.testing.assert_allclose(sums, expected, rtol=1e-5)


def test_roughness_as_its_naive_twin():
    heights = np.random.default_rng(4).gamma(3, 3, (30, 40)).astype(np.float32)
    table = CityMap(heights, 2.0).buildings
    squares = np.zeros(len(table))
    _kernels.off_squared(table.labels, heights, table.height, squares)
    np.testing.assert_allclose(squares, naive.off_squared(table.labels, heights, table.height))


def test_energy_distance_of_one_feature_is_scipy_s():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(1, 90)).astype(np.float32), rng.gamma(2, 1, (1, 70)).astype(np.float32)
    ends = np.array([1])
    within = [mean_distance(one, one, ends)[0] for one in (x, y)]
    # scipy's is the root, and counts the pairs of a value with itself
    biased = [one * (1 - 1 / n) for one, n in zip(within, (90, 70), strict=True)]
    squared = 2 * mean_distance(x, y, ends)[0] - sum(biased)
    # scipy's energy distance squared, in one dimension, is half of ours doubled: 2 ∫ (F − G)²
    assert squared == pytest.approx(stats.energy_distance(x[0], y[0]) ** 2, rel=1e-4)


def test_all_numbers_are_the_textbook_s(districts):
    lyon, montpellier, york = districts
    weights = np.array([0.3, 0.7])
    reference = [(lyon, 3.0), (montpellier, 7.0)]
    (a, b), kept = scaled([lyon, montpellier])
    everything = features(york)[kept] / np.sqrt(_variance([lyon, montpellier])[kept, None])
    assert kept.all()
    for name, rows in zip(
        NUMBERS, [range(5), range(6), [*range(5), 6], [*range(5), 7, 8]], strict=True
    ):
        rows = list(rows)
        x, ys = everything[rows], [a[rows], b[rows]]
        between = [mean(x, y) for y in ys]
        within = np.array([[mean(y, z) for z in ys] for y in ys])
        expected = 2 * weights @ between - mean(x, x) - weights @ within @ weights
        measure = fabric_distance if name == "fabric_distance" else get(f"fabric_distance.{name}")
        assert measure(york, reference) == pytest.approx(expected, abs=1e-4)


def _variance(cities):
    found = [features(city) for city in cities]
    centre = np.mean([one.mean(axis=1) for one in found], axis=0)
    variance = np.mean([((one.T - centre) ** 2).mean(axis=0) for one in found], axis=0)
    variance[7:] = variance[7:].sum()
    return variance


def test_features_of_a_house():
    heights = np.zeros((64, 64))
    heights[8:16, 8:24] = np.tile([9.0, 10.0], 8)
    heights[8:16, 24:32] = 15
    (area, short, box, hull, party, rough, height, cos, sin) = features(CityMap(heights, 2.0))
    assert np.exp(area) == pytest.approx([512, 256])
    assert short.tolist() == [0.5, 1]
    assert box.tolist() == hull.tolist() == [1, 1]
    assert party == pytest.approx([8 / 48, 8 / 32])
    assert rough == pytest.approx([0.5, 0])
    assert height.tolist() == [9.5, 15]
    assert (cos.tolist(), sin.tolist()) == ([1, 1], [0, 0])


# -- laws ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fabric_distance", "fabric_distance.roughness"])
def test_a_map_is_about_0_from_itself_and_far_from_others(districts, name):
    measure = get(name)
    for city in districts:
        assert -0.1 < measure(city, reference=city) < 0.01
        others = [other for other in districts if other is not city]
        assert min(measure(city, other) for other in others) > 0.1


def test_unbiased_between_halves_of_one_population(towns):
    values = [fabric_distance(one, other) for one in towns for other in towns if one is not other]
    assert abs(np.mean(values)) < 0.06
    assert min(values) < 0.02


def test_symmetric_but_for_the_scale():
    one, other = town(1), town(2).replace(np.kron(town(2).heights[:64, :64], np.ones((2, 2))))
    pooled = [(one, 1.0), (other, 1e-9)], [(other, 1.0), (one, 1e-9)]  # one scale for both
    assert fabric_distance(other, pooled[0]) == pytest.approx(
        fabric_distance(one, pooled[1]), abs=1e-4
    )


@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_the_map_turns_nothing_but_directions(districts, iso):
    lyon, york = districts[0], districts[2]
    turned = york.replace(isometries.apply(iso, york.heights))
    for name in ("fabric_distance", "fabric_distance.roughness", "fabric_distance.height"):
        assert get(name)(turned, lyon) == pytest.approx(get(name)(york, lyon), abs=0.005)
    measure = get("fabric_distance.direction")
    same = pytest.approx(measure(york, lyon), abs=0.005)
    assert (measure(turned, lyon) == same) == (iso < 4)


def test_directions_tell_a_turned_lattice_from_a_straight_one():
    y, x = np.mgrid[:256, :256]

    def lattice(turn):
        along, across = y * np.cos(turn) + x * np.sin(turn), x * np.cos(turn) - y * np.sin(turn)
        return CityMap(9.0 * ((along % 24 < 12) & (across % 24 < 14)), 2.0)

    straight = lattice(0.05)
    measure = get("fabric_distance.direction")
    assert measure(lattice(0.45), straight) > measure(lattice(0.08), straight) + 0.5


def test_weights_are_shares(districts):
    lyon, montpellier, york = districts
    each = [(lyon, 2.0), (montpellier, 2.0)]
    assert fabric_distance(york, each) == fabric_distance(york, [lyon, montpellier])
    # of one city twice, the pairs of a building with itself count among those of two cities
    assert fabric_distance(york, [lyon, lyon]) == pytest.approx(
        fabric_distance(york, lyon), abs=0.01
    )
    near = [fabric_distance(york, [(lyon, w), (montpellier, 1 - w)]) for w in (0.95, 0.5, 0.05)]
    assert near == sorted(near)  # New York is nearer to Lyon


@pytest.mark.slow
def test_children_are_compared_with_what_they_are_laid_of(districts):
    lyon, montpellier, _ = districts
    genomes = [evocity.encode(city, block=2).genome for city in (lyon, montpellier)]
    reference = Reference.sources([lyon, montpellier])
    for genome, city in zip(genomes, (lyon, montpellier), strict=True):
        decoded = evocity.decode(genome).city
        of_one = fabric_distance(decoded, reference, genome)
        assert of_one == pytest.approx(
            fabric_distance(decoded, [(city, 1.0), *_rest(city, lyon, montpellier)]), abs=1e-4
        )
        assert of_one < 0.1
    heights = np.where(np.arange(256) < 128, montpellier.heights, lyon.heights)
    stitched, laid = lyon.replace(heights), _laid(genomes)
    assert laid.parent.tolist().count(1) == len(laid) // 2
    assert fabric_distance(stitched, reference, laid) < 0.03
    built = [lyon.built[:, 128:].sum() / lyon.built.sum()]
    built += [montpellier.built[:, :128].sum() / montpellier.built.sum()]
    whole = [
        share * features(city).shape[1]
        for share, city in zip(built, (lyon, montpellier), strict=True)
    ]
    assert fabric_distance(stitched, reference, laid) == pytest.approx(
        fabric_distance(stitched, [(lyon, whole[0]), (montpellier, whole[1])]), abs=1e-6
    )
    other = laid.replace(parent=1 - laid.parent)
    assert fabric_distance(stitched, reference, other) > 0.1


def _rest(city, *cities):
    """The others, which count for next to nothing but for the scale."""
    return [(other, 1e-9) for other in cities if other is not city]


def _laid(genomes):
    """A genome whose western half comes from the second city, the eastern from the first."""
    first = genomes[0]
    columns = first.pavement.columns
    west = np.arange(len(first)) % columns < columns // 2
    names = tuple(genome.cities[0] for genome in genomes)
    return first.replace(parent=west.astype(np.uint8), cities=names)


# -- what has no meaning -------------------------------------------------------------------


def test_fewer_than_20_buildings_tell_nothing(districts):
    heights = np.zeros((64, 64))
    for place in range(19):
        heights[
            12 * (place // 5) : 12 * (place // 5) + 4, 12 * (place % 5) : 12 * (place % 5) + 6
        ] = 9
    few = CityMap(heights, 2.0, name="few")
    assert fabric_distance(few, districts[0]).reason.startswith(
        "19 buildings of 24 m² or more in few"
    )
    assert fabric_distance(districts[0], few).reason.startswith(
        "19 buildings of 24 m² or more in the"
    )
    assert np.isnan(get("fabric_distance.height")(few, districts[0]))
    with pytest.raises(FitnessError, match="19 buildings"):
        left_out(few)


def test_what_is_the_same_in_all_buildings_is_left_out_and_told(districts):
    flat = evocity.read_map("villeurbanne-gratte-ciel")  # no heights in its source
    assert left_out(flat) == ("share of party walls", "roughness", "height")
    lyon = districts[0]
    assert left_out([flat, lyon]) == ()
    assert fabric_distance(lyon, flat) == get("fabric_distance.height")(lyon, flat)
    assert fabric_distance(lyon, flat) != get("fabric_distance.direction")(lyon, flat)


def test_buildings_that_are_all_alike_are_no_reference(districts):
    heights = np.zeros((64, 64))
    for place in range(20):
        heights[
            12 * (place // 5) : 12 * (place // 5) + 4, 12 * (place % 5) : 12 * (place % 5) + 6
        ] = 9
    alike = CityMap(heights, 2.0)
    assert "all alike" in fabric_distance(districts[0], alike).reason


@pytest.mark.parametrize("told", ["lyon-1er", [], 3, [("a", 1.0)], ({},)])
def test_what_is_no_reference_is_refused(towns, told):
    with pytest.raises(FitnessError, match="the reference"):
        fabric_distance(towns[0], told)


@pytest.mark.parametrize("weight", [0, -1.0, np.inf, np.nan, True, "1"])
def test_weights_that_are_none_are_refused(towns, weight):
    with pytest.raises(FitnessError, match="weights above 0"):
        fabric_distance(towns[0], [(towns[1], weight)])


def test_without_a_reference_it_says_how_to_give_one(towns):
    with pytest.raises(FitnessError, match=r"without its reference(?s:.)*--reference CITY"):
        fabric_distance(towns[0])


def test_a_reference_by_the_genome_wants_one_of_its_cities(towns):
    reference = Reference.sources(towns[:2])
    with pytest.raises(FitnessError, match="without its genome"):
        fabric_distance(towns[0], reference)
    strange = evocity.encode(towns[3].replace(towns[3].heights, name="elsewhere")).genome
    with pytest.raises(FitnessError, match="the genome has the source cities elsewhere, but"):
        fabric_distance(towns[3], reference, genome=strange)


# -- binding -------------------------------------------------------------------------------


def test_a_bound_measure_keeps_its_reference_through_a_pickle(towns):
    bound = fabric_distance.bound(towns[1])
    assert (bound.name, bound.needs) == ("fabric_distance", ())
    assert bound(towns[0]) == fabric_distance(towns[0], towns[1])
    again = pickle.loads(pickle.dumps(bound))
    assert again(towns[0]) == bound(towns[0])
    assert bound(towns[0], towns[2]) == fabric_distance(towns[0], towns[2])
    gsi = get("gsi")
    assert gsi.bound(towns[1]) is gsi


def test_the_name_alone_means_the_first_of_its_numbers():
    assert [one.name for one in evocity.fitness.named("fabric_distance")] == ["fabric_distance"]
    assert len(FEATURES) == 5
