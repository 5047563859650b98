"""What decides the births of a run is sealed: a changed, missing or misnamed part is named, and the
log is repaired by breeding its generations again."""

import json
import shutil
from functools import partial
from pathlib import Path
from unittest.mock import patch

import pytest
from click.testing import CliRunner
from toy_runs import unsealed, write_toy

from evocity import store
from evocity.cli import main
from evocity.errors import RunError
from evocity.fitness import registry
from evocity.search import Search, read_recipe, replay
from evocity.store import RunLog, RunWriter, events
from evocity.store.event_chain import EventLog
from evocity.store.run_directory import RunDirectory

OLD = Path(__file__).parent.parent / "old"


def rows(path) -> list[dict]:
    run = RunLog(path)
    return [*run.births().drop_columns(["seconds"]).to_pylist(), *run.members().to_pylist()]


def bred(search) -> None:
    for _ in search:
        pass


def resumed(path, **changes):
    with Search.resume(path, workers=0, **changes) as search:
        bred(search)


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run of generations 0…4 with a pick before 2, and other weights before 3; read only."""
    folder = tmp_path_factory.mktemp("whole")
    with patch.dict(registry._from_files):
        recipe = read_recipe(write_toy(folder), generations=4)
        with Search(recipe, out=folder / "run", workers=0) as search:
            for generation in search:
                if generation.number == 1:
                    search.pick([9], share=0.9)
                if generation.number == 2:
                    search.reweight(mutation=9)
    return folder / "run"


@pytest.fixture
def run(whole, tmp_path):
    """A copy of the run."""
    return shutil.copytree(whole, tmp_path / "run")


# -- events ------------------------------------------------------------------------------


def lines(path) -> list[bytes]:
    return (path / "events.jsonl").read_bytes().splitlines(keepends=True)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda all: [all[0], all[1].replace(b"[9]", b"[8]"), *all[2:]], "line 2 has changed"),
        (lambda all: [all[0], *all[2:]], "line 2 has changed"),
        (lambda all: [all[0], all[2], all[1], *all[3:]], "line 2 has changed"),
        (lambda all: [all[1], *all[2:]], "line 1 has changed"),
        (lambda all: [*all[:2], b"\n", *all[2:]], "line 3 has changed"),
        (
            lambda all: [*all, b'{"event": "command", "command": "stop"}\n'],
            "line 5 has changed",
        ),
        (lambda all: [*all[:-1], all[-1].rstrip() + b" "], "line 4 has changed"),
        (lambda all: all[:2], "lacks lines"),
        (lambda all: [], "lacks lines"),
    ],
)
def test_events_that_were_changed_are_named(run, change, says):
    assert len(lines(run)) == 4
    (run / "events.jsonl").write_bytes(b"".join(change(lines(run))))
    with pytest.raises(RunError, match=says) as caught:
        RunLog(run).events()
    assert "events.jsonl" in caught.value.found
    for attempt in (RunWriter.reopen, store.set_aside, Search.resume, replay):
        with pytest.raises(RunError, match=says):
            attempt(run)
    result = call("status", run)
    assert result.exit_code == 2
    assert "events.jsonl" in result.output


def test_events_are_json_with_a_checksum_each(run):
    documents = [json.loads(line) for line in lines(run)]
    assert [one["event"] for one in documents] == ["start", "command", "command", "finish"]
    assert all(len(one["chain"]) == 32 for one in documents)
    assert not any("chain" in one for one in RunLog(run).events())


def test_a_last_line_that_a_crash_cut_short_is_no_damage(run):
    whole, expected = lines(run), RunLog(run).events()
    for length in (1, len(whole[-1]) // 2, len(whole[-1]) - 2):
        (run / "events.jsonl").write_bytes(b"".join(whole[:-1]) + whole[-1][:length])
        assert RunLog(run).events() == expected[:-1]
    writer = RunWriter.reopen(run)
    writer.event("finish")
    writer.close()
    assert [one["event"] for one in RunLog(run).events()][-2:] == ["command", "finish"]
    (run / "events.jsonl").write_bytes((run / "events.jsonl").read_bytes()[:-1])
    assert [one["event"] for one in RunLog(run).events()][-1] == "finish"


def test_events_without_checksums_are_read_and_sealed_by_the_next(tmp_path):
    path = tmp_path / "events.jsonl"
    path.write_bytes(b'{"event": "start"}\n{"event": "sto')
    directory = RunDirectory(tmp_path)
    assert events.read_events(directory) == [{"event": "start"}]
    EventLog(directory, "events.jsonl").append({"event": "resume"})
    names = [one["event"] for one in events.read_events(directory)]
    assert names == ["start", "resume"]
    path.write_bytes(path.read_bytes().replace(b"start", b"STOP."))
    with pytest.raises(RunError, match="line 3 has changed"):
        events.read_events(directory)


def test_events_that_are_exchanged_while_a_run_writes_stop_it(tmp_path):
    log = EventLog(RunDirectory(tmp_path), "events.jsonl")
    log.append({"event": "start"})
    (tmp_path / "events.jsonl").unlink()
    with pytest.raises(RunError, match="lacks lines"):
        log.append({"event": "finish"})


# -- provenance --------------------------------------------------------------------------


def test_provenance_that_was_changed_is_named(run):
    path = run / "provenance.json"
    path.write_text(path.read_text().replace('"seed": 3', '"seed": 4'))
    for attempt in (RunLog, RunWriter.reopen, Search.resume):
        with pytest.raises(RunError, match=r"provenance\.json is damaged.*its seal"):
            attempt(run)
    path.write_text(json.dumps(unsealed(path)))  # as older releases wrote it
    assert "seal" not in RunLog(run).provenance


# -- generations -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["births", "membership"])
def test_a_file_under_the_name_of_another_generation_is_damage(run, whole, kind):
    copied, named = (run / kind / f"generation-{number:08d}.parquet" for number in (2, 3))
    shutil.copy(copied, named)
    assert list(RunLog(run).generations) == [0, 1, 2]
    state = json.loads(call("status", run, "--json").stdout)
    assert f"{kind}/generation-00000003.parquet" in state["damaged"]
    assert "--set-aside" in call("status", run).stdout
    with pytest.raises(RunError, match="--set-aside"):
        Search.resume(run)
    assert len(store.set_aside(run)) == 4
    resumed(run)
    assert rows(run) == rows(whole)


@pytest.mark.parametrize("number", [0, 1, 3])
@pytest.mark.parametrize("kind", ["births", "membership"])
def test_a_missing_file_in_the_middle_is_bred_again(run, whole, kind, number):
    (run / kind / f"generation-{number:08d}.parquet").unlink()
    state = json.loads(call("status", run, "--json").stdout)
    assert state["damaged"] == [f"{kind}/generation-{number:08d}.parquet"]
    with pytest.raises(RunError, match=r"(?s)is missing.*set-aside"):
        Search.resume(run)
    store.set_aside(run)
    with Search.resume(run, workers=0) as search:
        bred(search)
    assert rows(run) == rows(whole)
    commands = [one for one in RunLog(run).events() if one["event"] == "command"]
    assert len(commands) == 2  # they count as before, and are not logged again


def test_a_damaged_file_in_the_middle_is_bred_again_with_later_commands(run, whole):
    path = run / "births" / "generation-00000001.parquet"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    store.set_aside(run)
    with Search.resume(run, workers=0) as search:
        assert next(iter(search)).number == 1
    resumed(run)  # once more, after the pick and before the weights
    assert rows(run) == rows(whole)


def test_an_earlier_recipe_s_generations_are_not_bred_by_the_present_one(run):
    about = unsealed(run / "provenance.json")
    about["recipe"]["before"] = [{"file": "recipe-1.toml", "generations": 3}]
    (run / "provenance.json").write_text(json.dumps(about))
    (run / "births" / "generation-00000001.parquet").unlink()
    before = sorted(run.rglob("*"))
    with pytest.raises(RunError, match=r"generation 1 is damaged or missing.*recipe-1\.toml"):
        store.set_aside(run)
    assert sorted(run.rglob("*")) == before


def test_replay_names_what_cannot_be_verified(run):
    result = call("replay", run, "--all")
    assert result.exit_code == 0
    assert "without checksums" not in result.output
    assert RunLog(run).unverified() == []
    (run / "provenance.json").write_text(json.dumps(unsealed(run / "provenance.json")))
    assert "wrote provenance.json without checksums" in call("replay", run, "--all").output


def test_a_run_of_an_older_release_is_read_and_named(tmp_path):
    path = shutil.copytree(OLD / "run-1", tmp_path / "run")
    parts = RunLog(path).unverified()
    assert parts[:2] == ["provenance.json", "events.jsonl"]
    assert [part.split("/")[0] for part in parts[2:]] == ["sources", "births", "membership"]
    before = RunLog(path).events()
    writer = RunWriter.reopen(path)
    writer.event("resume")
    writer.update_provenance(RunLog(path).provenance)
    writer.close()
    assert RunLog(path).events()[:-1] == before
    assert RunLog(path).unverified() == parts[2:]
    content = (path / "events.jsonl").read_bytes()
    (path / "events.jsonl").write_bytes(content.replace(b"finish", b"FINISH"))
    with pytest.raises(RunError, match="has changed, or a line before"):
        RunLog(path).events()


# -- commands ----------------------------------------------------------------------------


def asked(folder, content, generations=3):
    """A run that finds this ``content`` in commands.jsonl after generation 1."""
    out = folder / "run"
    recipe = read_recipe(write_toy(folder), generations=generations)
    with Search(recipe, out=out, workers=0) as search:
        for generation in search:
            if generation.number == 1:
                (out / "commands.jsonl").write_bytes(content)
            if generation.number == 2:
                with (out / "commands.jsonl").open("ab") as file:
                    file.write(b'{"command": "pick", "ids": [5]}\n')
    return RunLog(out)


@pytest.mark.parametrize(
    ("content", "limit"),
    [
        pytest.param(b'{"command": "pick", "ids": [3]}\n' + b"\n" * 250_000, 20, id="lines"),
        pytest.param(b'{"command": "pick", "ids": [3]}\n' + b"x" * 50_000, 20, id="one long line"),
    ],
)
def test_too_many_commands_end_no_run(tmp_path, monkeypatch, content, limit):
    monkeypatch.setattr(events, "MOST_AT_ONCE", limit)
    monkeypatch.setattr(events, "MOST_BYTES", 10_000)
    monkeypatch.setattr(events, "LONGEST", 1000)
    run = asked(tmp_path, content)
    assert len(run.generations) == 4
    (aside,) = [one for one in run.events() if one["event"] == "commands set aside"]
    assert (aside["generation"], aside["file"]) == (2, "damaged/commands.jsonl")
    assert (run.path / aside["file"]).read_bytes() == content
    picks = [one["ids"] for one in run.events() if one["event"] == "command"]
    assert picks == [[3], [5]]
    resumed(run.path, generations=4)
    assert [one["ids"] for one in run.events() if one["event"] == "command"] == picks


def test_commands_in_another_file_are_carried_out(tmp_path):
    run = asked(tmp_path, b'{"command": "pick", "ids": [3]}\n')
    (run.path / "commands.jsonl").write_bytes(b'{"command": "pick", "ids": [4]}\n')
    resumed(run.path, generations=4)
    resumed(run.path, generations=5)
    assert [one["ids"] for one in run.events() if one["event"] == "command"] == [[3], [5], [4]]


def test_a_stranger_s_commands_are_counted_within_bounds(tmp_path, monkeypatch):
    monkeypatch.setattr(events, "MOST_BYTES", 5000)
    monkeypatch.setattr(events, "LONGEST", 1000)
    path = tmp_path / "commands.jsonl"
    path.write_bytes(b"\n" * 20_000)
    assert events.count_commands(RunDirectory(tmp_path)) == 5000
    read = partial(events.commands_of, RunDirectory(tmp_path))
    assert read(4000)[1]
    assert len(read(0)[0]) == events.MOST_AT_ONCE
