"""`evocity scene` and `evocity library new`: options, and what they refuse."""

import numpy as np
from cli_tools import call, refused
from towns import TWO_CLASSES, four_houses

from evocity.scene.library import Library


def test_the_command_draws_as_it_is_asked(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1)
    call(*words, "-o", tmp_path / "plain.png", "--width", 300)
    call(*words, "-o", tmp_path / "plan.png", "--width", 300, "--tilt", 90, "--azimuth", 0)
    call(*words, "-o", tmp_path / "classes.png", "--width", 300, "--colours", "classes")
    drawn = {(tmp_path / f"{name}.png").read_bytes() for name in ("plain", "plan", "classes")}
    assert len(drawn) == 3
    refused(
        tmp_path,
        *words,
        "-o",
        tmp_path / "x.glb",
        "--tilt",
        60,
        says="--tilt cannot be used with the output x.glb",
    )
    assert "'--seed'" in call(*words, "-o", tmp_path / "x.glb", "--seed", -1, code=2).stderr
    refused(
        tmp_path, *words, "-o", tmp_path / "x.glb", "--storeys", "1e30", says="metres, 0.1 to 100"
    )


def test_nothing_that_is_read_is_written_over(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1)
    table = tmp_path / "own.city.json"
    table.write_text(TWO_CLASSES)
    refused(tmp_path, *words, "--classes", table, "-o", table, says="both the input and the output")
    Library.of(four_houses(), licence="CC0-1.0").write(tmp_path / "objects")
    path = tmp_path / "objects" / "objects.gpkg"
    library = ("--library", tmp_path / "objects", "-o", path)
    refused(tmp_path, *words, *library, says="both the input and the output")
    own = ("--licence", "CC0-1.0", "-o", tmp_path / "objects")
    refused(tmp_path, "library", "new", path, *own, says="both the input and the output")


def test_maps_of_one_name_make_a_library(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        np.save(tmp_path / folder / "town.npy", four_houses().heights)
    maps = [tmp_path / folder / "town.npy" for folder in ("a", "b")]
    out = tmp_path / "objects"
    call("library", "new", *maps, "--metres-per-pixel", 1, "--licence", "CC0-1.0", "-o", out)
    assert {one.rpartition("-")[0] for one in Library.read(out).ids} == {"town", "town (2)"}


def test_objects_of_one_atmosphere(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    Library.of(four_houses(), licence="CC0-1.0", atmosphere="old town").write(tmp_path / "objects")
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1, "-o", tmp_path / "x.glb")
    library = ("--library", tmp_path / "objects", "--atmosphere")
    assert "4 replaced by objects of the library" in call(*words, *library, "old town").output
    refused(tmp_path, *words, *library, "old twon", says="one of 'old town'")
    refused(
        tmp_path, *words, "--atmosphere", "old town", says="--atmosphere is given without --library"
    )


def test_a_library_of_other_classes_is_told(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    (tmp_path / "own.toml").write_text(TWO_CLASSES)
    Library.of(four_houses(), licence="CC0-1.0").write(tmp_path / "objects")
    told = call(
        "scene", tmp_path / "town.npy", "--metres-per-pixel", 1, "--classes", tmp_path / "own.toml",
        "--library", tmp_path / "objects", "-o", tmp_path / "x.glb",
    )  # fmt: skip
    assert "the library has building, the map high" in told.stderr
