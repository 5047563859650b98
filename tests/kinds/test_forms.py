"""Forms: what they are laid as, what is no individual, and their files."""

import itertools
import json

import numpy as np
import pytest

from evocity import CityMap, encode
from evocity.condensation import Condensation
from evocity.errors import GenomeError, MapError
from evocity.fitness.curves import line_distance
from evocity.kinds import CurveForm, ShapeForm, Site, read_form
from evocity.kinds.site import courses_of
from evocity.kinds.window_lines import cut_to_window, line_in, place_line
from evocity.recipe.sections import CourseSection
from evocity.shapes import Curve, ShapeError, known

WINDOW = {"pixels": 32, "metres_per_pixel": 2.0}


def curve(points, breadth=4.0, **more) -> CurveForm:
    made = Curve.bezier(points)
    return CurveForm(points=made.points, maps=made.maps, breadth=breadth, **WINDOW | more)


@pytest.fixture(scope="module")
def fabric():
    rng = np.random.default_rng(0)
    lots = np.where(rng.random((8, 8)) < 0.6, 3 * rng.integers(1, 6, (8, 8)), 0)
    city = CityMap(lots.repeat(4, 0).repeat(4, 1).astype(np.float32), 2.0, name="toy")
    return encode(city, block=4, reach=8, threads=1, fit=False).genome


@pytest.mark.parametrize("name", ["sierpinski", "koch", "fern", "dragon"])
def test_a_shape_is_laid_where_the_points_of_its_words_are(name):
    form = ShapeForm.of(known(name), 48, 1.0)
    points = form.shape.chaos(40_000, np.random.default_rng(1))
    assert points.min() >= 0
    assert points.max() <= 1
    there = np.zeros((48, 48), bool)
    there[47 - (points[:, 1] * 48).astype(int), (points[:, 0] * 48).astype(int)] = True
    mask = form.mask
    grown = np.pad(mask, 1)
    near = np.zeros_like(mask)
    for i, j in itertools.product(range(3), repeat=2):
        near |= grown[i : i + 48, j : j + 48]
    assert not (there & ~near).any()  # what the game finds is laid, within a pixel
    grown, near = np.pad(there, 1), np.zeros_like(mask)
    for i, j in itertools.product(range(3), repeat=2):
        near |= grown[i : i + 48, j : j + 48]
    assert not (mask & ~near).any()


def test_a_shape_that_does_not_contract_is_named_or_told():
    maps = ShapeForm.of(known("sierpinski"), 32, 1.0).maps.copy()
    maps[1, :, :2] *= 2.5
    with pytest.raises(ShapeError, match="map 1"):
        ShapeForm(maps=maps, **WINDOW)
    maps[1, :, :2] *= 0.98 / 1.25
    assert "map 1 does not contract enough" in ShapeForm(maps=maps, **WINDOW).problem
    far = ShapeForm.of(known("koch"), 32, 1.0).maps + np.array([0, 0, 40])
    assert "within the window" in ShapeForm(maps=far, **WINDOW).problem


def test_shapes_of_space_have_no_window():
    with pytest.raises(GenomeError, match="three-dimensional"):
        ShapeForm.of(known("menger"), 32, 1.0)


def test_a_curve_is_a_strip_of_its_breadth():
    form = curve([[8, 31], [24, 31], [56, 31]], breadth=6.0)
    assert form.problem is None
    rows, _columns = np.nonzero(form.mask)
    assert (rows.min(), rows.max()) == (15, 17)  # y 28…34 m of 64, from the north
    assert form.mask[16, 5:27].all()
    assert not form.mask[:, :2].any()
    assert form.city.heights[16, 10] == form.lay
    assert form.length == pytest.approx(48)


@pytest.mark.parametrize(
    ("points", "told"),
    [
        ([[25, 5], [100, 60], [-40, 60], [35, 5]], "crosses itself"),
        ([[10, 10], [90, 90], [70, 20]], "leaves the window"),
    ],
)
def test_what_crosses_itself_or_leaves_is_no_individual(points, told):
    form = curve(points)
    assert told in form.problem
    with pytest.raises(GenomeError, match=told):
        _ = form.city


def test_a_course_stands_in_the_map_and_nothing_else_moves(fabric):
    course = curve([[2, 2], [30, 40], [60, 60]], lay=0.0)
    site = Site.of(fabric, (course,))
    assert site.problem is None
    assert (site.city.heights[course.mask] == 0).all()
    assert site.before.heights[course.mask].any()
    wall = Site.of(fabric, (course.replace(lay=5.0),))
    assert (wall.city.heights[course.mask] == 5).all()
    assert site.digest != wall.digest


def test_a_course_that_cuts_what_is_locked_is_no_individual(fabric):
    course = curve([[2, 2], [30, 40], [60, 60]], lay=0.0)
    inside = tuple(np.argwhere(course.mask)[20])
    for at, told in ((inside, "cuts a locked part"), ((2, 2), None)):
        mask = np.zeros((32, 32), bool)
        mask[at] = True
        locked = fabric.replace(condensation=Condensation(np.full((32, 32), 7.0), mask))
        problem = Site.of(locked, (course,)).problem
        assert problem is None if told is None else told in problem


def test_forms_are_written_and_read(fabric, tmp_path):
    mask = np.zeros((32, 32), bool)
    mask[2, 2] = True
    locked = fabric.replace(condensation=Condensation(np.full((32, 32), 7.0), mask))
    course = curve([[2, 2], [30, 40], [60, 60]], lay=3.0)
    forms = [
        ShapeForm.of(known("koch"), 32, 1.0, "k").replace(made={"operator": "x"}),
        course,
        Site.of(locked, (course, course.replace(breadth=8.0))),
    ]
    for number, form in enumerate(forms):
        path = tmp_path / f"{number}.parquet"
        form.write(path)
        again = read_form(path)
        assert again.digest == form.digest
        assert again == form
        assert hash(again) == hash(form)
        assert again != forms[number - 1]
        assert type(again) is type(form)
        assert again.made == form.made
    assert again.fabric == locked
    assert again.courses[1].breadth == 8.0


def test_what_is_no_form_is_refused(fabric, tmp_path):
    path = tmp_path / "genome.parquet"
    fabric.write(path)
    with pytest.raises(GenomeError, match="cannot be read as a shape"):
        read_form(path)
    path.write_bytes(b"PAR1 and no more")
    with pytest.raises(GenomeError, match="cannot be read as a shape"):
        read_form(path)


def test_a_course_from_a_file_is_the_line_with_its_details(tmp_path):
    x = np.linspace(-5, 70, 400)
    line = np.column_stack([x, 30 + 12 * np.sin(x / 9) + 2 * np.sin(x)])
    (tmp_path / "river.geojson").write_bytes(document(line.tolist(), window=True))
    city = CityMap(np.zeros((32, 32)), 2.0)
    course = CourseSection.model_validate(
        {"width": 4.0, "from": "river.geojson", "points": 4},
        context={"folder": tmp_path, "kept": None},
    )
    (found,) = courses_of([course], city, tmp_path)
    assert found.problem is None
    assert len(found.details) > 3
    assert len(found.points) == 4
    assert line_distance(found.line, cut_to_window(line, 64.0, "river")) < 0.2
    moved = found.replace(points=found.points + np.array([1.0, -2.0]))  # its details go with it
    assert np.abs(moved.line - found.line - np.array([1.0, -2.0])).max() < 1e-9
    found.write(tmp_path / "a.parquet")
    assert read_form(tmp_path / "a.parquet").digest == found.digest


def document(coordinates, **more) -> bytes:
    return json.dumps({"type": "LineString", "coordinates": coordinates, **more}).encode()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"{", "not complete JSON"),
        (b'{"type": "Point", "coordinates": [1, 2]}', "no line"),
        (document([[1, 2]]), "one point"),
        (document([[1, 2], [1, 2]]), "one point"),
        (document([[1, 2], ["x", 2]]), "cannot be read"),
        (document([[1, 2], [500, 2]]), "out of range"),
    ],
)
def test_lines_at_fault_are_told(content, told):
    with pytest.raises(MapError, match=told):
        line_in(content, "river.geojson")


def test_a_line_is_placed_by_degrees_or_metres():
    line, degrees = line_in(document([[1, 2], [1, 2], [3, 4]], window=True), "a")
    assert not degrees
    assert line.tolist() == [[1, 2], [3, 4]]
    lyon = (842_000.0, 6_520_000.0)
    line, degrees = line_in(document([[4.83, 45.76], [4.84, 45.77]]), "a")
    here = place_line(line, degrees, 100.0, lyon, "EPSG:2154", "a")
    assert degrees
    assert np.abs(here).max() < 5000
    with pytest.raises(MapError, match="no position in a reference system"):
        place_line(line, degrees, 100.0, None, None, "a")
    with pytest.raises(MapError, match="outside the window"):
        cut_to_window(np.array([[200.0, 0], [300, 50]]), 100.0, "river.geojson")
    assert cut_to_window(np.array([[-50.0, 50], [150, 50]]), 100.0, "a").tolist() == [
        [0, 50],
        [100, 50],
    ]
