"""What a run will take is told by its first generation, and holds."""

from dataclasses import replace

from test_search_run import run

from evocity.search import Search, read_recipe
from evocity.search.estimate import Estimate, estimate_of
from evocity.search.stopping import size_of


def test_the_estimate_is_near_what_the_run_takes(toy, tmp_path):
    recipe = read_recipe(toy(recipe="[stop]\ndisk = '1 GB'\n"), generations=12)
    with Search(recipe, out=tmp_path / "run", workers=0) as search:
        found = estimate_of(tmp_path / "run", recipe, next(iter(search)))
    assert found.births == 13 * 8
    assert (found.allowed, found.last, found.warning) == (10**9, None, "")
    run(toy(), tmp_path / "whole", workers=0, generations=12)
    size = size_of(tmp_path / "whole")
    assert 0.7 * size < found.size < 1.4 * size
    assert "about 104 births of" in found.words
    assert "free) and 0:0" in found.words


def test_a_disk_that_is_too_small_is_told():
    found = Estimate(births=12_800, size=207_000_000, free=100_000_000, seconds=2700.0)
    assert found.words == (
        "about 12800 births of 16.2 kB: 207 MB of the disk (100 MB free) and 0:45:00 more"
    )
    assert "about 207 MB are needed, 100 MB are free" in found.warning
    assert replace(found, free=207_000_000).warning == ""
    limited = replace(found, allowed=50_000_000, last=30)
    assert limited.words.endswith("; [stop] disk = 50 MB ends it by generation 30")
    assert limited.warning == ""


def test_a_run_without_more_generations_needs_no_estimate(toy, tmp_path):
    recipe = read_recipe(toy(), generations=0)
    with Search(recipe, out=tmp_path / "run", workers=0) as search:
        assert estimate_of(tmp_path / "run", recipe, next(iter(search))) is None
