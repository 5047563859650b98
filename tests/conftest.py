"""Fixtures that many tests share, and what no test may leave behind for the next."""

import contextlib
import gc
import os
import signal
from collections.abc import Iterator
from unittest.mock import patch

import pytest
from budget import pytest_runtest_call, pytest_terminal_summary
from chromium import started
from finished_runs import FinishedRuns, of_invocation
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from towns import draw_town

from evocity.citymap import CityMap
from evocity.fitness import registry

__all__ = ["pytest_runtest_call", "pytest_terminal_summary"]

# Other work on the machine, or a library that is loaded when it is first used, is no fault. The
# gate tries the same examples each time; `make test-long` explores, and its finds become examples.
settings.register_profile("evocity", deadline=None, derandomize=True, database=None)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "evocity"))
# Hypothesis also draws constants of the modules loaded so far, which it must read for that: the
# tests before would decide the examples of the next.
if "HYPOTHESIS_PROFILE" not in os.environ and hasattr(providers, "_get_local_constants"):
    providers._get_local_constants = lambda: providers._local_constants  # none, ever

# Tests make few cycles, and looking for them among all that a process has loaded takes a while.
gc.set_threshold(50_000, 20, 100)

# A shell's background job ignores Ctrl-C, and so would all it starts; some tests press it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


#: How names of files end whose tests use the browser of the process.
IN_A_BROWSER = ("test_axonometry", "test_stroll", "test_walk", "_in_a_browser")
#: Files with long tests: the other processes would wait for the process that began them last.
FIRST = (
    *("test_typed_surface.py", "test_growth.py", "test_notebooks.py", "test_docs.py"),
    *("test_faults_night.py", "test_faults_workers.py", "test_faults_inputs.py"),
)


def pytest_ignore_collect(collection_path, config):
    """Whether a file need not be imported: of slow tests alone, most files have none."""
    if config.option.markexpr.startswith("slow") and collection_path.suffix == ".py":
        return True if b"slow" not in collection_path.read_bytes() else None
    return None


def pytest_collection_modifyitems(items):
    for one in items:
        if (mark := one.get_closest_marker("slow_cases")) and one.callspec.id in mark.args:
            one.add_marker("slow")
    # a browser stays open to the end, and Playwright's loop of events would be in the way of others
    items.sort(key=lambda one: (one.path.name not in FIRST) + one.path.stem.endswith(IN_A_BROWSER))


@pytest.fixture(autouse=True, scope="session")
def _state_of_its_own(tmp_path_factory):
    """What evocity remembers for its user stays out of the home of whoever tests."""
    with patch.dict(os.environ, {"XDG_STATE_HOME": str(tmp_path_factory.mktemp("state"))}):
        yield


@pytest.fixture(autouse=True, scope="session")
def _no_waiting_for_disks():
    """Files outlive the kill of a process without being flushed, and no test cuts the power."""
    with patch("os.fsync", lambda file: None):
        yield


@pytest.fixture(scope="session")
def town() -> CityMap:
    return draw_town(1)


@pytest.fixture(scope="session")
def other_town() -> CityMap:
    return draw_town(2)


@pytest.fixture(scope="session")
def browser():
    """The browser of this process, for pages without a window."""
    with started() as browser:
        yield browser


@pytest.fixture(scope="session")
def finished_runs(tmp_path_factory) -> FinishedRuns:
    """Finished runs, of which a fixture or test copies its own."""
    return of_invocation(tmp_path_factory.getbasetemp())


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
