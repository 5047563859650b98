"""Growth between cities: which original is laid where."""

import numpy as np
import pytest
from codes import draw_code, uniformly
from towns import draw_town

from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.genome import packed
from evocity.growth import grow
from evocity.growth.shares import Shares

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def codes():
    drawn = [
        draw_town(1, side=96, buildings=90),
        draw_town(2, side=128, buildings=40),
        draw_town(3, side=64, buildings=30),
    ]
    return [
        uniformly(town.replace(town.heights, name=f"town {k}")).genome
        for k, town in enumerate(drawn)
    ]


FAR = (-700, 900, 256, 256)


@pytest.mark.slow
def test_the_share_0_and_1_lay_one_alone(codes):
    a, b, _ = codes
    none, all_ = (grow([a, b], rng=RNG(0), share=share) for share in (0, 1.0))
    assert not none.sources(*FAR)["original"].any()
    assert all_.sources(*FAR)["original"].all()
    for fabric in (none, all_):
        assert np.array_equal(fabric.window(0, 0, 96, 96), decode(a).city.heights)
    # the first alone is the fabric of the first alone, if no window of the other's is like its
    assert np.array_equal(none.window(*FAR), grow(a, rng=RNG(0)).window(*FAR))


def test_cells_show_what_they_name(codes):
    fabric = grow(codes, rng=RNG(1), share=[1, 1, 1])
    told, shown = fabric.sources(*FAR), fabric.window(*FAR)
    heights = [decode(code).city.heights for code in codes]
    for i, j in np.ndindex(told["iso"].shape):
        one, row, column, iso = (told[name][i, j] for name in ("original", "row", "column", "iso"))
        cut = heights[one][4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
        turned = np.rot90(cut.T if iso >= 4 else cut, iso % 4)
        assert np.array_equal(shown[4 * i : 4 * i + 4, 4 * j : 4 * j + 4], turned)
    parts = np.bincount(told["original"].ravel(), minlength=3) / told["original"].size
    assert parts == pytest.approx([1 / 3] * 3, abs=0.15)


@pytest.mark.slow
def test_a_ramp_goes_from_west_to_east(codes):
    fabric = grow(codes[:2], 256, 1024, RNG(2))
    assert fabric.place == (80, 0)
    second = fabric.sources()["original"]
    along = second.reshape(64, 4, 64).mean(axis=(0, 2))
    assert along == pytest.approx([1 / 8, 3 / 8, 5 / 8, 7 / 8], abs=0.17)
    assert (np.diff(along) > 0).all()
    assert not fabric.sources(0, -400, 256, 256)["original"].any()
    assert fabric.sources(0, 1100, 256, 256)["original"].all()


@pytest.mark.slow
def test_a_painted_share_is_laid_where_it_is_painted(codes):
    painted = np.zeros((2, 2))
    painted[0, 1] = 1
    fabric = grow(codes[:2], 512, 512, RNG(0), share=painted, corner=(-100, -100))
    second = fabric.sources()["original"]
    rim = 14  # groups reach so far beyond their middles
    assert second[: 64 - rim, 64 + rim :].all()
    assert not second[64 + rim :].any()
    assert not second[:, : 64 - rim].any()
    assert fabric.sources(-400, 600, 128, 128)["original"].all()  # the edges go on
    shown = fabric.window(160, 160, 192, 192)
    same = [
        lambda y, x: float(y < 256 and x >= 256),
        lambda y, x: (1 - (y < 256 and x >= 256), y < 256 and x >= 256),
        np.stack([1 - painted, painted]),
    ]
    for share in same:
        other = grow(codes[:2], 512, 512, RNG(0), share=share, corner=(-100, -100))
        assert np.array_equal(other.window(160, 160, 192, 192), shown)


def test_what_a_share_lies_over_makes_maps_fit(codes):
    whole = grow(codes[:2], 128, 640, RNG(0), corner=(0, 0))
    part = grow(codes[:2], 128, 128, RNG(0), corner=(0, -64), share_over=(0, -256, 128, 640))
    assert np.array_equal(part.window(0, 0, 128, 128), whole.window(0, 256, 128, 128))


def test_several_do_not_repeat(codes):
    fabric = grow(codes, 448, 448, RNG(0), share=[1, 2, 1])
    assert fabric.repeats() == 0


def test_a_genome_of_several_names_its_cities(codes):
    a, b, _ = codes
    fabric = grow([a, b], rng=RNG(0), share=0.5)
    box = (-200, 100, 160, 160)
    child, told = fabric.genome(*box), fabric.sources(*box)
    assert child.cities == ("town 0", "town 1")
    assert child.attribution == "drawn by seed 1; drawn by seed 2"
    assert np.array_equal(child.parent, told["original"].ravel())
    places = packed(4 * told["row"], 4 * told["column"])
    assert np.array_equal(child.source, places.ravel())
    error = decode(child).city.heights - fabric.window(*box)
    assert np.sqrt(np.mean(error**2)) < 1
    assert child.made["share"] == [0.5, 0.5]
    assert fabric.name == "town 0 × town 1, grown"


def test_shares_are_interpolated_between_all():
    ramp = Shares(3, None, (100, 200), (0, 0))
    for x, parts in [(-5, (1, 0, 0)), (50, (0.5, 0.5, 0)), (100, (0, 1, 0)), (999, (0, 0, 1))]:
        assert ramp.at(3, x) == pytest.approx(parts)


@pytest.mark.parametrize(
    ("share", "says"),
    [
        (1.5, "a number from 0 to 1"),
        (-0.1, "a number from 0 to 1"),
        (float("nan"), "a number from 0 to 1"),
        ("north", "a number from 0 to 1"),
        ([1, 1, 1], "2 numbers of 0 or more"),
        ([0, 0], "at least one above 0"),
        (np.full((4, 4), 2.0), "a number from 0 to 1"),
        (np.zeros((0, 4)), "a number from 0 to 1"),
        (np.ones((3, 4, 4)), "a number from 0 to 1"),
        (lambda y, x: 2, "share = 2 at row"),
        (lambda y, x: (1, 2, 3), "at row"),
        (lambda y, x: None, "share = None at row"),
    ],
)
def test_a_share_that_is_none_is_refused(codes, share, says):
    with pytest.raises(OperatorError) as error:
        grow(codes[:2], rng=RNG(0), share=share).window(300, 300, 8, 8)
    assert says in str(error.value)


def test_genomes_that_do_not_go_together_are_refused(codes):
    with pytest.raises(OperatorError, match="genomes have pixels of different sides, 1 and 2 m"):
        grow([codes[0], codes[1].replace(metres_per_pixel=1.0)], rng=RNG(0))
    with pytest.raises(OperatorError, match="a single genome"):
        grow(codes[:1], rng=RNG(0), share=0.5)
    with pytest.raises(OperatorError, match="share_over = "):
        grow(codes[:2], rng=RNG(0), share_over=(0, 0, 0, 5))
    coarse = draw_code(4, 16, 16, block=6)
    mixed = grow([codes[0], coarse], rng=RNG(0), cell=8)
    mixed.window(200, 0, 8, 8)
    with pytest.raises(OperatorError, match="range blocks of 4 and 6 px"):
        mixed.genome(0, 0, 96, 96)
    with pytest.raises(OperatorError, match="of several sides"):
        grow([codes[0], coarse], rng=RNG(0), size_max=6)
