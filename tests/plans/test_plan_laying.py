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
from evocity.operators.plans import (
    FaceGene,
    fill_face,
    fill_halves,
    lay,
    plan_of,
    storey_range,
)
from evocity.operators.plans._kernels import (
    drop_pieces,
    fill_gaps,
    improve_candidates,
    sample_polygons,
    score_candidates,
    sum_squares,
)
from evocity.operators.plans.donor import donor_of
from evocity.operators.plans.fill import _draw, _gene
from evocity.operators.plans.laying import (
    _SHIFTS,
    LEAST_PIECE,
    LEAST_SHARE,
    SLENDER,
    Lot,
    _sample,
    lay_piece,
    lot_of,
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
        assert set(np.unique(heights)) <= set(gene.clamp(donor_of(cities[1]).heights))


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
            whole = donor.areas[number] * gene.stretch
            height = gene.clamp(donor.heights)[number]
            here = (sampled == number).sum() * pixel**2
            for part in range(1, count + 1):
                size = (parts == part).sum() * pixel**2
                stands = result[parts == part] == height
                if here >= 0.95 * whole:
                    assert stands.all()  # whole inside the lot
                elif here >= LEAST_SHARE * whole and size >= LEAST_PIECE:
                    square = np.ones((math.ceil(SLENDER / pixel),) * 2)
                    thick = scipy.ndimage.binary_opening(parts == part, square)
                    if thick.sum() * pixel**2 >= LEAST_PIECE and scipy.ndimage.label(thick)[1] == 1:
                        assert (result[thick] == height).all()
                    elif not thick.any() and size >= 2 * LEAST_PIECE:
                        assert not stands.all()


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


def test_the_kernels_of_candidates_score_as_their_naive_twin(cities):
    rng = np.random.default_rng(2)
    plan, donor = plan_of(cities[0]), donor_of(cities[1])
    lot, used = Lot(plan, 5), rng.random(cities[1].shape) < 0.005
    candidates = _draw(plan, 5, donor, 12, (0.88, 1.15), rng)
    points = np.arange(0, lot.down.size, 40)
    arguments = (
        donor.numbers, donor.areas, used, 2.0, donor.step, lot.down[points], lot.along[points], 20,
        60.0, 0.5, 0.6, 0.1, 0.2,
    )  # fmt: skip
    scores = np.empty(12)
    score_candidates(*arguments, candidates, -np.inf, scores)
    for floor in np.linspace(-1.5, 1, 11):
        above = np.empty(12)
        score_candidates(*arguments, candidates, floor, above)
        assert ((above == scores) | ((above == -np.inf) & (scores < floor))).all()

    def true_score(candidate):
        return naive.score_candidate(_gene(candidate, 5, "x"), *arguments)

    truth = [true_score(candidate) for candidate in candidates]
    assert scores == pytest.approx(truth)
    assert np.isfinite(scores).any()
    assert not np.isfinite(scores).all()
    moves = np.array([(0.0, 0.0), (1.0, 0.0)])
    trials = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.5), (0.0, 0.0, 1.1)])
    better = candidates.copy()
    improve_candidates(*arguments, better, moves, trials, 0.88, 1.15)
    for old, new in zip(candidates, better, strict=True):
        moved = max((old + np.array([*move, 0, 0, 0, 0]) for move in moves), key=true_score)
        sized = [moved + np.array([*way, 0, 0, 0, 0]) for *way, _ in trials]
        for one, (*_, size) in zip(sized[1:], trials[1:], strict=True):
            one[4] = np.clip(one[4] * size, 0.88, 1.15)
        best = max(sized, key=true_score)
        np.testing.assert_allclose(new, best)


@pytest.mark.parametrize("radius", [0.2, 6.5, 500.0])
def test_sums_over_squares_are_those_of_their_pixels(radius):
    rng = np.random.default_rng(5)
    raster = rng.integers(-9, 9, (30, 22)) + 1j * rng.integers(-9, 9, (30, 22))
    sums = np.zeros((31, 23), complex)
    sums[1:, 1:] = raster.cumsum(axis=0).cumsum(axis=1)
    places, totals = rng.uniform(0, [29, 21], (40, 2)), np.empty(40, complex)
    sum_squares(places, radius, sums, totals)
    for (row, column), total in zip(places, totals, strict=True):
        low = [max(round(at - radius), 0) for at in (row, column)]
        high = [max(round(at + radius) + 1, 0) for at in (row, column)]
        assert total == raster[low[0] : high[0], low[1] : high[1]].sum()


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


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    angle=st.floats(0, 7),
    mirror=st.booleans(),
    scale=st.floats(0.88, 1.15),
    axis=st.none() | st.floats(0, 4),
)
def test_the_sampling_kernel_counts_as_its_naive_twin(seed, angle, mirror, scale, axis):
    plan, source = plan_of(draw_town(seed, side=64)), draw_town(seed + 1, side=64)
    gene = FaceGene(1, "other", 30.3, 31.7, angle, mirror, scale, axis)
    lot, donor = Lot(plan, 1), donor_of(source)
    assert np.array_equal(_sample(lot, gene, donor), naive.sample_polygons(lot, gene, donor))
    assert sample_polygons.__doc__


@settings(max_examples=25, deadline=None)
@given(axis=st.floats(0, 4), scale=st.floats(0.5, 2), angle=st.floats(0, 7), mirror=st.booleans())
def test_a_scale_with_an_axis_acts_along_it_only(axis, scale, angle, mirror):
    gene = FaceGene(1, "x", 0.0, 0.0, angle, mirror, scale, axis)
    assert math.hypot(*gene.offsets(math.sin(axis), math.cos(axis))) == pytest.approx(1 / scale)
    assert math.hypot(*gene.offsets(math.cos(axis), -math.sin(axis))) == pytest.approx(1)
    assert gene.stretch == scale


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), low=st.floats(0, 20), more=st.floats(2, 20))
def test_heights_keep_to_the_range_of_their_gene(seed, low, more):
    host, source = draw_town(seed, side=64), draw_town(seed + 1, side=64)
    plan, free = plan_of(host), FaceGene(1, "other", 30.3, 31.7, 0.4)
    gene = FaceGene(1, "other", 30.3, 31.7, 0.4, lowest=low, highest=low + more)
    before, after = lay(plan, [free], {"other": source}), lay(plan, [gene], {"other": source})
    mine = plan.lots == 1
    assert np.array_equal(before > 0, after > 0)
    expected = np.clip(before[mine], np.float32(low), np.float32(low + more))
    assert np.array_equal(after[mine], np.where(before[mine] > 0, expected, 0))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), angle=st.floats(0, 7), other=st.floats(0, 7))
def test_the_line_between_halves_cuts_no_building(seed, angle, other):
    host, source = draw_town(seed, side=96), draw_town(seed + 1, side=96)
    plan, donor = plan_of(host), donor_of(source)
    genes = [
        FaceGene(1, "other", 40.3, 51.7, angle, part=1),
        FaceGene(1, "other", 60.0, 31.0, other, True, 0.9, part=2),
    ]
    heights = lay(plan, genes, {"other": source})
    assert heights.tobytes() == lay(plan, genes[::-1], {"other": source}).tobytes()
    assert np.array_equal(heights[plan.lots != 1], host.heights[plan.lots != 1])
    lot = lot_of(plan, 1)
    assert (lot.side(1) ^ lot.side(2)).all()
    standing = np.zeros(lot.down.size, bool)
    for gene in genes:
        whole, side = _sample(lot, gene, donor), lot.side(gene.part)
        laid = lay_piece(lot, gene, donor, standing=standing) > 0
        assert not (laid & standing).any()
        for number in np.unique(whole[whole > 0]):
            here = whole == number
            if here.sum() * plan.metres_per_pixel**2 >= 0.95 * donor.areas[number] * gene.stretch:
                inside = (here & side).sum() * 2
                stands = inside >= here.sum() if gene.part == 2 else inside > here.sum()
                if stands and not (here & standing).any():
                    assert laid[here].all()
        standing |= laid


def test_two_places_fill_the_halves_of_large_faces(cities):
    host, source = cities
    plan, rng, count = plan_of(host), np.random.default_rng(4), 0
    for face in range(1, 25):
        result = fill_halves(plan, face, (source, source), rng)
        if result is None:
            continue
        genes, own = result
        count += 1
        heights = lay(plan, genes, {"lyon-1er": source})
        assert np.array_equal(heights[plan.lots == face], own)
        lot, former = lot_of(plan, face), host.heights[plan.lots == face] > 1
        for part in (1, 2):
            side = lot.side(part)
            assert abs((own[side] > 0).mean() - former[side].mean()) <= 0.2
            strip = side & lot.strip
            assert (own[strip] > 0).mean() >= former[strip].mean() - 0.1
    assert count >= 2


def test_no_tower_stands_among_houses(cities):
    host, source = cities
    towers = CityMap(source.heights * 5, 2.0, name="towers")
    plan = plan_of(host)
    for face in range(1, len(plan) + 1):
        result = fill_face(plan, face, towers, np.random.default_rng(face), draws=40)
        if result is not None:
            low, high = storey_range(plan, face)
            built = result[1][result[1] > 0]
            assert low - 1e-3 <= built.min()
            assert built.max() <= high + 1e-3
    with pytest.raises(MapError, match="face = 0"):
        storey_range(plan, 0)
    bare = np.zeros(host.shape, np.float32)
    assert storey_range(plan, 1, bare) is None


def test_genes_of_older_files_have_no_limits():
    old = {"face": 1, "source": "x", "row": 1.0, "column": 2.0, "angle": 0.5, "mirror": True}
    gene = FaceGene(**old, scale=1.1)
    assert (gene.axis, gene.lowest, gene.highest, gene.part) == (None, None, None, 0)
    assert gene.stretch == pytest.approx(1.21)


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
        (FaceGene(1, "lyon-1er", 900.0, 9, 0.0), "the gene copies from row"),
        (FaceGene(1, "lyon-1er", 9, 9, math.nan), "angle"),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, scale=0.0), "scale = 0"),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, axis=math.inf), "axis = "),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, part=3), "part = 3"),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, lowest=9.0, highest=6.0), "lowest = 9"),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, highest=0.0), "highest = 0"),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, lowest=math.nan), "lowest = "),
        (FaceGene(1, "lyon-1er", 9, 9, 0.0, part=2), "part 2 of face 1"),
    ],
)
def test_genes_that_do_not_suit_are_refused(cities, gene, words):
    with pytest.raises(MapError, match=words):
        lay(plan_of(cities[0]), [gene], {"lyon-1er": cities[1]})


def test_two_genes_of_a_face_are_refused(cities):
    gene = FaceGene(1, "lyon-1er", 9, 9, 0.0)
    with pytest.raises(MapError, match="two genes are for face 1"):
        lay(plan_of(cities[0]), [gene, gene], {"lyon-1er": cities[1]})


def test_a_face_that_the_plan_has_not_is_refused(cities):
    with pytest.raises(MapError, match="no face with the number 0"):
        fill_face(plan_of(cities[0]), 0, cities[1], np.random.default_rng(0))


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), width=st.integers(2, 4), part=st.integers(0, 2))
def test_the_kernels_of_laying_do_as_their_naive_twins(seed, width, part):
    town, rng = draw_town(seed, side=28), np.random.default_rng(seed)
    plan = plan_of(town)
    lot, table = lot_of(plan, 1), town.buildings
    numbers = np.where(plan.lots == 1, np.roll(table.labels, rng.integers(12, size=2), (0, 1)), 0)
    numbers = np.ascontiguousarray(numbers[lot.window]) * (rng.random(lot.mask.shape) < 0.97)
    areas = np.concatenate([[0], table.area]) * rng.uniform(0.5, 1.5)
    arguments = areas, 2.0, 0.95, 0.5, 6.0, width, 3
    dropped = numbers.copy()
    drop_pieces(dropped, *arguments)
    assert np.array_equal(dropped, naive.drop_pieces(numbers, *arguments))
    ring = lot.ring
    where = lot.rows[ring], lot.columns[ring], lot.ring_inward, lot.side(part)[ring]
    grown = numbers.copy()
    fill_gaps(grown, *where, _SHIFTS, 4.0, 0.8)
    assert np.array_equal(grown, naive.fill_gaps(numbers, *where, 5.5, 4.0, 0.8))
