"""Measures of shapes, curves and sites: known values; targets from files."""

import io
import json
import math

import numpy as np
import pytest
from PIL import Image

from evocity import CityMap, encode, fitness
from evocity.errors import FitnessError, MapError
from evocity.fitness.curves import line_distance
from evocity.kinds import CurveForm, ShapeForm, Site
from evocity.shapes import Curve, known

WINDOW = {"pixels": 32, "metres_per_pixel": 2.0}


def curve(points, **more) -> CurveForm:
    made = Curve.bezier(points)
    return CurveForm(points=made.points, maps=made.maps, breadth=4.0, **WINDOW | more)


@pytest.fixture
def site():
    heights = np.zeros((32, 32), np.float32)
    heights[4:12, 4:12], heights[20:28, 4:12] = 9, 12
    code = encode(CityMap(heights, 2.0, name="two"), block=4, reach=8, threads=1, fit=False).genome
    return Site.of(code, (curve([[2, 48], [60, 48]], lay=0.0),))  # along row 8 from the north


def test_known_curves_have_known_values():
    straight = curve([[4, 4], [44, 34]])
    assert fitness.curve_length(straight) == pytest.approx(50)
    assert fitness.sinuosity(straight) == pytest.approx(1)
    assert fitness.simplicity(straight) == 1
    assert fitness.curve_dimension(straight) == pytest.approx(1, abs=0.05)
    bent = curve([[4, 4], [34, 60], [60, 4]])
    assert fitness.simplicity(bent) < 0.5
    assert fitness.sinuosity(bent) > 1.2
    closed = curve([[4, 4], [60, 30], [10, 60], [4, 4]])
    assert math.isnan(fitness.sinuosity(closed))


def test_lines_side_by_side_lie_as_far_apart_as_they_do():
    one = np.array([[0.0, 0], [100, 0]])
    assert line_distance(one, one + np.array([0, 7])) == pytest.approx(7)
    assert line_distance(one, one) == 0
    assert line_distance(one, one[::-1]) == 0


def test_shapes_are_measured_as_they_are_drawn():
    carpet = ShapeForm.of(known("carpet"), 128, 1.0)
    assert fitness.shape_dimension(carpet) == pytest.approx(1.8928, abs=0.1)
    assert fitness.shape_cover(carpet) == carpet.mask.mean()
    assert math.isnan(fitness.shape_dimension(ShapeForm.of(known("carpet"), 32, 1.0)))


def test_what_a_course_takes_and_what_lies_near_it(site):
    before = site.before.built
    assert fitness.built_area_lost(site) == (before & site.mask).sum() / before.sum()
    assert 0.05 < fitness.built_area_lost(site) < 0.5
    far = Site.of(site.fabric, (curve([[2, 62], [60, 62]], lay=0.0),))
    assert fitness.built_area_lost(far) == 0
    assert fitness.buildings_near_course(far) == 1  # of 2, both within 50 m
    assert fitness.area_within_reach(far) <= before.sum() * 4


def test_a_measure_of_one_thing_refuses_another(site):
    for measure, thing in (
        (fitness.curve_length, site.city),
        (fitness.shape_cover, site),
        (fitness.gsi, site),
    ):
        with pytest.raises(FitnessError, match=f"{measure.name} cannot measure a"):
            measure(thing)
    with pytest.raises(FitnessError, match="of = 'town'"):
        fitness.fitness(of="town")


def picture(dark: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(np.where(dark, 0, 255).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def test_a_picture_is_a_target(tmp_path):
    form = ShapeForm.of(known("sierpinski"), 32, 1.0)
    (tmp_path / "own.png").write_bytes(picture(form.mask))
    (own,) = fitness.load_file(tmp_path / "own.png")
    assert (own.name, own.of, own.goal) == ("own_distance", "shape", "min")
    assert own(form) == 0
    assert own(ShapeForm.of(known("koch"), 32, 1.0)) > 0.02
    for content, told in (
        (b"no picture", "the picture cannot be read"),
        (picture(np.zeros((9, 9), bool)), "the picture is nowhere dark"),
        (picture(np.ones((9, 9), bool)), "the picture is all dark"),
        (picture(np.eye(9, 5000, dtype=bool)), "5000 × 9 px"),
    ):
        (tmp_path / "bad.png").write_bytes(content)
        with pytest.raises(FitnessError, match=told):
            fitness.load_file(tmp_path / "bad.png")


def test_a_line_is_a_target(tmp_path):
    form = curve([[4, 4], [44, 34]])
    told = {"type": "LineString", "window": True, "coordinates": [[4, 4], [44, 34]]}
    path = tmp_path / "way.geojson"
    path.write_text(json.dumps(told))
    (way,) = fitness.load_file(path)
    assert (way.name, way.of, way.unit) == ("way_distance", "curve", "m")
    assert way(form) < 1e-6
    path.write_text(json.dumps(told | {"coordinates": [[500, 4], [600, 34]]}))
    (way,) = fitness.load_file(path)
    with pytest.raises(MapError, match=r"way\.geojson lies outside"):
        way(form)
