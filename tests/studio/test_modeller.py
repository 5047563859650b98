"""The modeller's server: shapes of the page and of files, shapes between two, pictures, recipes."""

import io
import json
import shutil
import zipfile

import numpy as np
import pytest
from asking import Client, contents
from PIL import Image

from evocity.kinds.window_lines import read_line
from evocity.recipe.reader import read_recipe
from evocity.shapes import Curve, known, read_curve, read_shape, write_shape
from evocity.studio import modeller
from evocity.studio.modeller import FileText, ShapeFields
from evocity.studio.server import running_server


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    with running_server(folder=tmp_path_factory.mktemp("modeller") / "runs", fresh=True) as server:
        client = Client(server)
        client.open()
        yield client


@pytest.fixture(scope="module")
def starts(asked) -> dict[str, dict]:
    listed = asked.get("/api/modeller").json["starts"]
    return {one["title"]: {k: v for k, v in one["shape"].items() if k != "ends"} for one in listed}


def fault(told) -> dict:
    assert told.status in (400, 409), told.content[:200]
    return told.json["error"]


@pytest.mark.parametrize("name", ["sierpinski", "koch", "dragon", "levy", "carpet", "fern"])
def test_known_shapes_reach_the_page_and_come_back_in_files(asked, starts, name, tmp_path):
    told = asked.post("/api/modeller-json", starts[name])
    (tmp_path / "shape.json").write_bytes(told.content)
    read = read_shape(tmp_path / "shape.json")
    assert np.abs(read.maps - known(name).maps).max() < 1e-12
    assert starts[name]["kind"] == ("wire" if name in ("koch", "dragon", "levy") else "frames")
    again = asked.post("/api/modeller-open", {"text": told.content.decode()}).json["shape"]
    assert again["kind"] == starts[name]["kind"]


def test_a_curve_is_saved_as_a_curve(asked, starts, tmp_path):
    fields = starts["curve of Bézier"]
    told = asked.post("/api/modeller-json", fields)
    (tmp_path / "curve.json").write_bytes(told.content)
    line = read_curve(tmp_path / "curve.json").detailed.line()
    exact = Curve.bezier(fields["points"]).line(12)
    far = np.sqrt(((line[:, None] - exact[None]) ** 2).sum(axis=2)).min(axis=1)
    assert far.max() < 1e-3
    opened = modeller.open_file(FileText(text=told.content.decode()))["shape"]
    assert np.abs(np.array(opened["points"]) - fields["points"]).max() < 1e-9


def test_a_wire_form_of_the_page_is_the_wire_form_of_python(starts):
    fields = ShapeFields.model_validate_json(json.dumps(starts["koch"]))
    assert np.array_equal(fields.shape().maps, known("koch").maps)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not a shape"),
        ("[1, 2", "not a shape"),
        ("[" * 100_000, "not a shape"),
        ('{"evocity": "genome"}', "not a shape"),
        ('{"evocity": "shape", "version": 1}', "keys are missing"),
        ('{"evocity": "shape", "version": 9, "maps": []}', "unknown file version"),
        ('{"evocity": "shape", "version": 1, "maps": [[[1, 0, 0], [0, 1, 0]]]}', "not contract"),
        ('{"evocity": "shape", "version": 1, "maps": [[[1e999, 0, 0], [0, 1, 0]]]}', "not finite"),
        ('{"evocity": "curve", "version": 1, "maps": 3, "points": 3}', "keys are missing"),
    ],
)
def test_files_that_are_no_shapes_are_refused(asked, text, words):
    error = fault(asked.post("/api/modeller-open", {"text": text}))
    assert words in error["found"]
    assert error["expected"]
    assert error["remedy"]


def test_a_shape_of_space_or_of_some_words_is_refused(asked, tmp_path):
    write_shape(known("menger"), tmp_path / "menger.json")
    write_shape(known("koch").level(3), tmp_path / "level.json")
    for name, words in (("menger", "three-dimensional"), ("level", "limited to some words")):
        text = (tmp_path / f"{name}.json").read_text()
        assert words in fault(asked.post("/api/modeller-open", {"text": text}))["found"]


def film(starts, **more) -> dict:
    view = {"left": -0.1, "low": -0.4, "wide": 1.2}
    shapes = {"shape": starts["koch"], "last": starts["levy"]}
    return shapes | view | {"kind": "zip", "frames": 3, "side": 64} | more


def test_a_film_has_its_frames(asked, starts):
    told = asked.post("/api/modeller-picture", film(starts))
    with zipfile.ZipFile(io.BytesIO(told.content)) as archive:
        frames = [np.asarray(Image.open(archive.open(name))) for name in archive.namelist()]
    assert archive.namelist() == ["frame-0001.png", "frame-0002.png", "frame-0003.png"]
    still = asked.post("/api/modeller-picture", film(starts, kind="png", last=None))
    assert np.array_equal(frames[0], np.asarray(Image.open(io.BytesIO(still.content))))
    assert not np.array_equal(frames[0], frames[2])
    told = asked.post("/api/modeller-picture", film(starts, kind="webp", paint="measure"))
    with Image.open(io.BytesIO(told.content)) as seen:
        assert (seen.format, seen.n_frames, seen.size) == ("WEBP", 3, (64, 64))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"frames": 10_000}, "frames = 10000"),
        ({"side": 100_000}, "side in pixels = 100000"),
        ({"last": None}, "a film needs a second shape"),
        ({"level": 20}, "pieces"),
        ({"wide": 1e-9, "left": 0, "low": 0, "frames": 2}, "pieces"),
    ],
    ids=str,
)
def test_films_that_are_too_large_are_refused(asked, starts, more, words):
    assert words in fault(asked.post("/api/modeller-picture", film(starts, **more)))["found"]


def test_shapes_that_do_not_fit_are_refused(asked, starts):
    pair = {"first": starts["curve of Bézier"], "last": starts["koch"]}
    assert "is a curve" in fault(asked.post("/api/modeller-morph", pair))["found"]
    wide = starts["sierpinski"] | {"maps": [[2, 0, 0, 0, 0.5, 0]]}
    error = fault(asked.post("/api/modeller-json", wide | {"colours": None}))
    assert error["found"].startswith("map 0 does not contract: its spectral radius is 2")
    for bad in ({"kind": "../x"}, {"maps": [[1, 2]]}, {"points": [["a", "b"]]}, {"path": "/etc"}):
        assert asked.post("/api/modeller-json", starts["koch"] | bad).status == 400


def use(starts, role: str, title: str, **more) -> dict:
    return {"role": role, "shape": starts[title], "width": 14, "city": 0} | more


def test_a_shape_becomes_a_parent_a_course_and_a_motif(asked, starts):
    home = asked.server.studio.modeller.home
    told = asked.post("/api/modeller-use", use(starts, "parent", "koch", last=starts["levy"])).json
    recipe = read_recipe(home / "modelled-parent-recipe" / "recipe.toml")
    assert recipe.run.kind == "shape"
    assert [parent.shape for parent in recipe.parents] == ["shape-1.json", "shape-2.json"]
    assert told["command"].startswith("evocity run ")
    asked.post("/api/modeller-use", use(starts, "course", "koch"))
    folder = home / "modelled-course-recipe"
    assert read_recipe(folder / "recipe.toml").run.kind == "site"
    line, in_degrees = read_line(folder / "course.geojson", "course.geojson")
    assert not in_degrees
    assert np.ptp(line[:, 0]) == pytest.approx(0.9 * 256, abs=0.01)
    asked.post("/api/modeller-use", use(starts, "motif", "carpet", level=2))
    folder = home / "modelled-motif-recipe"
    assert [p.map for p in read_recipe(folder / "recipe.toml").parents][1].endswith("motif.tif")
    asked.post("/api/modeller-use", use(starts, "parent", "curve of Bézier"))
    recipe = read_recipe(home / "modelled-parent-2-recipe" / "recipe.toml")
    assert recipe.run.kind == "curve"
    assert np.array(recipe.parents[0].curve).max() < 64
    told = asked.post("/api/modeller-use", use(starts, "motif", "carpet")).json
    assert told["folder"] == str(home / "modelled-motif-2-recipe")


def test_what_a_run_cannot_use_is_refused_and_leaves_no_file(asked, starts):
    home = asked.server.studio.modeller.home
    before = contents(home) if home.exists() else {}
    crossing = starts["koch"] | {"points": [[0, 0], [0.6, 0.3], [0.5, -0.3], [0.4, 0.3], [1, 0]]}
    for role, title, more, words in (
        ("course", "sierpinski", {}, "the shape is not a line"),
        ("course", "wire form, branches", {}, "the shape is not a line"),
        ("course", "koch", {"shape": crossing}, "the line crosses itself"),
        ("parent", "curve of B-spline", {}, "not a curve of Bézier"),
        ("parent", "koch", {"last": starts["curve of Bézier"]}, "a curve"),
        ("parent", "curve of Bézier", {"last": starts["koch"]}, "not a curve of Bézier"),
        ("motif", "curve of Bézier", {}, "a curve"),
        ("course", "koch", {"width": 1}, "width of the course"),
        ("parent", "koch", {"city": 99}, "city = 99"),
    ):
        error = fault(asked.post("/api/modeller-use", use(starts, role, title) | more))
        assert words in error["found"]
    assert (contents(home) if home.exists() else {}) == before


def test_a_folder_that_cannot_be_written_is_named(asked, starts):
    home = asked.server.studio.modeller.home
    shutil.rmtree(home, ignore_errors=True)
    home.write_text("a file")
    try:
        error = fault(asked.post("/api/modeller-use", use(starts, "parent", "koch")))
        assert "cannot be written" in error["found"]
    finally:
        home.unlink()
