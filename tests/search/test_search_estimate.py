"""What a run will take is told by its first generation, and holds."""

import re
from dataclasses import replace
from datetime import timedelta

import pytest
from test_search_recipe import replaced
from test_search_run import run
from test_search_stopping import EVENING

from evocity.search import Search, read_recipe
from evocity.search.steering.estimate import (
    Estimate,
    describe_bound,
    estimate_of,
    first_representative,
)
from evocity.search.steering.stop_rules import size_of


def test_the_estimate_is_near_what_the_run_takes(toy, tmp_path):
    recipe = read_recipe(toy(recipe="[stop]\ndisk = '1 GB'\n"), generations=12)
    with Search(recipe, out=tmp_path / "run", workers=0) as search:
        found = estimate_of(tmp_path / "run", recipe, next(iter(search)))
    assert found.births == 13 * 8
    assert (found.needed, found.last, found.warning) == (None, None, "")
    run(toy(), tmp_path / "whole", workers=0, generations=12)
    size = size_of(tmp_path / "whole")
    assert 0.7 * size < found.size < 1.4 * size
    assert found.sizes[0] < size < found.sizes[1]
    assert "104 births of" in found.words
    assert "free) and 0:0" in found.words


def test_where_genomes_are_left_out_it_waits_for_a_generation_like_those_to_come(toy, tmp_path):
    recipe = read_recipe(toy(recipe="[log]\ngenomes = 'front'\n"), generations=12)
    found = []
    with Search(recipe, out=tmp_path / "run", workers=0) as search:
        for generation in search:
            if generation.number <= first_representative(recipe) == 1:
                search.flush()
                found.append(estimate_of(tmp_path / "run", recipe, generation))
    size = size_of(tmp_path / "run")
    assert found[0] is None
    assert found[1].births == 13 * 8
    assert 0.7 * size < found[1].size < 1.4 * size


@pytest.mark.slow
def test_the_range_of_sizes_holds_nine_of_ten_times(toy, tmp_path):
    held = 0
    for seed in range(10):
        path = replaced(toy(generations=5), "seed = 3", f"seed = {seed}")
        with Search(read_recipe(path), out=tmp_path / f"run-{seed}", workers=0) as search:
            found = estimate_of(tmp_path / f"run-{seed}", search.recipe, next(iter(search)))
            list(search)
        held += found.sizes[0] <= size_of(tmp_path / f"run-{seed}") <= found.sizes[1]
    assert held >= 9


def test_a_disk_that_is_too_small_is_told():
    found = Estimate(births=12_800, size=207_000_000, free=100_000_000, seconds=2700.0)
    assert found.words == (
        "12800 births of 11.3 kB to 40.4 kB: 145 MB to 518 MB of the disk (100 MB free) and "
        "0:22:30 to 2:15:00 more"
    )
    assert "the disk will not hold this run: about 207 MB are needed, at most 518 MB; 100 MB" in (
        found.warning
    )
    assert "the disk may not hold" in replace(found, free=207_000_000).warning
    assert replace(found, free=518_000_000).warning == ""
    limited = replace(found, needed=50_000_000, last=30, stop="disk = 50 MB")
    assert limited.words.endswith("; [stop] disk = 50 MB ends it by about generation 30")
    assert limited.warning == ""


def test_a_run_without_more_generations_needs_no_estimate(toy, tmp_path):
    recipe = read_recipe(toy(), generations=0)
    with Search(recipe, out=tmp_path / "run", workers=0) as search:
        assert estimate_of(tmp_path / "run", recipe, next(iter(search))) is None


@pytest.mark.parametrize(
    ("stop", "last"),
    [
        ('until = "22:10"', 10),
        ('until = "22:10"\ndisk = "1 GB"', 10),
        ('until = "7:00"', None),
        ('until = "22:10"\ndisk = "1 kB"', 0),
    ],
)
def test_what_ends_the_run_first_is_told(toy, tmp_path, stop, last):
    recipe = read_recipe(toy(recipe=f"[stop]\n{stop}\n"), generations=99)
    with Search(recipe, out=tmp_path / "run", workers=0, clock=lambda: EVENING) as search:
        first = replace(next(iter(search)), seconds_left=99 * 60.0)  # a minute each
    found = estimate_of(tmp_path / "run", recipe, first, clock=lambda: EVENING)
    assert found.last == last
    if last is not None:
        at = f"{EVENING + timedelta(minutes=10):%Y-%m-%d %H:%M}"
        told = "disk = 1 kB" if last == 0 else f"until = {at}"
        assert f"; [stop] {told} ends it by about generation {last}" in found.words
        assert found.needed < found.size


def test_a_run_stays_below_what_was_told_before_it_began(toy, tmp_path):
    recipe = read_recipe(toy(), generations=20)
    with Search(recipe, out=tmp_path / "run", workers=0) as search:
        search.prepare()
        told = describe_bound(tmp_path / "run", recipe)
        list(search)
    number, unit = re.match(r"168 births, at most ([\d.]+) (kB|MB) of the disk", told).groups()
    written = sum(size_of(tmp_path / "run" / kind) for kind in ("births", "membership"))
    assert written < float(number) * {"kB": 1e3, "MB": 1e6}[unit]
    assert told.endswith("the first 8 will tell how long it takes")
