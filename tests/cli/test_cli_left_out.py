"""Whoever reads a run whose log leaves genomes out has them all the same."""

import json

import numpy as np
from cli_tools import call
from toy_runs import forgotten

import evocity
from evocity.search import Search

__all__ = ["forgotten"]


def test_all_that_reads_a_run_has_those_left_out(tmp_path, finished_runs):
    copy = finished_runs.copy("left out", tmp_path)
    run = evocity.open_run(copy)
    living = set(run.members(3)["id"].to_pylist())
    breedings = run.births(columns=["breedings"])["breedings"].to_pylist()
    one = next(one for one, count in enumerate(breedings) if count and one not in living)
    archived = evocity.archive(run).births["id"].to_pylist()
    assert [b.id for b in run.individuals(archived)] == archived
    call("decode", copy, "--id", one, "-o", tmp_path / "one.npy")
    heights = np.load(tmp_path / "one.npy")
    assert (heights == evocity.decode(run.genome(one)).city.heights).all()
    call("show", copy, "--id", one, "-o", tmp_path / "one.png")
    call("scene", copy, "--id", one, "-o", tmp_path / "one.obj")
    score = json.loads(call("score", copy, "--id", one, "--fitness", "gsi", "--json").stdout)
    assert score
    call("pick", copy, one)
    call("report", copy)
    (same,) = json.loads(call("replay", copy, one, "--json").stdout)
    assert same["same"] is True
    birth = run.individuals([one])
    assert run.parents(birth)[0]
    found = evocity.Recipe(
        parents=[{"run": str(copy), "id": one}, {"map": str(tmp_path / "left.npy")}],
        map={"pixels": 64, "metres_per_pixel": 2.0},
        genome={"block": 4, "fit": False},
        fitness=["alignment"],
        run={"population": 2, "generations": 0},
    )
    with Search(found, workers=0) as search:
        (first, *_) = list(search)
    assert first.births == 2
    evocity.refine(copy, one, way="heights", budget=2)
