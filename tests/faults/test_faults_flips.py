"""Bits flipped in all that decides the births of a run: a resumed run breeds the same births, or
evocity names what was changed. Nothing is silent."""

import shutil
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from toy_runs import write_toy

from evocity.errors import EvocityError
from evocity.fitness import registry
from evocity.search import Search, read_recipe, replay
from evocity.store import RunLog

PARTS = """
[[fitness]]
name = "fabric_distance"
reference = ["model.npy"]
[[fitness]]
name = "gsi"
goal = "max"
within = "disc.npy"
[locked]
mask = "mask.npy"
"""
#: The parts of a run, and the files of each.
KINDS = {
    "events": ["events.jsonl"],
    "provenance": ["provenance.json"],
    "recipes": ["recipe.toml", "recipe-1.toml"],
    "sources": ["sources/*", "references/*", "within/*"],
    "fitness": ["fitness/*"],
    "log": ["births/*", "membership/*"],
}
LAST = 4


def finish(path, generations=LAST):
    """Breed the run at ``path`` to its end, in this process."""
    with Search.resume(path, generations=generations, workers=0, trust=True) as search:
        for _ in search:
            pass


def rows(path) -> list[dict]:
    run = RunLog(path)
    return [*run.births().drop_columns(["seconds"]).to_pylist(), *run.members().to_pylist()]


@pytest.fixture(scope="module")
def steered(tmp_path_factory):
    """A run of three generations of LAST, with picks, weights, another recipe, references, a mask,
    a lock and a measure of its own whose file is gone; and its births to the end."""
    folder = tmp_path_factory.mktemp("steered")
    rng = np.random.default_rng(3)
    mask = np.zeros((64, 64), np.float32)
    mask[:8, :8] = 1
    disc = np.hypot(*np.mgrid[-32:32, -32:32]) < 20
    with patch.dict(registry._from_files):
        recipe = write_toy(folder, recipe=PARTS, generations=LAST)
        np.save(folder / "model.npy", np.load(folder / "right.npy").T)
        np.save(folder / "disc.npy", disc.astype(np.float32))
        np.save(folder / "mask.npy", mask)
        out = folder / "run"
        with Search(read_recipe(recipe), out=out, workers=0) as search:
            for generation in search:
                if generation.number == 1:
                    search.pick([int(rng.integers(8, 16))], share=0.9)
                    break
        text = recipe.read_text().replace("mutation = 2", "mutation = 3")
        recipe.write_text(text)
        with Search.resume(out, recipe=read_recipe(recipe), workers=0) as search:
            next(iter(search))
            search.reweight(lambda_crossover=5)
            search._carry_out_commands()
        for name in ("toys.py", "left.npy", "right.npy", "model.npy", "disc.npy", "mask.npy"):
            (folder / name).unlink()
        shutil.copytree(out, folder / "whole")
        finish(folder / "whole")
    return out, rows(folder / "whole")


def flipped(path: Path, bit: int) -> None:
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


def outcome(path, expected) -> str:
    """What a resume of the run at ``path``, and reading it, give: "same", "refused" or "other"."""
    try:
        if RunLog(path).damaged:
            return "refused"
        finish(path)
        return "same" if rows(path) == expected else "other"
    except EvocityError:
        return "refused"


def check(steered, kind: str, count: int, seed: int) -> dict[str, int]:
    """Flip ``count`` bits, one at a time; return how often a resume ended in which way."""
    out, expected = steered
    rng, counts = np.random.default_rng(seed), {"same": 0, "refused": 0}
    files = sorted(path for pattern in KINDS[kind] for path in out.glob(pattern))
    sizes = np.array([path.stat().st_size for path in files if path.is_file()])
    files = [path for path in files if path.is_file()]
    copy = out.with_name("flipped")
    for _ in range(count):
        shutil.copytree(out, copy)
        at = int(rng.choice(len(files), p=sizes / sizes.sum()))
        bit = int(rng.integers(int(sizes[at]) * 8))
        flipped(copy / files[at].relative_to(out), bit)
        try:
            with patch.dict(registry._from_files):
                found = outcome(copy, expected)
        finally:
            shutil.rmtree(copy)
        assert found != "other", (files[at].name, bit)
        counts[found] += 1
    return counts


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("kind", KINDS)
def test_a_bit_that_is_flipped_changes_no_birth_silently(steered, kind):
    counts = check(steered, kind, 300, 11)
    print(kind, counts)
    assert counts["refused"] > 75


def test_an_earlier_recipe_that_was_changed_is_named(steered, tmp_path):
    """No birth of a resumed run depends on it; those that it bred are not replayed."""
    run = shutil.copytree(steered[0], tmp_path / "run")
    assert all(one.same for one in replay(run, [9, 10], trust=True))
    path = run / "recipe-1.toml"
    path.write_text(path.read_text().replace("mutation = 2", "mutation = 5"))
    with pytest.raises(EvocityError, match="recipe"):
        replay(run, [9, 10], trust=True)


@pytest.mark.parametrize("kind", KINDS)
def test_some_bits_that_are_flipped_change_no_birth_silently(steered, kind):
    assert check(steered, kind, 5, 5)["refused"]
