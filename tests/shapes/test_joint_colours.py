"""Maps that mix places and colours, positions as colours, and pieces against brute force."""

import json
import struct
from itertools import product

import numpy as np
import pytest
import shapely

from evocity.shapes import (
    Primitive,
    Shape,
    ShapeError,
    glb_of,
    joint_picture,
    known,
    motif_picture,
    picture_of,
    position_colours,
)
from evocity.shapes.joint_colours import joint_box
from evocity.shapes.primitives import primitive_of
from evocity.shapes.rendering import Frame

RNG = np.random.default_rng(5)
COLOURS = RNG.random((4, 3))


def joint(form, colour, colour_of_place=0.0, place_of_colour=0.0) -> np.ndarray:
    """Maps of form and colour; the other blocks are constant."""
    maps = np.zeros((len(form), 5, 6))
    maps[:, :2, [0, 1, 5]], maps[:, 2:, [2, 3, 4, 5]] = form, colour
    maps[:, 2:, :2], maps[:, :2, 2:5] = colour_of_place, place_of_colour
    return maps


def pulls(colours, mix=0.5) -> np.ndarray:
    part = np.broadcast_to(mix * np.eye(3), (len(colours), 3, 3))
    return np.concatenate([part, (1 - mix) * colours[:, :, None]], axis=2)


def test_separable_maps_have_the_colours_of_a_shape():
    quarters = [[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)]
    shape = Shape(quarters, colours=COLOURS)
    drawn = np.asarray(joint_picture(joint(shape.maps, pulls(COLOURS)), 64)).astype(int)
    plain = np.asarray(picture_of(shape, 64)).astype(int)
    assert np.abs(drawn - plain).max() <= 8


@pytest.mark.parametrize("turned", [0.0, 0.2])
def test_joint_maps_against_all_words(turned):
    """Colours that grow with the place, and places that colours push, by brute force."""
    form = np.array([[[0.5, 0, x], [turned, 0.5, y]] for x, y in ((0, 0), (0.4, 0), (0.2, 0.4))])
    maps = joint(form, pulls(0.6 * COLOURS[:3], 0.4), 0.15, 0.05)
    box, side, depth = joint_box(maps), 24, 8
    frame = Frame.of(box[:, :2], side)
    top = np.full((side, side, 3), 255)
    words = np.array(list(product(range(3), repeat=depth)))
    places = np.tile(box.mean(axis=0), (len(words), 1))
    for letters in words.T[::-1]:
        places = np.einsum("nij,nj->ni", maps[letters, :, :5], places) + maps[letters, :, 5]
    for at in places:  # later words cover earlier ones
        row, column = frame.cells(at[:2])
        top[row, column] = np.round(at[2:] * 255)
    drawn = np.asarray(joint_picture(maps, side)).astype(int)
    assert (
        np.abs(drawn - top).max(axis=2) <= 8
    ).mean() > 0.9  # pieces end at words of other lengths
    colours = {tuple(one) for one in drawn.reshape(-1, 3)}
    assert len(colours) > 20


def test_the_box_holds_the_attractor():
    maps = RNG.uniform(-0.2, 0.2, (4, 5, 6))
    low, high = joint_box(maps)
    at = np.zeros(5)
    for letter in RNG.integers(0, 4, 3000):
        at = maps[letter, :, :5] @ at + maps[letter, :, 5]
        assert (at >= low - 1e-6).all()
        assert (at <= high + 1e-6).all()
    assert joint_box(maps[:1]) == pytest.approx(
        np.tile(np.linalg.solve(np.eye(5) - maps[0, :, :5], maps[0, :, 5]), (2, 1)), abs=1e-6
    )


@pytest.mark.parametrize(
    ("maps", "says"),
    [
        (np.zeros((2, 4, 5)), "have the shape"),
        (joint(known("koch").maps, pulls(COLOURS + 1)), "colours of the attractor lie between"),
        (joint(4 * known("koch").maps[:2], pulls(COLOURS[:2])), "does not contract"),
    ],
)
def test_joint_maps_that_do_not_fit_are_refused(maps, says):
    with pytest.raises((ShapeError, UserWarning), match=says):
        joint_picture(maps, 32)


# -- positions as colours --------------------------------------------------------------------


def test_solids_have_their_positions_as_colours():
    content = glb_of(known("menger"), 1, paint="position")
    length = struct.unpack("<I", content[12:16])[0]
    document = json.loads(content[20 : 20 + length])
    found = {
        tuple(one["pbrMetallicRoughness"]["baseColorFactor"][:3]) for one in document["materials"]
    }
    assert len(found) == 20  # one for each cube, as they have different middles
    points = RNG.random((7, 3))
    np.testing.assert_array_equal(position_colours(known("menger"), points), points)
    flat = position_colours(known("carpet"), points[:, :2])
    np.testing.assert_array_equal(flat, np.column_stack([points[:, :2], np.zeros(7)]))


def test_positions_beyond_the_unit_cube_are_no_colours():
    with pytest.raises(ShapeError, match=r"(?s)the shape lies from.*unit cube"):
        glb_of(known("menger").moved(np.eye(3, 4) * 2), 1, paint="position")
    with pytest.raises(ShapeError, match="paint"):
        glb_of(known("menger"), 1, paint="height")


# -- pieces of a level, painted --------------------------------------------------------------


@pytest.mark.parametrize("depth", [1, 2, 3, 4])
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.1])
def test_painted_pieces_equal_brute_force(depth, turn):
    """Each pixel has the colour of the greatest word whose piece holds the pixel's middle."""
    cos, sin = np.cos(turn), np.sin(turn)
    maps = [
        [[0.55 * cos, -0.55 * sin, x], [0.55 * sin, 0.55 * cos, y]]
        for x, y in ((0.1, 0.0), (0.6, 0.1), (0.2, 0.7), (0.4, 0.3))
    ]
    shape = Shape(maps, "square", colours=COLOURS)
    side, pieces = 61, shape.pieces(depth)
    points = pieces.points.reshape(-1, 2)
    frame = Frame.of(np.stack([points.min(axis=0), points.max(axis=0)]), side)
    rows, columns = np.mgrid[:side, :side] + 0.5
    at = (np.stack([columns, side - rows], axis=-1) - frame.offset) / frame.scale
    truth = np.full((side, side, 3), 255)
    middles = shapely.points(at)
    for corners, colour in zip(pieces.points, pieces.colours, strict=True):
        truth[shapely.covers(shapely.Polygon(corners), middles)] = np.round(colour * 255)
    drawn = np.asarray(picture_of(shape, side, depth)).astype(int)
    assert (drawn == truth).all(axis=2).mean() >= 0.9995  # all but middles on an edge


def test_each_map_has_its_motif_by_brute_force():
    """Each pixel has the colour of the greatest word whose motif holds the pixel's middle."""
    turns = 2 * np.pi * np.arange(24) / 24
    disc = Primitive.polygon(0.5 + 0.4 * np.column_stack([np.cos(turns), np.sin(turns)]))
    maps = [[[0.55, -0.1, x], [0.1, 0.55, y]] for x, y in ((0.1, 0), (0.45, 0.1), (0.2, 0.4))]
    shape = Shape(maps, colours=COLOURS[:3])
    motifs = [disc, "square", Primitive.polygon([(0, 0), (1, 0), (0.5, 1)])]
    side, depth, corners = 61, 3, []
    for word, matrix in zip(shape.words(depth), shape.pieces(depth).maps, strict=True):
        motif = primitive_of(motifs[word[-1]])
        corners.append(motif.points @ matrix[:, :2].T + matrix[:, 2])
    every = np.vstack(corners)
    frame = Frame.of(np.stack([every.min(axis=0), every.max(axis=0)]), side)
    rows, columns = np.mgrid[:side, :side] + 0.5
    middles = shapely.points(
        (np.stack([columns, side - rows], axis=-1) - frame.offset) / frame.scale
    )
    truth = np.full((side, side, 3), 255)
    for points, colour in zip(corners, shape.pieces(depth).colours, strict=True):
        truth[shapely.covers(shapely.Polygon(points), middles)] = np.round(colour * 255)
    drawn = np.asarray(motif_picture(shape, motifs, depth, side)).astype(int)
    assert (drawn == truth).all(axis=2).mean() >= 0.9995  # all but middles on an edge


def test_equal_motifs_give_the_picture_of_the_shape():
    shape = Shape([[[0.6, 0, x], [0.1, 0.6, 0]] for x in (0, 0.4)], "square", colours=COLOURS[:2])
    drawn = motif_picture(shape, ["square", "square"], 4, 64)
    assert np.array_equal(np.asarray(drawn), np.asarray(picture_of(shape, 64, 4)))


@pytest.mark.parametrize(
    ("motifs", "depth", "says"),
    [
        (["square"], 2, "1 motifs, but the shape has 4"),
        (["square", "square", "segment", "square"], 2, "motif 2 has no faces"),
        (["square"] * 3 + ["cube"], 2, "is three-dimensional"),
        (["square"] * 4, 0, "depth = 0"),
    ],
)
def test_motifs_that_do_not_fit_are_refused(motifs, depth, says):
    with pytest.raises(ShapeError, match=says):
        motif_picture(known("koch"), motifs, depth)


def test_pieces_between_the_middles_mark_their_pixels():
    thin = Shape([[[0.5, 0, 0.25], [0, 0.001, 0.7]], [[0.001, 0, 0.1], [0, 0.001, 0.1]]], "square")
    ink = np.asarray(picture_of(thin, 64, 1, np.array([[0.0, 0.0], [1.0, 1.0]])).convert("L")) < 255
    assert ink[64 - 45, 16:48].all()  # y = 0.7
    assert ink[64 - 7, 6]
    assert ink.sum() <= 36
