"""The picture of a grid: what lies where, and what is told of it."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import evocity
from evocity.cli import main
from evocity.report import grid as room
from evocity.report import grid_picture, run_picture, write_report
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


def cells_drawn(picture, layout, count) -> set[tuple[int, int]]:
    """Cells that hold more than bare ground."""
    pixels = np.asarray(picture)
    found = set()
    for place in np.ndindex(*count):
        left, top = layout.corner(place)
        inside = pixels[top + 4 : top + layout.side - 4, left + 4 : left + layout.side - 4]
        if (inside != np.array(room.GROUND)).any():
            found.add(place)
    return found


def test_maps_lie_in_the_filled_cells(small):
    bins = small.columns.grids[None]
    picture = run_picture(small)
    layout = room._Layout.of(bins)
    assert layout.maps
    births = evocity.archive(small).births.to_pydict()
    filled = set(zip(births["cell.gsi"], births["cell.fsi"], strict=True))
    assert cells_drawn(picture, layout, (4, 3)) == filled
    assert 1 < len(filled) < 12
    # the second descriptor runs upwards
    assert layout.corner((0, 2))[1] < layout.corner((0, 0))[1]
    assert layout.corner((1, 0))[0] > layout.corner((0, 0))[0]


def test_many_cells_are_colours(small, monkeypatch):
    monkeypatch.setattr(room, "_MOST_MAPS", 0)
    bins = small.columns.grids[None]
    layout = room._Layout.of(bins)
    assert not layout.maps
    monkeypatch.setattr(room, "cities_of", None)  # no map is decoded
    births = bins.births.to_pydict()
    filled = set(zip(births["cell.gsi"], births["cell.fsi"], strict=True))
    picture = grid_picture(small)
    assert cells_drawn(picture, layout, (4, 3)) == filled
    best = bins.grid.places(births["cell"])[int(bins.worth.argmax())]
    left, top = layout.corner(best)
    middle = left + layout.side // 2, top + layout.side // 2
    assert picture.getpixel(middle) == room._BAR


def test_a_third_descriptor_makes_slices(tmp_path):
    run = bred(
        tmp_path,
        "['gsi', 'fsi', 'mean_height']",
        "[3, 3, 4]",
        "[[0, 1], [0, 9], [0, 40]]",
    )
    bins = run.columns.grids[None]
    layout = room._Layout.of(bins)
    births = bins.births.to_pydict()
    assert layout.slices == tuple(sorted(set(births["cell.mean_height"])))
    picture = grid_picture(run)
    assert picture.size[0] == layout.width
    places = zip(births["cell.gsi"], births["cell.fsi"], births["cell.mean_height"], strict=True)
    for place in places:
        left, top = layout.corner(place)
        assert 0 < left < left + layout.side < picture.width
        assert 0 < top < top + layout.side < layout.low
    empty = next(k for k in range(4) if k not in layout.slices)
    assert layout.corner((0, 0, empty)) is None


def test_grids_of_any_size_are_drawn(small, monkeypatch):
    from evocity.search.record.grid import binned
    from evocity.selection.cells import Grid

    for counts in ((1, 1), (1, 1000), (1000, 1000), (2, 37)):
        grid = Grid(("gsi", "fsi"), counts, ((0.0, 1.0), (0.0, 9.0)))
        monkeypatch.setitem(small.columns.grids, None, binned(small, grid))
        width, height = grid_picture(small).size
        assert max(width, height) < 1800


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
