"""Growth: the original stays, the fabric has no end and no seam, and does not repeat itself."""

import hashlib
import pickle
import subprocess
import sys

import naive
import numpy as np
import pytest
from codes import draw_code, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.growth import WINDOW, _kernels, grow
from evocity.growth.lattice import CROSSING, EAST, INSIDE, SOUTH, TILE, Lattice

RNG = np.random.default_rng


# -- a function of seed and place -------------------------------------------------------------


@pytest.mark.slow
def test_the_original_stays_as_it_is_and_all_is_laid(code, fabric):
    top, left = fabric.place
    assert fabric.place == (52, 84)
    assert np.array_equal(fabric.window(top, left, 96, 96), decode(code).city.heights)
    stones = fabric.plane.stones(-60, -70, 90, 80)
    assert (stones >= 0).all()
    assert stones.max() < 8 * len(code)
    shown = fabric.window(top - 240, left - 280, 600, 600)
    assert np.array_equal(shown, naive.fabric(stones, [decode(code).city.heights], 4))


WINDOWS = [
    (0, 0, 200, 264), (-700, 13, 50, 3), (199, 263, 1, 1), (40, 40, 0, 5), (-131, -9, 300, 20),
    (10**12 + 1, -(10**14), 140, 30), (-300, -900, 64, 64),
]  # fmt: skip


@pytest.mark.slow
def test_windows_are_the_same_in_any_order(code):
    first, second = (grow(code, 200, 264, RNG(5)) for _ in range(2))
    forward = [first.window(*box) for box in WINDOWS]
    backward = [second.window(*box) for box in WINDOWS[::-1]][::-1]
    for one, other, box in zip(forward, backward, WINDOWS, strict=True):
        assert one.shape == box[2:]
        assert np.array_equal(one, other)
    assert not np.array_equal(grow(code, 200, 264, RNG(6)).window(*WINDOWS[0]), forward[0])


def digest_of(fabric) -> str:
    state = hashlib.sha256()
    for box in WINDOWS:
        state.update(np.ascontiguousarray(fabric.window(*box)).tobytes())
    return state.hexdigest()


@pytest.mark.slow
def test_another_process_shows_the_same(code, tmp_path):
    code.write(tmp_path / "town.parquet")
    program = f"""
import hashlib, numpy as np, evocity
from evocity.growth import grow
fabric = grow(evocity.read_genome({str(tmp_path / "town.parquet")!r}), 200, 264,
              np.random.default_rng(5))
state = hashlib.sha256()
for box in {WINDOWS[::-1]}[::-1]:
    state.update(np.ascontiguousarray(fabric.window(*box)).tobytes())
print(state.hexdigest())
"""
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == digest_of(grow(code, 200, 264, RNG(5)))


@pytest.mark.slow
def test_what_is_kept_changes_nothing(code, fabric, monkeypatch):
    monkeypatch.setattr("evocity.growth.plane._REGIONS", 3)
    forgetful = grow(code, 200, 264, RNG(5))
    assert digest_of(forgetful) == digest_of(fabric)
    assert len(forgetful.plane._regions) <= 3


@pytest.mark.slow
def test_a_fabric_travels_to_other_processes(fabric):
    assert digest_of(pickle.loads(pickle.dumps(fabric))) == digest_of(fabric)


@pytest.fixture(scope="module")
def whole(fabric):
    """All that the windows of the next test lie within."""
    return fabric.window(-200, -200, 600, 600)


@settings(max_examples=30, deadline=None)
@given(
    top=st.integers(-200, 200), left=st.integers(-200, 200),
    height=st.integers(1, 200), width=st.integers(1, 200),
)  # fmt: skip
def test_windows_that_overlap_agree(fabric, whole, top, left, height, width):
    part = whole[top + 200 : top + 200 + height, left + 200 : left + 200 + width]
    assert np.array_equal(fabric.window(top, left, height, width), part)


@pytest.mark.slow
def test_size_and_corner_of_the_map_change_nothing_in_the_fabric(code, fabric):
    shown = fabric.window(fabric.place[0] - 200, fabric.place[1] - 200, 500, 500)
    for options in ({}, {"height": 96, "width": 300}, {"corner": (-90, 3)}):
        other = grow(code, rng=RNG(5), **options)
        y, x = other.place
        assert np.array_equal(other.window(y - 200, x - 200, 500, 500), shown)
    other = fabric.at(-71, 13, 33, 55)
    assert other.shape == (33, 55)
    assert np.array_equal(other.window(0, 0, 33, 55), fabric.window(-71, 13, 33, 55))
    assert np.array_equal(other.city().heights, fabric.window(-71, 13, 33, 55))


def test_without_a_size_the_map_is_the_original(code):
    same = grow(code, rng=RNG(0))
    assert (same.shape, same.place) == ((96, 96), (0, 0))
    assert same.genome() == code


@pytest.mark.parametrize("corner", [(0, 0), (26, 42), (3, 17), (-5, 200)])
def test_the_original_stands_where_it_is_told(code, corner):
    fabric = grow(code, 200, 264, RNG(0), corner=corner)
    assert fabric.place == (4 * corner[0], 4 * corner[1])
    assert np.array_equal(fabric.window(*fabric.place, 96, 96), decode(code).city.heights)
    told = fabric.sources(*fabric.place, 96, 96)
    assert not told["original"].any()
    assert not told["iso"].any()
    assert np.array_equal(24 * told["row"] + told["column"], np.arange(576).reshape(24, 24))


@pytest.mark.slow
def test_cells_need_not_be_the_range_blocks(code):
    heights = decode(code).city.heights
    for cell in (2, 3, 6, 8):
        fabric = grow(code, 200, 264, RNG(1), cell=cell)
        assert fabric.cell == cell
        stones = fabric.plane.stones(-20, -20, 50, 50)
        shown = fabric.window(*(at - 20 * cell for at in fabric.place), 70 * cell, 70 * cell)
        assert np.array_equal(shown, naive.fabric(stones, [heights], cell))


def test_cells_are_of_8_metres_in_whole_range_blocks():
    drawn = draw_town(1, side=96, buildings=90)
    for block, metres, cell in [(4, 2, 4), (2, 2, 4), (8, 2, 8), (4, 1, 8), (2, 4, 2), (16, 2, 4)]:
        town = CityMap(drawn.heights, metres)
        assert grow(uniformly(town, block=block).genome, rng=RNG(0)).cell == cell


# -- tiles ------------------------------------------------------------------------------------

LATTICES = (
    st.tuples(st.integers(3, 14), st.integers(5, 14))
    .filter(lambda s: s[0] <= s[1])
    .flatmap(
        lambda sizes: st.builds(
            Lattice,
            st.integers(sizes[1] + 1, 90),
            st.integers(sizes[1] + 1, 90),
            st.integers(2 * sizes[1] + 1, 40),
            st.just(sizes[0]),
            st.just(sizes[1]),
        )
    )
)


@settings(max_examples=100, deadline=None)
@given(lattice=LATTICES)
def test_tiles_cover_the_plane_once(lattice):
    for axis, side in ((0, lattice.rows), (1, lattice.columns)):
        lines = [lattice.line(axis, k) for k in range(-4, 9)]
        assert (np.diff(lines) > lattice.size_max).all()
        assert {0, side} <= set(lines)
        for at in range(-60, 160):
            k = lattice.tile_of(axis, at)
            assert lattice.line(axis, k) <= at < lattice.line(axis, k + 1)


@settings(max_examples=60, deadline=None)
@given(lattice=LATTICES, i=st.integers(-2, 4), j=st.integers(-2, 4))
def test_what_is_laid_apart_lies_apart(lattice, i, j):
    """Of what is laid without knowing of each other, no two cells touch by a side."""
    near = [(i + di, j + dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]
    for kinds in ((CROSSING,), (EAST, SOUTH), (INSIDE,)):
        regions = {(kind, *at): lattice.extent(kind, *at) for kind in kinds for at in near}
        for kind in kinds:
            top, left, bottom, right = regions.pop((kind, i, j))
            for other in regions.values():
                down = max(top, other[0]) - min(bottom, other[2])
                along = max(left, other[1]) - min(right, other[3])
                assert max(down, along) >= 1 or (down == along == 0)
            regions[kind, i, j] = top, left, bottom, right


@settings(max_examples=100, deadline=None)
@given(lattice=LATTICES, i=st.integers(-2, 3), j=st.integers(-2, 3), seed=st.integers(0, 2**32))
def test_places_cover_a_tile_and_what_stands_lies_within_them(lattice, i, j, seed):
    rng, reach = RNG(seed), 60
    origin = lattice.line(0, i) - reach, lattice.line(1, j) - reach
    span = lattice.line(0, i + 1) - origin[0] + reach, lattice.line(1, j + 1) - origin[1] + reach
    laid = np.zeros(span, bool)

    def of(rectangle):
        top, left, bottom, right = rectangle
        rows = slice(max(top - origin[0], 0), max(bottom - origin[0], 0))
        return rows, slice(max(left - origin[1], 0), max(right - origin[1], 0))

    original = of((0, 0, lattice.rows, lattice.columns))
    laid[original] = True
    for key in [*lattice.prerequisites(INSIDE, i, j), (INSIDE, i, j)]:
        whole = np.zeros(span, bool)
        whole[of(lattice.extent(*key))] = True
        for top, left, tall, wide in lattice.places(*key, rng):
            assert max(tall, wide) <= lattice.size_max
            place = of((top, left, top + tall, left + wide))
            assert whole[place].all()
            bare, beyond = ~laid[place], laid.copy()
            beyond[place] = False
            rows, columns = place
            # no bare cell beside what stands outside: there, no step could be measured
            assert not (bare[0] & beyond[rows.start - 1, columns]).any()
            assert not (bare[-1] & beyond[rows.stop, columns]).any()
            assert not (bare[:, 0] & beyond[rows, columns.start - 1]).any()
            assert not (bare[:, -1] & beyond[rows, columns.stop]).any()
            laid[place] = True
        assert laid[whole].all()
    tile = (lattice.line(0, i), lattice.line(1, j), lattice.line(0, i + 1), lattice.line(1, j + 1))
    assert laid[of(tile)].all()


@pytest.mark.slow
def test_no_seam_along_the_lines_between_tiles(code):
    fabric = grow(code, rng=RNG(1))
    heights = fabric.window(-1088, -1088, 1024, 1024)
    for shown in (heights, heights.T):
        steps = np.abs(np.diff(shown, axis=0)).mean(axis=1)
        rows = np.arange(-1087, -64)  # a step at row y leads there from the row before
        between = steps[rows % fabric.cell == 0].mean()  # seams run between cells alone
        lines = steps[rows % TILE == 0]
        assert len(lines) == 8
        assert lines.mean() < 1.1 * between
        # nor beside them, where strips and tiles meet
        beside = [steps[rows % TILE == k % TILE].mean() for k in range(-28, 29, 4)]
        assert max(beside) < 1.5 * between


# -- groups -----------------------------------------------------------------------------------


def laid_one_by_one(code, monkeypatch, **options):
    """(fabric before, its stones after, the place, its step) of every group laid."""
    laid = []

    def one_by_one(*, stones, places, steps, **others):
        single = {name: others.pop(name) for name in ("owners", "draws", "twice")}
        single |= {"places": places, "steps": steps}
        grown = np.zeros(2, int)
        for n in range(len(places)):
            before = stones.copy()
            some = {name: values[n : n + 1] for name, values in single.items()}
            grown += _kernels.lay_groups(stones=stones, **some, **others)
            if np.isfinite(steps[n]):
                laid.append((before, stones.copy(), places[n], steps[n]))
        return grown

    monkeypatch.setattr("evocity.growth.plane.lay_groups", one_by_one)
    grow(code, 128, 128, RNG(3), corner=(-24, 0), **options).city()
    return laid


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [2.0, pytest.param(6.0, marks=pytest.mark.long)])
def test_outlines_step_by_no_more_than_the_tolerance(code, monkeypatch, tolerance):
    heights = decode(code).city.heights
    laid = laid_one_by_one(code, monkeypatch, tolerance=tolerance)
    forced = 0
    for before, after, (top, left, tall, wide), step in laid:
        place = np.s_[top : top + tall, left : left + wide]
        changed = before != after
        changed[place] = False
        assert not changed.any()
        shown, now = (naive.fabric(stones, [heights], 4) for stones in (before, after))
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


@pytest.mark.slow
def test_density_is_kept(code):
    own = CityMap(decode(code).city.heights, 2)
    for place in (-2000, 5000):
        shown = grow(code, rng=RNG(0)).city(place, place, 384, 384)
        assert evocity.fitness.gsi(shown) == pytest.approx(evocity.fitness.gsi(own), rel=0.12)


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


@pytest.mark.slow_cases("town-options0", "oblong-options1", "small-options2")
@pytest.mark.parametrize(
    ("name", "options"),
    [
        *((name, {}) for name in ("town", "oblong", "small", "flat")),
        ("oblong", {"turned": False, "candidates": 100}),
        ("town", {"cell": 8}),
        pytest.param("town", {"turned": False, "candidates": 100}, marks=pytest.mark.long),
        pytest.param("town", {"cell": 2}, marks=pytest.mark.long),
    ],
)
def test_drawn_towns_do_not_repeat(name, options):
    drawn = uniformly(CityMap(DRAWN[name], 2)).genome
    fabric = grow(drawn, 416, 384, RNG(1), **options)
    assert repeated_beyond(decode(drawn).city.heights, fabric.city().heights) == 0
    assert fabric.repeats() == 0


@pytest.mark.slow_cases("town", "small", "open")
@pytest.mark.parametrize("name", [name for name in DRAWN if name not in ("ramp", "chess")])
def test_not_even_open_ground_repeats_in_a_tile(name):
    drawn = uniformly(CityMap(DRAWN[name], 2)).genome
    fabric = grow(drawn, rng=RNG(1))
    for i, j in [(-2, -1), (3, 3)]:
        top, left, bottom, right = (4 * at for at in fabric.plane.lattice.context(INSIDE, i, j))
        shown = fabric.window(top, left, bottom - top, right - left)
        region = fabric.plane.region(INSIDE, i, j)
        found = repeated_beyond(decode(drawn).city.heights, shown)
        assert found == region.repeated == 0


@pytest.mark.slow
def test_repeats_are_counted():
    drawn = uniformly(CityMap(DRAWN["house"], 2)).genome
    fabric = grow(drawn, 400, 384, RNG(1))
    box = (-300, 20, 400, 384)
    found = repeated_beyond(decode(drawn).city.heights, fabric.window(*box))
    assert fabric.repeats(*box) == found > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cape-town-salt-river", "lyon-1er"])
def test_cities_do_not_repeat_and_keep_their_density(name):
    city = evocity.read_map(name)
    fabric = grow(uniformly(city).genome, 512, 512, RNG(1))
    shown, own = fabric.city(), fabric.city(*fabric.place, 256, 256)
    assert fabric.repeats() == 0
    assert repeated_beyond(own.heights, shown.heights) == 0
    for measure in (evocity.fitness.gsi, evocity.fitness.mean_height):
        assert measure(shown) == pytest.approx(measure(own), rel=0.1)
    # hardly more crumbs than in the original, though every seam could make some
    assert evocity.fitness.crumbs(shown) < 2.5 * evocity.fitness.crumbs(own)
    told = fabric.account()
    assert told["repeated"] == 0
    assert told["step"] < 4
    assert told["forced"] <= 0.02 * told["groups"]


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", evocity.cities())
def test_no_window_comes_twice_within_4096_pixels(name):
    fabric = grow(uniformly(evocity.read_map(name)).genome, 4096, 4096, RNG(1))
    assert fabric.repeats() == 0
    assert fabric.repeats(-30_000, 10_000, 4096, 4096) == 0


@pytest.mark.slow
def test_what_must_repeat_is_told():
    # no window of it is without the house, so that straight copies cannot but show it again
    code = uniformly(CityMap(one_house(80), 2)).genome
    fabric = grow(code, 120, 128, RNG(1), turned=False)
    assert fabric.account()["repeated"] > 0
    assert fabric.repeats() > 0


# -- what it tells ----------------------------------------------------------------------------


def test_a_fabric_lies_where_its_original_lies(code):
    placed = code.replace(origin=(1000.0, 5000.0), crs="EPSG:2154")
    fabric = grow(placed, 200, 264, RNG(0), corner=(3, 10))
    assert fabric.origin == (1000 - 10 * 8, 5000 + 3 * 8)
    assert fabric.city(-7, 13, 40, 40).origin == (1000 - 80 + 26, 5000 + 24 + 14)
    assert fabric.at(-7, 13, 40, 40).origin == (1000 - 80 + 26, 5000 + 24 + 14)
    for whole in (fabric, fabric.city(), fabric.genome(repair=None)):
        assert whole.crs == "EPSG:2154"
        assert whole.origin == fabric.origin
        assert whole.attribution == "drawn by seed 1"
    assert grow(code, 96, 96, RNG(0)).origin is None


def test_straight_growth_turns_nothing(code):
    fabric = grow(code, 200, 264, RNG(5), turned=False)
    assert not fabric.sources()["iso"].any()
    assert len(np.unique(grow(code, 200, 264, RNG(5)).sources()["iso"])) == 8


@pytest.mark.slow
def test_cells_have_their_share(code):
    told = grow(code, 400, 400, RNG(0)).sources()
    uses = np.bincount((24 * told["row"] + told["column"]).ravel(), minlength=len(code))
    assert np.count_nonzero(uses) == len(code)
    assert uses.std() < uses.mean()  # drawn without regard to it, some would stand everywhere


def test_progress_is_told_to_the_end(code):
    told = []
    grow(code, 200, 200, RNG(0)).account(progress=lambda *step: told.append(step))
    assert told[-1][0] == told[-1][1] > 0
    assert told == sorted(told)


@pytest.mark.slow
def test_sizes_in_metres_and_in_range_blocks_mean_the_same(code):
    blocks = grow(code, rng=RNG(0), size_min=4, size_max=6)
    metres = grow(code, rng=RNG(0), side_min=32, side_max=48.0)
    assert digest_of(blocks) == digest_of(metres)
    assert blocks.made == metres.made
    assert (metres.made["side_min"], metres.made["side_max"]) == (32, 48)
    coarse = grow(code, rng=RNG(0), cell=8, size_min=6, size_max=12)
    assert (coarse.made["side_min"], coarse.made["side_max"]) == (48, 96)


# -- what cannot be ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"height": 0}, "height 1 to"),
        ({"height": 40_000}, "height 1 to 32767"),
        ({"height": 200.0}, "height = 200.0"),
        ({"height": True}, "height = True"),
        ({"height": 32_000, "width": 32_000}, "at most 134 million"),
        ({"rng": 1}, "a NumPy Generator"),
        ({"genome": "lyon"}, "an object of the class Genome"),
        ({"genome": []}, "an object of the class Genome"),
        ({"corner": (0.5, 0)}, "(row, column), counted in cells of 4 px"),
        ({"corner": 3}, "(row, column), counted in cells"),
        ({"cell": 5}, "one of 2, 3, 4, 6, 8 px"),
        ({"cell": 16}, "one of 2, 3, 4, 6, 8 px"),
        ({"cell": 4.0}, "one of 2, 3, 4, 6, 8 px"),
        ({"size_min": 2}, "24 to 112 m, 3 to 14 cells"),
        ({"size_max": 15}, "24 to 112 m"),
        ({"size_min": 9, "size_max": 8}, "the smaller at most the larger"),
        ({"size_max": 4}, "the larger 40 m or more"),
        ({"size_min": 4.5}, "24 to 112 m"),
        ({"side_max": 130}, "growth: side_max = 130"),
        ({"side_max": float("nan")}, "24 to 112 m"),
        ({"side_min": "32"}, "24 to 112 m"),
        ({"side_min": 32, "size_min": 4}, "side_min = 32 is given together with size_min = 4"),
        ({"side_max": 64, "size_max": 8}, "size_max"),
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


@pytest.mark.parametrize(
    ("box", "says"),
    [
        ((0.0, 0, 5, 5), "top = 0.0"),
        ((0, 1 << 51, 5, 5), "at most 2⁵⁰ from 0"),
        ((0, 0, -1, 5), "height 0 to"),
        ((0, 0, 5, 1 << 40), "width 0 to"),
        ((0, 0, 30_000, 30_000), "several smaller rectangles"),
    ],
)
def test_windows_that_cannot_be_are_refused(fabric, box, says):
    with pytest.raises(OperatorError) as error:
        fabric.window(*box)
    assert says in str(error.value)


@pytest.mark.parametrize(("blocks", "block"), [(5, 2), (17, 13)])
def test_too_small_originals_are_refused(blocks, block):
    with pytest.raises(OperatorError, match="6 × 6 whole cells of 2 to 11 px"):
        grow(draw_code(0, blocks, blocks, block), rng=RNG(0))
