"""`evocity score --within` and `evocity run` with parts of the map."""

import json

import numpy as np
import pytest
from cli_tools import AT_2_M, call, refused, write_recipe, write_town

from evocity import fitness
from evocity.coding import decode
from evocity.io import read_map
from evocity.store import RunLog

MASK = np.zeros((32, 32), np.float32)
MASK[4:20, 8:24] = 1
CORNER = np.tril(np.ones((32, 32), np.float32))


@pytest.fixture
def masks(tmp_path):
    np.save(tmp_path / "middle.npy", MASK)
    np.save(tmp_path / "corner.npy", CORNER)
    return tmp_path


def test_a_part_of_a_map_is_scored(masks):
    town = write_town(masks / "town.npy", side=32)
    city = read_map(town, metres_per_pixel=2.0)
    words = ("score", town, *AT_2_M, "--within", masks / "middle.npy")
    told = json.loads(call(*words, "--json").stdout)
    assert told["gsi"] == city.built[4:20, 8:24].mean()
    assert told["integrity"] is None
    shown = call(*words, "--fitness", "gsi").stdout
    assert "middle.npy, 16 × 16 px, 0.102 ha" in shown
    words = ("score", town, *AT_2_M, "--within", masks / "corner.npy")
    told = json.loads(call(*words, "--json").stdout)
    assert told["gsi"] == city.built[CORNER > 0].mean()
    assert told["lacunarity"] is None
    assert "528 px within 32 × 32 px" in call(*words, "--fitness", "gsi").stdout
    lines = call(*words).stdout
    assert "this part of the map is not a rectangle" in lines
    for name, says in (("lacunarity", "is not a rectangle"), ("integrity", "whole map: genome")):
        refused(masks, *words, "--fitness", name, says=says)


def test_parts_that_do_not_serve_are_refused(masks):
    town = write_town(masks / "town.npy", side=64)
    words = ("score", town, *AT_2_M, "--within")
    refused(
        masks, *words, masks / "middle.npy", says="middle has 32 × 32 px, but town has 64 × 64 px"
    )
    refused(masks, *words, masks / "none.npy", says="no file")
    np.save(masks / "none.npy", np.zeros((64, 64), np.float32))
    refused(masks, *words, masks / "none.npy", says="no value above 0 on the map town")


def test_a_run_is_scored_as_it_was_measured(masks):
    goals = 'name = "gsi"\ntarget = 0.3\nwithin = "corner.npy"'
    recipe = write_recipe(masks, fitness=goals)
    call("run", recipe, "--out", masks / "run")
    found = RunLog(masks / "run")
    row = found.births(1).to_pylist()[0]
    words = ("score", masks / "run", "--id", row["id"], "--within", masks / "corner.npy", "--json")
    told = json.loads(call(*words, "--fitness", "gsi", "--fitness", "fabric_distance").stdout)
    assert told["gsi"] == row["fitness.gsi@corner"]
    city = decode(found.genome(row["id"])).city.within(CORNER > 0)
    assert told["gsi"] == fitness.gsi(city)
    status = call("status", masks / "run").stdout
    assert "best gsi@corner" in status


def test_a_recipe_with_a_mask_of_another_size_is_refused(masks):
    goals = 'name = "gsi"\ntarget = 0.3\nwithin = "corner.npy"'
    recipe = write_recipe(masks, fitness=goals, map="pixels = 64")
    for seed, name in enumerate(("left", "right")):
        write_town(masks / f"{name}.npy", seed + 1, side=64)
    words = ("run", recipe, "--out", masks / "run")
    before = sorted(masks.iterdir())
    told = call(*words, code=2).stderr
    assert (
        "fitness[0] (gsi): within = 'corner.npy': corner has 32 × 32 px, but left has 64 × 64 px"
        in told
    )
    assert sorted(masks.iterdir()) == before
