"""Runs of the release of algorithms, 2026-11-23: survival by hypervolume contribution, steered
and with refinements (schema 5), and MAP-Elites (schema 6); and one of 2026-11-24, of three islands
with an algorithm each (schema 7), and one whose log leaves genomes out (schema 8); and two of
2026-11-26, of sites (schema 9) and with thumbnails (schema 10); and one of 2026-11-27, with settled
roofs (schema 11).
`tests/old/expected-algorithms.json` has what those releases made of them, and what they bred
next."""

import hashlib
import json
import shutil
from pathlib import Path

import pytest

import evocity
from evocity.report import write_report
from evocity.search import Search

OLD = Path(__file__).parent / "old"
EXPECTED = json.loads((OLD / "expected-algorithms.json").read_text(encoding="utf-8"))


@pytest.fixture(params=["run-5", "run-6", "run-7", "run-8", "run-9", "run-10", "run-11"])
def name(request):
    return request.param


def test_its_births_are_those_written(name):
    run, expected = evocity.open_run(OLD / name), EXPECTED[name]
    assert run.header.schema_version == int(name.removeprefix("run-"))
    marks = {"run-5": ("contribution",), "run-6": ("cell",), "run-8": ("contribution",)}
    marks |= dict.fromkeys(("run-9", "run-10", "run-11"), marks["run-5"])
    assert run.header.kind == ("site" if name == "run-9" else "fabric")
    assert run.header.settle == ("roofs" if name == "run-11" else True)
    assert run.header.genomes == ("front" if name == "run-8" else "all")
    assert run.header.marks == marks.get(name, ("cell", "contribution", "crowding"))
    assert run.births(columns=list(expected["births"][0])).to_pylist() == expected["births"]
    assert run.members(3).to_pylist() == expected["living"]
    assert run.history()[-1] == expected["history"]
    for identifier, told in expected["decoded"].items():
        genome, city = run.genome(int(identifier)), run[int(identifier)].city
        heights = hashlib.blake2b(city.heights.tobytes(), digest_size=8).hexdigest()
        found = {"digest": genome.digest, "heights": heights, "shape": list(city.shape)}
        assert found == told


@pytest.mark.slow_cases("run-5", "run-6", "run-8", "run-10")
def test_it_goes_on_as_it_would_have(name, tmp_path):
    shutil.copytree(OLD / name, tmp_path / name)
    shutil.copy(OLD / name / "recipe.toml", tmp_path / f"{name}.toml")
    with Search.resume(tmp_path / name, generations=4, workers=0, accept_changes=True) as search:
        list(search)
    run = evocity.open_run(tmp_path / name)
    bred = run.births(4).to_pylist()
    told = [[one["id"], one["parents"], one["operator"], one["genome"]] for one in bred]
    assert told == EXPECTED[name]["next"]
    page = write_report(tmp_path / name).read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") > 3
    assert len(evocity.archive(run).births) > 0
