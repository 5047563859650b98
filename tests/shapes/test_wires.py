"""Wire forms, what turns one into another, and files."""

import json

import numpy as np
import pytest
from scipy import ndimage

from evocity.shapes import (
    KNOWN,
    Language,
    Shape,
    ShapeError,
    known,
    mask_of,
    metamorphosis,
    read_shape,
    wire,
    write_shape,
)
from evocity.shapes.wires import joint_gap

KOCH = [0, 1 / 3, 0.5 + 1j * np.sqrt(3) / 6, 2 / 3, 1]


def test_koch_by_substitution_is_the_ifs():
    third, turn = 1 / 3, np.pi / 3
    told = []
    for angle, x, y in ((0, 0, 0), (turn, 1 / 3, 0), (-turn, 0.5, np.sqrt(3) / 6), (0, 2 / 3, 0)):
        cos, sin = third * np.cos(angle), third * np.sin(angle)
        told.append([[cos, -sin, x], [sin, cos, y]])
    np.testing.assert_allclose(wire(KOCH).maps, told, atol=1e-12)


def test_flipped_arcs_are_mirrored_and_arcs_may_be_any():
    plain, flipped = wire([0j, 0.5 + 0.4j, 1]), wire([0j, 0.5 + 0.4j, 1], flipped=[True, False])
    point = np.array([0.3, 0.2])
    mirrored = np.array([0.3, -0.2])
    np.testing.assert_allclose(
        flipped.maps[0, :, :2] @ point, plain.maps[0, :, :2] @ mirrored, atol=1e-12
    )
    np.testing.assert_array_equal(flipped.maps[1], plain.maps[1])
    branched = wire([(0, 0), (0.5, 0), (0.5, 0.4), (1, 0)], arcs=[(0, 1), (1, 3), (1, 2)])
    assert len(branched) == 3
    _, count = ndimage.label(mask_of(branched, 256), np.ones((3, 3)))
    assert count == 1


@pytest.mark.parametrize("last", [[0, 0.2 + 0.3j, 0.5 - 0.1j, 0.8 + 0.2j, 1], [0, 0.5 + 0.5j, 1]])
def test_what_hangs_together_does_so_in_between(last):
    turning = metamorphosis(wire(KOCH), wire(last))
    assert turning.linear
    for t in np.linspace(0, 1, 11):
        between = turning(float(t))
        assert joint_gap(between) <= 1e-12
        _, count = ndimage.label(mask_of(between, 256), np.ones((3, 3)))
        assert count == 1


def test_free_maps_keep_their_area_though_they_turn_far():
    far = np.deg2rad(170)
    turned = 0.5 * np.array([[np.cos(far), -np.sin(far)], [np.sin(far), np.cos(far)]])
    first = Shape([np.column_stack([0.5 * np.eye(2), (0, 0)])] * 2)
    last = Shape([np.column_stack([turned, (1, 0)])] * 2)
    for t in np.linspace(0, 1, 11):
        part = metamorphosis(first, last, linear=False)(float(t)).maps[0, :, :2]
        assert np.linalg.det(part) == pytest.approx(0.25, abs=1e-12)
    assert np.linalg.det(metamorphosis(first, last, linear=True)(0.5).maps[0, :, :2]) < 0.01


def test_turns_of_space_go_the_shorter_way():
    def turned(angle):
        cos, sin = np.cos(angle), np.sin(angle)
        part = 0.5 * np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
        return Shape([np.column_stack([part, (0, 0, 0)])])

    between = metamorphosis(turned(0.3), turned(2.3))(0.25)
    np.testing.assert_allclose(between.maps, turned(0.8).maps, atol=1e-12)


def test_pairs_are_told_where_numbers_differ():
    turning = metamorphosis(known("sierpinski"), known("carpet"))
    assert turning.pairs == ((0, 0), (1, 1), (2, 2), (2, 3), (2, 4), (2, 5), (2, 6), (2, 7))
    assert np.array_equal(turning(1.0).maps, known("carpet").maps)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: wire([0j]), "too few points, 1"),
        (lambda: wire([(0, 0, 0)]), "points have the shape"),
        (lambda: wire([0j, 1], arcs=[(0, 2)]), "an arc joins a point that does not exist"),
        (lambda: wire([0j, 0.5, 1], flipped=[True]), "'flipped' has 1 values for 2 arcs"),
        (lambda: wire([0j, 2, 1]), "map 0 does not contract: its spectral radius is 2"),
        (lambda: metamorphosis(known("koch"), known("menger")), "one shape is two-dimensional"),
        (
            lambda: metamorphosis(known("koch"), known("koch").level(2)),
            "the language of a shape is restricted",
        ),
        (lambda: metamorphosis(known("koch"), known("levy"))(2.0), "t = 2.0"),
    ],
)
def test_what_cannot_be_is_told(fault, says):
    with pytest.raises(ShapeError, match=says):
        fault()


# -- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_a_shape_comes_back_from_its_file(tmp_path, name):
    shape = known(name)
    if name == "carpet":
        shape = Shape(shape.maps, "square", Language.without(8, (0, 0)), [(0.1, 0.2, 0.3)] * 8, 0.4)
    write_shape(shape, tmp_path / "a.json")
    back = read_shape(tmp_path / "a.json")
    assert np.array_equal(back.maps, shape.maps)
    assert back.language == shape.language
    assert (back.mix, back.colours is None) == (shape.mix, shape.colours is None)
    assert np.array_equal(back.pieces(2).points, shape.pieces(2).points)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"evocity": "map"}, "not a shape"),
        ({"version": 9}, "version 9"),
        ({"maps": "rm -rf"}, "the maps have the shape"),
        ({"maps": [[[1e999, 0, 0], [0, 0.5, 0]]]}, "not finite"),
        ({"maps": [[[2.0, 0, 0], [0, 0.5, 0]]]}, "spectral radius is 2"),
        ({"primitive": 7}, "the value of the key 'primitive' is invalid"),
        ({"primitive": {"points": "x"}}, "the points have the shape"),
        (
            {"language": {"table": [[9] * 4], "accepting": [True]}},
            "the state 9, which does not exist",
        ),
        ({"language": {"table": [[0] * 4]}}, "values are not numbers"),
        ({"colours": [[0, 0, 9]] * 4}, "colours"),
        ({"mix": "half"}, "mix"),
    ],
)
def test_a_file_at_fault_is_told_with_its_name(tmp_path, change, says):
    write_shape(known("koch"), tmp_path / "a.json")
    document = json.loads((tmp_path / "a.json").read_text()) | change
    (tmp_path / "a.json").write_text(json.dumps(document))
    with pytest.raises(ShapeError, match=says) as caught:
        read_shape(tmp_path / "a.json")
    assert "a.json" in caught.value.found


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"[" * 100_000, b"{}", b"null"])
def test_what_is_no_file_of_a_shape_is_told(tmp_path, content):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(ShapeError, match="not a shape"):
        read_shape(tmp_path / "a.json")
    with pytest.raises(ShapeError, match="No such file"):
        read_shape(tmp_path / "b.json")
