"""Shapes: pieces against products made one by one, pictures against the chaos game."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial import cKDTree

from evocity.shapes import (
    KNOWN,
    Language,
    Primitive,
    Shape,
    ShapeError,
    box_dimension,
    boxes_of,
    dimension_of,
    known,
    mask_of,
    picture_of,
    svg_of,
)
from evocity.shapes.rendering import Frame

PLANE = [name for name in KNOWN if name != "menger"]
HALVES = [[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)]
COLOURS = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)]


def product_of(maps, word):
    found = np.eye(maps.shape[1] + 1)
    for letter in word:
        found = found @ np.vstack([maps[letter], np.eye(maps.shape[1] + 1)[-1]])
    return found[:-1]


@st.composite
def shapes(draw):
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    size, count = draw(st.sampled_from([2, 3])), draw(st.integers(1, 4))
    maps = rng.normal(size=(count, size, size + 1))
    norms = np.linalg.norm(maps[:, :, :size], 2, axis=(1, 2))
    maps[:, :, :size] *= (rng.uniform(0.1, 0.8, count) / norms)[:, None, None]
    forbidden = draw(
        st.lists(st.lists(st.integers(0, count - 1), min_size=2, max_size=2), max_size=2)
    )
    return Shape(maps, language=Language.without(count, *forbidden))


@pytest.mark.slow
@settings(deadline=None)
@given(shapes(), st.integers(0, 4))
def test_pieces_are_the_products_of_the_words_in_their_order(shape, depth):
    pieces = shape.pieces(depth)
    words = list(shape.words(depth))
    assert len(pieces) == len(words) == shape.count(depth)
    told = [product_of(shape.maps, word) for word in words]
    np.testing.assert_allclose(pieces.maps, np.array(told).reshape(pieces.maps.shape), atol=1e-12)
    assert (pieces.lengths == depth).all()


@pytest.mark.slow
@settings(deadline=None)
@given(shapes())
def test_the_attractor_lies_in_its_box(shape):
    if not shape.language.lasts:
        return
    low, high = shape.box
    points = shape.chaos(3000, np.random.default_rng(1))
    slack = 1e-9 * (np.abs([low, high]).max() + 1)
    assert (points >= low - slack).all()
    assert (points <= high + slack).all()


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("koch", [[0, 0], [1, np.sqrt(3) / 6]]),
        ("dragon", [[-1 / 3, -1 / 3], [7 / 6, 2 / 3]]),
        ("levy", [[-0.5, -0.25], [1.5, 1]]),
        ("carpet", [[0, 0], [1, 1]]),
    ],
)
def test_boxes_are_the_known_ones(name, told):
    np.testing.assert_allclose(known(name).box, told, atol=0.01)


def test_colours_are_sums_of_letters_that_count_less_and_less():
    shape = Shape(HALVES, colours=COLOURS, mix=0.3)
    for word, colour in zip(shape.words(5), shape.pieces(5).colours, strict=True):
        shares = 0.3 ** np.arange(5)
        told = (shares[:, None] * np.array(COLOURS)[list(word)]).sum(axis=0)
        np.testing.assert_allclose(colour, told * (1 - 0.3) / (1 - 0.3**5), atol=1e-12)


def test_the_greatest_address_has_the_colour():
    """Against all words of depth 9 of three overlapping maps."""
    maps = [
        [[0.6, 0, 0], [0, 0.6, 0]],
        [[0.6, 0, 0.4], [0, 0.6, 0]],
        [[0.6, 0, 0.2], [0, 0.6, 0.4]],
    ]
    shape = Shape(maps, colours=COLOURS[:3])
    frame = Frame.of(shape.box, 64)
    pieces = shape.pieces(9)
    top = np.full((64, 64, 3), 255, np.uint8)
    middle = moved_middle(pieces, shape)
    for (row, column), colour in zip(frame.cells(middle), pieces.colours, strict=True):
        top[row, column] = np.round(colour * 255)
    depth = shape.pieces(pixel=1 / frame.scale).lengths
    assert set(depth.tolist()) == {9}, "as deep as pixels ask for"
    assert np.array_equal(np.asarray(picture_of(shape, 64)), top)


def moved_middle(pieces, shape):
    size = shape.size
    return pieces.maps[:, :, :size] @ shape.box.mean(axis=0) + pieces.maps[:, :, size]


@pytest.mark.parametrize("name", PLANE)
def test_pictures_are_what_the_chaos_game_finds(name):
    shape, side = known(name), 256
    frame = Frame.of(shape.box, side)
    played = np.zeros((side, side), bool)
    played[tuple(frame.cells(shape.chaos(10**6, np.random.default_rng(2))).T)] = True
    mask = mask_of(shape, side)
    a, b = np.argwhere(played), np.argwhere(mask)
    assert cKDTree(b).query(a)[0].max() <= 1.5
    assert cKDTree(a).query(b)[0].max() <= (1.5 if name != "fern" else 3)


def test_the_chaos_game_runs_an_automaton_backwards():
    shape = Shape(HALVES, language=Language.without(4, (0, 1), (2, 2), (3, 1)))
    frame = Frame.of(shape.box, 128)
    played = np.zeros((128, 128), bool)
    played[tuple(frame.cells(shape.chaos(400_000, np.random.default_rng(3))).T)] = True
    a, b = np.argwhere(played), np.argwhere(mask_of(shape, 128))
    assert max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max()) <= 1.5


# -- dimensions ------------------------------------------------------------------------------


@pytest.mark.slow
def test_dimensions_are_the_known_ones():
    exact = {
        "sierpinski": np.log2(3), "koch": np.log(4) / np.log(3), "carpet": np.log(8) / np.log(3),
        "menger": np.log(20) / np.log(3), "dragon": 2.0, "levy": 2.0,
    }  # fmt: skip
    for name, told in exact.items():
        assert dimension_of(known(name)) == pytest.approx(told, abs=1e-12)
    for name in ("sierpinski", "koch", "carpet", "menger"):
        side = 1024 if name != "menger" else None
        assert box_dimension(known(name), side).dimension == pytest.approx(exact[name], abs=0.03)
    with pytest.raises(ShapeError, match="equally in all directions"):
        dimension_of(known("fern"))


def test_no_3_after_3_has_its_dimension():
    shape = Shape(HALVES, language=Language.without(4, (3, 3)))
    told = np.log2((3 + np.sqrt(21)) / 2)
    assert dimension_of(shape) == pytest.approx(told, abs=1e-12)
    assert box_dimension(shape, 1024).dimension == pytest.approx(told, abs=0.03)
    alone = Language.without(4, *((k, j) for k in range(4) for j in range(4) if k != j))
    assert dimension_of(shape.restricted(alone)) == 0


@pytest.mark.long
def test_the_boundary_of_the_dragon():
    mask = np.pad(mask_of(known("dragon"), 4096), 1)
    outside, _ = ndimage.label(~mask)
    edge = mask & ndimage.binary_dilation(outside == outside[0, 0])
    assert boxes_of(edge[1:-1, 1:-1]).dimension == pytest.approx(1.5236, abs=0.03)


@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(0, 3), st.integers(0, 3))
def test_blocks_hold_what_their_cells_hold(seed, side, down, across):
    from evocity.shapes.dimension import _blocks

    down, across = min(down, side - 1), min(across, side - 1)
    mask = np.random.default_rng(seed).random((13, 11)) < 0.1
    cells = {((r + down) // side, (c + across) // side) for r, c in np.argwhere(mask).tolist()}
    assert {tuple(one) for one in np.argwhere(_blocks(mask, side, down, across)).tolist()} == cells


# -- what is made of shapes ------------------------------------------------------------------


def test_both_of_two_and_copies_of_one_along_the_other():
    carpet, koch = known("carpet"), known("koch")
    both = carpet | koch
    assert both.count(3) == carpet.count(3) + koch.count(3)
    along = carpet.level(2) @ koch
    assert along.count(5) == 8**2 * 4**3
    pieces = along.pieces(3).maps
    outer, inner = carpet.pieces(2).maps, koch.pieces(1).maps
    told = [product_of(np.array([a, b]), (0, 1)) for a in outer for b in inner]
    np.testing.assert_allclose(pieces, told, atol=1e-12)


def test_words_of_shapes_with_the_same_maps():
    a = Shape(HALVES, language=Language.without(4, (3, 3)))
    b = Shape(HALVES, language=Language.without(4, (0, 0)))
    assert (a & b).language == Language.without(4, (3, 3), (0, 0))
    assert (a - b).count(2) == 1
    with pytest.raises(ShapeError, match="the two shapes have different affine maps"):
        a & known("koch")


def test_a_shape_that_is_moved_is_the_same_elsewhere():
    turn = np.array([[0.0, -2.0, 5.0], [1.0, 0.5, -3.0]])
    shape = known("koch")
    points = shape.moved(turn).pieces(4).points
    np.testing.assert_allclose(
        points, shape.pieces(4).points @ turn[:, :2].T + turn[:, 2], atol=1e-12
    )


def test_frames_are_maps():
    shape = Shape.from_frames([((1, 2), (0.5, 0), (0, 0.5)), ((0, 0), (0, 0.3), (-0.3, 0))])
    np.testing.assert_array_equal(shape.maps[0], [[0.5, 0, 1], [0, 0.5, 2]])
    np.testing.assert_array_equal(shape.maps[1], [[0, -0.3, 0], [0.3, 0, 0]])


# -- contraction, and bad input --------------------------------------------------------------


def test_contraction_is_proved_by_longer_products_and_refuted_by_name():
    sheared = Shape([[[0.5, 3.0, 0], [0, 0.5, 0]], [[0.5, 0, 1], [0, 0.5, 0]]])
    assert sheared.contraction.proved
    assert sheared.contraction.length > 1
    with pytest.raises(ShapeError, match=r"map 1 does not contract: its spectral radius is 1\.2"):
        Shape([[[0.5, 0, 0], [0, 0.5, 0]], [[1.2, 0, 0], [0, 0.1, 0]]])
    growing = [[[0, 2.0, 0], [0.1, 0, 0]], [[0, 0.1, 0], [2.0, 0, 0]]]
    with pytest.raises(ShapeError, match="the product of maps 0 1"):
        Shape(growing)
    # one after the other they grow; without that word they contract
    assert Shape(growing, language=Language.without(2, (0, 1), (1, 0))).contraction.proved


def test_what_is_not_decided_is_warned_of():
    turn = np.array([[np.cos(1), -np.sin(1)], [np.sin(1), np.cos(1)]])
    skew = np.array([[1, 2.0], [0, 1]])
    maps = [np.column_stack([0.9999 * skew @ turn @ np.linalg.inv(skew), [0, 1]])]
    with pytest.warns(UserWarning, match="may not contract"):
        Shape(maps)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: Shape([[1, 2]]), "the maps have the shape"),
        (lambda: Shape("koch"), "the maps have the shape"),
        (lambda: Shape([[[np.nan, 0, 0], [0, 0.5, 0]]]), "entry 0 of the maps is not finite"),
        (lambda: Shape(HALVES, "cub"), "did you mean cube"),
        (lambda: Shape(HALVES, "cube"), "the primitive is three-dimensional"),
        (lambda: Shape(HALVES, colours=[(0, 0, 2)] * 4), "colours"),
        (lambda: Shape(HALVES, mix=1.0), "mix = 1.0"),
        (lambda: Shape(HALVES, language=Language.every(3)), "3 letters does not fit 4 affine maps"),
        (lambda: Shape(HALVES).pieces(12), "16777216 pieces"),
        (lambda: Shape(HALVES).pieces(), "both missing"),
        (lambda: Shape(HALVES).pieces(64), "depth = 64"),
        (lambda: Shape(HALVES).pieces(pixel=0.001, most=1000), "1001 pieces or more"),
        (
            lambda: Shape(HALVES, language=Language.level(4, 2)).pieces(pixel=0.1),
            "finitely many words",
        ),
        (lambda: Shape.from_frames([]), "the frames of the shape are invalid"),
        (
            lambda: Primitive.of([(0, 0)], faces=[(0, 1, 2)]),
            "the list of faces contains a missing point, number 2",
        ),
        (lambda: picture_of(known("menger")), "the shape is not two-dimensional"),
        (lambda: known("kock"), "did you mean koch"),
        (lambda: mask_of(known("koch"), 4), "side = 4"),
        (lambda: boxes_of(np.zeros((512, 512))), "0 cells are filled"),
    ],
)
def test_what_cannot_be_is_told(fault, says):
    with pytest.raises(ShapeError, match=says):
        fault()


def test_svg_has_a_path_a_colour():
    import xml.etree.ElementTree as tree

    root = tree.fromstring(svg_of(Shape(HALVES, "square", colours=COLOURS), 2))
    assert len(root) == 16
    assert root[0].get("fill") == "#ff0000"
    lone = tree.fromstring(svg_of(known("koch"), 3))
    assert len(lone) == 1
    assert lone[0].get("d").count("M") == 64
