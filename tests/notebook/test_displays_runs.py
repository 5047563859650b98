"""What notebooks show of runs and their individuals, old and hostile ones too."""

import json
import shutil
from pathlib import Path

import pytest
from test_displays import HOSTILE, MOST, Seen
from toy_runs import unsealed
from written_runs import written

import evocity
from evocity.analysis.shortlist import Shortlist
from evocity.notebook import html_of

OLD = Path(__file__).parent.parent / "old"
RUNS = sorted(path.name for path in OLD.glob("run-*") if path.is_dir())


@pytest.mark.parametrize("name", RUNS)
def test_runs_of_every_release_show_themselves(name):
    run = evocity.open_run(OLD / name)
    page = run._repr_html_()
    assert len(page) <= MOST
    seen = Seen(page)
    status = run.status()
    assert name in seen.text
    assert str(status["births"]) in seen.text
    images = [attributes for tag, attributes in seen.elements if tag == "img"]
    assert len(images) >= len(run.sources())
    assert all(one["alt"] for one in images)
    assert run.header.attribution in seen.text
    for aim in run.aims:
        assert aim.name in seen.text


def test_the_best_are_those_of_the_run():
    run = evocity.open_run(OLD / "run-3")
    seen = Seen(run._repr_html_())
    for aim in run.aims:
        if aim.goal in ("max", "min"):
            assert f"{run.best(aim.name).id}" in seen.text.split()


def test_a_goal_that_nobody_reached_is_praised_for_nobody(tmp_path):
    failed = {"status": "error", "error": "no", "values": {}, "genome": None}
    wanted = [{"name": "gsi", "goal": "max"}, {"name": "fsi", "goal": "max", "min": 5}]
    births = [{"id": 0, "values": {"gsi": 0.4, "fsi": 2.0}}, {"id": 1} | failed]
    seen = Seen(written(tmp_path / "run", [births], wanted=wanted)._repr_html_())
    assert "gsi" in seen.text
    assert "best gsi" not in seen.text


def test_many_worth_keeping_are_cut_and_counted():
    kept = evocity.open_run(OLD / "run-3").keep()
    page = html_of(Shortlist([*kept] * 100))
    assert len(page) <= MOST
    assert f"and {100 * len(kept) - 40} more" in Seen(page).text


def test_individuals_show_map_scores_and_origin():
    run = evocity.open_run(OLD / "run-3")
    for one in (run[0], run[len(run) - 1]):
        page = one._repr_html_()
        seen = Seen(page)
        assert len(page) <= MOST
        assert f"individual {one.id} of run-3" in seen.text
        for name, value in one.scores.items():
            assert name in seen.text
            assert f"{value:.4g}" in seen.text
        assert [tag for tag, _ in seen.elements].count("img") == (one.status == "ok")
        assert f"generation {one.generation}" in seen.text


def test_what_is_worth_keeping_is_told_with_its_reasons():
    kept = evocity.open_run(OLD / "run-3").keep()
    seen = Seen(kept._repr_html_())
    assert [tag for tag, _ in seen.elements].count("img") == len(kept)
    for one in kept:
        assert f"{one.individual.id}: {one.role}" in seen.text
        assert one.why in seen.text
        assert one.gave_up in seen.text


def copied(tmp_path, change):
    folder = tmp_path / "run"
    shutil.copytree(OLD / "run-3", folder)
    path = folder / "provenance.json"
    told = unsealed(path)
    change(told)
    path.write_text(json.dumps(told), encoding="utf-8")
    return evocity.open_run(folder)


def test_hostile_texts_are_text(tmp_path):
    def change(told):
        for one in told["fitness"]:
            one["objective"] = HOSTILE

    run = copied(tmp_path, change)
    for page in (run._repr_html_(), run[0]._repr_html_()):
        seen = Seen(page)
        assert not {tag for tag, _ in seen.elements} & {"script", "iframe"}
        assert HOSTILE in seen.text


def test_a_run_that_does_not_tell_what_it_wanted_is_shown_all_the_same(tmp_path):
    run = copied(tmp_path, lambda told: told.update(fitness=[]))
    assert "generations" in Seen(run._repr_html_()).text


def test_damage_is_told(tmp_path):
    run = copied(tmp_path, lambda told: None)
    for path in (run.path / "sources").iterdir():
        path.write_bytes(b"no Parquet")
    seen = Seen(run._repr_html_())
    assert [tag for tag, _ in seen.elements] == ["pre"]
    assert "what to do" in seen.text
