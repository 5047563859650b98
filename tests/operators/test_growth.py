"""Growth: the original stays, the fabric is whole, seamless, and does not repeat itself."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import NUCLEOTIDES
from evocity.growth import WINDOW, Growth, _kernels, grow
from evocity.growth.fabric import LAYS
from evocity.growth.laying import _places
from evocity.pavement import Pavement

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def code():
    return encode(draw_town(1, side=96, buildings=90)).genome


@pytest.fixture(scope="module")
def fabric(code):
    return grow(code, 200, 264, RNG(5))


# -- the laws ---------------------------------------------------------------------------------


def test_the_original_stays_as_it_is_and_all_is_laid(code, fabric):
    heights = fabric.city().heights
    top, left = (4 * side for side in fabric.corner)
    assert fabric.corner == ((50 - 24) // 2, (66 - 24) // 2)
    assert np.array_equal(heights[top : top + 96, left : left + 96], decode(code).city.heights)
    assert (fabric.stones >= 0).all()
    assert fabric.stones.max() < 8 * len(code)
    assert np.array_equal(heights, naive.fabric(fabric.stones, fabric.heights, 4))


def test_the_same_generator_state_grows_the_same_fabric(code, fabric):
    before = code.digest
    again, other = grow(code, 200, 264, RNG(5)), grow(code, 200, 264, RNG(6))
    assert code.digest == before
    assert np.array_equal(again.stones, fabric.stones)
    assert again.made == fabric.made
    assert not np.array_equal(other.stones, fabric.stones)


@pytest.mark.parametrize("corner", [(0, 0), (26, 42), (3, 17)])
def test_the_original_stands_where_it_is_told(code, corner):
    fabric = grow(code, 200, 264, RNG(0), corner=corner)
    own = fabric.stones[corner[0] : corner[0] + 24, corner[1] : corner[1] + 24]
    assert np.array_equal(own, 8 * np.arange(576).reshape(24, 24))
    assert (fabric.stones >= 0).all()


def test_windows_are_cut_from_the_fabric(fabric):
    heights = fabric.city().heights
    for box in [(0, 0, 200, 264), (7, 13, 50, 3), (199, 263, 1, 1), (40, 40, 0, 5)]:
        y, x, tall, wide = box
        assert np.array_equal(fabric.window(*box), heights[y : y + tall, x : x + wide])
    for box in [(-1, 0, 5, 5), (0, 0, 201, 5), (0, 260, 5, 5)]:
        with pytest.raises(OperatorError, match="inside the fabric"):
            fabric.window(*box)


def test_a_fabric_of_the_original_size_is_the_original(code):
    same = grow(code, 96, 96, RNG(0))
    assert same.genome() == code
    assert same.made["groups"] == 0


@settings(max_examples=200, deadline=None)
@given(
    sizes=st.tuples(st.integers(3, 14), st.integers(3, 14)).map(sorted),
    side=st.tuples(st.integers(3, 20), st.integers(3, 20)),
    free=st.tuples(st.integers(0, 40), st.integers(0, 40)),
    at=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    seed=st.integers(0, 2**32),
)
def test_places_cover_the_fabric_and_what_stands_lies_within_them(sizes, side, free, at, seed):
    pavement = Pavement(2 * (side[0] + free[0]), 2 * (side[1] + free[1]), 2)
    row, column = (round(a * f) for a, f in zip(at, free, strict=True))
    original = (row, column, row + side[0], column + side[1])
    laid = np.zeros((pavement.rows + 2, pavement.columns + 2), bool)  # nothing beyond its border
    laid[row + 1 : row + side[0] + 1, column + 1 : column + side[1] + 1] = True
    for top, left, tall, wide in _places(pavement, original, *sizes, RNG(seed)):
        assert max(tall, wide) <= sizes[1]
        place = np.s_[top + 1 : top + tall + 1, left + 1 : left + wide + 1]
        bare, beyond = ~laid[place], laid.copy()
        beyond[place] = False
        rows, columns = place
        # no bare block beside what stands outside: there, no step could be measured
        assert not (bare[0] & beyond[top, columns]).any()
        assert not (bare[-1] & beyond[top + tall + 1, columns]).any()
        assert not (bare[:, 0] & beyond[rows, left]).any()
        assert not (bare[:, -1] & beyond[rows, left + wide + 1]).any()
        laid[place] = True
    assert laid[1:-1, 1:-1].all()


def laid_one_by_one(code, monkeypatch, **options):
    """(fabric before, its stones after, the place, its step) of every group laid."""
    laid = []

    def one_by_one(stones, original, heights, lays, isos, block, places, draws, *rest):
        *rest, steps, twice = rest
        grown = np.zeros(2, int)
        for n in range(len(places)):
            before = stones.copy()
            some = slice(n, n + 1)
            grown += _kernels.lay_groups(
                stones, original, heights, lays, isos, block, places[some], draws[some],
                *rest, steps[some], twice[some],
            )  # fmt: skip
            if np.isfinite(steps[n]):
                laid.append((before, stones.copy(), places[n], steps[n]))
        return grown

    monkeypatch.setattr("evocity.growth.laying.lay_groups", one_by_one)
    grow(code, 160, 136, RNG(3), **options)
    return laid


@pytest.mark.parametrize("tolerance", [2.0, 6.0])
def test_outlines_step_by_no_more_than_the_tolerance(code, monkeypatch, tolerance):
    heights = decode(code).city.heights
    laid = laid_one_by_one(code, monkeypatch, tolerance=tolerance)
    forced = 0
    for before, after, (top, left, tall, wide), step in laid:
        place = np.s_[top : top + tall, left : left + wide]
        changed = before != after
        changed[place] = False
        assert not changed.any()
        shown, now = (naive.fabric(stones, heights, 4) for stones in (before, after))
        mask = (before != after)[place]
        assert mask[before[place] < 0].all()
        stone = int(after[place][mask][0])  # where a block of the group comes from tells the rest
        i, j = np.argwhere(mask)[0]
        brought = candidate_of(stone, i, j, tall, wide, heights)
        pixels = np.s_[4 * top : 4 * (top + tall), 4 * left : 4 * (left + wide)]
        where = mask.repeat(4, 0).repeat(4, 1)
        assert np.array_equal(now[pixels][where], brought[where])
        told = naive.outline_of_laid(shown, brought, 4 * top, 4 * left, mask, 4)
        assert step == pytest.approx(told, abs=1e-4)
        forced += step > tolerance
    assert len(laid) > 20
    assert forced <= 0.2 * len(laid)


def candidate_of(stone, i, j, tall, wide, heights):
    """The rectangle of which block (i, j) is ``stone``."""
    iso, columns = stone % 8, heights.shape[1] // 4
    for row, column in np.ndindex(heights.shape[0] // 4, columns):
        index = np.arange(heights.size // 16).reshape(-1, columns)
        cut = naive.rectangle(index, iso, row, column, tall, wide)
        if cut.shape == (tall, wide) and cut[i, j] == stone // 8:
            scale = (4 * row, 4 * column, 4 * tall, 4 * wide)
            return naive.rectangle(heights, iso, *scale)
    raise AssertionError("no such rectangle")


# -- it does not repeat itself ----------------------------------------------------------------


def keys_of(heights: np.ndarray) -> np.ndarray:
    """A number for each 64 × 64 window, equal for equal ones: a random weight for each pixel."""
    rng = RNG(0)
    levels, which = np.unique(heights, return_inverse=True)
    weights = [rng.integers(1, 1 << 62, n, dtype=np.uint64) | np.uint64(1) for n in (64, 64)]
    values = rng.integers(0, 1 << 62, levels.size, dtype=np.uint64)[which.reshape(heights.shape)]
    with np.errstate(over="ignore"):
        across = sum(
            values[:, k : values.shape[1] - WINDOW + 1 + k] * w for k, w in enumerate(weights[0])
        )
        return sum(
            across[k : across.shape[0] - WINDOW + 1 + k] * w for k, w in enumerate(weights[1])
        )


def repeated_beyond(original: np.ndarray, heights: np.ndarray) -> int:
    """How many windows come twice that neither the original nor an image of it repeats."""
    together = np.zeros((8, *[max(original.shape)] * 2), np.float32) - 1
    images = [isometries.apply(k, original) for k in range(8)]
    for layer, image in zip(together, images, strict=True):
        layer[: image.shape[0], : image.shape[1]] = image
    # one call, so that equal windows have equal keys
    gap = np.full((WINDOW, heights.shape[1]), -1, np.float32)
    stack = [heights]
    for image in images:
        row = np.full((image.shape[0], heights.shape[1]), -1, np.float32)
        row[:, : image.shape[1]] = image
        stack += [gap, row]
    keys = keys_of(np.vstack(stack))
    own, top = [], heights.shape[0]
    for image in images:
        top += WINDOW
        tall, wide = (side - WINDOW + 1 for side in image.shape)
        each, counts = np.unique(keys[top : top + tall, :wide], return_counts=True)
        own.append(each[counts > 1])
        top += image.shape[0]
    each, counts = np.unique(keys[: heights.shape[0] - WINDOW + 1], return_counts=True)
    return int((counts[~np.isin(each, np.concatenate(own))] > 1).sum())


def test_repeated_windows_are_found():
    original = draw_town(3, side=80).heights
    doubled = np.hstack([original, original[:, 10:]])
    assert repeated_beyond(original, original) == 0
    assert repeated_beyond(original, doubled) == (80 - 63) * (70 - 63)
    flat = np.zeros((80, 80), np.float32)
    assert repeated_beyond(flat, np.zeros((90, 90), np.float32)) == 0
    assert repeated_beyond(original, np.hstack([original, flat])) == 1


def one_house(side: int) -> np.ndarray:
    heights = np.zeros((side, side), np.float32)
    heights[60:70, 50:60] = 9
    return heights


DRAWN = {
    "town": draw_town(1, side=96, buildings=90).heights,
    "open": draw_town(2, side=96, buildings=9).heights,
    "house": one_house(136),
    "flat": np.zeros((80, 80)),
    "chess": np.kron(np.indices((6, 6)).sum(0) % 2, np.full((16, 16), 9.0)),
    "ramp": np.arange(96.0)[:, None] + np.zeros((96, 96)),
    "oblong": draw_town(4, side=96, buildings=90).heights[:72],
    "small": draw_town(4, side=32).heights,
}


@pytest.mark.parametrize(
    ("name", "block"),
    [*((name, 4) for name in DRAWN), ("town", 2), ("town", 8), ("open", 8), ("town", 16)],
)
def test_drawn_towns_do_not_repeat(name, block):
    drawn = encode(CityMap(DRAWN[name], 2), block=block).genome
    for options in ({}, {"turned": False, "candidates": 100}):
        fabric = grow(drawn, 160, 176, RNG(1), **options)
        found = repeated_beyond(fabric.heights, fabric.city().heights)
        assert found == fabric.made["repeated"] == 0


@pytest.mark.parametrize("name", ["cape-town-salt-river", "lyon-1er"])
def test_cities_do_not_repeat_and_keep_their_density(name):
    city = evocity.read_map(name)
    fabric = grow(encode(city).genome, 512, 512, RNG(1))
    assert fabric.made["repeated"] == 0
    assert repeated_beyond(fabric.heights, fabric.city().heights) == 0
    own = CityMap(fabric.heights, 2)
    for measure in (evocity.fitness.gsi, evocity.fitness.mean_height):
        assert measure(fabric.city()) == pytest.approx(measure(own), rel=0.1)
    # as few crumbs as in the original, though every seam could make some
    assert evocity.fitness.crumbs(fabric.city()) < 2 * evocity.fitness.crumbs(own)
    assert fabric.made["step"] < 4
    assert fabric.made["forced"] <= 0.02 * fabric.made["groups"]


def test_what_must_repeat_is_told():
    # no window of it is without the house, so that straight copies cannot but show it again
    code = encode(CityMap(one_house(96), 2)).genome
    fabric = grow(code, 160, 176, RNG(1), turned=False)
    assert fabric.made["repeated"] > 0
    assert repeated_beyond(fabric.heights, fabric.city().heights) > 0


# -- as a genome ------------------------------------------------------------------------------


def turned_whole(code, iso):
    """The whole original under an isometry, as a fabric."""
    p = code.pavement
    stones = 8 * isometries.apply(iso, np.arange(len(p)).reshape(p.rows, p.columns)) + iso
    rows, columns = stones.shape
    pavement = Pavement(rows * p.block, columns * p.block, p.block)
    stones = np.ascontiguousarray(stones, np.int32)
    heights = decode(code).city.heights
    return Growth(code, heights, pavement, (0, 0), stones, np.empty(0), {})


@pytest.mark.parametrize("iso", range(8))
def test_domain_blocks_are_carried_along_and_turned(iso):
    rng = RNG(iso)
    town = draw_town(6, side=96, buildings=90)
    code = encode(town.replace(town.heights[:64]), domains=(2, 3)).genome
    # oblong domain blocks too
    wider = np.where(code.uniform | (code.x > 40), code.dx, code.dx + 4 * rng.integers(0, 3))
    code = code.replace(dx=wider)
    fabric = turned_whole(code, iso)
    image = isometries.apply(iso, decode(code).city.heights)
    assert np.array_equal(fabric.window(0, 0, *fabric.shape), image)
    assert decode(fabric.genome(repair=None)).city.heights == pytest.approx(image, abs=0.05)


def test_lifs_name_the_stone_they_come_from(code):
    child = grow(code, 160, 160, RNG(2), turned=False).genome(repair=None)
    for name in ("sigma", "beta", "iso", "dx", "dy"):
        assert np.array_equal(getattr(child, name), getattr(code, name)[child.source])
    assert child.cities == code.cities
    y, x = child.pavement.corners
    own_y, own_x = (corner[child.source] for corner in code.pavement.corners)
    moved = (child.x - x != code.x[child.source] - own_x) | (
        child.y - y != code.y[child.source] - own_y
    )
    inside = (child.x > 0) & (child.y > 0) & (child.x + child.dx < 160) & (child.y + child.dy < 160)
    assert not (moved & inside & ~child.uniform).any()


def test_provenance_of_a_child_is_carried_on(code):
    other = encode(draw_town(2, side=96, buildings=90)).genome
    child = evocity.operators.make("pavement_fusion", tolerance=50)([code, other], RNG(0))
    fabric = grow(child, 160, 160, RNG(0))
    grown = fabric.genome()
    lifs = fabric.stones.ravel() >> 3
    assert np.array_equal(grown.parent, child.parent[lifs])
    assert np.array_equal(grown.source, child.source[lifs])
    assert grown.cities == child.cities
    assert grown.attribution == child.attribution


def test_repair_brings_the_genome_to_the_fabric(code, fabric):
    heights = fabric.city().heights
    errors = [
        np.sqrt(np.mean((decode(fabric.genome(repair=repair)).city.heights - heights) ** 2))
        for repair in (None, 0.5)
    ]
    coding = decode(code).city.heights - draw_town(1, side=96, buildings=90).heights
    assert errors[1] < 0.5 * errors[0]
    assert errors[1] < 1.5 * np.sqrt(np.mean(coding**2))
    made = fabric.genome().made
    assert made["operator"] == "growth"
    assert made["repaired"] > 0


def test_a_fabric_lies_where_its_original_lies(code):
    placed = code.replace(origin=(1000.0, 5000.0), crs="EPSG:2154")
    fabric = grow(placed, 200, 264, RNG(0), corner=(3, 10))
    assert fabric.origin == (1000 - 10 * 8, 5000 + 3 * 8)
    for whole in (fabric, fabric.city(), fabric.genome(repair=None)):
        assert whole.crs == "EPSG:2154"
        assert whole.origin == fabric.origin
        assert whole.attribution == "drawn by seed 1"
    assert grow(code, 96, 96, RNG(0)).origin is None


def test_what_is_condensed_stays_in_its_place_alone(code):
    mask = np.zeros((96, 96), bool)
    mask[30:41, 20:60] = True
    layer = Condensation(np.full((96, 96), 33.0), mask)
    fabric = grow(code.replace(condensation=layer), 160, 160, RNG(0), corner=(8, 8))
    child = fabric.genome()
    assert len(child.condensation) == mask.sum()
    kept = decode(child).city.heights[32 : 32 + 96, 32 : 32 + 96]
    assert (kept[mask] == 33).all()
    assert (fabric.window(32, 32, 96, 96)[mask] == 33).all()


def test_straight_growth_turns_nothing(code):
    fabric = grow(code, 200, 264, RNG(5), turned=False)
    assert (fabric.stones & 7 == 0).all()
    assert len(np.unique(grow(code, 200, 264, RNG(5)).stones & 7)) == 8


def test_lifs_have_their_share(code):
    fabric = grow(code, 400, 400, RNG(0))
    uses = np.bincount(fabric.stones.ravel() >> 3, minlength=len(code))
    assert uses.min() >= 1
    assert uses.std() < uses.mean()  # drawn without regard to it, some would stand everywhere


def test_progress_is_told_to_the_end(code):
    told = []
    grow(code, 200, 200, RNG(0), progress=lambda done, total: told.append((done, total)))
    assert told[-1][0] == told[-1][1] > 0
    assert told == sorted(told)


# -- what cannot be ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"height": 201}, "height 200 or 204"),
        ({"width": 92}, "width 96"),
        ({"height": 40_000}, "height 32764"),
        ({"height": 200.0}, "height 96 or more"),
        ({"height": True}, "height 96 or more"),
        ({"height": 32_000, "width": 32_000}, "at most 134 million"),
        ({"rng": 1}, "a NumPy Generator"),
        ({"genome": "lyon"}, "a Genome"),
        ({"corner": (27, 0)}, "rows 0 to 26, columns 0 to 42"),
        ({"corner": (-1, 0)}, "rows 0 to 26"),
        ({"corner": 3}, "rows 0 to 26"),
        ({"size_min": 2}, "3 to 14 range blocks"),
        ({"size_max": 15}, "3 to 14 range blocks"),
        ({"size_min": 9, "size_max": 8}, "size_min at most size_max"),
        ({"size_min": 4.5}, "3 to 14 range blocks"),
        ({"tolerance": -1}, "0 m or more"),
        ({"tolerance": float("nan")}, "0 m or more"),
        ({"tolerance": "6"}, "0 m or more"),
        ({"candidates": 0}, "1 to 1048576"),
        ({"candidates": 1.5}, "1 to 1048576"),
    ],
)
def test_what_cannot_be_is_refused(code, changes, says):
    call = {"genome": code, "height": 200, "width": 264, "rng": RNG(0)} | changes
    with pytest.raises(OperatorError) as error:
        grow(**call)
    assert says in str(error.value)


@pytest.mark.parametrize(("side", "block"), [(8, 4), (96, 24)])
def test_too_few_or_too_large_range_blocks_are_refused(side, block):
    city = CityMap(RNG(0).random((side, side)) * 9, 2)
    with pytest.raises(OperatorError, match="3 × 3 range blocks or more, of at most 18 px"):
        grow(encode(city, block=block).genome, 480, 480, RNG(0))


# -- kernels against their twins --------------------------------------------------------------


def test_windows_of_stones_against_the_twin():
    rng = RNG(1)
    heights = rng.random((12, 20)).astype("f4")
    stones = rng.integers(-8, 8 * 15, (6, 5)).astype(np.int32)
    stones[stones < 0] = -1
    shown = naive.fabric(stones, heights, 4)
    for top, left, tall, wide in [(0, 0, 24, 20), (3, 5, 14, 11), (7, 6, 1, 1), (4, 4, 4, 16)]:
        out = np.empty((tall, wide), np.float32)
        _kernels.fabric_window(stones, heights, LAYS, 4, top, left, out)
        assert np.array_equal(out, shown[top : top + tall, left : left + wide])


@pytest.mark.parametrize("iso", range(8))
def test_candidates_against_the_twin(iso):
    rng = RNG(iso)
    heights = rng.random((24, 32)).astype("f4")
    seen = set()
    for draw in rng.integers(0, 1 << 62, 50):
        chosen = _kernels.candidate(draw, np.array([iso]), 3, 5, 6, 8, LAYS)
        seen.add(chosen[1:])
        for block, values in ((4, heights), (1, np.arange(48.0).reshape(6, 8))):
            first, down, along = _kernels.strides(chosen, 3, 5, block, values.shape[1], LAYS)
            at = [
                [first + y * down + x * along for x in range(5 * block)] for y in range(3 * block)
            ]
            scaled = (block * part for part in (*chosen[1:], 3, 5))
            assert np.array_equal(values.ravel()[at], naive.rectangle(values, iso, *scaled))
    assert len(seen) > 5


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_the_least_cut_against_all_cuts(data):
    shape = data.draw(st.sampled_from([(1, 1), (1, 5), (3, 3), (2, 5), (4, 3)]))
    cost = st.integers(0, 4)
    count = shape[0] * shape[1]
    costs = np.array(data.draw(st.lists(cost, min_size=2 * count, max_size=2 * count)), float)
    rims = np.array(data.draw(st.lists(cost, min_size=count, max_size=count)), float)
    kinds = data.draw(st.lists(st.integers(0, 3), min_size=count, max_size=count))
    must, never = (np.array(kinds).reshape(shape) == kind for kind in (0, 1))
    costs, rims = costs.reshape(*shape, 2), rims.reshape(shape)
    laid = np.zeros(shape, bool)
    _kernels.least_cut(costs, rims, must, never, laid)
    assert laid[must].all()
    assert not laid[never].any()
    # an edge costs 1/1024 m more, which decides between equal cuts alone
    assert naive.cut_cost(costs, rims, laid) == pytest.approx(
        naive.least_cut(costs, rims, must, never), abs=0.05
    )


@pytest.mark.parametrize("side", [1, 3, 8])
def test_window_keys_tell_equal_from_different(side):
    values = RNG(side).integers(-1, 2, (14, 17)).astype("f4")
    values[3:9, 2:9] = values[8:14, 9:16] = 1
    values[(values < 0) & (RNG(0).random(values.shape) < 0.9)] = 0
    keys = _kernels.window_keys(values, side)
    found = naive.windows(values, side)
    assert set(found) == set(np.ndindex(keys.shape))
    for corner, content in found.items():
        assert (keys[corner] == 0) == (content is None)
    pairs = {(content, keys[c]) for c, content in found.items() if content is not None}
    assert len(pairs) == len({k for k, _ in pairs}) == len({k for _, k in pairs})
    assert _kernels.window_keys(values, 18).size == 0


def test_window_keys_against_each_window_alone():
    values = RNG(0).random((70, 68)).astype("f4")
    keys = _kernels.window_keys(values, WINDOW)
    each = sliding_window_view(values, (WINDOW, WINDOW))
    for corner in np.ndindex(keys.shape):
        alone = _kernels.window_keys(np.ascontiguousarray(each[corner]), WINDOW)
        assert keys[corner] == alone[0, 0]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_windows_that_come_twice_against_the_twin(seed):
    rng = RNG(seed)
    side, apart, across = 4, 3, 8
    values = rng.choice(np.array([0, 1, 9], "f4"), (20, 22), p=[0.45, 0.1, 0.45])
    values[15:, 12:] = -1
    elsewhere = values[1:9, 2:10].copy() if rng.random() < 0.5 else rng.random((8, 8)) + 2
    known, table = {}, (np.zeros(64, np.uint64), np.full(64, _kernels.FREE, np.int64))
    for y, x in np.ndindex(2, 2):  # anchors south of what is looked at
        content = np.ascontiguousarray(elsewhere[y : y + side, x : x + side], np.float32)
        known[90 + 3 * y, 3 * x] = content.tobytes()
        key = _kernels.window_keys(content, side)[0, 0]
        _kernels.remember(*table, key, (30 + y) * across + x)
    found = _kernels.window_keys(values, side)
    flat = _kernels.window_keys(np.zeros((side, side), np.float32), side).ravel()
    box = (*rng.integers(0, 10, 2), *rng.integers(11, 20, 2))
    for exempt, content in ((flat, {bytes(4 * side * side)}), (flat[:0], set())):
        assert _kernels.comes_twice(
            *table, found, exempt, side, 0, 0, apart, across, box
        ) == naive.comes_twice(values, known, content, side, apart, box)


def test_common_windows_are_those_that_hold_one():
    values = RNG(0).random((80, 90)).astype("f4")
    values[5:75, 12:82] = 0
    found = _kernels.window_keys(values, _kernels.ANCHORED)
    common = _kernels.window_keys(np.zeros((57, 57), np.float32), 57).ravel()
    flat = _kernels.window_keys(np.zeros((64, 64), np.float32), 64).ravel()
    every = _kernels.window_keys(values, WINDOW)
    kept = _kernels.common_windows(values, found, common, flat)
    for (y, x), key in np.ndenumerate(kept):
        window = values[y : y + 64, x : x + 64]
        holds = (sliding_window_view(window, (57, 57)) == 0).all(axis=(2, 3)).any()
        assert key == (every[y, x] if holds and window.any() else 0)
    assert 0 < np.count_nonzero(kept) < kept.size
    assert _kernels.common_windows(values, found, common[:0], flat).size == 0


def test_the_table_of_windows_against_a_dictionary():
    rng = RNG(0)
    keys, anchors = np.zeros(32, np.uint64), np.full(32, _kernels.FREE, np.int64)
    truth, filled = {}, 0
    for _ in range(400):
        key, anchor = np.uint64(rng.integers(1, 12) << 40), int(rng.integers(0, 5))
        if rng.random() < 0.6:
            filled += _kernels.remember(keys, anchors, key, anchor)
            truth[key] = anchor if truth.get(key, anchor) == anchor else "many"
        else:
            image = np.full((1, 1), key)
            _kernels.forget(keys, anchors, image, image * 0, anchor, 0, 1, 1)
            if truth.get(key) == anchor:
                del truth[key]
        if rng.random() < 0.05:
            keys, anchors, filled = _kernels.rehashed(keys, anchors, 64)
            assert filled == len(truth)
        for key in map(np.uint64, np.arange(1, 12) << 40):
            for anchor in range(5):
                elsewhere = _kernels.stands_elsewhere(keys, anchors, key, anchor)
                assert elsewhere == (key in truth and truth[key] != anchor)


def test_genomes_of_a_fabric_have_legal_nucleotides(fabric):
    child = fabric.genome(repair=None)  # its bounds are checked by Genome
    assert len(child) == fabric.pavement.rows * fabric.pavement.columns
    assert {getattr(child, name).dtype for name in NUCLEOTIDES} == {
        nucleotide.dtype for nucleotide in NUCLEOTIDES.values()
    }
