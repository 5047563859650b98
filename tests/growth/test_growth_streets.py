"""Growth along streets: a function of seed and place, streets that run through, whole fronts."""

import hashlib
import pickle

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.genome import unpacked
from evocity.growth import grow
from evocity.growth.avenues import AVENUE, Avenues
from evocity.operators.plans import FaceGene

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def fabric(code):
    return grow(code, 200, 264, RNG(5), streets=True)


@pytest.fixture(scope="module")
def whole(fabric):
    """All that the windows of a test lie within."""
    return fabric.window(-300, -300, 800, 800)


# -- a function of seed and place -------------------------------------------------------------

WINDOWS = [
    (0, 0, 200, 264), (-500, 13, 50, 3), (199, 263, 1, 1), (40, 40, 0, 5), (-131, -9, 300, 20),
    (10**12 + 1, -(10**14), 140, 30), (-300, -600, 64, 64),
]  # fmt: skip


def digest_of(fabric, windows=WINDOWS) -> dict:
    return {
        box: hashlib.sha256(np.ascontiguousarray(fabric.window(*box)).tobytes()).hexdigest()
        for box in windows
    }


@pytest.mark.slow
def test_windows_are_the_same_in_any_order(code, fabric):
    other = grow(code, 200, 264, RNG(5), streets=True)
    assert digest_of(other, WINDOWS[::-1]) == digest_of(fabric)
    assert digest_of(pickle.loads(pickle.dumps(fabric))) == digest_of(fabric)
    assert digest_of(grow(code, 200, 264, RNG(6), streets=True)) != digest_of(fabric)


@pytest.mark.slow
def test_a_small_cache_changes_nothing(code, fabric, monkeypatch):
    monkeypatch.setattr("evocity.growth.quarter_plane._DISTRICTS", 2)
    forgetful = grow(code, 200, 264, RNG(5), streets=True)
    assert digest_of(forgetful) == digest_of(fabric)
    assert len(forgetful.plane._regions) <= 2


@settings(max_examples=40, deadline=None)
@given(
    top=st.integers(-300, 400), left=st.integers(-300, 400),
    height=st.integers(1, 100), width=st.integers(1, 100),
)  # fmt: skip
def test_windows_that_overlap_agree(fabric, whole, top, left, height, width):
    part = whole[top + 300 : top + 300 + height, left + 300 : left + 300 + width]
    assert np.array_equal(fabric.window(top, left, height, width), part)
    # and so do the places that they come from
    y, x = (at - (at - by) % 4 for at, by in zip((top, left), fabric.place, strict=True))
    wider = fabric.sources(y - 40, x - 40, 100, 100)
    for name, values in fabric.sources(y, x, 8, 8).items():
        assert np.array_equal(values, wider[name][10:12, 10:12])


def test_the_original_stays_as_it_is(code, fabric):
    assert np.array_equal(fabric.window(*fabric.place, 96, 96), decode(code).city.heights)
    found = fabric.sources(*fabric.place, 96, 96)
    assert not found["original"].any()
    assert not found["iso"].any()
    assert np.array_equal(24 * found["row"] + found["column"], np.arange(576).reshape(24, 24))


def test_the_old_way_is_the_default(code):
    plain, same = grow(code, 96, 96, RNG(5)), grow(code, 96, 96, RNG(5), streets=False)
    assert np.array_equal(plain.window(-200, 0, 64, 64), same.window(-200, 0, 64, 64))
    assert "streets" not in plain.made
    assert plain.made == same.made


# -- avenues and districts --------------------------------------------------------------------

LATTICES = st.builds(
    lambda rows, columns, side, seed: Avenues(
        (rows, columns), (side * 0.7, side * 1.3), 2.0, seed, [4.0, 9.0, 14.0]
    ),
    st.integers(60, 200), st.integers(60, 200), st.integers(24, 60), st.integers(0, 2**40),
)  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(avenues=LATTICES, far=st.sampled_from([0, 10**13, -(10**13)]))
def test_districts_cover_the_plane_once(avenues, far):
    top, left = far - 150, -90
    count = np.zeros((300, 260), int)
    rows, columns = np.arange(top, top + 300)[:, None], np.arange(left, left + 260)[None]
    for i, j in avenues.districts(top, left, top + 300, left + 260):
        count += avenues.within(i, j, rows, columns)
    assert (count == 1).all()
    if not far:
        own = np.zeros_like(count)
        own[150 : 150 + avenues.shape[0], 90 : 90 + avenues.shape[1]] = 1
        assert np.array_equal(avenues.within(0, 0, rows, columns), own[:300, :260])


@settings(max_examples=25, deadline=None)
@given(avenues=LATTICES, i=st.integers(-3, 3), j=st.integers(-3, 3))
def test_streets_part_the_quarters_of_a_district(avenues, i, j):
    district = avenues.district(i, j)
    labels, lots = district.labels, district.lots
    corner = district.corner
    rows = np.arange(labels.shape[0])[:, None] + corner[0]
    within = avenues.within(i, j, rows, np.arange(labels.shape[1])[None] + corner[1])
    assert np.array_equal(labels > 0, within)
    assert np.array_equal(lots[lots > 0], labels[lots > 0])
    assert district.angle.size == district.colour.size == labels.max()
    # 8 m of street, 4 px, between two quarters
    for axis in (0, 1):
        for step in (1, 2):
            one = np.moveaxis(lots, axis, 0)[:-step]
            other = np.moveaxis(lots, axis, 0)[step:]
            assert not ((one > 0) & (other > 0) & (one != other)).any()


def test_avenues_run_from_end_to_end(fabric, whole):
    avenues = fabric.plane.avenues
    y, x = (at + 300 for at in fabric.place)
    half = int(AVENUE[0] / 2 / 2) - 1
    for i in range(-1, 3):
        for j in range(-1, 3):
            for end in ((i, j + 1), (i + 1, j)):
                one, other = np.array(avenues.crossing(i, j)), np.array(avenues.crossing(*end))
                points = one + np.linspace(0, 1, 200)[:, None] * (other - one)
                rows, columns = np.rint(points + np.array([y, x])).astype(int).T
                seen = (rows > 8) & (columns > 8) & (rows < 790) & (columns < 790)
                for away in (-half, 0, half):
                    down, along = (away, 0) if end[0] == i else (0, away)
                    at = rows[seen] + down, columns[seen] + along
                    inside = (at[0] >= y) & (at[0] < y + 96) & (at[1] >= x) & (at[1] < x + 96)
                    assert not whole[at][~inside].any()


# -- what stands in the quarters --------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(
    iso=st.integers(0, 7), off=st.floats(-0.7, 0.7), row=st.floats(0, 90), column=st.floats(0, 90)
)
def test_the_nearest_isometry_turns_as_the_gene_does(iso, off, row, column):
    ways = isometries.AFFINE[iso, 2:6]
    mirror = bool(ways[0] * ways[3] - ways[1] * ways[2] < 0)
    turn = -np.arctan2(ways[2], ways[0]) + off
    gene = FaceGene(1, "town", row, column, float(turn), mirror)
    assert gene.nearest_isometry() == iso


def test_quarters_show_the_places_of_their_genes(code, fabric):
    heights = set(np.unique(decode(code).city.walls.heights.astype(np.float32)).tolist())
    laid = fabric.plane.laid(2, -1)
    assert all(gene is not None for gene in laid.genes)
    assert set(np.unique(laid.heights).tolist()) <= heights | {0.0}
    assert not laid.heights[laid.district.lots == 0].any()
    assert ((laid.front >= 0) & (laid.front <= 1)).all()


@pytest.mark.slow
def test_a_genome_names_the_place_of_each_lifs(code, fabric):
    box = (-200, 44, 96, 96)
    found = fabric.sources(*box)
    untouched = fabric.genome(*box, repair=None)
    places = (24 * found["row"] + found["column"]).ravel()
    assert np.array_equal(code.pavement.index[unpacked(untouched.source)], places)
    assert (untouched.parent == 0).all()
    child = fabric.genome(*box)
    assert np.array_equal(child.source, untouched.source)
    assert np.array_equal(child.parent, untouched.parent)
    assert child.cities == code.cities
    assert child.made["streets"] is True
    errors = [
        np.sqrt(np.mean((decode(one).city.heights - fabric.window(*box)) ** 2))
        for one in (untouched, child)
    ]
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.slow
def test_cities_share_the_quarters(code):
    other = uniformly(draw_town(2, side=96, buildings=90)).genome
    both = grow([code, other], 400, 400, RNG(3), share=0.5, streets=True)
    assert set(np.unique(both.sources(-200, 0, 400, 400)["original"])) == {0, 1}
    alone = grow([code, other], 400, 400, RNG(3), share=0.0, streets=True)
    assert not alone.sources(-200, 0, 400, 400)["original"].any()


def test_without_turns_quarters_keep_their_directions(code):
    fabric = grow(code, 96, 96, RNG(1), streets=True, turned=False)
    for gene in fabric.plane.laid(1, 1).genes:
        assert not gene.mirror
        assert abs(np.angle(np.exp(1j * gene.angle))) <= np.pi / 4 + 1e-9


@pytest.mark.slow
def test_a_city_without_buildings_grows_open_ground():
    bare = uniformly(CityMap(np.zeros((96, 96)), 2)).genome
    fabric = grow(bare, 96, 96, RNG(1), streets=True)
    assert not fabric.window(-200, 100, 200, 200).any()
    told = fabric.account(-200, 100, 200, 200)
    assert told["forced"] == told["groups"] > 0


@pytest.mark.slow
def test_streets_run_through_as_in_the_city():
    city = evocity.read_map("lyon-1er")
    fabric = grow(uniformly(city).genome, 256, 256, RNG(7), streets=True)
    own = decode(fabric.originals[0]).city
    lengths, distances = [], []
    for top, left in ((20_000, 20_000), (-30_000, 15_000), (50_000, -40_000)):
        shown = fabric.city(top, left, 256, 256)
        graph = shown.alley_graph
        strokes = np.bincount(graph.street, graph.length)
        lengths.append((strokes**2).sum() / strokes.sum())
        distances.append(evocity.fitness.street_distance(shown, reference=own))
        assert evocity.fitness.gsi(shown) == pytest.approx(evocity.fitness.gsi(own), rel=0.25)
    assert np.mean(lengths) > 190
    assert np.mean(distances) < 0.3


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
def test_no_window_comes_twice_within_4096_pixels(name):
    fabric = grow(uniformly(evocity.read_map(name)).genome, 4096, 4096, RNG(1), streets=True)
    assert fabric.repeats(-30_000, 10_000, 4096, 4096) == 0


# -- bad input --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"tolerance": 5.0}, "only parameters that apply to quarters"),
        ({"size_min": 4}, "leave out size_min"),
        ({"side_min": 20.0}, "side_min = 20.0"),
        ({"side_max": 500.0}, "40 to 105.6 m"),
        ({"side_min": 90.0, "side_max": 60.0}, "the smaller at most the larger"),
    ],
)
def test_what_cannot_be_is_refused(code, options, says):
    with pytest.raises(OperatorError) as error:
        grow(code, 96, 96, RNG(0), streets=True, **options)
    assert says in str(error.value)


def test_a_small_map_is_refused():
    small = uniformly(draw_town(4, side=32)).genome
    with pytest.raises(OperatorError, match="sides of at least 73 m"):
        grow(small, 96, 96, RNG(0), streets=True)
