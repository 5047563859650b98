"""Types of buildings: drawn ones get their names, tables no gaps and no overlaps."""

import itertools
import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import (
    Reference,
    TypeTable,
    building_types,
    get,
    load_file,
    type_distance,
    types_of,
)
from evocity.fitness.type_table import FEATURES
from evocity.fitness.types import TYPES, features, shares
from evocity.views.limit_tables import MOST, intersection, remainder

DATA = Path(evocity.__file__).parent / "data" / "building-types.toml"
SEVEN = {"shed", "courtyard_block", "tower", "row", "hall", "detached", "slab"}


def drawn(*boxes, side=128, pixel=2.0):
    """A map of (top, left, bottom, right, height), px and m, each drawn over those before."""
    heights = np.zeros((side, side))
    for top, left, bottom, right, height in boxes:
        heights[top:bottom, left:right] = height
    return CityMap(heights, pixel, name="drawn")


def houses(count, deep, wide, heights=(9, 12)):
    """A row of houses from (10, 10) eastwards, of alternating ``heights``."""
    return [
        (10, 10 + k * wide, 10 + deep, 10 + (k + 1) * wide, heights[k % 2]) for k in range(count)
    ]


def around(court, wing=6, height=18):
    """Four wings of one height about a square court of ``court`` px."""
    out = court + 2 * wing
    return [
        (20, 20, 20 + out, 20 + out, height),
        (20 + wing, 20 + wing, 20 + wing + court, 20 + wing + court, 0),
    ]


# -- what a planner would call them --------------------------------------------------------------

BY_ITSELF = {
    "garage": ("shed", [(10, 10, 13, 12, 3)]),
    "detached house": ("detached", [(10, 10, 16, 15, 7)]),
    "urban villa": ("detached", [(10, 10, 20, 19, 12)]),
    "point block": ("tower", [(10, 10, 20, 20, 24)]),
    "high-rise": ("tower", [(10, 10, 30, 32, 60)]),
    "slab": ("slab", [(10, 10, 16, 50, 15)]),
    "slab of twenty storeys": ("slab", [(10, 10, 17, 60, 60)]),
    "slab with a bend": ("slab", [(10, 10, 16, 50, 15), (10, 44, 50, 50, 15)]),
    "terrace of equal eaves": ("row", [(10, 10, 15, 60, 6)]),
    "market hall": ("hall", [(10, 10, 30, 40, 9)]),
    "works": ("hall", [(10, 10, 26, 80, 8)]),
    "block about a court": ("courtyard_block", around(12)),
    "block with a light well": ("slab", around(2, wing=12)),
}


@pytest.mark.parametrize("name", BY_ITSELF)
@pytest.mark.parametrize("iso", range(8))
def test_a_building_by_itself_is_called_what_it_is(name, iso):
    expected, boxes = BY_ITSELF[name]
    city = drawn(*boxes)
    assert types_of(city.replace(isometries.apply(iso, city.heights))) == (expected,)


def test_houses_wall_to_wall_are_a_row():
    assert set(types_of(drawn(*houses(6, deep=6, wide=4)))) == {"row"}
    assert set(types_of(drawn(*houses(2, deep=5, wide=4)))) == {"row"}  # semi-detached


def test_what_stands_around_a_court_is_a_courtyard_block_house_by_house():
    south = [(30, 10, 36, 34, 10)]
    sides = [(16, 10, 30, 14, 15), (16, 30, 30, 34, 20)]
    types = types_of(drawn(*houses(6, deep=6, wide=4), *south, *sides))
    assert set(types) == {"courtyard_block"}
    opened = types_of(drawn(*houses(6, deep=6, wide=4), *south, sides[0]))
    assert "courtyard_block" not in opened
    assert opened.count("row") >= 6


def test_what_stands_in_a_court_has_no_court_of_its_own():
    assert types_of(drawn(*around(30), (32, 32, 38, 37, 6))) == ("courtyard_block", "detached")


def test_a_tower_rises_out_of_a_street_block():
    block = houses(4, deep=8, wide=8, heights=(15, 18))
    assert types_of(drawn(*block, (11, 18, 17, 24, 55))).count("tower") == 1
    assert "tower" not in types_of(drawn(*block, (11, 18, 17, 24, 30)))


def test_slabs_that_meet_end_to_end_stay_slabs():
    assert types_of(drawn((10, 10, 16, 40, 15), (10, 40, 16, 70, 18))) == ("slab", "slab")


def test_the_districts_are_what_they_are_known_for():
    def most(name):
        found = building_types(evocity.read_map(name))
        return max(found, key=found.get), found

    assert most("lyon-1er")[0] == "courtyard_block"
    kind, york = most("new-york-west-village")
    assert kind == "courtyard_block"
    assert york["courtyard_block"] + york["row"] > 0.7
    assert york["tower"] > 0.1
    kind, montpellier = most("montpellier-pas-du-loup")
    assert kind == "slab"
    assert montpellier["detached"] > 0.25
    assert montpellier["courtyard_block"] == 0
    assert most("cape-town-salt-river")[0] == "row"


def test_features_of_what_is_drawn():
    (area, height, walls, courts, elongation) = features(
        drawn((10, 10, 20, 30, 9), (13, 13, 17, 17, 0), (20, 10, 24, 14, 12))
    )
    assert area == pytest.approx([4 * (200 - 16), 64])
    assert height == pytest.approx([9, 12])
    assert walls == pytest.approx([4 / (60 + 16), 4 / 16])
    assert courts == pytest.approx([16 / (200 - 16 + 16)] * 2)
    assert elongation == pytest.approx([(200 - 16) / 400, 1])


# -- laws of shares and distances ----------------------------------------------------------------

some_town = st.builds(
    draw_town, st.integers(0, 10_000), side=st.just(64), buildings=st.integers(1, 60)
)


@settings(max_examples=30, deadline=None)
@given(some_town, st.integers(1, 7))
def test_shares_are_of_all_that_is_built_however_the_map_lies(city, iso):
    found = building_types(city)
    assert set(found) == SEVEN
    assert sum(found.values()) == pytest.approx(1)
    table = city.buildings
    by_hand = dict.fromkeys(SEVEN, 0.0)
    for name, area in zip(types_of(city), table.area, strict=True):
        by_hand[name] += area / table.area.sum()
    assert found == pytest.approx(by_hand)
    turned = city.replace(isometries.apply(iso, city.heights))
    assert building_types(turned) == pytest.approx(found)


@settings(max_examples=30, deadline=None)
@given(some_town, some_town, some_town)
def test_the_distance_is_one(a, b, c):
    assert type_distance(a, a) == 0
    assert 0 <= type_distance(a, b) <= 1
    assert type_distance(a, b) == pytest.approx(type_distance(b, a))
    assert type_distance(a, c) <= type_distance(a, b) + type_distance(b, c) + 1e-12
    p, q = (building_types(one) for one in (a, b))
    more = sum(max(0, p[name] - q[name]) for name in p)  # what would have to be rebuilt
    assert type_distance(a, b) == pytest.approx(more)


def test_nothing_in_common_is_1():
    house, slab = drawn((10, 10, 16, 15, 7)), drawn((10, 10, 16, 50, 15))
    assert type_distance(house, slab) == 1
    both = [(house, 1.0), (slab, 3.0)]
    assert type_distance(house, both) == pytest.approx(0.75)
    half = drawn((10, 10, 16, 15, 7), (30, 10, 36, 15, 15))
    assert building_types(half)["detached"] == 1
    assert type_distance(half, [house]) == 0


def test_sources_count_as_much_as_is_built_of_them():
    west, east = np.zeros((2, 64, 64))
    west[4:10, 4:9] = 7  # a house
    east[20:26, 36:62] = 15  # a slab
    cities = [CityMap(west, 2.0, name="west"), CityMap(east, 2.0, name="east")]
    reference = Reference.sources(cities)
    genomes = [evocity.encode(one, block=4).genome for one in cities]
    mixed = genomes[0].replace(
        cities=("west", "east"),
        parent=(np.arange(len(genomes[0])) % 16 >= 8).astype(np.uint8),
    )
    both = CityMap(west + east, 2.0, name="both")
    assert type_distance(both, reference, mixed) == pytest.approx(0)
    assert type_distance(cities[0], reference, mixed) == pytest.approx(0)
    assert type_distance(cities[1], reference, genomes[0].replace(cities=("west", "x"))) == 1
    other = CityMap(east, 2.0, name="of none")
    nowhere = genomes[0].replace(cities=("x", "west"), parent=np.zeros(256, np.uint8))
    assert "comes from a city" in type_distance(other, reference, nowhere).reason


def test_nothing_built_has_no_types():
    empty, house = drawn(), drawn((10, 10, 16, 15, 7))
    assert all(np.isnan(value) for value in building_types(empty).values())
    assert building_types(empty)["row"].reason == "nothing is built in drawn"
    assert type_distance(empty, house).reason == "nothing is built in drawn"
    assert type_distance(house, empty).reason == "nothing is built in drawn"
    assert types_of(empty) == ()
    assert building_types(drawn((4, 4, 5, 5, 3)))["shed"] == 1


# -- tables --------------------------------------------------------------------------------------


def text_of(entries):
    """TOML of (name, {feature: (from, below)})."""
    return "\n".join(
        f'[[type]]\nname = "{name}"\n'
        + "".join(f"{key} = {{ from = {a!r}, below = {b!r} }}\n" for key, (a, b) in box.items())
        for name, box in entries
    )


def space():
    return {name: (0.0, highest) for name, (_, highest, _) in FEATURES.items()}


@st.composite
def partitions(draw):
    """Boxes that fill the space of features, cut in two again and again; each its own type."""
    boxes = [space()]
    for _ in range(draw(st.integers(1, 12))):
        box = boxes.pop(draw(st.integers(0, len(boxes) - 1)))
        feature = draw(st.sampled_from(list(FEATURES)))
        low, high = box[feature]
        if feature in ("party_walls", "elongation"):
            cut = low + (high - low) * draw(st.sampled_from([0.25, 0.5, 0.75]))
        else:
            cut = low + draw(st.integers(1, 40)) if np.isinf(high) else (low + high) / 2
        boxes += [box | {feature: (low, cut)}, box | {feature: (cut, high)}]
    return [(f"t{k}", whole(box)) for k, box in enumerate(boxes)]


def whole(box):
    """``box`` without limits that are none: 1 itself is a share too."""
    return {
        name: (low, np.inf if high == FEATURES[name][1] else high)
        for name, (low, high) in box.items()
    }


def holds(box, building):
    return all(
        low <= value < high for (low, high), value in zip(box.values(), building, strict=True)
    )


some_building = st.tuples(
    st.floats(0, 1e4), st.floats(0, 100), st.floats(0, 1), st.floats(0, 3), st.floats(0, 1)
)


@settings(max_examples=60, deadline=None)
@given(partitions(), st.lists(some_building, min_size=1, max_size=20))
def test_a_table_that_fills_the_space_says_of_each_building_what_its_text_says(entries, buildings):
    table = TypeTable.of(text_of(entries))
    found = [table.names[k] for k in table.classified(np.array(buildings).T)]
    by_hand = [next(n for n, box in entries if holds(box, one)) for one in buildings]
    assert found == by_hand


@settings(max_examples=60, deadline=None)
@given(partitions(), st.data())
def test_a_gap_is_refused_with_a_building_in_it(entries, data):
    k = data.draw(st.integers(0, len(entries) - 1))
    _, box = entries.pop(k)
    with pytest.raises(FitnessError, match="no type includes a building of") as caught:
        TypeTable.of(text_of(entries))
    assert holds(box, example(caught.value.found))
    assert "add a type" in caught.value.remedy


@settings(max_examples=60, deadline=None)
@given(partitions(), st.data())
def test_an_overlap_is_refused_with_both_types_and_a_building_of_both(entries, data):
    one = data.draw(st.integers(0, len(entries) - 1))
    entries[one] = entries[one][0], whole(space())
    with pytest.raises(
        FitnessError, match=r"the limits of t\d+ and of t\d+ both include a building of"
    ) as caught:
        TypeTable.of(text_of(entries))
    told = caught.value.found.split()
    both = [dict(entries)[told[3]], dict(entries)[told[6]]]
    assert f"t{one}" in (told[3], told[6])
    assert all(holds(box, example(caught.value.found)) for box in both)
    # the same type twice is no matter
    entries = [("one", box) for _, box in entries]
    assert TypeTable.of(text_of(entries)).names == ("one",)


def example(found):
    """The building that a message names, as a tuple."""
    told = found.partition(" a building of ")[2].split(", ")
    return [float(part.split()[1]) for part in told]


def test_boxes_without_gap_by_brute_force():
    rng = np.random.default_rng(5)
    for _ in range(60):
        boxes = []
        for _ in range(rng.integers(1, 9)):
            low = rng.integers(0, 3, 2)
            boxes.append((low.astype(float), low + rng.integers(1, 4, 2).astype(float)))
        whole_space = np.zeros(2), np.full(2, 4.0)
        covered = [
            any((box[0] <= p).all() and (p < box[1]).all() for box in boxes)
            for p in itertools.product(np.arange(0.5, 4), repeat=2)
        ]
        gap = remainder(whole_space, boxes)
        assert (gap is None) == all(covered)
        if gap:
            assert all(intersection(gap, box) is None for box in boxes)


def test_the_bundled_table_has_a_reason_for_each_limit():
    text = DATA.read_text(encoding="utf-8")
    assert set(TYPES.names) == SEVEN == {one["name"] for one in tomllib.loads(text)["type"]}
    reasons = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
    for entry in tomllib.loads(text)["type"]:
        for limits in (value for key, value in entry.items() if key != "name"):
            for number in limits.values():
                shown = {
                    f"{number:g} m",
                    f"{number:g} m²",
                    f"{number:g}"[1:] + " of",
                    f"{number:g}"[1:] + ":",
                }
                assert number == 0.03 or any(one in reasons for one in shown), number
    assert "3 % of the built ground" in reasons


HOUSE = '[[type]]\nname = "house"\n'


@pytest.mark.parametrize(
    ("text", "found", "remedy"),
    [
        ("[[type]", "no TOML", "correct"),
        ("", "0 entries [[type]]", "for example height"),
        ("type = 3", "no entries [[type]]", "for example height"),
        ("[[types]]\nname = 'a'", "types in a table of types", "did you mean type"),
        ("houses = 1", "houses in a table of types", "take it out"),
        (
            "[run]\n[[parents]]\n[[fitness]]\nname = 'gsi'",
            "a recipe, because it has the sections run, parents, fitness",
            "evocity run",
        ),
        ("[[type]]\narea = { from = 3 }", "name = None", "for example"),
        ('[[type]]\nname = "two words"', "name = 'two words'", "for example"),
        (HOUSE + "hight = { from = 3 }", "hight of entry 1, type house", "did you mean height"),
        (HOUSE + "height = 3", "height = 3 of entry 1, type house", "for example"),
        (HOUSE + "height = {}", "height = {} of", "for example"),
        (HOUSE + "height = { to = 3 }", "height = { to = 3 } of", "for example"),
        (HOUSE + "height = { from = 'a' }", "height = { from = 'a' }", "for example"),
        (HOUSE + "height = { from = true }", "height = { from = true }", "for example"),
        (HOUSE + "height = { from = nan }", "height = { from = nan }", "for example"),
        (HOUSE + "height = { from = -1 }", "height = { from = -1 }", "for example"),
        (
            HOUSE + "height = { from = 3, below = 3 }",
            "height = { from = 3, below = 3 }",
            "for example",
        ),
        (HOUSE + "elongation = { from = 1.5 }", "elongation = { from = 1.5 }", "for example"),
        (HOUSE * (MOST + 1), f"{MOST + 1} entries", "for example"),
        (
            HOUSE + "height = { below = 9 }",
            "no type includes a building of area 100",
            "height of house",
        ),
        (HOUSE + "elongation = { below = 1 }", "elongation 1", "elongation of house"),
        (
            HOUSE + "[[type]]\nname = 'all'",
            "the limits of house and of all both include",
            "their overlap is all buildings",
        ),
        (HOUSE + "[shares]\nhouse = 1.5", "[shares] that sum to 1.5", "divide each by that sum"),
        (HOUSE + "[shares]\nhouse = 0", "[shares] that sum to 0", "house = 1 under [shares]"),
        (HOUSE + "[shares]\nhouse = 'a'", "[shares] has house = 'a'", "house = 1 under [shares]"),
        ("shares = 1", "shares = 1", "= 0.6 under [shares]"),
        (
            "[shares]\nrows = 1\nslab = -1",
            "[shares] has rows, which is not a type, did you mean row?; slab = -1",
            "correct [shares]",
        ),
    ],
)
def test_what_is_no_table_is_told_in_three_parts(tmp_path, text, found, remedy):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    for read in (TypeTable.read, load_file):
        with pytest.raises(FitnessError) as caught:
            read(path)
        assert caught.value.found.startswith(f"{path}: ")
        assert found in caught.value.found
        assert caught.value.expected
        assert remedy in caught.value.remedy


def test_a_table_that_is_not_there(tmp_path):
    with pytest.raises(FitnessError, match="cannot be read"):
        TypeTable.read(tmp_path / "gone.toml")
    with pytest.raises(FitnessError, match="no table at"):
        load_file(tmp_path / "gone.toml")


# -- tables of one's own -------------------------------------------------------------------------

LOW_AND_HIGH = """
[[type]]
name = "low"
height = { below = 10 }
[[type]]
name = "high"
height = { from = 10 }
"""


def test_a_table_of_one_s_own_is_a_file_of_measures(tmp_path):
    path = tmp_path / "storeys_of.toml"
    path.write_text(LOW_AND_HIGH)
    low, high, distance = load_file(path)
    assert [one.name for one in (low, high, distance)] == [
        "storeys_of.low",
        "storeys_of.high",
        "storeys_of_distance",
    ]
    assert distance.needs == ("reference",)
    assert (distance.goal, low.goal) == ("min", None)
    city, other = drawn((10, 10, 20, 20, 6), (30, 30, 40, 40, 12)), drawn((10, 10, 20, 20, 6))
    assert (low(city), high(city)) == (0.5, 0.5)
    assert distance(city, other) == 0.5
    assert low.file == low.origin == str(path)
    again = pickle.loads(pickle.dumps(distance.bound(other)))
    assert again(city) == 0.5
    assert get("storeys_of.low")(other) == 1
    before = low.source_hash
    path.write_text(LOW_AND_HIGH.replace("10", "13"))
    assert load_file(path)[0].source_hash != before
    assert types_of(city, TypeTable.read(path)) == ("low", "low")


def test_a_known_distribution_needs_no_reference(tmp_path):
    path = tmp_path / "quarter.toml"
    path.write_text(LOW_AND_HIGH + "[shares]\nhigh = 0.25\nlow = 0.75\n")
    *_, distance = load_file(path)
    assert distance.needs == distance.takes == ()
    assert distance(drawn((10, 10, 20, 20, 6), (30, 30, 40, 40, 12))) == 0.25
    assert np.isnan(distance(drawn()))


def test_shares_alone_are_of_the_package_s_types(tmp_path):
    path = tmp_path / "wanted.toml"
    path.write_text("[shares]\nrow = 0.6\ndetached = 0.4\n")
    *types, distance = load_file(path)
    assert {one.number for one in types} == SEVEN
    assert distance(drawn((10, 10, 16, 15, 7))) == pytest.approx(0.6)
    assert TypeTable.read(path).names == TYPES.names


def test_names_that_are_taken_or_none(tmp_path):
    path = tmp_path / "building_types.toml"
    path.write_text(DATA.read_text(encoding="utf-8"))
    with pytest.raises(FitnessError, match="second measure has the name building_types"):
        load_file(path)
    path = path.rename(tmp_path / "my-types.toml")
    with pytest.raises(FitnessError, match=r"the file name my-types\.toml"):
        load_file(path)


def test_shares_of_a_table_are_those_of_the_city():
    city = draw_town(2)
    assert shares(city, TYPES).tolist() == list(building_types(city).values())
