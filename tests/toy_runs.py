"""Two toy towns of 64², measures that cost nothing, and recipes made of them."""

import json
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest

from evocity.fitness import registry
from evocity.store.event_chain import EventLog
from evocity.store.run_directory import RunDirectory

MEASURES = """
import hashlib, os, time
import evocity

def number(city):
    return int.from_bytes(hashlib.blake2b(city.heights.tobytes(), digest_size=4).digest(), "big")

@evocity.fitness(goal="max")
def spread(city):
    print("noise on standard output")
    return float(city.heights.std())

@evocity.fitness(goal="min", unit="m")
def roof(city):
    return float(city.heights.mean())
"""

RECIPE = """
[run]
name = "toy"
seed = 3
population = {population}
generations = {generations}
[map]
pixels = 64
metres_per_pixel = 2.0
[genome]
{genome}
[[parents]]
map = "left.npy"
[[parents]]
map = "right.npy"
[operators]
pavement_fusion = {{ weight = 4, size_max = 6, size_min = 2 }}
lambda_crossover = 1
mutation = 2
[[fitness]]
file = "toys.py"
[evaluation]
workers = {workers}
timeout = {timeout}
max_failures = {max_failures}
"""


def town(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    lots = np.where(rng.random((16, 16)) < 0.5, rng.integers(3, 20, (16, 16)), 0)
    return lots.repeat(4, 0).repeat(4, 1).astype(np.float32)[:64, :64]


@pytest.fixture(autouse=True)
def forgotten():
    """What a test loads from files is not known to the next."""
    with patch.dict(registry._from_files):
        yield


def unsealed(path) -> dict:
    """The provenance at ``path``, without its seal: it may be changed and written again."""
    told = json.loads(path.read_text(encoding="utf-8"))
    told.pop("seal", None)
    return told


def append_events(out, *events):
    """Append ``events`` to the run at ``out``, with their checksums."""
    log = EventLog(RunDirectory(out), "events.jsonl")
    for event in events:
        log.append(event)


def without_digests(out):
    """Make the run at ``out`` one of before its sources had digests."""
    path = out / "provenance.json"
    told = unsealed(path)
    del told["files"]
    path.write_text(json.dumps(told), encoding="utf-8")


def write_toy(folder, measures="", recipe="", **settings):
    """Write a recipe beside its maps and measures into a ``folder``; returns its path. Range blocks
    of one side, not fitted, unless ``genome`` has other lines."""
    np.save(folder / "left.npy", np.roll(town(1), 1, axis=0))
    np.save(folder / "right.npy", np.roll(town(2), 2, axis=1))
    (folder / "toys.py").write_text(MEASURES + measures)
    chosen = {
        "population": 8,
        "generations": 3,
        "workers": 0,
        "timeout": 30.0,
        "max_failures": 0.5,
        "genome": "block = 4\nfit = false",
    }
    path = folder / "toy.toml"
    path.write_text(RECIPE.format(**(chosen | settings)) + recipe)
    return path


@pytest.fixture
def toy(tmp_path):
    """`write_toy` in the test's own folder."""
    return partial(write_toy, tmp_path)
