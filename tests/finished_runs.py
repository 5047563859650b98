"""Finished runs that many tests read or go on with: each is made once an invocation of pytest.

The process that needs a run first makes it, in a folder that all processes share; each fixture gets
a copy of the folder, so that a test changes the run of no other.
"""

import contextlib
import io
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np
from toy_runs import town, write_toy

import evocity
from evocity.fitness import registry

try:
    import fcntl
except ImportError:  # Windows: each process makes its own
    fcntl = None

#: More measures of a toy run, of which one is a constraint.
GOALS = """
[[fitness]]
name = "alignment"
[[fitness]]
name = "crumbs"
goal = "min"
max = 500
"""
#: Two islands of them.
ISLANDS = """
[[islands]]
name = "towers"
measures = ["spread", "roof"]
[[islands]]
name = "crowd"
measures = ["alignment"]
[migration]
every = 1
migrants = 2
"""
GRID = """
[run]
seed = 3
population = 10
generations = 2
[map]
pixels = 64
metres_per_pixel = 2.0
[genome]
block = 4
fit = false
[[parents]]
map = "left.npy"
[[parents]]
map = "right.npy"
[[fitness]]
name = "alignment"
[search]
algorithm = "map_elites"
descriptors = ["gsi", "mean_height"]
grid = [4, 3]
ranges = [[0.2, 0.8], [2.0, 8.0]]
"""
WINDOW = "[search]\nwindow = 4\n"
LEFT_OUT = '[log]\ngenomes = "front"\n'


def search(recipe: Path, generations: Sequence[int] = ()) -> None:
    """Run a ``recipe`` in ``run`` beside it, and go on to each of these ``generations``."""
    folder = recipe.parent / "run"
    with patch.dict(registry._from_files), contextlib.redirect_stdout(io.StringIO()):
        with evocity.Search(evocity.read_recipe(recipe), out=folder, workers=0) as begun:
            list(begun)
        for more in generations:
            with evocity.Search.resume(folder, generations=more, workers=0) as resumed:
                list(resumed)


def _plain(folder: Path) -> None:
    search(write_toy(folder))


def _goals(folder: Path) -> None:
    path = write_toy(folder, recipe=GOALS)
    path.write_text(path.read_text().replace("seed = 3", 'seed = 3\nrecord = ["fsi", "gsi"]'))
    search(path)


def _islands(folder: Path) -> None:
    search(write_toy(folder, recipe=GOALS + ISLANDS, generations=2), [4])


def _grid(folder: Path) -> None:
    for name, seed in (("left", 1), ("right", 2)):
        np.save(folder / f"{name}.npy", town(seed))
    path = folder / "cells.toml"
    path.write_text(GRID, encoding="utf-8")
    search(path)


def _window(folder: Path) -> None:
    search(write_toy(folder, population=6, generations=4, recipe=WINDOW))


def _left_out(folder: Path) -> None:
    search(write_toy(folder, recipe=LEFT_OUT))


def _commanded(folder: Path) -> None:
    from cli_tools import call, write_recipe

    call("run", write_recipe(folder), "--out", folder / "run", report=True)


def _kind(kind: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        from kind_runs import written

        search(written(folder, kind))

    return make


#: What each run is: a toy with three generations, the same with four goals, with two islands and a
#: resume, a grid of MAP-Elites, a window, a log that leaves genomes out, `evocity run` with its
#: report, and the three kinds of chromosomes that are no fabric.
MAKERS: dict[str, Callable[[Path], None]] = {
    "plain": _plain,
    "goals": _goals,
    "islands": _islands,
    "grid": _grid,
    "window": _window,
    "left out": _left_out,
    "commanded": _commanded,
    "shape": _kind("shape"),
    "curve": _kind("curve"),
    "site": _kind("site"),
}


class FinishedRuns:
    """The finished runs of this invocation, below a folder that its processes share."""

    def __init__(self, shared: Path):
        self._shared = shared

    def copy(self, name: str, folder: Path) -> Path:
        """Copy the run of this ``name``, with its recipe, maps and measures, into a ``folder``;
        returns the path of the run in it."""
        shutil.copytree(self._made(name), folder, dirs_exist_ok=True)
        return folder / "run"

    def _made(self, name: str) -> Path:
        place, mark = self._shared / name, self._shared / f"{name}.made"
        with self._locked(name):
            if not mark.exists():
                shutil.rmtree(place, ignore_errors=True)  # of a process that was stopped
                place.mkdir(parents=True)
                MAKERS[name](place)
                mark.touch()
        return place

    @contextlib.contextmanager
    def _locked(self, name: str) -> Iterator[None]:
        self._shared.mkdir(exist_ok=True)
        with open(self._shared / f"{name}.lock", "w") as lock:
            if fcntl is not None:
                fcntl.flock(lock, fcntl.LOCK_EX)
            yield


def of_invocation(base: Path) -> FinishedRuns:
    """The runs below ``base``, the folder for temporary files of this process."""
    shared = "PYTEST_XDIST_WORKER" in os.environ and fcntl is not None
    return FinishedRuns((base.parent if shared else base) / "finished-runs")
