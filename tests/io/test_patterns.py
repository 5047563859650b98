"""Towns drawn by a rule: valid maps with streets and houses, the same for the same seed."""

import contextlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy import ndimage

import evocity
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import write_map, write_shares
from evocity.pictures import Shares
from evocity.pictures.picture import render_shares
from evocity.towns import PATTERNS, substitution_town
from evocity.towns.houses import STOREY

every = pytest.mark.parametrize("name", PATTERNS)


def parameters(name):
    return {k: p.default for k, p in inspect.signature(PATTERNS[name]).parameters.items()}


def drawn(name, seed=None, **options):
    rng = None if seed is None else np.random.default_rng(seed)
    return PATTERNS[name](rng=rng, **options)


# -- what each is -----------------------------------------------------------------------------


@every
@pytest.mark.parametrize("seed", [None, 3])
def test_a_town_has_streets_and_houses_of_plausible_sizes(name, seed):
    town = drawn(name, seed)
    assert isinstance(town, CityMap)
    assert town.shape == (256, 256)
    assert (town.name, town.attribution) == (f"{name}-town", "")
    assert 0.2 < town.built.mean() < 0.65
    assert 60 < len(town.areas) < 300
    assert 60 < np.median(town.areas) < 3000  # a house, or a closed block about its court
    storeys = town.heights[town.built] / STOREY
    np.testing.assert_array_equal(storeys, np.round(storeys))
    assert storeys.min() >= 1
    assert 4 <= storeys.max() <= 8


@every
def test_streets_are_one_net_that_leads_to_every_block(name):
    town = drawn(name, 5)
    ground = ~town.built
    labels, _ = ndimage.label(ground)
    street = np.bincount(labels[ground]).argmax()
    net = labels == street
    assert net.mean() > 0.2
    beside = ndimage.binary_dilation(net)
    touching = {int(label) for label in np.unique(town.labels[beside]) if label}
    assert len(touching) == len(town.areas)


@every
def test_the_same_seed_draws_the_same_town_and_another_another(name):
    assert (drawn(name, 3).heights == drawn(name, 3).heights).all()
    assert (drawn(name, 3).heights != drawn(name, 4).heights).any()
    assert (drawn(name).heights == drawn(name).heights).all()


@every
def test_a_town_is_a_parent(name):
    town = drawn(name, 2, pixels=64)
    encoding = uniformly(town)
    assert encoding.genome.cities == (town.name,)
    assert evocity.decode(encoding.genome).converged
    assert encoding.psnr > 12


@every
def test_a_town_is_written_and_read_back(name, tmp_path):
    town = drawn(name, 1)
    write_map(town, tmp_path / "town.tif")
    again = evocity.read_map(tmp_path / "town.tif")
    assert (again.heights == town.heights).all()
    assert (again.name, again.metres_per_pixel) == (town.name, 2.0)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from([*PATTERNS]),
    st.integers(1, 140),
    st.sampled_from([0.5, 1.0, 2.0, 3.7]),
    st.sampled_from([None, 1]),
)
def test_any_size_is_a_map(name, pixels, side, seed):
    options = {"pixels": pixels, "metres_per_pixel": side}
    if name in ("substitution", "chessboard") and pixels * side < 80:
        with contextlib.suppress(MapError):  # no room for a street and a shape on each side
            assert drawn(name, seed, **options).shape == (pixels, pixels)
    else:
        town = drawn(name, seed, **options)
        assert town.shape == (pixels, pixels)
        assert town.metres_per_pixel == side


@pytest.mark.parametrize(("name", "word"), [("substitution", "too small"), ("chessboard", "less")])
def test_a_map_too_small_for_a_street_is_refused(name, word):
    with pytest.raises(MapError, match=word):
        drawn(name, pixels=5)


@pytest.mark.parametrize("name", ["concentric", "chessboard", "radial"])
def test_metres_are_metres_whatever_the_pixels(name):
    coarse, fine = drawn(name), drawn(name, pixels=512, metres_per_pixel=1.0)
    assert fine.built.mean() == pytest.approx(coarse.built.mean(), abs=0.03)
    assert fine.heights.max() == coarse.heights.max()
    # a coarse pixel is that of the fine ones its centre lies in
    beside = np.stack([fine.built[i::2, j::2] for i in (0, 1) for j in (0, 1)])
    alike = (beside == coarse.built).any(axis=0)
    assert alike.mean() > 0.97


@pytest.mark.parametrize("name", ["concentric", "radial"])
def test_places_and_rings_are_where_they_should_be(name):
    town = drawn(name, place=40.0)
    at = (np.arange(256) - 127.5) * 2
    r = np.hypot(at[:, None], at[None, :])
    assert not town.built[r < 40].any()
    assert town.built[(r > 40) & (r < 52)].mean() > 0.5
    inner, outer = (town.heights[town.built & near].mean() for near in (r < 120, r > 200))
    assert inner > outer + 3


def test_a_chessboard_turns_into_itself():
    heights = drawn("chessboard", pixels=252).heights  # a block and its street are 42 px
    np.testing.assert_array_equal(heights[::-1, ::-1], heights)
    closed = heights[4:38, 6:36]  # the first block: built all round, open in its middle
    assert (closed[:2] > 0).all()
    assert (closed[13:21, 11:19] == 0).all()


# -- the motif --------------------------------------------------------------------------------


def test_iterations_part_every_shape_into_a_motif():
    counts = [
        len(substitution_town(512, 1.0, iterations=n, least=1, street=8.0).areas) for n in (1, 2, 3)
    ]
    assert counts == [4, 16, 64]


def test_one_iteration_is_the_motif_itself():
    town = substitution_town(60, 1.0, motif="AAB/..B", turns="00", iterations=1, street=2.0)
    expected = np.zeros((60, 60), bool)
    expected[1:29, 1:39] = True
    expected[1:59, 41:59] = True
    np.testing.assert_array_equal(town.built, expected)


def test_what_stays_open_in_the_motif_stays_open():
    built = drawn("substitution").built
    assert not built[103:153, 103:153].any()  # its middle fifth


def test_streets_narrow_with_every_iteration():
    options = {"motif": "AB", "turns": "00", "iterations": 2, "street": 20.0, "least": 2.0}
    row = substitution_town(128, 1.0, **options).built[64]
    edges = np.flatnonzero(np.diff(row.astype(int)))
    gaps = np.diff(edges)[1::2]
    assert gaps.tolist() == [10, 30, 10]  # a half on each side of the main one, and its own


def test_the_rule_turns_the_motif():
    options = {"motif": "AB/AC", "iterations": 2, "street": 6.0}
    same = substitution_town(turns="000", **options).built
    turned = substitution_town(turns="200", **options).built
    half = np.s_[:, :128]
    assert (turned[:, 128:] == same[:, 128:]).all()
    np.testing.assert_array_equal(turned[half][:, ::-1], same[half])


def test_a_shape_too_narrow_to_be_parted_stays_whole():
    town = substitution_town(iterations=8, least=20.0)
    slices = ndimage.find_objects(town.labels)
    shortest = min(min(s.stop - s.start for s in pair) for pair in slices)
    assert 2 * shortest >= 20 - 2


# -- what is refused --------------------------------------------------------------------------


BAD = [
    ("pixels", [0, -1, 1.5, True, 10**9, "64", None]),
    ("metres_per_pixel", [0, -2.0, float("nan"), float("inf"), "2", None, 10**400]),
    ("rng", [7, "seed"]),
    ("street", [0, -1, float("nan"), 1e9, "12", None, 10**400, True]),
    ("storeys", [3, (0, 4), (5, 2), (1, 2, 3), (1.5, 2), "27", (1, 10**9)]),
]
BAD_OF = {
    "substitution": [
        ("motif", ["", "A", "AB/A", "ABA", "AB/BA", "....", 5, "A/B/", None, "A" * 9]),
        ("turns", ["", "012", "0129", "01230", 1230, None]),
        ("iterations", [0, 9, 2.0, True, "3"]),
        ("narrowing", [0, 1.1, -0.5, float("nan"), "x"]),
        ("least", [0.5, -1, None]),
    ],
    "concentric": [("roads", [2, 361, 6.0, None]), ("place", [0, None]), ("ring", [1])],
    "chessboard": [("street", [600]), ("gap", [0]), ("block", ["x"]), ("frontage", [1e7])],
    "radial": [("roads", [0, "8"]), ("spacing", [-4]), ("depth", [float("nan")])],
}


@every
def test_what_is_out_of_bounds_is_refused_by_name(name):
    for key, values in BAD + BAD_OF[name]:
        for value in values:
            with pytest.raises(MapError, match=rf"^{key} = ") as raised:
                PATTERNS[name](**{key: value})
            assert len(raised.value.args) == 3


@every
def test_streets_narrower_than_a_pixel_are_refused(name):
    with pytest.raises(MapError, match="smaller pixels"):
        PATTERNS[name](metres_per_pixel=25.0)


# -- what is told of them ---------------------------------------------------------------------


@every
def test_the_page_tells_every_parameter_and_its_default(name):
    text = (Path(__file__).parents[2] / "docs" / "pictures.md").read_text("utf-8")
    (part,) = re.findall(rf"^### {name}\n(.*?)(?=^##|\Z)", text, re.M | re.S)
    told = dict(re.findall(r"^\| `(\w+)` \| `([^`]+)` \|", part, re.M))
    own = {k: v for k, v in parameters(name).items() if k not in ("pixels", "metres_per_pixel")}
    del own["rng"]
    assert told == {key: repr(default) for key, default in own.items()}


# -- shares as a picture ----------------------------------------------------------------------


@pytest.fixture
def shares(town):
    weights = np.zeros((*town.shape, 3), np.float32)
    weights[:, :32, 0] = 1
    weights[:, 32:, 1] = 1
    return Shares(town, weights, ("west", "east", "nowhere"), "halves")


def test_each_part_has_a_hue_and_half_and_half_lies_between(shares):
    picture = np.asarray(render_shares(shares, legend=False), float)
    assert picture.shape == (*shares.city.shape, 3)
    mixed = Shares(
        shares.city, np.full((*shares.city.shape, 2), 0.5, np.float32), ("west", "east"), ""
    )
    between = np.asarray(render_shares(mixed, legend=False), float)
    built = shares.city.built
    west, east = (picture[built & half].mean(axis=0) for half in halves(built.shape))
    apart = np.abs(west - east).sum()
    assert apart > 150
    middle = between[built].mean(axis=0)
    assert np.abs(middle - west).sum() < 0.8 * apart
    assert np.abs(middle - east).sum() < 0.8 * apart
    assert picture[~built].mean() > picture[built].mean() + 30  # ground is pale


def halves(shape):
    west = np.zeros(shape, bool)
    west[:, : shape[1] // 2] = True
    return west, ~west


def test_many_parts_lie_far_apart():
    city = CityMap(np.full((8, 8), 9.0), 2.0)
    colours = []
    for part in range(8):
        weights = np.zeros((8, 8, 8), np.float32)
        weights[..., part] = 1
        picture = render_shares(Shares(city, weights, [*"abcdefgh"], ""), legend=False)
        colours.append(np.asarray(picture, float)[4, 4])
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(colours) for b in colours[:i]]
    assert min(gaps) > 25


def test_the_legend_names_who_has_a_part_and_thanks(tmp_path, shares):
    write_shares(shares, tmp_path / "halves.png")
    with Image.open(tmp_path / "halves.png") as picture:
        assert picture.text["Title"] == "town-1: halves"
        assert picture.text["Copyright"] == shares.city.attribution
        two = picture.size
    weights = np.full((*shares.city.shape, 200), 1 / 200, np.float32)
    many = Shares(shares.city, weights, [f"a city of number {n}" for n in range(200)], "many")
    write_shares(many, tmp_path / "many.png")
    with Image.open(tmp_path / "many.png") as picture:
        assert picture.width == two[0]
        assert two[1] < picture.height < 2 * two[1]


def test_shares_are_written_bare_or_refused(tmp_path, shares):
    write_shares(shares, tmp_path / "halves.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "halves.npy"), shares.weights)
    with pytest.raises(MapError, match=r"\.npy, \.png"):
        write_shares(shares, tmp_path / "halves.tif")
    assert {path.name for path in tmp_path.iterdir()} == {"halves.npy"}
