"""Polynomial deformation as an operation on the maps, against the polynomial of points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity.shapes import Shape, ShapeError, deform, known, monomials
from evocity.shapes.rendering import Frame

RNG = np.random.default_rng(11)


@settings(max_examples=20, deadline=None)
@given(
    size=st.sampled_from([2, 3]),
    power=st.integers(1, 3),
    seed=st.integers(0, 999),
    depth=st.integers(0, 3),
)
def test_lifted_products_are_the_polynomial_of_the_pieces(size, power, seed, depth):
    rng = np.random.default_rng(seed)
    maps = rng.uniform(-0.3, 0.3, (3, size, size + 1))
    shape = Shape(maps, "square" if size == 2 else "cube")
    coefficients = rng.normal(size=(size, len(monomials(size, power))))
    bent = deform(shape, coefficients)
    assert bent.power == power
    points = shape.pieces(depth).points

    def polynomial(point):  # term by term
        total = np.zeros(size)
        for factors, exponents in zip(coefficients.T, monomials(size, power), strict=True):
            total += factors * np.prod([x**e for x, e in zip(point, exponents, strict=True)])
        return total

    naive = np.array([[polynomial(point) for point in piece] for piece in points])
    np.testing.assert_allclose(bent.points(depth), naive, atol=1e-12)
    np.testing.assert_allclose(bent(points), naive, atol=1e-12)


def test_the_lifted_maps_act_on_monomials():
    shape = known("fern")
    bent = deform(shape, np.zeros((2, 10)))
    powers = monomials(2, 3)
    point = np.array([0.3, -1.7])
    values = np.prod(point**powers, axis=1)
    for one, lifted in zip(shape.maps, bent.lifted, strict=True):
        image = one[:, :2] @ point + one[:, 2]
        np.testing.assert_allclose(lifted @ values, np.prod(image**powers, axis=1), atol=1e-12)
    # the monomial 1 stays, and those of one degree depend on no higher ones
    np.testing.assert_array_equal(bent.lifted[:, 0], np.eye(10)[[0] * 4])
    degree = powers.sum(axis=1)
    assert not bent.lifted[:, degree[:, None] < degree[None]].any()


def test_a_power_of_one_moves_the_shape():
    matrix = np.array([[0.8, -0.4, 0.1], [0.3, 0.9, -0.2]])
    moved = known("koch").moved(matrix)
    bent = deform(known("koch"), matrix[:, [2, 0, 1]])
    square, straight = Shape(known("koch").maps, "square"), matrix[:, [2, 0, 1]]
    expected = square.moved(matrix).pieces(3).points
    np.testing.assert_allclose(deform(square, straight).points(3), expected, atol=1e-12)
    low, high = bent.box
    np.testing.assert_allclose([low, high], moved.box, atol=0.02)


def test_the_picture_holds_the_deformed_points_of_the_chaos_game():
    shape = known("sierpinski")
    bent = deform(shape, [[0, 1, 0, 0, 0.5, 0], [0, 0, 1, 0.6, 0, 0]])  # x + xy/2, y + 0.6 x²
    side = 128
    ink = np.asarray(bent.picture(side).convert("L")) < 255
    frame = Frame.of(bent.box, side)
    played = np.zeros((side, side), bool)
    cells = frame.cells(bent(shape.chaos(60_000, RNG)))
    played[cells[:, 0], cells[:, 1]] = True
    for some, other in ((ink, played), (played, ink)):  # within a pixel of each other
        near = np.zeros_like(other)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                near |= np.roll(other, (down, right), axis=(0, 1))
        assert (some & ~near).sum() <= 0.002 * some.sum()


def test_the_deformed_attractor_is_made_of_deformed_copies():
    shape = known("koch")
    bent = deform(shape, [[0, 1, 0, 0, 0, 0], [0, 0, 1, -0.8, 0, 0]])  # bent down at x²
    whole, parts = bent.points(4), shape.pieces(3).points
    copies = [bent(parts @ one[:, :2].T + one[:, 2]) for one in shape.maps]
    np.testing.assert_allclose(np.concatenate(copies), whole, atol=1e-12)


@pytest.mark.parametrize(
    ("coefficients", "says"),
    [
        (np.zeros((2, 15)), "the power 4"),
        (np.zeros((2, 21)), "the power 5"),
        (np.zeros((2, 5)), r"\(2, 3\) or \(2, 6\) or \(2, 10\)"),
        (np.zeros((3, 6)), "have the shape"),
        ([[1, 2], [3]], "have the shape"),
        (np.full((2, 6), np.inf), "not finite"),
    ],
)
def test_other_powers_are_refused(coefficients, says):
    with pytest.raises(ShapeError, match=says):
        deform(known("koch"), coefficients)


def test_a_shape_in_space_has_points_and_no_picture():
    bent = deform(known("menger"), np.eye(3, 10, 1))
    np.testing.assert_allclose(bent.points(1), known("menger").pieces(1).points, atol=1e-12)
    with pytest.raises(ShapeError, match="not two-dimensional"):
        bent.picture()
