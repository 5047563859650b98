"""OpenStreetMap as its mappers and Overpass write it: parts, deletions, places in ways."""

import gzip
import json

import numpy as np
import pytest

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.map_reader import data_of
from evocity.io.reader_types import Request

LON, LAT = 4.83, 45.7565
STEP = np.array([1 / np.cos(np.radians(LAT)), 1]) / 111_195  # degrees of a metre
BUILT = {"building": "yes"}


def rectangle(west, south, wide, tall):
    """Corners of a closed way, in degrees, from metres about the middle."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]
    metres = np.array([(west + wide * x, south + tall * y) for x, y in corners])
    return (np.array([LON, LAT]) + metres * STEP).round(7).tolist()


class Town:
    """Ways with their tags, as XML with nodes or places in ways, or as JSON of Overpass."""

    def __init__(self, *ways, relations=()):
        self.ways = ways  # (corners, tags) or (corners, tags, attributes)
        self.relations = relations  # (members, tags): way number from 1, and role

    def nodes(self, number, corners):
        return [100 * number + at for at in range(len(corners) - 1)] + [100 * number]

    def xml(self, inline=False, missing=()):
        nodes, ways = [], []
        for number, (corners, tags, *more) in enumerate(self.ways, 1):
            ids = self.nodes(number, corners)
            if not inline:
                nodes += [
                    f'<node id="{i}" lon="{x}" lat="{y}"/>'
                    for i, (x, y) in zip(ids[:-1], corners, strict=False)
                    if i not in missing
                ]
            refs = "".join(
                f'<nd ref="{i}" lon="{x}" lat="{y}"/>' if inline else f'<nd ref="{i}"/>'
                for i, (x, y) in zip(ids, corners, strict=True)
            )
            ways.append(f'<way id="{number}" {"".join(more)}>{refs}{xml_tags(tags)}</way>')
        relations = [
            f'<relation id="{k}">'
            + "".join(self.xml_member(way, role, inline) for way, role in members)
            + f"{xml_tags(tags)}</relation>"
            for k, (members, tags) in enumerate(self.relations, 1)
        ]
        return f'<osm version="0.6">{"".join(nodes + ways + relations)}</osm>'

    def xml_member(self, way, role, inline):
        places = [f'<nd lon="{x}" lat="{y}"/>' for x, y in self.ways[way - 1][0]] if inline else []
        return f'<member type="way" ref="{way}" role="{role}">{"".join(places)}</member>'

    def overpass(self, geometry=True, members_only=False):
        elements = []
        for number, (corners, tags, *_) in enumerate(self.ways, 1):
            places = [{"lon": x, "lat": y} for x, y in corners]
            ids = self.nodes(number, corners)
            way = {"type": "way", "id": number, "nodes": ids, "tags": tags}
            if geometry:
                way["geometry"] = places
            else:
                elements += [
                    {"type": "node", "id": i} | at for i, at in zip(ids, places, strict=True)
                ]
            if tags or not members_only:
                elements.append(way)
        for k, (members, tags) in enumerate(self.relations, 1):
            listed = []
            for way, role in members:
                member = {"type": "way", "ref": way, "role": role}
                if geometry:
                    places = [{"lon": x, "lat": y} for x, y in self.ways[way - 1][0]]
                    member["geometry"] = places
                listed.append(member)
            elements.append({"type": "relation", "id": k, "members": listed, "tags": tags})
        return {"version": 0.6, "generator": "Overpass API", "elements": elements}


def xml_tags(tags):
    return "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())


def areas(path):
    """m² of each height, to the metre."""
    city = read_map(path, center=(LON, LAT), pixels=512, metres_per_pixel=0.5)
    heights, counts = np.unique(city.heights, return_counts=True)
    return {round(float(h), 2): int(n) / 4 for h, n in zip(heights, counts, strict=True) if h}


def account(path):
    found = data_of(path, Request())[0].account
    return found.features, dict(found.dropped)


def write(tmp_path, text, name="a.osm"):
    path = tmp_path / name
    path.write_text(text if isinstance(text, str) else json.dumps(text), encoding="utf-8")
    return path


def near(expected):
    return {height: pytest.approx(area, rel=0.03) for height, area in expected.items()}


BIG = rectangle(-20, -20, 40, 40)


def part(west, south, wide, tall, height):
    tags = {"building:part": "yes"} | ({"height": str(height)} if height else {})
    return rectangle(west, south, wide, tall), tags


@pytest.mark.parametrize(
    ("outline", "parts", "built", "replaced"),
    [
        # the trouble that was reported: a part of the whole, and a tower in it
        ("100", [(-20, -20, 40, 40, 10), (-5, -5, 10, 10, 100)], {10: 1500, 100: 100}, 1),
        # parts side by side
        ("30", [(-20, -20, 20, 40, 30), (0, -20, 20, 40, 5)], {30: 800, 5: 800}, 1),
        # by the rule of Simple 3D Buildings the height is that of the highest part
        ("100", [(-20, -20, 20, 20, 10), (0, 0, 10, 10, 100)], {10: 400, 100: 100}, 1),
        # a lower outline says what stands outside its tower
        ("18", [(-5, -5, 10, 10, 60)], {18: 1500, 60: 100}, 0),
        (None, [(-5, -5, 10, 10, 60)], {6: 1500, 60: 100}, 0),
        # parts without a height have that of the outline
        ("24", [(-20, -20, 40, 40, None)], {24: 1600}, 1),
        # a part elsewhere replaces nothing
        ("24", [(40, 0, 10, 10, 9)], {24: 1600, 9: 100}, 0),
    ],
)
def test_parts_replace_their_outline(tmp_path, outline, parts, built, replaced):
    tags = BUILT | ({"height": outline} if outline else {})
    path = write(tmp_path, Town((BIG, tags), *(part(*one) for one in parts)).xml())
    assert areas(path) == near(built)
    dropped = {"replaced by building parts": 1} if replaced else {}
    assert account(path) == (1 + len(parts), dropped)


def test_parts_replace_an_outline_with_a_court(tmp_path):
    town = Town(
        (BIG, {}),
        (rectangle(-10, -10, 20, 20), {}),
        part(-20, -20, 40, 10, 12),
        part(-20, 10, 40, 10, 12),
        part(-20, -10, 10, 20, 8),
        part(10, -10, 10, 20, 8),
        relations=[([(1, "outer"), (2, "inner")], {"type": "multipolygon", **BUILT})],
    )
    path = write(tmp_path, town.xml())
    assert areas(path) == near({12: 800, 8: 400})
    assert account(path) == (5, {"replaced by building parts": 1})


@pytest.mark.parametrize(
    ("tags", "stays"),
    [
        ({"location": "underground", "building:levels": "1"}, False),
        ({"building:levels": "0", "building:levels:underground": "2"}, False),
        ({"layer": "-1", "tunnel": "yes"}, False),
        ({"is_underground": "true"}, False),
        ({"layer": "-1", "height": "9"}, True),  # below a bridge
        ({"building:levels:underground": "2"}, True),
        ({"building:levels": "0", "building:levels:underground": "1", "height": "4"}, True),
        ({"location": "overground"}, True),
        ({"is_underground": "no", "tunnel": "no", "layer": "-2"}, True),
    ],
)
def test_buildings_underground_are_left_out(tmp_path, tags, stays):
    town = Town((BIG, BUILT | {"height": "9"}), (rectangle(30, 0, 20, 20), BUILT | tags))
    path = write(tmp_path, town.xml())
    assert account(path) == (2, {} if stays else {"underground": 1})
    assert sum(areas(path).values()) == pytest.approx(2000 if stays else 1600, rel=0.03)


def test_an_underground_part_replaces_nothing(tmp_path):
    cellar = (BIG, {"building:part": "yes", "location": "underground"})
    path = write(tmp_path, Town((BIG, BUILT | {"height": "9"}), cellar).xml())
    assert areas(path) == near({9: 1600})


@pytest.mark.parametrize("attribute", ["action='delete' visible='true'", 'visible="false"'])
@pytest.mark.parametrize("packed", [False, True])
def test_deleted_ways_are_left_out(tmp_path, attribute, packed):
    town = Town((BIG, BUILT, attribute), (rectangle(30, 0, 20, 20), BUILT))
    path = write(tmp_path, town.xml())
    if packed:
        path = tmp_path / "a.osm.gz"
        path.write_bytes(gzip.compress(town.xml().encode()))
    assert areas(path) == near({6: 400})
    assert account(path) == (2, {"deleted": 1})


def test_a_deleted_relation_or_node_is_left_out(tmp_path):
    relations = [([(1, "outer")], {"type": "multipolygon", **BUILT})]
    text = Town((BIG, {}), (rectangle(30, 0, 20, 20), BUILT), relations=relations).xml()
    gone = write(tmp_path, text.replace('<relation id="1"', '<relation action="delete" id="1"'))
    assert account(gone) == (2, {"deleted": 1})
    gone = write(tmp_path, text.replace('<node id="201"', '<node action="delete" id="201"'))
    assert account(gone) == (2, {"with missing corners": 1})
    assert areas(gone) == near({6: 1600})


def test_edited_xml_is_read_as_pyosmium_reads_it(tmp_path):
    relations = [([(1, "outer"), (2, "inner")], {"type": "multipolygon", **BUILT})]
    town = Town((BIG, {}), (rectangle(-10, -10, 20, 20), {}), relations=relations)
    plain = read_map(write(tmp_path, town.xml()), center=(LON, LAT))
    edit = "<node id='9999' action='delete' lat='1' lon='1'/></osm>"
    text = town.xml().replace("</osm>", edit)
    edited = read_map(write(tmp_path, text, "b.osm"), center=(LON, LAT))
    np.testing.assert_array_equal(plain.heights, edited.heights)


@pytest.mark.parametrize("missing", [100, 101, 103])
def test_a_way_that_lacks_a_node_is_left_out(tmp_path, missing):
    town = Town((BIG, BUILT), (rectangle(30, 0, 20, 20), BUILT))
    path = write(tmp_path, town.xml(missing=[missing]))
    assert areas(path) == near({6: 400})
    assert account(path) == (2, {"with missing corners": 1})


def test_a_relation_keeps_the_rings_that_close(tmp_path):
    members = [(1, "outer"), (2, "inner"), (3, "outer"), (77, "outer")]
    relations = [(members, {"type": "multipolygon", **BUILT})]
    ways = [(BIG, {}), (rectangle(-5, -5, 10, 10), {}), (rectangle(30, 0, 20, 20), {})]
    town = Town(*ways, relations=relations)
    path = write(tmp_path, town.xml(missing=[302]).replace('ref="77"', 'ref="777"'))
    assert areas(path) == near({6: 1500})
    path = write(tmp_path, town.xml(missing=[102, 302]))  # the court does not become a building
    assert account(path) == (1, {"with missing corners": 1})


def test_what_has_no_area_is_counted(tmp_path):
    town = Town(
        (BIG, BUILT),
        (BIG[:3], BUILT),
        (rectangle(30, 0, 20, 0), BUILT),
        relations=[([(1, "outer")], {"type": "site", **BUILT})],
    )
    shop = f'<node id="9" lat="{LAT}" lon="{LON}"><tag k="building" v="yes"/></node></osm>'
    text = town.xml().replace('<nd ref="200"/><tag', "<tag").replace("</osm>", shop)
    path = write(tmp_path, text)
    assert account(path) == (5, {"without a polygon": 3, "with a degenerate outline": 1})


COURT = Town(
    (BIG, {}),
    (rectangle(-10, -10, 20, 20), {}),
    (rectangle(30, 0, 20, 20), BUILT | {"height": "12"}),
    relations=[([(1, "outer"), (2, "inner")], {"type": "multipolygon", **BUILT})],
)
WITHOUT_MEMBERS = COURT.overpass(members_only=True)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.osm", COURT.xml()),
        ("b.osm", COURT.xml(inline=True)),
        ("a.json", COURT.overpass()),
        ("b.json", WITHOUT_MEMBERS),
        ("c.json", COURT.overpass(geometry=False)),
        ("a.geojson", COURT.overpass(geometry=False)),
    ],
)
def test_answers_of_overpass(tmp_path, name, content):
    path = write(tmp_path, content, name)
    assert areas(path) == near({6: 1200, 12: 400})
    assert account(path) == (2, {})
    assert read_map(path).attribution == "© OpenStreetMap contributors"


def test_members_that_come_again_without_tags_keep_them(tmp_path):
    document = COURT.overpass(geometry=False)
    again = [one | {"tags": {}} for one in document["elements"] if one["type"] == "way"]
    document["elements"] += again
    assert areas(write(tmp_path, document, "a.json")) == near({6: 1200, 12: 400})


def test_a_null_in_a_geometry_is_a_missing_corner(tmp_path):
    document = COURT.overpass()
    document["elements"][2]["geometry"][1] = None
    path = write(tmp_path, document, "a.json")
    assert account(path) == (2, {"with missing corners": 1})


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"elements": [{"type": "way", "id": 1, "nodes": [1, 2], "tags": BUILT}]}, "out geom"),
        ({"elements": []}, "no nodes"),
        ({"elements": [{"id": 1}]}, "KeyError"),
        ({"elements": [3]}, "TypeError"),
        ({"elements": [{"type": "node", "id": 1, "lat": 95, "lon": 1}]}, "invalid location"),
        ({"elements": [{"type": "node", "id": "x"}]}, "invalid literal"),
        ({"elements": [{"type": "way", "id": 1, "nodes": [1], "geometry": []}]}, "1 nodes and 0"),
        ({"elements": [], "remark": "runtime error: Query timed out"}, "Query timed out"),
    ],
)
def test_bad_answers_of_overpass(tmp_path, change, found):
    with pytest.raises(MapError, match=found):
        read_map(write(tmp_path, {"version": 0.6} | change, "a.json"))


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("</osm>", "<remark>runtime error: Query timed out</remark></osm>", "Query timed out"),
        ('<osm version="0.6">', "<!DOCTYPE osm><osm>", "holds XML"),
        ('<osm version="0.6">', f"<!-- {'<osm ' * 900}--><!DOCTYPE osm><osm>", "document type|XML"),
        ("</relation>", "", "cannot be read"),
        ('id="1"', 'id="one"', "cannot be read"),
        ('ref="1"', "", "cannot be read"),
    ],
)
def test_bad_xml_of_overpass(tmp_path, old, new, found):
    text = COURT.xml(inline=True).replace(old, new)
    with pytest.raises(MapError, match=found):
        read_map(write(tmp_path, text))
