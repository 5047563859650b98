"""Palettes, stolen colours, solids."""

import json
import struct
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from PIL import Image

from evocity.shapes import (
    Shape,
    ShapeError,
    coloured_as,
    glb_of,
    known,
    palette,
    palette_of,
    picture_of,
    stolen,
    tinted,
)

RNG = np.random.default_rng(3)
QUARTERS = Shape([[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)], "square")
PICTURE = Image.fromarray(RNG.integers(0, 256, (64, 64, 3), np.uint8))


def test_a_palette_is_a_chequer_of_its_colours():
    colours = RNG.random((3, 3, 3))
    one = palette(colours)
    drawn = np.asarray(picture_of(one, 90, depth=1)) / 255
    for i, j in product(range(3), repeat=2):
        np.testing.assert_allclose(
            drawn[89 - (30 * j + 15), 30 * i + 15], colours[i, j], atol=1 / 255
        )
    grey = Image.new("RGB", (60, 60), (10, 20, 30))
    np.testing.assert_allclose(palette_of(grey, 2).colours, np.tile([10, 20, 30], (4, 1)) / 255)
    again = palette_of(picture_of(one, 90, depth=1).crop((1, 1, 90, 90)), 3)
    np.testing.assert_allclose(again.colours, one.colours, atol=0.1)


def test_colours_are_carried_to_other_forms_by_their_addresses():
    one = palette(RNG.random((2, 2, 3)), mix=0.3)
    other = coloured_as(replace(known("koch"), primitive="square"), one)
    np.testing.assert_array_equal(other.pieces(4).colours, one.pieces(4).colours)
    np.testing.assert_array_equal(other.pieces(4).maps, known("koch").pieces(4).maps)


@pytest.mark.parametrize(("mix", "depth"), [(0.5, 4), (0.3, 3), (0.9, 5), (0.5, 0)])
def test_mixtures_begin_with_the_initial_colour(mix, depth):
    """Against T̃_α1 … T̃_αn c, one homothety after the other (Tosan 2005 §5.1)."""
    own, initial = RNG.random((4, 3)), np.array([0.9, 0.1, 0.4])
    shape = replace(QUARTERS, colours=own, mix=mix)
    found = tinted(shape, initial, depth).pieces(depth).colours
    for word, colour in zip(shape.words(depth), found, strict=True):
        expected = initial
        for letter in reversed(word):
            expected = own[letter] + mix * (expected - own[letter])
        np.testing.assert_allclose(colour, expected, atol=1e-12)


def test_a_picture_stolen_by_its_own_addresses_is_the_picture():
    found = stolen(QUARTERS, QUARTERS, PICTURE, 64)
    np.testing.assert_array_equal(np.asarray(found), np.asarray(PICTURE))


def test_each_point_has_the_colour_of_its_greatest_address():
    """All words of one length, the later over the earlier: pieces of 0.6⁶ are less than a 16th."""
    over = Shape([[[0.6, 0, x], [0, 0.6, y]] for x in (0, 0.4) for y in (0, 0.4)])
    found = np.asarray(stolen(over, QUARTERS, PICTURE, 16))
    deep, there = over.pieces(6), QUARTERS.pieces(6)
    at = deep.maps[:, :, :2] @ over.box.mean(axis=0) + deep.maps[:, :, 2]
    middles = there.maps[:, :, :2] @ np.array([0.5, 0.5]) + there.maps[:, :, 2]
    told = np.full((16, 16, 3), 255)
    low, high = over.box
    for (x, y), (u, v) in zip((at - low) / (high - low) * 16, middles * 64, strict=True):
        told[15 - int(y), int(x)] = np.asarray(PICTURE)[63 - int(v), int(u)]
    np.testing.assert_array_equal(found, told)


def parsed(content):
    length = struct.unpack("<I", content[12:16])[0]
    return json.loads(content[20 : 20 + length])


def test_solids_have_all_triangles_and_colours():
    menger = known("menger")
    document = parsed(glb_of(menger, 2))
    count = sum(
        document["accessors"][part["indices"]]["count"]
        for mesh in document["meshes"]
        for part in mesh["primitives"]
    )
    assert count == 3 * 12 * 400
    low = np.min([one["min"] for one in document["accessors"] if "min" in one], axis=0)
    high = np.max([one["max"] for one in document["accessors"] if "max" in one], axis=0)
    np.testing.assert_allclose([low, high], [[0, 0, -1], [1, 1, 0]], atol=1e-6)
    coloured = replace(menger, colours=RNG.random((20, 3)))
    assert len(parsed(glb_of(coloured, 1))["materials"]) == 20
    flat = parsed(glb_of(known("carpet"), 2))
    corners = flat["meshes"][0]["primitives"][0]["indices"]
    assert flat["accessors"][corners]["count"] == 2 * 3 * 64  # two triangles a square


def test_mirrored_pieces_are_seen_from_outside():
    """The volume of the mesh is that of the cube, not less than nothing."""
    mirror = Shape([np.column_stack([np.diag([-0.5, 0.5, 0.5]), [0.5, 0, 0]])], "cube")
    content = glb_of(mirror, 1)
    document = parsed(content)
    start = 20 + struct.unpack("<I", content[12:16])[0] + 8
    part = document["meshes"][0]["primitives"][0]
    views = [document["accessors"][k] for k in (part["attributes"]["POSITION"], part["indices"])]
    arrays = []
    for view, kind in zip(views, (np.float32, np.uint16), strict=True):
        at = document["bufferViews"][view["bufferView"]]
        begin = start + at["byteOffset"]
        arrays.append(np.frombuffer(content[begin : begin + at["byteLength"]], kind))
    points, triangles = arrays[0].reshape(-1, 3), arrays[1].reshape(-1, 3)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    assert np.einsum("ki,ki->", a, np.cross(b, c)) / 6 == pytest.approx(0.125)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: palette(np.zeros((2, 3, 3))), "colours have the shape"),
        (lambda: palette(np.full((2, 2, 3), 1.5)), "numbers from 0 to 1"),
        (lambda: palette_of(PICTURE, 17), "side = 17"),
        (lambda: coloured_as(QUARTERS, known("koch")), "has no colours"),
        (lambda: tinted(QUARTERS, (0, 0, 0), 2), "has no colours"),
        (lambda: tinted(palette(np.zeros((2, 2, 3))), (0, 0, 2), 2), "numbers from 0 to 1"),
        (lambda: tinted(palette(np.zeros((2, 2, 3))), (0, 0, 1), 64), "depth = 64"),
        (lambda: coloured_as(known("carpet"), palette(np.zeros((2, 2, 3)))), "of 8 affine maps"),
        (lambda: stolen(known("menger"), QUARTERS, PICTURE), "is not two-dimensional"),
        (lambda: stolen(known("carpet"), QUARTERS, PICTURE), "the source shape has 4 affine maps"),
        (lambda: glb_of(known("koch"), 2), "has no faces"),
        (lambda: glb_of(known("menger"), 5), "triangles"),
    ],
)
def test_what_has_no_colours_or_solids_is_told(fault, says):
    with pytest.raises(ShapeError, match=says):
        fault()
