"""Laws of laying: genes replay bit for bit, stay in their lot, and cut buildings only at it."""

import json
import math

import naive
import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.operators.plans import FaceGene, fill_face, lay, plan_of
from evocity.operators.plans._kernels import count_built
from evocity.operators.plans.donor import donor_of
from evocity.operators.plans.fill import _draw
from evocity.operators.plans.laying import (
    LEAST_PIECE,
    LEAST_SHARE,
    Lot,
    _sample,
    lay_piece,
    places_of,
)


@pytest.fixture(scope="module")
def cities() -> list[CityMap]:
    return [evocity.read_map(name) for name in ("new-york-west-village", "lyon-1er")]


@pytest.fixture(scope="module")
def filled(cities):
    """All faces of New York that Lyon's buildings fill, with their heights."""
    host, source = cities
    plan, rng = plan_of(host), np.random.default_rng(1)
    results = (fill_face(plan, face, source, rng) for face in range(1, len(plan) + 1))
    return plan, [result for result in results if result]


def test_a_real_city_fills_many_faces(filled):
    plan, results = filled
    faces = [gene.face - 1 for gene, _ in results]
    assert len(faces) >= 10
    assert plan.lot_area[faces].sum() > 0.25 * plan.lot_area.sum()


def test_laying_replays_what_filling_found(cities, filled):
    plan, results = filled
    genes = [FaceGene(**json.loads(json.dumps(gene.as_dict()))) for gene, _ in results]
    assert genes == [gene for gene, _ in results]
    heights = lay(plan, [*genes, None], {"lyon-1er": cities[1]})
    assert heights.tobytes() == lay(plan, genes[::-1], {"lyon-1er": cities[1]}).tobytes()
    for gene, own in results:
        assert np.array_equal(heights[plan.lots == gene.face], own)
    rest = ~np.isin(plan.lots, [gene.face for gene in genes])
    assert np.array_equal(heights[rest], cities[0].heights[rest])


def test_filled_faces_keep_coverage_and_front(cities, filled):
    plan, results = filled
    for gene, heights in results:
        lot, built = Lot(plan, gene.face), heights > 0
        assert abs(built.mean() - plan.coverage[gene.face - 1]) <= 0.2
        assert built[lot.strip].mean() >= plan.front[gene.face - 1] - 0.1
        assert 0.88 <= gene.scale <= 1.15
        assert set(np.unique(heights)) <= set(donor_of(cities[1]).heights)


def test_cut_buildings_are_large_and_nothing_else_cuts(cities, filled):
    plan, results = filled
    donor, pixel = donor_of(cities[1]), plan.metres_per_pixel
    for gene, heights in results:
        lot = Lot(plan, gene.face)
        sampled = np.zeros(lot.mask.shape, np.int32)
        sampled[lot.mask] = _sample(lot, gene, donor)
        result = np.zeros(lot.mask.shape, np.float32)
        result[lot.mask] = heights
        for number in np.unique(sampled[sampled > 0]):
            parts, count = scipy.ndimage.label(sampled == number)
            whole = donor.areas[number] * gene.scale**2
            here = (sampled == number).sum() * pixel**2
            for part in range(1, count + 1):
                size = (parts == part).sum() * pixel**2
                stands = result[parts == part] == donor.heights[number]
                if here >= 0.95 * whole or (here >= LEAST_SHARE * whole and size >= LEAST_PIECE):
                    assert stands.all()  # whole inside the lot


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), angle=st.floats(0, 7), mirror=st.booleans(), data=st.data())
def test_any_gene_stays_in_its_lot_and_replays(seed, angle, mirror, data):
    host, source = draw_town(seed, side=96), draw_town(seed + 1, side=96)
    plan = plan_of(host)
    face = data.draw(st.integers(1, len(plan)))
    gene = FaceGene(face, "other", 40.3, 51.7, angle, mirror, 1.07)
    heights = lay(plan, [gene], {"other": source})
    assert heights.tobytes() == lay(plan, [gene], {"other": source}).tobytes()
    assert np.array_equal(heights[plan.lots != face], host.heights[plan.lots != face])
    assert set(np.unique(heights[plan.lots == face])) <= set(donor_of(source).heights)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("angle", [0.0, math.pi / 2, 2.0])
def test_a_gene_finds_the_buildings_of_its_place(mirror, angle):
    """A rectangle turned by a known angle about its middle has that place, angle and mirror."""
    y, x = np.mgrid[:120, :120] - 59.5
    source = CityMap(shape_at(x, y), 2.0, name="source")
    along, down = (
        math.cos(angle) * x + math.sin(angle) * y,
        math.cos(angle) * y - math.sin(angle) * x,
    )
    host = CityMap(shape_at(-along if mirror else along, down), 2.0, name="host")
    plan = plan_of(host)
    face = int(plan.lots[60, 60])
    offset = plan.centre[face - 1] - 59.5
    gene = FaceGene(face, "source", 0.0, 0.0, angle, mirror)
    row, column = gene.offsets(*offset)
    gene = FaceGene(face, "source", float(59.5 + row), float(59.5 + column), angle, mirror)
    heights = lay(plan, [gene], {"source": source})
    assert ((heights > 0) != host.built).sum() <= 0.03 * host.built.sum()


def shape_at(x, y):
    """A building like an L of unequal arms, without a symmetry."""
    return np.where(
        ((abs(x) < 30) & (y > -5) & (y < 20)) | ((x > 15) & (x < 30) & (abs(y) < 20)), 9.0, 0
    )


def test_candidates_see_the_places_of_their_genes(cities):
    plan = plan_of(cities[0])
    lot, donor = Lot(plan, 5), donor_of(cities[1])
    candidates = _draw(plan, 5, donor, 9, (0.88, 1.15), np.random.default_rng(0))
    turns = candidates.turns(2.0)
    for k in range(9):
        own = places_of(lot, candidates.gene(k, 5, "x"), cities[1])
        rows = candidates.row[k] + turns[k, 0] * lot.down + turns[k, 1] * lot.along
        columns = candidates.column[k] + turns[k, 2] * lot.down + turns[k, 3] * lot.along
        np.testing.assert_allclose(own, (rows, columns), atol=1e-6)


def test_the_kernel_counts_as_its_naive_twin(cities):
    rng = np.random.default_rng(2)
    plan, donor = plan_of(cities[0]), donor_of(cities[1])
    lot, used = Lot(plan, 5), rng.random(cities[1].shape) < 0.3
    candidates = _draw(plan, 5, donor, 12, (0.88, 1.15), rng)
    arguments = (
        donor.numbers, used, 2.0 / donor.step, lot.down[::40], lot.along[::40], 9,
        candidates.row, candidates.column, candidates.turns(2.0),
    )  # fmt: skip
    counts = np.empty((12, 4), np.int64)
    count_built(*arguments, counts)
    truth = naive.count_built(*arguments)
    assert np.array_equal(counts[:, 3], truth[:, 3])
    inside = counts[:, 3] == 0
    assert inside.any()
    assert not inside.all()
    assert np.array_equal(counts[inside], truth[inside])


def test_walls_at_half_a_metre_are_the_buildings(cities):
    for city in cities:
        donor = donor_of(city)
        coarse = donor.numbers[2::4, 2::4] > 0
        assert donor.step * donor.numbers.shape[0] == 2.0 * city.shape[0]
        assert (coarse != city.built).mean() < 0.05
        covered = np.bincount(donor.numbers.ravel(), minlength=len(donor.areas)) * donor.step**2
        assert covered[1:] == pytest.approx(donor.areas[1:], rel=0.1, abs=5)


@pytest.mark.parametrize("pixel", [1e-6, 0.2, 3.0, 1e6])
def test_pixels_of_any_size_make_a_donor(pixel):
    """Fine pixels follow the map's pixels, so no map makes a raster without end."""
    town = draw_town(4, pixel=pixel)
    donor = donor_of(town)
    assert pixel / 4 <= donor.step <= pixel
    assert donor.numbers.size <= 16 * town.heights.size
    plan = plan_of(town)
    assert plan.area.sum() == pytest.approx((plan.labels > 0).sum() * pixel**2)
    fill_face(plan, 1, town, np.random.default_rng(0), draws=5)


def test_used_places_are_left_alone(cities):
    host, source = cities
    plan, used = plan_of(host), np.zeros(cities[1].shape, bool)
    used[:, :128] = True
    results = [
        fill_face(plan, face, source, np.random.default_rng(face), used=used)
        for face in range(1, len(plan) + 1)
    ]
    assert any(results)
    for gene, heights in filter(None, results):
        _, columns = places_of(Lot(plan, gene.face), gene, source)
        assert (columns[heights > 0] < 127).mean() <= 0.02
    everywhere = np.ones(used.shape, bool)
    assert fill_face(plan, 5, source, np.random.default_rng(0), used=everywhere) is None


def test_each_face_takes_as_many_random_numbers(cities):
    host, source = cities
    plan, states = plan_of(host), set()
    for face in (1, int(np.flatnonzero(plan.open)[0]) + 1, len(plan)):
        rng = np.random.default_rng(3)
        fill_face(plan, face, source, rng, draws=20)
        states.add(str(rng.bit_generator.state))
    assert len(states) == 1


def test_an_empty_source_fills_nothing(cities):
    bare = CityMap(np.zeros((64, 64)), 2.0, name="bare")
    plan = plan_of(cities[0])
    assert fill_face(plan, 1, bare, np.random.default_rng(0)) is None
    heights = lay(plan, [FaceGene(1, "bare", 32, 32, 0.0)], {"bare": bare})
    assert not heights[plan.lots == 1].any()


def test_sources_may_have_other_pixels(cities):
    host = cities[0]
    fine = evocity.read_map("lyon-1er", pixels=512, metres_per_pixel=1.0)
    plan = plan_of(host)
    coarse, gene = donor_of(cities[1]), FaceGene(5, "lyon-1er", 100.0, 120.0, 0.7)
    there = FaceGene(5, "lyon-1er", 200.5, 240.5, 0.7)
    one = lay_piece(Lot(plan, 5), gene, coarse) > 0
    other = lay_piece(Lot(plan, 5), there, donor_of(fine)) > 0
    assert (one != other).mean() < 0.15


@pytest.mark.parametrize(
    ("gene", "words"),
    [
        (FaceGene(0, "lyon-1er", 9, 9, 0.0), "face 0"),
        (FaceGene(999, "lyon-1er", 9, 9, 0.0), "face 999"),
        (FaceGene(1, "paris", 9, 9, 0.0), "source city paris"),
        (FaceGene(1, "lyon-1er", 900.0, 9, 0.0), "place"),
        (FaceGene(1, "lyon-1er", 9, 9, math.nan), "angle"),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, scale=0.0), "scale = 0"),
    ],
)
def test_genes_that_do_not_suit_are_refused(cities, gene, words):
    with pytest.raises(MapError, match=words):
        lay(plan_of(cities[0]), [gene], {"lyon-1er": cities[1]})


def test_two_genes_of_a_face_are_refused(cities):
    gene = FaceGene(1, "lyon-1er", 9, 9, 0.0)
    with pytest.raises(MapError, match="two genes name face 1"):
        lay(plan_of(cities[0]), [gene, gene], {"lyon-1er": cities[1]})


def test_a_face_that_the_plan_has_not_is_refused(cities):
    with pytest.raises(MapError, match="face = 0"):
        fill_face(plan_of(cities[0]), 0, cities[1], np.random.default_rng(0))
