"""Runs of the release before algorithms, a2f85c3: on leaves (schema 3), and with measures recorded
besides (schema 4). `tests/old/expected-leaves.json` has what that release made of them, and what it
bred next. Genome files on leaves (schema 3) and with settled roofs (schema 4), of 2026-11-27."""

import hashlib
import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import evocity
from evocity.fitness import registry
from evocity.genome.writer import GENOME_KEY
from evocity.report import write_report
from evocity.search import Search
from evocity.selection.algorithms import algorithms

OLD = Path(__file__).parent / "old"
EXPECTED = json.loads((OLD / "expected-leaves.json").read_text(encoding="utf-8"))


@pytest.fixture(params=["run-3", "run-4"])
def name(request):
    return request.param


def test_its_births_are_those_written(name):
    run, expected = evocity.open_run(OLD / name), EXPECTED[name]
    assert run.header.schema_version == int(name[-1])
    assert run.header.marks == ("crowding",)
    columns = list(expected["births"][0])
    assert run.births(columns=columns).to_pylist() == expected["births"]
    assert run.members(3)["id"].to_pylist() == expected["living"]
    for identifier, told in expected["decoded"].items():
        genome = run.genome(int(identifier))
        city = evocity.decode(genome).city
        heights = hashlib.blake2b(city.heights.tobytes(), digest_size=8).hexdigest()
        found = {"digest": genome.digest, "heights": heights, "shape": list(city.shape)}
        assert found == told


@pytest.mark.slow_cases("run-3")
def test_it_goes_on_as_it_would_have(name, tmp_path):
    """By the algorithm of its release, with nobody kept because they differ."""
    shutil.copytree(OLD / name, tmp_path / name)
    shutil.copy(OLD / name / "recipe.toml", tmp_path / f"{name}.toml")
    with Search.resume(tmp_path / name, generations=5, workers=0, accept_changes=True) as search:
        assert search.recipe.search.settings["algorithm"] == "nsga2"
        assert search.recipe.search.settings["distinct"] == 0
        list(search)
    run = evocity.open_run(tmp_path / name)
    assert run.header == evocity.open_run(OLD / name).header
    bred = run.births(columns=["generation", "id", "parents", "operator"]).to_pylist()
    # height scaling has changed since, and so the children of generation 4
    later = [[one["id"], one["parents"], one["operator"]] for one in bred if one["generation"] == 4]
    assert later == EXPECTED[name]["next"][:6]
    assert set(run.members(5).column_names) == {"generation", "slot", "id", "rank", "crowding"}
    page = write_report(tmp_path / name).read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") > 3


@pytest.mark.parametrize("version", [3, 4])
def test_a_genome_on_leaves_is_read_as_it_was(version, tmp_path):
    path, expected = OLD / f"genome-{version}.parquet", EXPECTED[f"genome-{version}.parquet"]
    genome = evocity.read_genome(path)
    assert genome.settle == (True if version == 3 else "roofs")
    assert genome.turn.any()
    assert not genome.pavement.uniform
    city = evocity.decode(genome).city
    heights = hashlib.blake2b(city.heights.tobytes(), digest_size=8).hexdigest()
    assert (genome.digest, heights) == (expected["digest"], expected["heights"])
    assert list(city.shape) == expected["shape"]
    for name, value in expected["values"].items():
        assert registry.get(name)(city, genome=genome) == pytest.approx(value, rel=1e-6, abs=1e-9)
    genome.write(tmp_path / "again.parquet")
    again = evocity.read_genome(tmp_path / "again.parquet")
    assert (again, again.made, again.settle) == (genome, genome.made, genome.settle)
    for file in (path, tmp_path / "again.parquet"):
        about = json.loads(pq.read_schema(file).metadata[GENOME_KEY])
        assert about["schema_version"] == version


@pytest.mark.parametrize("kind", algorithms().values(), ids=lambda kind: kind.name)
def test_columns_of_every_algorithm_are_told_apart(kind):
    assert not {"generation", "slot", "id", "rank"} & set(kind.marks)
