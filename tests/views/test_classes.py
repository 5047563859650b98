"""Classes: drawn objects come out as themselves, footprints as buildings; tables are whole."""

import json
from importlib.resources import files

import numpy as np
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer
from rasterio import features as raster
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.pictures import render_classes
from evocity.views.classes import ClassTable, packaged
from evocity.views.classes.classes import features, low_objects
from evocity.views.classes.table import FEATURES
from evocity.views.limit_tables import remainder

DATA = files("evocity") / "data" / "classes.toml"
SEVEN = ("building", "furniture", "tree", "ground", "fountain", "shelter", "post")


def laid(*shapes, pixel=1.0, side=60.0):
    """A map of polygons with heights, about its middle, by the pixel-centre rule."""
    count = round(side / pixel)
    heights = raster.rasterize(
        [(polygon, height) for polygon, height in shapes],
        out_shape=(count, count),
        transform=Affine(pixel, 0, -side / 2, 0, -pixel, side / 2),
        dtype="float32",
    )
    return CityMap(heights, pixel, name="drawn")


def disc(radius, x=0.0, y=0.0):
    return shapely.Point(x, y).buffer(radius, 32)


def block(wide, deep, turn=0.0, x=0.0, y=0.0):
    box = shapely.box(-wide / 2, -deep / 2, wide / 2, deep / 2)
    return shapely.affinity.translate(shapely.affinity.rotate(box, turn), x, y)


def only(city):
    """The one class of a map's objects."""
    found = {name for name, count in city.classes.counts.items() if count}
    assert len(found) == 1, city.classes.counts
    return found.pop()


# name -> class, shape by a turn in degrees, height, coarsest pixel that shows it
DRAWN = {
    "pool": ("ground", lambda turn: block(8, 4, turn), 0.15, 2.0),
    "lawn": ("ground", lambda turn: block(30, 18, turn), 0.2, 2.0),
    "pond": ("ground", lambda turn: disc(5), 0.3, 2.0),
    "car park": ("ground", lambda turn: block(25, 15, turn), 0.12, 2.0),
    "bench": ("furniture", lambda turn: block(3, 1, 0), 0.5, 1.0),
    "kiosk": ("furniture", lambda turn: block(3, 3, 0), 2.4, 1.0),
    "bus shelter": ("furniture", lambda turn: block(4, 2, turn), 2.4, 1.0),
    "hedge": ("furniture", lambda turn: block(20, 2, turn), 1.2, 1.0),
    "basin": ("fountain", lambda turn: disc(2), 1.0, 1.0),
    "fountain": ("fountain", lambda turn: disc(4), 1.4, 1.0),
    "large fountain": ("fountain", lambda turn: disc(5.5), 1.8, 1.0),
    "young tree": ("tree", lambda turn: disc(2), 7.0, 1.0),
    "tree": ("tree", lambda turn: disc(3.3), 9.0, 1.0),
    "plane tree": ("tree", lambda turn: disc(4.8), 14.0, 1.0),
    "pole": ("post", lambda turn: block(1, 1), 8.0, 0.5),
    "lamp": ("post", lambda turn: block(0.5, 0.5), 4.0, 0.25),
    "shed": ("shelter", lambda turn: block(4, 3.5, turn), 2.6, 1.0),
    "garage": ("shelter", lambda turn: block(6, 3, turn), 2.8, 0.5),
    "house": ("building", lambda turn: block(10, 9, turn), 7.0, 2.0),
    "cottage": ("building", lambda turn: block(7, 6, turn), 4.0, 2.0),
    "point block": ("building", lambda turn: block(20, 20, turn), 40.0, 2.0),
    "round tower": ("building", lambda turn: disc(6), 30.0, 2.0),
    "slab": ("building", lambda turn: block(50, 11, turn), 18.0, 2.0),
}


SHOWN = [(name, p) for name, one in DRAWN.items() for p in (0.25, 0.5, 1.0, 2.0) if p <= one[3]]


@pytest.mark.parametrize(("name", "pixel"), SHOWN)
def test_a_drawn_object_comes_out_as_itself(name, pixel):
    expected, shape, height, _ = DRAWN[name]
    for turn in (0, 20, 45, 70):
        city = laid((shape(turn), height), pixel=pixel)
        assert only(city) == expected, turn


@pytest.mark.parametrize("height", [3.0, 13.0, 40.0])
@pytest.mark.parametrize("pixel", [0.5, 1.0, 2.0])
def test_fewer_than_two_by_two_pixels_are_no_class_of_their_own(height, pixel):
    heights = np.zeros((40, 40))
    heights[5, 5], heights[10, 10:12], heights[20:22, 20], heights[21, 21] = [height] * 4
    heights[30:32, 30:32] = height
    classes = CityMap(heights, pixel).classes
    assert set(classes.classes[:3].tolist()) == {classes.names.index("building")}
    square = classes.table.classified(features(CityMap(heights, pixel).buildings))[3]
    assert classes.classes[3] == square


@pytest.mark.parametrize("iso", range(8))
def test_turning_and_mirroring_changes_no_class(iso):
    shapes = [
        (shapely.affinity.translate(shape(20), 70 * (k % 5), 70 * (k // 5)), h)
        for k, (_, shape, h, _) in enumerate(DRAWN.values())
    ]
    moved = [(shapely.affinity.translate(one, -140, -140), height) for one, height in shapes]
    city = laid(*moved, side=360, pixel=0.5)
    turned = city.replace(isometries.apply(iso, city.heights))
    assert turned.classes.counts == city.classes.counts
    assert sum(bool(count) for count in city.classes.counts.values()) == len(SEVEN)


def test_what_stands_on_something_lower_is_an_object_of_its_own():
    lawn, bench, tree = block(30, 20), block(3, 1, x=5), disc(3.3, x=-8)
    counts = laid((lawn, 0.2), (bench, 0.6), (tree, 9.0)).classes.counts
    assert (counts["ground"], counts["furniture"], counts["tree"]) == (1, 1, 1)
    assert sum(counts.values()) == 3


def test_buildings_keep_their_numbers_and_low_objects_follow():
    city = laid((block(10, 9), 7), (block(12, 6, x=20), 0.2), (disc(3, x=-20), 1.0))
    classes = city.classes
    n = len(city.buildings)
    assert np.array_equal(np.where(classes.labels <= n, classes.labels, 0), city.building_labels)
    assert [classes.names[k] for k in classes.of_buildings] == ["building"]
    assert sorted(classes.names[k] for k in classes.classes[n:]) == ["fountain", "ground"]
    pixels = np.bincount(classes.labels.ravel())[1:]
    assert np.array_equal(classes.area, pixels * city.metres_per_pixel**2)
    assert np.array_equal(classes.area[:n], city.buildings.area)


def test_the_foot_of_a_wall_is_no_object_but_a_terrace_is():
    house = block(10, 9)
    foot = laid((block(12, 11), 0.8), (house, 7))
    assert foot.classes.counts["furniture"] == 0
    assert len(foot.classes) == 1
    terrace = laid((block(6, 4, y=-6.5), 0.4), (house, 7))
    assert terrace.classes.counts["ground"] == 1


def test_traces_are_no_objects():
    assert len(laid((block(2, 2), 0.25)).classes) == 0  # lower than a seat, smaller than a car
    assert len(laid((block(20, 20), 0.08)).classes) == 0  # lower than a kerb


def test_raw_attractors_are_not_full_of_objects():
    city = evocity.read_map("lyon-1er", pixels=128)
    raw = evocity.decode(evocity.encode(city).genome, settle=False).city
    strewn = raw.heights[~raw.built] > 0.1
    assert np.count_nonzero(strewn) > 300
    assert len(raw.classes) - len(raw.buildings) <= 20


def test_roundness_of_discs_and_rectangles():
    def roundness(shape):
        return laid((shape, 9), pixel=0.25).classes.roundness[0]

    assert roundness(disc(10)) == pytest.approx(1, abs=0.06)
    assert roundness(block(16, 16, 30)) == pytest.approx(0.5, abs=0.03)
    assert roundness(block(24, 12, 30)) == pytest.approx(0.4, abs=0.03)
    cross = block(20, 4).union(block(4, 20))
    assert roundness(cross) < 0.5


@pytest.mark.parametrize("name", evocity.cities())
@pytest.mark.parametrize("pixel", [1.0, 2.0])
def test_source_footprints_come_out_as_buildings_or_shelters(name, pixel):
    """98 % of those of 24 m² and more by number, 99.5 % by area."""
    city = evocity.read_map(name, pixels=round(512 / pixel), metres_per_pixel=pixel)
    found = _footprints(city, name)
    numbers = raster.rasterize(
        [(one, k + 1) for k, one in enumerate(found)],
        out_shape=city.shape,
        transform=Affine(pixel, 0, city.origin[0], 0, -pixel, city.origin[1]),
        dtype="int32",
    )
    classes = city.classes
    good = {classes.names.index(one) for one in ("building", "shelter")}
    pairs = np.stack([numbers, classes.labels])[:, (numbers > 0) & (classes.labels > 0)]
    seen = {}
    keys, counts = np.unique(pairs, axis=1, return_counts=True)
    for (number, label), count in zip(keys.T.tolist(), counts.tolist(), strict=True):
        if count > seen.get(number, (0, 0))[1]:
            seen[number] = label, count
    areas = shapely.area(found)
    right = np.array([classes.classes[label - 1] in good for label, _ in seen.values()])
    own = areas[np.array(list(seen)) - 1]
    assert len(seen) > 0.97 * len(found)
    assert right.mean() >= 0.98
    assert own[right].sum() >= 0.995 * own.sum()


def _footprints(city, name):
    """Those of the source in the map's metres, cut at its window, of 24 m² and more."""
    document = json.loads((files("evocity") / f"data/cities/{name}.geojson").read_text())
    into = Transformer.from_crs(4326, city.crs, always_xy=True)
    rows = [one for one in document["features"] if one["properties"].get("height", 9.0) > 1.5]
    found = shapely.from_geojson([json.dumps(one["geometry"]) for one in rows])
    found = shapely.make_valid(shapely.transform(found, into.transform, interleaved=False))
    (left, top), side = city.origin, city.shape[0] * city.metres_per_pixel
    within = shapely.intersection(found, shapely.box(left, top - side, left + side, top))
    return within[shapely.area(within) >= 24]


# -- any map ---------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    side=st.integers(1, 24),
    pixel=st.sampled_from([0.5, 1.0, 2.0]),
    least=st.floats(0, 1),
)
def test_any_map_has_classes(seed, side, pixel, least):
    rng = np.random.default_rng(seed)
    heights = rng.gamma(1, 2, (side, side)) * (rng.random((side, side)) > least)
    city = CityMap(heights, pixel)
    classes = city.classes
    assert len(classes) == classes.labels.max(initial=0)
    assert sum(classes.counts.values()) == len(classes)
    assert not classes.labels.flags.writeable
    assert not classes.classes.flags.writeable
    assert classes.labels[city.heights <= 0.1].max(initial=0) == 0
    assert (classes.labels[city.built] > 0).all()
    total = sum(classes.shares.values())
    assert total == pytest.approx(1 if len(classes) else 0)
    assert np.array_equal(classes.image > 0, classes.labels > 0)


def test_low_objects_of_a_part_of_a_map():
    city = laid((block(10, 9), 7), (block(12, 6, x=20), 0.2))
    half = city.within(np.arange(60)[None, :] >= np.full((60, 1), 30))
    assert half.classes.counts["ground"] == 1
    assert low_objects(city.heights, city.heights > -1, 1.0) is None


def test_features_are_those_a_table_may_ask_of():
    assert features(draw_town(1).buildings).shape == (len(FEATURES), len(draw_town(1).buildings))


# -- tables ----------------------------------------------------------------------------------------


def table(*entries, colours=None):
    """TOML of entries (name, limits)."""
    names = dict.fromkeys(name for name, _ in entries)
    colours = dict.fromkeys(names, '"#112233"') if colours is None else colours
    text = "".join(f'[[class]]\nname = "{name}"\n{limits}\n' for name, limits in entries)
    return text + "[colours]\n" + "".join(f"{k} = {v}\n" for k, v in colours.items())


TWO = (("low", "height = { below = 3 }"), ("high", ""))


def test_the_package_s_table_has_the_seven_and_a_reason_for_each_entry():
    own = packaged()
    assert sorted(own.names) == sorted(SEVEN)
    assert len(set(own.colours)) == len(SEVEN)
    lines = DATA.read_text(encoding="utf-8").splitlines()
    for k, line in enumerate(lines):
        if line == "[[class]]":
            assert lines[k - 1].startswith("#")


def test_the_colours_are_those_of_the_paper():
    """Blue grey, light orange, light and dark green, dark blue, brown."""
    rgb = dict(zip(packaged().names, packaged().rgb.astype(int).tolist(), strict=True))
    red, green, blue = (
        dict(zip(rgb, channel, strict=True)) for channel in zip(*rgb.values(), strict=True)
    )
    assert blue["building"] > green["building"] > red["building"] > 100
    assert red["furniture"] > green["furniture"] > blue["furniture"] > 80
    assert green["tree"] > red["tree"] > blue["tree"] > 80
    assert green["ground"] > max(red["ground"], blue["ground"])
    assert green["ground"] < green["tree"] - 60
    assert blue["fountain"] > 100 > max(red["fountain"], green["fountain"])
    assert 150 > red["shelter"] > green["shelter"] > blue["shelter"]
    assert max(rgb["post"]) - min(rgb["post"]) < 20


def test_the_first_entry_that_takes_an_object_wins():
    own = ClassTable.of(
        table(("low", "height = { below = 3 }"), ("wide", "area = { from = 50 }"), ("else_", ""))
    )
    found = own.classified(np.array([[100, 100, 10], [2, 3, 9], [0.5] * 3, [0.2] * 3], float))
    assert [own.names[k] for k in found] == ["low", "wide", "else_"]


def test_a_table_of_one_s_own_is_read_from_a_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(table(*TWO))
    city = laid((block(10, 9), 7), (block(12, 6, x=20), 0.2))
    mine = city.classified(ClassTable.read(path))
    assert mine.counts == {"low": 1, "high": 1}
    assert city.classes.counts["ground"] == 1


FAULTS = {
    "no TOML": ("[[class", "no TOML"),
    "nothing": ("", "0 entries"),
    "another part": (table(*TWO) + "[shares]\nlow = 1\n", "shares in a table"),
    "no list": ("class = 3\n", "no entries"),
    "no name": ("[[class]]\nheight = { below = 3 }\n", "entry 1"),
    "a name that is none": ('[[class]]\nname = "a b"\n', "entry 1"),
    "an unknown key": (
        table(("low", "hight = { below = 3 }"), ("high", "")),
        "hight of entry 1, class low",
    ),
    "no limits": (table(("low", "height = 3"), ("high", "")), "height = 3 of entry 1"),
    "an unknown limit": (table(("low", "height = { to = 3 }"), ("high", "")), "height"),
    "text": (table(("low", 'height = { below = "3" }'), ("high", "")), "height"),
    "yes": (table(("low", "height = { below = true }"), ("high", "")), "height"),
    "NaN": (table(("low", "height = { below = nan }"), ("high", "")), "height"),
    "an infinite lowest value": (
        table(("low", "height = { from = inf }"), ("high", "")),
        "height",
    ),
    "below 0": (table(("low", "height = { from = -1 }"), ("high", "")), "height"),
    "turned round": (table(("low", "height = { from = 3, below = 2 }"), ("high", "")), "height"),
    "beyond 1": (table(("low", "roundness = { from = 1.5 }"), ("high", "")), "roundness"),
    "a gap": (
        table(("low", "height = { below = 3 }"), ("high", "height = { from = 4 }")),
        "no class includes",
    ),
    "a gap in one corner": (
        table(("low", "height = { below = 3 }"), ("wide", "area = { from = 9 }")),
        "no class includes",
    ),
    "an overlap": (
        table(TWO[0], ("lower", "height = { below = 2 }"), TWO[1]),
        "entry 2, class lower",
    ),
    "an overlap with several": (
        table(
            ("small", "area = { below = 9 }"),
            ("large", "area = { from = 9 }"),
            ("low", "height = { below = 3 }"),
        ),
        "earlier entries, 1 (small), 2 (large), include all objects of this entry",
    ),
    "twice the same": (table(TWO[1], ("again", "")), "entry 2, class again"),
    "what no object is": (
        table(
            ("flat", "area = { from = 100 }\nheight = { below = 3 }\nslenderness = { from = 2 }"),
            TWO[1],
        ),
        "no object has",
    ),
    "no colours": ('[[class]]\nname = "all_"\n', "no [colours]"),
    "a colour missing": (table(*TWO, colours={"low": '"#112233"'}), "no colour for high"),
    "a colour of no class": (
        table(*TWO, colours={"low": '"#112233"', "high": '"#112233"', "hihg": '"#112233"'}),
        "did you mean high",
    ),
    "an unknown colour": (
        table(*TWO, colours={"low": '"teal"', "high": '"#112233"'}),
        "low = 'teal'",
    ),
    "a short colour": (table(*TWO, colours={"low": '"#123"', "high": '"#112233"'}), "low"),
    "a colour and more": (table(*TWO, colours={"low": '"#1122334"', "high": '"#112233"'}), "low"),
    "a number for a colour": (table(*TWO, colours={"low": "3", "high": '"#112233"'}), "low = 3"),
    "too many": (
        table(*[("a", f"height = {{ from = {k}, below = {k + 1} }}") for k in range(101)]),
        "101 entries",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_table_at_fault_is_refused(name, tmp_path):
    text, told = FAULTS[name]
    path = tmp_path / "faulty.toml"
    path.write_text(text)
    with pytest.raises(MapError) as caught:
        ClassTable.read(path)
    assert caught.value.found.startswith(f"{path}: ")
    assert told in str(caught.value)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"\x00"])
def test_bytes_that_are_no_text_are_refused(content):
    with pytest.raises(MapError, match="no TOML"):
        ClassTable.of(content)


def test_a_table_that_is_not_there_is_told(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(MapError, match="cannot be read"):
            ClassTable.read(path)


def test_every_object_there_may_be_is_of_a_class_and_every_entry_takes_some():
    own = packaged()
    space = np.zeros(4), np.array([np.inf, np.inf, np.nextafter(1, 2), np.inf])
    assert remainder(space, [box for _, box in own.entries]) is None
    rng = np.random.default_rng(1)
    area, height = np.exp(rng.uniform(-2, 7, 20_000)), np.exp(rng.uniform(-2, 4, 20_000))
    found = own.classified(np.stack([area, height, rng.random(20_000), height / np.sqrt(area)]))
    assert set(found.tolist()) == set(range(len(SEVEN)))


# -- pictures --------------------------------------------------------------------------------------


def test_a_picture_has_each_class_in_its_colour():
    city = laid((block(20, 18), 3), (block(12, 10, x=20), 0.2))
    bare = np.asarray(render_classes(city, legend=False))
    assert bare.shape == (60, 60, 3)
    for name in ("building", "ground"):
        k = city.classes.names.index(name)
        assert (bare == city.classes.table.rgb[k]).all(axis=2).any()
    whole = render_classes(city, zoom=4)
    assert whole.size > (240, 240)


def test_a_picture_of_an_empty_map():
    assert render_classes(CityMap(np.zeros((8, 8)), 2.0)).size > (8, 8)
