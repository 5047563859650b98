"""Operators of shapes and curves: what every one promises, and the laws of each."""

from functools import cache

import numpy as np
import pytest

from evocity.errors import OperatorError
from evocity.kinds import CurveForm, ShapeForm
from evocity.operators import OF_FORMS, make
from evocity.shapes import Curve, Detailed, ShapeError, known

SIDE = {"pixels": 32, "metres_per_pixel": 2.0}


def curve(points, detailed=False) -> CurveForm:
    made = Curve.bezier(points)
    form = CurveForm(points=made.points, maps=made.maps, breadth=4.0, **SIDE)
    if not detailed:
        return form
    line = form.line + np.column_stack([np.zeros(257), np.sin(np.arange(257) / 4)])
    coded = Detailed.of(line, made.maps, 5)
    return form.replace(points=coded.curve.points, details=coded.details)


@cache
def curves() -> tuple[CurveForm, ...]:
    places = [[4, 4], [20, 50], [40, 10], [60, 40]], [[4, 50], [20, 10], [45, 50], [60, 30]]
    return tuple(curve(points, detailed=True) for points in places)


@cache
def shapes() -> tuple[ShapeForm, ...]:
    return tuple(ShapeForm.of(known(name), 32, 2.0, name) for name in ("sierpinski", "koch"))


def parents_of(kind) -> list:
    return (curves() if kind.of == "curve" else shapes())[: kind.parents[0]]


@pytest.mark.parametrize("name", OF_FORMS)
def test_every_operator_breeds_one_of_its_window(name):
    kind, before = OF_FORMS[name], [one.digest for one in (*curves(), *shapes())]
    parents = parents_of(kind)
    one, again = (make(name)(parents, np.random.default_rng(5)) for _ in range(2))
    other = make(name)(parents, np.random.default_rng(6))
    assert one.digest == again.digest
    assert one.made["operator"] == name
    assert (one.pixels, one.metres_per_pixel) == (32, 2.0)
    assert one.problem is None
    if name != "detail_exchange":  # which draws nothing
        assert other.digest != one.digest
    assert [form.digest for form in (*curves(), *shapes())] == before


@pytest.mark.parametrize("name", OF_FORMS)
def test_what_does_not_suit_is_refused(name):
    kind = OF_FORMS[name]
    others = shapes() if kind.of == "curve" else curves()
    with pytest.raises(OperatorError, match=f"{kind.of}s"):
        make(name)(others[: kind.parents[0]], np.random.default_rng(0))
    with pytest.raises(OperatorError, match="a list of"):
        make(name)([], np.random.default_rng(0))
    with pytest.raises(OperatorError, match="tries"):
        make(name, tries=0)


def test_at_their_ends_they_give_a_parent():
    rng = np.random.default_rng(0)
    assert make("map_perturbation", step=0.0)(shapes()[:1], rng).digest == shapes()[0].digest
    assert make("point_perturbation", step=0.0)(curves()[:1], rng).digest == curves()[0].digest
    assert make("part_perturbation", step=0.0)(curves()[:1], rng).digest == curves()[0].digest
    assert make("detail_scaling", step=0.0)(curves()[:1], rng).digest == curves()[0].digest
    assert make("point_exchange", share=1.0)(curves(), rng).digest == curves()[1].digest
    assert make("curve_metamorphosis", far=0.0)(curves(), rng).digest == curves()[0].digest
    swapped = make("detail_exchange", levels=64)(curves(), rng)
    assert all(map(np.array_equal, swapped.details, curves()[1].details))
    assert np.array_equal(swapped.points, curves()[0].points)


def test_parts_that_join_stay_joined():
    plain = [one.replace(details=()) for one in curves()]
    rng = np.random.default_rng(1)
    bent = make("part_perturbation", step=0.2)(plain[:1], rng)
    assert np.abs(bent.maps - plain[0].maps).max() > 0.01
    assert bent.curve.gap < 1e-9
    assert np.abs(bent.curve.ends - np.eye(4)[[0, 3]]).max() < 1e-9
    three = np.stack([plain[1].maps[0], plain[1].maps[1], np.zeros((4, 4))])
    three[2, 3] = 1.0  # its end alone
    three[1] = plain[1].maps[1]
    richer = plain[1].replace(maps=three)
    child = make("curve_metamorphosis")([plain[0], richer], rng)
    assert child.curve.gap < 1e-9
    assert child.made["pairs"] == [[0, 0], [1, 1], [None, 2]]


def test_shapes_of_other_numbers_of_maps_are_paired_and_told():
    child = make("shape_metamorphosis")(shapes(), np.random.default_rng(2))
    assert child.made["pairs"] == [[0, 0], [1, 1], [2, 2], [2, 3]]
    assert len(child.maps) == 4


def test_an_end_is_kept_where_it_is_asked_for():
    plain = curves()[0].replace(details=())
    for seed in range(4):
        child = make("point_perturbation", ends=False)([plain], np.random.default_rng(seed))
        assert np.array_equal(child.points[[0, -1]], plain.points[[0, -1]])


def test_a_shape_that_never_contracts_is_told_by_its_maps():
    wild = make("map_perturbation", step=10.0, share=1.0, tries=2)
    with pytest.raises(ShapeError, match="spectral radius"):
        wild(shapes()[:1], np.random.default_rng(0))


def test_curves_of_other_points_or_without_details_are_refused():
    rng, short = np.random.default_rng(0), curve([[4, 4], [30, 40], [60, 4]])
    for name in ("point_exchange", "curve_metamorphosis", "detail_exchange"):
        with pytest.raises(OperatorError, match="4 and 3 control points"):
            make(name)([curves()[0], short], rng)
    with pytest.raises(OperatorError, match="has no details"):
        make("detail_scaling")([short], rng)
    with pytest.raises(OperatorError, match=r"5 levels of details; .* 0 levels"):
        make("detail_exchange")([curves()[0], curves()[1].replace(details=())], rng)
