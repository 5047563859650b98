"""The picture of a grid: what lies where, and what is told of it."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import evocity
from evocity.cli import main
from evocity.report import contact_sheet, grid_picture, run_picture, write_report
from evocity.report import grid as room
from evocity.search import Search, read_recipe

RECIPE = """
run = { name = "small", population = 6, generations = 1 }
map = { pixels = 64 }
parents = [{ map = "lyon-1er" }, { map = "new-york-west-village" }]
genome = { fit = false }
fitness = [{ name = "autosimilarity" }]
search = { algorithm = "map_elites", descriptors = %s, grid = %s, ranges = %s }
"""


def bred(folder, descriptors="['gsi', 'fsi']", grid="[4, 3]", ranges="[[0, 1], [0, 9]]"):
    (folder / "small.toml").write_text(RECIPE % (descriptors, grid, ranges), encoding="utf-8")
    with Search(read_recipe(folder / "small.toml"), out=folder / "run", workers=0) as search:
        for _ in search:
            pass
    return evocity.open_run(folder / "run")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return bred(tmp_path_factory.mktemp("grid"))


def test_the_picture_of_a_run_is_its_grid(small, monkeypatch):
    picture = run_picture(small)
    assert np.array_equal(picture, grid_picture(small))
    assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 100  # maps
    monkeypatch.setattr(room, "find_spec", lambda name: None)
    assert np.array_equal(run_picture(small), contact_sheet(small))  # without matplotlib


def test_a_third_descriptor_makes_slices(tmp_path):
    run = bred(
        tmp_path,
        "['gsi', 'fsi', 'mean_height']",
        "[3, 3, 4]",
        "[[0, 1], [0, 9], [0, 40]]",
    )
    assert min(grid_picture(run).size) > 400
    with pytest.raises(ValueError, match="without a grid"):
        grid_picture(run, "x")


@pytest.mark.slow
def test_grids_of_any_size_are_drawn(small, monkeypatch):
    from evocity.plot import grids
    from evocity.selection.cells import Grid

    for counts in ((1, 1), (1, 1000), (1000, 1000), (2, 37)):
        grid = Grid(("gsi", "fsi"), counts, ((0.0, 1.0), (0.0, 9.0)))
        monkeypatch.setattr(grids, "grid_of_run", lambda run, island, grid=grid: grid)
        width, height = grid_picture(small).size
        assert max(width, height) < 2400


def test_the_report_has_the_grid_and_the_figures(small, tmp_path):
    text = write_report(small.path, tmp_path / "report.html").read_text(encoding="utf-8")
    data = json.loads(text.split('id="page">')[1].split("</script>")[0])
    told, grid = data["document"]["about"]["grid"], small.columns.grids[None].grid
    assert told["counts"] == list(grid.counts)
    assert told["edges"] == [grid.edges(axis).tolist() for axis in range(len(grid.counts))]
    figures = {one["name"] for one in data["document"]["curves"] if one["group"] == "figure"}
    for name in ("coverage", "cells", "qd score"):
        assert f">{name}</abbr></dt>" in text
        assert name.replace(" ", "_") in figures


def test_status_and_show_tell_of_the_grid(small, tmp_path):
    told = small.status()["algorithm"]
    found = CliRunner().invoke(main, ["status", str(small.path)])
    assert found.exit_code == 0
    lines = dict(line.split("  ", 1) for line in found.stdout.splitlines() if "  " in line)
    assert float(lines["cells"].strip()) == told["cells"]
    assert float(lines["coverage"].strip()) == pytest.approx(told["coverage"], rel=1e-3)
    assert float(lines["qd score"].strip()) == pytest.approx(told["qd_score"], rel=1e-3)
    found = CliRunner().invoke(main, ["show", str(small.path), "-o", str(tmp_path / "grid.png")])
    assert found.exit_code == 0
    with Image.open(tmp_path / "grid.png") as picture:
        assert picture.size == grid_picture(small).size
