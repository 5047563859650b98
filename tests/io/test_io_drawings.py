"""DXF drawings: arcs, old polylines, mirrored and paper space, blocks, binary files; and KML."""

import math

import numpy as np
import pytest
from format_writers import write_kml, write_kmz
from test_io_troubles import A, B, areas_of, near

from evocity.errors import MapError
from evocity.io import read_map

FINE = {"pixels": 512, "metres_per_pixel": 0.5}
SQUARE = [(0, 0, 0), (20, 0, 0), (20, 20, 0), (0, 20, 0)]


def lines_of(*pairs):
    return "\n".join(str(value) for pair in pairs for value in pair) + "\n"


def polyline(points, *pairs, layer="HOUSES"):
    """A closed LWPOLYLINE of points (x, y, bulge)."""
    corners = [pair for x, y, bulge in points for pair in ((10, x), (20, y), (42, bulge))]
    return lines_of((0, "LWPOLYLINE"), (8, layer), (70, 1), *pairs, *corners)


def old_polyline(points, *pairs, layer="HOUSES"):
    """A closed POLYLINE of points (x, y, z)."""
    text = lines_of((0, "POLYLINE"), (8, layer), (66, 1), (70, 1), *pairs)
    for x, y, z in points:
        text += lines_of((0, "VERTEX"), (8, layer), (10, x), (20, y), (30, z))
    return text + lines_of((0, "SEQEND"), (8, layer))


def drawing(tmp_path, *entities, blocks="", end="\n"):
    text = lines_of((0, "SECTION"), (2, "BLOCKS")) + blocks + lines_of((0, "ENDSEC"))
    text += lines_of((0, "SECTION"), (2, "ENTITIES")) + "".join(entities)
    text += lines_of((0, "ENDSEC"), (0, "EOF"))
    path = tmp_path / "a.dxf"
    path.write_bytes(text.replace("\n", end).encode())
    return path


def areas(path, **options):
    return areas_of(read_map(path, **FINE | options))


NINE = (39, 9)


def test_holes_cut_only_the_polygons_around_them(tmp_path):
    outer = polyline([(0, 0, 0), (40, 0, 0), (40, 40, 0), (0, 40, 0)], NINE)
    hole = [(10, 10, 0), (30, 10, 0), (30, 30, 0), (10, 30, 0)]
    inside = polyline([(15, 15, 0), (25, 15, 0), (25, 25, 0), (15, 25, 0)], NINE)
    path = drawing(tmp_path, outer, inside, polyline(hole, NINE, layer="HOUSES-holes"))
    assert areas(path) == areas(path, layer="HOUSES") == near({9: 1300})
    alone = drawing(tmp_path, polyline(hole, NINE, layer="HOUSES-holes"))
    assert areas(alone) == near({9: 400})


@pytest.mark.parametrize(
    ("points", "area"),
    [
        # a circle of two half circles, in both directions
        ([(0, 0, 1), (20, 0, 1)], math.pi * 100),
        ([(0, 0, -1), (20, 0, -1)], math.pi * 100),
        # a half circle outside a square, and one inside
        ([(0, 0, 1), (20, 0, 0), (20, 20, 0), (0, 20, 0)], 400 + math.pi * 50),
        ([(0, 0, -1), (20, 0, 0), (20, 20, 0), (0, 20, 0)], 400 - math.pi * 50),
        # four corners rounded with a radius of 5 m
        (
            [
                *((5, 0, 0), (15, 0, math.tan(math.pi / 8)), (20, 5, 0)),
                *((20, 15, math.tan(math.pi / 8)), (15, 20, 0), (5, 20, math.tan(math.pi / 8))),
                *((0, 15, 0), (0, 5, math.tan(math.pi / 8))),
            ],
            400 - (4 - math.pi) * 25,
        ),
    ],
)
def test_bulges_are_arcs(tmp_path, points, area):
    path = drawing(tmp_path, polyline(points, NINE))
    assert areas(path) == {9: pytest.approx(area, rel=0.03)}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_polylines_old_and_new_and_their_heights(tmp_path, end):
    path = drawing(
        tmp_path,
        old_polyline(SQUARE, NINE),
        old_polyline([(x + 40, y, 12) for x, y, _ in SQUARE]),
        polyline([(x, y + 40, 0) for x, y, _ in SQUARE], (38, 15)),
        polyline([(x + 40, y + 40, 0) for x, y, _ in SQUARE]),
        end=end,
    )
    assert areas(path) == {9: 400, 12: 400, 15: 400, 6: 400}


def test_a_mirrored_polyline_lies_where_programs_show_it(tmp_path):
    triangle = [(0, 0, 0), (-20, 0, 0), (-20, 40, 0)]
    mirrored = drawing(tmp_path, polyline(triangle, NINE, (230, -1)))
    heights = read_map(mirrored, **FINE).heights
    plain = drawing(tmp_path, polyline([(-x, y, 0) for x, y, _ in triangle], NINE))
    np.testing.assert_array_equal(heights, read_map(plain, **FINE).heights)


def test_an_outline_in_an_outline_is_no_court(tmp_path):
    inner = [(5 + x / 2, 5 + y / 2, 0) for x, y, _ in SQUARE]
    path = drawing(tmp_path, polyline(SQUARE, NINE), polyline(inner, (39, 15)))
    assert areas(path) == {9: 300, 15: 100}


def test_the_sheet_of_a_plan_is_no_building(tmp_path):
    frame = polyline([(x * 9, y * 9, 0) for x, y, _ in SQUARE], (67, 1))
    path = drawing(tmp_path, polyline(SQUARE, NINE), frame)
    assert areas(path) == {9: 400}
    with pytest.raises(MapError, match="no closed polyline"):
        read_map(drawing(tmp_path, frame))


@pytest.mark.parametrize("is_mixed", [False, True])
def test_blocks_are_not_expanded(tmp_path, is_mixed):
    block = lines_of((0, "BLOCK"), (8, "HOUSES"), (2, "house"), (10, 0), (20, 0))
    block += polyline(SQUARE, NINE) + lines_of((0, "ENDBLK"))
    insert = lines_of((0, "INSERT"), (8, "HOUSES"), (2, "house"), (10, 40), (20, 0))
    if is_mixed:
        path = drawing(tmp_path, insert, polyline(SQUARE, NINE), blocks=block)
        assert areas(path) == {9: 400}
        taken = read_map(path).taken
        assert "1 of the file's 2 features; left out: 1 without a polygon" in taken
    else:
        with pytest.raises(MapError, match="no closed polyline") as fault:
            read_map(drawing(tmp_path, insert, blocks=block))
        assert "explode blocks" in str(fault.value)


def test_layers_of_a_drawing_are_chosen_by_name(tmp_path):
    other = polyline([(x + 40, y, 0) for x, y, _ in SQUARE], (39, 30), layer="TREES")
    path = drawing(tmp_path, polyline(SQUARE, NINE), other)
    with pytest.raises(MapError, match="2 layers") as fault:
        read_map(path)
    assert "HOUSES" in str(fault.value)
    assert areas(path, layer="HOUSES") == {9: 400}


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"AutoCAD Binary DXF\r\n\x1a\x00" + bytes(99), "binary DXF"),
        (b"AC1015" + bytes(99), "unknown"),  # DWG
        (b"0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\nx\n", "cut off|invalid literal"),
        (b"0\nSECTION\n2\nENTITIES\n0\nENDSEC\n", "EOF"),
        (b"0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n13\n0\nEOF\n", "not a usual one"),
    ],
)
def test_drawings_that_are_refused(tmp_path, content, found):
    (tmp_path / "a.dxf").write_bytes(content)
    with pytest.raises(MapError, match=found) as fault:
        read_map(tmp_path / "a.dxf")
    assert all(fault.value.args)


# ---------------------------------------------------------------- KML


@pytest.mark.parametrize("writer", [write_kml, write_kmz])
@pytest.mark.parametrize(
    ("mode", "row", "high"),
    [
        ("relativeToGround", {"altitude": 12}, 12),
        ("relativeToSeaFloor", {"altitude": 12}, 12),
        ("absolute", {"altitude": 182}, 6),  # says nothing about the ground
        ("clampToGround", {"altitude": 12}, 6),
        ("clampToGround", {"building:levels": 5}, 15),
        ("relativeToGround", {"altitude": 12, "height": 9}, 9),
    ],
)
def test_altitudes_and_data_of_placemarks(tmp_path, writer, mode, row, high):
    suffix = ".kml" if writer is write_kml else ".kmz"
    path = writer(tmp_path / f"a{suffix}", [A, B], [row, row], mode=mode)
    assert areas(path) == near({high: 800})


def test_links_of_kml_are_not_followed(tmp_path):
    (tmp_path / "other.kml").write_text(write_kml(tmp_path / "b.kml", [A], [{}]).read_text())
    link = "<NetworkLink><Link><href>other.kml</href></Link></NetworkLink>"
    text = f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{link}</Document></kml>'
    (tmp_path / "a.kml").write_text(text)
    with pytest.raises(MapError, match="1 links to other files"):
        read_map(tmp_path / "a.kml")
