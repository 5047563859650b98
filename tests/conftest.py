"""Fixtures that many tests share, and what no test may leave behind for the next."""

import contextlib
import os
import signal
from collections.abc import Iterator
from unittest.mock import patch

import pytest
from hypothesis import settings
from towns import draw_town

from evocity.citymap import CityMap
from evocity.fitness import registry

# Other work on the machine, or a library that is loaded when it is first used, is no fault.
settings.register_profile("evocity", deadline=None)
settings.load_profile("evocity")

# A shell's background job ignores Ctrl-C, and so would all it starts; some tests press it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


#: Files of a minute of tests, and such as have one long test: begun last, one process would be
#: waited for by all others.
FIRST = ("test_growth.py", "test_notebooks.py", "test_docs.py", "test_faults_night.py")


def pytest_collection_modifyitems(items):
    items.sort(key=lambda one: one.path.name not in FIRST)


@pytest.fixture(autouse=True, scope="session")
def _state_of_its_own(tmp_path_factory):
    """What evocity remembers for its user stays out of the home of whoever tests."""
    with patch.dict(os.environ, {"XDG_STATE_HOME": str(tmp_path_factory.mktemp("state"))}):
        yield


@pytest.fixture(scope="session")
def town() -> CityMap:
    return draw_town(1)


@pytest.fixture(scope="session")
def other_town() -> CityMap:
    return draw_town(2)


@contextlib.contextmanager
def _measures_as_they_were() -> Iterator[None]:
    registry.measures()  # the package's and plugins' are there before
    with patch.dict(registry._table), patch.dict(registry._from_files):
        yield


@pytest.fixture(autouse=True, scope="module")
def _no_measure_outlives_its_module():
    with _measures_as_they_were():
        yield


@pytest.fixture(autouse=True)
def _no_measure_outlives_its_test(_no_measure_outlives_its_module):
    with _measures_as_they_were():
        yield
