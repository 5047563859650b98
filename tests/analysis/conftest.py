"""Two small runs of the toy towns, made once: one that was resumed with islands, one plain."""

from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import pytest
from toy_runs import forgotten, write_toy

import evocity
from evocity.analysis import Run
from evocity.fitness import registry

__all__ = ["forgotten"]

WANTED = """
[[fitness]]
name = "alignment"
[[fitness]]
name = "crumbs"
goal = "min"
max = 500
"""

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


def bred(folder: Path, recipe: str, generations: Sequence[int], **run: str) -> Path:
    """A run that was stopped and resumed after each of these ``generations`` but the last; ``run``:
    more keys of ``[run]``."""
    path = write_toy(folder, recipe=recipe, generations=generations[0], workers=0)
    more = "".join(f"\n{key} = {value}" for key, value in run.items())
    path.write_text(path.read_text().replace("seed = 3", "seed = 3" + more))
    with patch.dict(registry._from_files):
        with evocity.Search(evocity.read_recipe(path), out=folder / "run") as search:
            list(search)
        for more in generations[1:]:
            with evocity.Search.resume(folder / "run", generations=more) as search:
                list(search)
    return folder / "run"


@pytest.fixture(scope="session")
def night(tmp_path_factory) -> Path:
    """Three goals and a constraint, fsi and gsi recorded besides."""
    return bred(tmp_path_factory.mktemp("night"), WANTED, (3,), record='["fsi", "gsi"]')


@pytest.fixture(scope="session")
def archipelago(tmp_path_factory) -> Path:
    """Two islands, resumed after the second generation."""
    return bred(tmp_path_factory.mktemp("islands"), WANTED + ISLANDS, (2, 4))


@pytest.fixture
def run(night) -> Run:
    return evocity.open_run(night)
