"""Two finished runs of the toy towns: one that was resumed with islands, one plain."""

from pathlib import Path

import pytest
from toy_runs import forgotten

import evocity
from evocity.analysis import Run

__all__ = ["forgotten"]


@pytest.fixture(scope="session")
def night(finished_runs, tmp_path_factory) -> Path:
    """Three goals and a constraint, fsi and gsi recorded besides."""
    return finished_runs.copy("goals", tmp_path_factory.mktemp("night"))


@pytest.fixture(scope="session")
def archipelago(finished_runs, tmp_path_factory) -> Path:
    """Two islands, resumed after the second generation."""
    return finished_runs.copy("islands", tmp_path_factory.mktemp("islands"))


@pytest.fixture
def run(night) -> Run:
    return evocity.open_run(night)
