"""`evocity shape`."""

import json

import pytest
from cli_tools import call, refused
from PIL import Image

from evocity.shapes import known, wire, write_shape


def test_shapes_are_drawn(tmp_path):
    call("shape", "show", "koch", "--side", 64, "-o", tmp_path / "koch.png")
    with Image.open(tmp_path / "koch.png") as picture:
        assert picture.size == (64, 64)
    call("shape", "show", "levy", "--depth", 4, "-o", tmp_path / "levy.svg")
    assert (tmp_path / "levy.svg").read_text().startswith("<svg")
    call("shape", "show", "menger", "--depth", 1, "-o", tmp_path / "menger.glb")
    assert (tmp_path / "menger.glb").read_bytes()[:4] == b"glTF"
    write_shape(wire([(0, 0), (0.4, 0.3), (1, 0)]), tmp_path / "own.json")
    call("shape", "show", tmp_path / "own.json", "--side", 64, "-o", tmp_path / "own.png")
    assert (tmp_path / "own.png").is_file()


def test_dimensions_and_counts_are_told():
    told = json.loads(call("shape", "dimension", "koch", "--side", 729, "--json").stdout)
    assert told["dimension"] == pytest.approx(1.2618595071429148, abs=1e-12)
    assert told["boxes"] == pytest.approx(told["dimension"], abs=0.03)
    assert json.loads(call("shape", "count", "menger", "--depth", 9, "--json").stdout) == {
        "count": 20**9
    }
    assert call("shape", "count", "koch", "--depth", 3).stdout == "64\n"
    fern = call("shape", "dimension", "fern", "--side", 256)
    assert "exact: unknown" in fern.stdout
    assert json.loads(call("shape", "dimension", "fern", "--side", 256, "--json").stdout)[
        "dimension"
    ] is None  # fmt: skip


def test_one_shape_becomes_another(tmp_path):
    done = call("shape", "morph", "koch", "levy", "-t", 0.5, "--side", 64, "-o", tmp_path / "a.png")
    assert "0→0, 1→1, 2→2, 3→3" in done.stderr
    assert (tmp_path / "a.png").is_file()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["show", "kock", "-o", "{}/a.png"], "did you mean koch"),
        (["show", "menger", "-o", "{}/a.png"], "the shape is not two-dimensional"),
        (["show", "koch", "-o", "{}/a.gif"], "a name that ends in .png, .svg or .glb"),
        (["show", "koch", "-o", "{}/a.svg"], "add --depth"),
        (["show", "koch", "-o", "{}/none/a.png"], "cannot be written"),
        (["show", "{}/none.json", "-o", "{}/a.png"], "No such file"),
        (["show", "koch", "--depth", "40", "-o", "{}/a.png"], "pieces"),
        (["morph", "koch", "menger", "-t", "0.5", "-o", "{}/a.png"], "is three-dimensional"),
    ],
)
def test_what_cannot_be_drawn_is_refused(tmp_path, words, says):
    refused(tmp_path, "shape", *(word.format(tmp_path) for word in words), says=says)


def test_files_at_fault_leave_nothing(tmp_path):
    write_shape(known("koch"), tmp_path / "a.json")
    (tmp_path / "a.json").write_text((tmp_path / "a.json").read_text()[:40])
    words = "shape", "show", tmp_path / "a.json", "-o", tmp_path / "b.png"
    refused(tmp_path, *words, says="not a shape")
