"""Runs that breed shapes, curves and sites: the same promises as of fabrics."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from kind_runs import MEASURES, PARENTS, written
from toy_runs import forgotten  # noqa: F401

import evocity
from evocity.cli import main
from evocity.errors import RecipeError, RunError
from evocity.search import Search, read_recipe


def bred(recipe, out, **changes):
    with Search(read_recipe(recipe), out=out, **changes) as search:
        for _ in search:
            pass
    return evocity.open_run(out)


def rows(run) -> list[dict]:
    table = run.births().to_pylist()
    return [{k: v for k, v in row.items() if k != "seconds"} for row in table]


@pytest.fixture(scope="module", params=["shape", "curve", "site"])
def run(request, finished_runs, tmp_path_factory):
    return evocity.open_run(
        finished_runs.copy(request.param, tmp_path_factory.mktemp(request.param))
    )


def test_a_run_is_told_measured_and_read_again(run):
    kind = run.header.kind
    assert run.header.schema_version == 9
    ok = [birth for birth in run.individuals(list(range(18))) if birth.ok]
    assert len(ok) > 12
    for birth in ok:
        assert birth.genome.kind == kind
        assert birth.genome.problem is None
        assert set(birth.values) == set(run.header.columns)
    assert {birth.operator for birth in ok} > {"source"}
    one = run[ok[-1].id]
    assert one.picture().size[0] > 64
    if kind == "site":
        assert sum(one.ancestry().values()) == pytest.approx(1)
        # one factor a birth: the other is the first parent's
        for birth in ok:
            if birth.parents:
                (parent,) = run.individuals([birth.parents[0]])
                same = birth.genome.fabric.digest == parent.genome.fabric.digest
                kept = [a.digest == b.digest for a, b in
                        zip(birth.genome.courses, parent.genome.courses, strict=True)]  # fmt: skip
                assert same or all(kept)
                assert sum(kept) >= len(kept) - 1
    else:
        with pytest.raises(RunError, match=f"a genome of the kind '{kind}' has no cities"):
            one.ancestry()
    with pytest.raises(RunError, match="zoom"):
        one.picture(zoom=2)
    assert "<img" in one._repr_html_()
    assert str(run.keep())
    assert run.score([one.id], ["gsi"], workers=0)["gsi"].notna().all()


def test_commands_take_it(run, tmp_path):
    kind, out = run.header.kind, str(run.path)
    for command in (
        ["status", out],
        ["replay", out, "--sample", "5", "--workers", "0"],
        ["show", out, "--id", "7", "-o", str(tmp_path / "one.png")],
        ["show", out, "-o", str(tmp_path / "run.png")],
        ["decode", out, "--id", "7", "-o", str(tmp_path / "one.npy")],
    ):
        told = CliRunner().invoke(main, command)
        assert told.exit_code == 0, told.output
    assert np.load(tmp_path / "one.npy").shape == (64, 64)
    told = CliRunner().invoke(main, ["decode", out, "--id", "7", "--zoom", "2", "-o", "x.npy"])
    assert told.exit_code == 2
    assert f"--zoom 2.0 cannot be used with a {kind}" in told.output
    words = ["decode", out, "--id", "7", "--no-settle", "-o", "x.npy"]
    told = CliRunner().invoke(main, words)
    assert told.exit_code == 2
    assert f"--no-settle cannot be used with a {kind}" in told.output
    run[7].save(tmp_path / "one.parquet")
    told = CliRunner().invoke(
        main, ["show", str(tmp_path / "one.parquet"), "-o", str(tmp_path / "again.png")]
    )
    assert told.exit_code == 0, told.output


def test_a_report_shows_it(run):
    from evocity.report import write_report

    page = write_report(run.path).read_text(encoding="utf-8")
    assert page.count("data:image/png") > 6
    assert ("4 pixels wide</p>" in page) == (run.header.kind == "site")


@pytest.mark.slow_cases("site")
def test_more_workers_and_a_stop_change_nothing(run, tmp_path):
    kind = run.header.kind
    recipe = written(tmp_path, kind, generations=1)
    other = bred(recipe, tmp_path / "other", workers=2 if kind == "site" else 0)
    with Search.resume(tmp_path / "other", generations=2, workers=0) as search:
        for _ in search:
            pass
    assert rows(evocity.open_run(other.path)) == rows(run)


def test_a_curve_goes_on_from_one_that_was_bred(run, tmp_path):
    kind = run.header.kind
    run[7].save(tmp_path / "seven.parquet")
    parents = f'[[parents]]\nrun = "{run.path}"\nid = 8\n[[parents]]\ngenome = "seven.parquet"\n'
    if kind == "site":
        parents += PARENTS[kind][PARENTS[kind].index("[[curves]]") :]
    recipe = written(tmp_path, kind, generations=0, parents=parents)
    again = bred(recipe, tmp_path / "again")
    first, second = again.individuals([0, 1])
    digests = [run[8].genome, run[7].genome]
    if kind == "site":
        assert first.genome.courses[0].digest == digests[0].courses[0].digest
    else:
        assert [first.genome.digest, second.genome.digest] == [one.digest for one in digests]


def test_logs_that_leave_genomes_out_breed_them_again(tmp_path):
    recipe = written(tmp_path, "curve", generations=3, more='[log]\ngenomes = "survivors"\n')
    run = bred(recipe, tmp_path / "run")
    left = [birth.id for birth in run.individuals(list(range(24)), rebred=False) if birth.left_out]
    assert left
    assert all(run.genome(one).kind == "curve" for one in left)


@pytest.mark.parametrize(
    ("kind", "changes", "told"),
    [
        ("shape", {"parents": PARENTS["curve"]}, "parents[0].curve: in a run of shapes"),
        ("shape", {"measures": MEASURES["site"]}, "built_area_lost, a measure of a site"),
        ("curve", {"more": "[operators]\nmutation = 1\n"}, "operators.mutation: it breeds fabric"),
        ("curve", {"more": "[refine]\nbirths = 1\n"}, "refine.births"),
        ("curve", {"more": '[search]\nalgorithm = "cma_es"\n'}, "search.algorithm"),
        ("curve", {"more": PARENTS["site"][PARENTS["site"].index("[[curves]]") :]}, "curves: in a"),
        ("shape", {"measures": '[[fitness]]\nname = "integrity"\n'}, "integrity needs data"),
        ("site", {"parents": '[[parents]]\nmap = "left.npy"\n'}, "curves: missing"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_for_a_kind_is_refused(tmp_path, kind, changes, told):
    with pytest.raises(RecipeError) as error:
        read_recipe(written(tmp_path, kind, **changes))
    assert told in error.value.found


@pytest.mark.parametrize(
    ("course", "told"),
    [
        ('width = 1\nfrom = "shore.geojson"', "curves[0].width: 1 m, with pixels of 2 m"),
        ("width = 8\nstart = [4, 4]\nend = [4, 500]", "curves[0].end"),
        ("width = 8\nstart = [4, 4]", "from, a file with a line; or start and end"),
        ("width = 8\nlay = -1\nstart = [4, 4]\nend = [4, 60]", "curves[0].lay"),
    ],
)
def test_courses_at_fault_are_named(tmp_path, course, told):
    parents = f'[[parents]]\nmap = "left.npy"\n[[curves]]\n{course}\n'
    with pytest.raises(RecipeError) as error:
        read_recipe(written(tmp_path, "site", parents=parents))
    assert told in error.value.found


def test_a_river_outside_the_window_is_named(tmp_path):
    recipe = written(tmp_path, "site")
    (tmp_path / "shore.geojson").write_text(
        json.dumps({"type": "LineString", "window": True, "coordinates": [[500, 0], [600, 9]]})
    )
    with pytest.raises(
        evocity.errors.MapError, match=r"shore\.geojson lies outside the window, a square"
    ):
        bred(recipe, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_another_kind_cannot_go_on(run, tmp_path):
    other = "curve" if run.header.kind == "shape" else "shape"
    recipe = written(tmp_path, other)
    with pytest.raises(RecipeError, match=r"run\.kind: was"):
        Search.resume(run.path, recipe=recipe)
