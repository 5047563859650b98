"""Runs to look at, and a cache of their own."""

import os
import shutil
from pathlib import Path
from unittest.mock import patch

import pytest
from asking import OLD, Client
from served_scene import served_modules, studio

from evocity.studio import server
from evocity.studio.server import running_server


@pytest.fixture(autouse=True, scope="session")
def _cache_of_its_own(tmp_path_factory):
    with patch.dict(os.environ, {"XDG_CACHE_HOME": str(tmp_path_factory.mktemp("cache"))}):
        yield


@pytest.fixture(autouse=True, scope="session")
def _patient_servers():
    """On a busy machine a page's last requests take longer than the second that a server has at its
    end; it would answer them with 500."""
    with patch.object(server, "_PATIENCE", 60):
        yield


@pytest.fixture
def night(tmp_path) -> Path:
    """A small run of an older release: three generations, 24 births."""
    return shutil.copytree(OLD / "run-6", tmp_path / "runs" / "night")


@pytest.fixture
def asked(night):
    """Of `night`."""
    with running_server(night) as server:
        client = Client(server)
        client.open()
        yield client


@pytest.fixture(scope="session")
def modules():
    """The address of studio's modules."""
    with served_modules() as address:
        yield address


@pytest.fixture(scope="module")
def started(browser, modules):
    """A page for views of one city: a page gives no more than a few contexts of WebGL back."""
    with studio(browser, modules) as found:
        yield found


@pytest.fixture
def opened(started):
    """Opens a page that has a city; afterwards the console must have been silent."""
    with started.opener() as found:
        yield found
