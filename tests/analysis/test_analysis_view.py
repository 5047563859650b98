"""A view of a run in Python: what is set and told, what the page is sent, what is no view."""

import shutil
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from written_runs import written

import evocity
from evocity.errors import EvocityError, RunError

pytest.importorskip("anywidget")

OLD = sorted((Path(__file__).parent.parent / "old").glob("run-*[0-9]"))
HOSTILE = "<script>window.hacked = 1</script>\"'&${1}"


def answer(view, message) -> list[tuple]:
    """What the page is sent back."""
    sent = []
    view.widget.send = lambda content, buffers: sent.append((content, buffers))
    view.widget._handle_custom_msg(message, [])
    return sent


def state(view, **changes) -> None:
    """As the page sends what was changed there."""
    view.widget.set_state(changes)


@pytest.mark.slow_cases("run-3", "run-5", "run-7", "run-9")
@pytest.mark.parametrize("path", OLD, ids=lambda path: path.name)
def test_runs_of_older_releases_are_viewed_alike(path):
    run = evocity.open_run(path)
    view = run.view()
    assert view.filtered.sort_index().equals(run.scores)
    assert [one["name"] for one in view.widget.axes] == [aim.name for aim in run.aims]
    about, ids = view.widget.about, np.frombuffer(view.widget.births, "<i4", len(run))
    assert ids.tolist() == run.columns.ids.tolist()
    columns = np.frombuffer(view.widget.births, "<f4", offset=4 * len(run)).reshape(-1, len(run))
    for told, values in zip(about["columns"], columns, strict=True):
        if told["name"] in run.scores and not told["words"]:
            right = run.scores[told["name"]].to_numpy(np.float32)
            assert np.array_equal(values, right, equal_nan=True), told["name"]
    words = {told["name"]: told["words"] for told in about["columns"]}
    named = {name: np.array(words[name], object)[columns[list(words).index(name)].astype(int)]
             for name in ("operator", "status", "archive")}  # fmt: skip
    assert named["operator"].tolist() == run.columns.operator.tolist()
    assert ids[named["archive"] == "yes"].tolist() == sorted(run.archive.ids.tolist())
    ((told, (image,)),) = answer(view, {"tiles": [0, 5, 11], "side": 96, "request": "r"})
    kept = [one.id for one in run.individuals([0, 5, 11], rebred=False) if one.genome is not None]
    assert (told["request"], told["tiles"]) == ("r", kept)
    assert image.startswith(b"\x89PNG")
    page = view._repr_html_()
    assert len(page) < 150_000
    assert f"{len(run)} of {len(run)} births pass" in page


def test_islands_are_words_of_an_axis(archipelago):
    run = evocity.open_run(archipelago)
    view = run.view(measures=["island", "alignment"])
    view.brushes = {"island": "crowd"}
    assert sorted(view.filtered.index) == run.where("island == 'crowd'").index.tolist()
    assert "parallel coordinates of island, alignment" in view._repr_html_()


def test_a_view_may_have_no_axes(run):
    view = run.view(measures=[])
    assert (view.widget.axes, view.order) == ([], "compromise")
    assert view.filtered.index[0] == run.compromise().id
    assert "parallel coordinates" not in view._repr_html_()


def test_what_is_chosen_there_is_known_here(run, tmp_path):
    view = run.view()
    heard = []
    view.widget.observe(lambda change: heard.append(change["new"]), "chosen")
    state(view, chosen=[5, 3])
    assert (heard, view.selected) == ([[5, 3]], [run[5], run[3]])
    state(view, chosen=[3, 3, 99_999, 7])  # one that is not there
    assert view.selected == [run[3], run[7]]
    run.save(view.selected, tmp_path / "chosen.zip")
    for which in (run.front(), run.archive.ids, run[4], 4, "alive and alignment > 0.1", [], None):
        view.selected = which
        right = [] if which is None else run._ids(which).tolist()
        assert view.widget.chosen == right


def test_what_is_brushed_there_is_known_here(run):
    view = run.view()
    low, middle, high = np.quantile(run.scores["fsi"].dropna(), [0, 0.5, 1])
    state(view, brushes={"fsi": [[low, middle]], "operator": ["mutation", "source"]})
    right = run.where(
        f"{low} <= fsi <= {middle} and (operator == 'mutation' or operator == 'source')"
    )
    assert sorted(view.filtered.index) == right.index.tolist()
    assert f"{len(right)} of {len(run)} births pass" in view._repr_html_()
    view.brushes = {"fsi": (middle, high), "alive": "yes"}
    assert view.widget.brushes == {"fsi": [[middle, high]], "alive": ["yes"]}
    assert set(view.filtered["alive"]) == {True}
    view.brushes = {}
    assert len(view.filtered) == len(run)


def test_parts_of_the_page_are_answered(run):
    view = run.view()
    ((told, _),) = answer(view, {"part": "keep", "request": "r"})
    assert told["value"] == view.page.keep
    assert [card["id"] for card in told["value"]] == [one.individual.id for one in run.keep()]
    ((told, _),) = answer(view, {"part": "__dict__", "request": "r"})
    assert (told["request"], "no part" in told["error"]) == ("r", True)


def test_the_gallery_stands_in_an_order(run):
    view = run.view(order="-fsi")
    assert view.order == "-fsi"
    assert view.filtered["fsi"].dropna().is_monotonic_decreasing
    view.order = "crumbs"  # fewer are better
    assert view.filtered["crumbs"].dropna().is_monotonic_increasing
    view.order = "alignment"  # more are better
    assert view.filtered["alignment"].dropna().is_monotonic_decreasing
    assert view.filtered_ids[0] == run.columns.ids[np.nanargmax(run.columns.value("alignment"))]
    for a, b in pairwise(run.view(order="generation").filtered_ids):
        assert run[int(a)].generation <= run[int(b)].generation


def test_some_births_are_viewed_alone(run):
    view = run.view("alive", ["crumbs", "fsi", "operator"])
    assert sorted(view.filtered.index) == run.where("alive").index.tolist()
    assert view.widget.axes == [
        {"name": "crumbs", "turned": True},
        {"name": "fsi", "turned": False},
        {"name": "operator", "turned": False},
    ]
    dead = run.where("not alive").index[0]
    with pytest.raises(RunError, match="the view does not show"):
        view.selected = dead
    assert answer(view, {"tiles": [int(dead)], "side": 96})[0][0]["tiles"] == []


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda run: run.view(measures=["fsy"]), "did you mean fsi"),
        (lambda run: run.view(order="fsy"), "did you mean fsi"),
        (lambda run: run.view("fsy > 1"), "did you mean fsi"),
        (lambda run: run.view([99_999]), "no individual 99999"),
        (lambda run: setattr(run.view(), "order", "-"), "there is no '-'"),
        (lambda run: setattr(run.view(), "selected", "fsy > 1"), "did you mean fsi"),
        (lambda run: setattr(run.view(), "brushes", {"fsi": 3}), "two numbers"),
        (lambda run: state(run.view(), brushes={"fsi": [[3, 1]]}), "the lower number first"),
    ],
)
def test_what_is_not_there_is_refused(run, ask, told):
    with pytest.raises(EvocityError, match=told):
        ask(run)


@pytest.mark.parametrize(
    "message",
    [
        None,
        3,
        {},
        {"tiles": [1]},
        {"tiles": [1], "side": 97},
        {"tiles": "12", "side": 96},
        {"tiles": [True], "side": 96},
        {"tiles": [1.5], "side": 96},
        {"tiles": {"1": 2}, "side": 96},
        {"tiles": [[1]], "side": 96},
    ],
)
def test_what_is_no_question_gets_no_answer(run, message):
    assert answer(run.view(), message) == []


def test_questions_are_bounded(run):
    sent = answer(run.view(), {"tiles": [*range(-5, 10_000), 10**40], "side": 96})
    assert sent[0][0]["tiles"] == [
        one for one in range(59) if one in run and run[one].status == "ok"
    ]


def test_failed_births_are_told_with_their_reason(tmp_path):
    failed = {"status": "error", "error": HOSTILE, "genome": None, "values": {}}
    late = {"status": "timeout", "error": "took 3 s"}
    births = [[{"id": 0}, {"id": 1} | failed, {"id": 2} | late]]
    view = written(tmp_path / "run", births).view()
    ((told, _),) = answer(view, {"tiles": [0, 1, 2], "side": 192})
    assert told["lacking"] == [[1, f"error: {HOSTILE}"]]
    assert told["tiles"] == [0, 2]  # it has a map, though it was too slow
    page = view._repr_html_()
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_a_log_that_leaves_genomes_out_is_viewed():
    run = evocity.open_run(Path(__file__).parent.parent / "old" / "run-8")
    left = [
        one.id for one in run.individuals(run.columns.ids.tolist(), rebred=False) if one.left_out
    ]
    assert left
    ((told, _),) = answer(run.view(), {"tiles": left, "side": 96})
    assert {one for one, _ in told["lacking"]} == set(left)
    assert "breeds it again" in told["lacking"][0][1]


def test_pictures_are_made_once(run, monkeypatch):
    view = run.view()
    first = answer(view, {"tiles": [3, 4], "side": 96})[0][1]
    asked = []
    monkeypatch.setattr(run, "individuals", lambda ids, **how: asked.extend(ids) or [])
    assert answer(view, {"tiles": [3, 4], "side": 96})[0][1] == first
    assert asked == []
    monkeypatch.undo()
    monkeypatch.setattr("evocity.analysis.thumbnails._KEPT", 20_000)
    answer(view, {"tiles": [5, 6, 7], "side": 96})
    assert sum(one.nbytes for one in view.page.thumbnails._kept.values()) <= 20_000


def test_damage_is_told_where_pictures_would_be(night, tmp_path):
    run = evocity.open_run(shutil.copytree(night, tmp_path / "run"))
    view = run.view()
    for path in (run.path / "births").iterdir():
        path.write_bytes(b"no Parquet")
    ((told, _),) = answer(view, {"tiles": [3], "side": 96})
    assert told["tiles"] == []
    assert "what to do" in told["lacking"][0][1]
    assert "what to do" in view._repr_html_()


def test_a_run_that_goes_on_is_looked_at_anew(night, tmp_path):
    path = shutil.copytree(night, tmp_path / "run")
    run = evocity.open_run(path)
    view = run.view()
    before = len(run)
    view.selected, view.brushes = [3, 5], {"operator": ["mutation"]}
    with evocity.Search.resume(path, generations=4, workers=0, trust=True) as search:
        list(search)
    assert view.widget.about["count"] == before
    assert view.refresh() is view
    assert view.widget.about["count"] == len(run) == before + 8
    assert (view.widget.chosen, view.brushes) == ([3, 5], {"operator": ["mutation"]})


def test_an_empty_run_and_an_empty_choice(run, tmp_path):
    with pytest.raises(RunError, match="no complete generation"):
        written(tmp_path / "run", []).view()
    view = run.view("fsi < 0")
    assert (len(view.filtered), view.selected) == (0, [])
    assert "0 of 0 births pass" in view._repr_html_()


def test_where_widgets_do_not_live_a_picture_stands_in_their_place(run):
    view = run.view()
    bundle = view._repr_mimebundle_()
    assert bundle["application/vnd.jupyter.widget-view+json"]["model_id"] == view.widget.model_id
    assert bundle["text/html"] == view._repr_html_()
    assert bundle["text/plain"].startswith(f"View({len(run)} of {len(run)} births of ")
    view.selected = [int(view.filtered_ids[0])]
    assert view._repr_html_().count("chosen") == 2  # in the sentence, and on its map


def test_without_anywidget_the_extra_is_named(run, monkeypatch):
    for name in [one for one in sys.modules if one.startswith("evocity.viewer.widget")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(EvocityError, match="anywidget") as caught:
        run.view()
    assert "evocity[notebook]" in caught.value.remedy
