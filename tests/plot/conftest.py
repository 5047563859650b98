"""Small runs of the toy towns, made once."""

from pathlib import Path
from unittest.mock import patch

import pytest
from toy_runs import write_toy
from written_runs import written

import evocity
from evocity.analysis import Run
from evocity.fitness import registry

WANTED = """
[[fitness]]
name = "alignment"
target = 0.2
[[fitness]]
name = "crumbs"
goal = "min"
max = 500
"""


def bred(recipe: Path) -> Path:
    folder = recipe.parent / "run"
    with (
        patch.dict(registry._from_files),
        evocity.Search(evocity.read_recipe(recipe), out=folder, workers=0) as search,
    ):
        list(search)
    return folder


@pytest.fixture(scope="session")
def night(tmp_path_factory) -> Path:
    """Four goals, one a target, one bounded; gsi recorded besides."""
    path = write_toy(tmp_path_factory.mktemp("night"), recipe=WANTED, workers=0)
    path.write_text(path.read_text().replace("seed = 3", 'seed = 3\nrecord = ["gsi"]'))
    return bred(path)


@pytest.fixture
def run(night) -> Run:
    return evocity.open_run(night)


@pytest.fixture(scope="session")
def cells(finished_runs, tmp_path_factory) -> Run:
    """A run of MAP-Elites."""
    return evocity.open_run(finished_runs.copy("grid", tmp_path_factory.mktemp("cells")))


@pytest.fixture(scope="session")
def broken(tmp_path_factory) -> Run:
    """Six births, of which two break a bound."""
    births = [{"id": n, "values": {"gsi": 0.1 * n, "fsi": 1.0 + n % 3}} for n in range(6)]
    wanted = [{"name": "gsi", "goal": "max", "max": 0.35}, {"name": "fsi", "goal": "max"}]
    return written(
        tmp_path_factory.mktemp("broken") / "run", [births[:3], births[3:]], wanted=wanted
    )
