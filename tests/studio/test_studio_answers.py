"""What studio tells of runs, whatever happens to them meanwhile, and what it keeps."""

import contextlib
import io
import json
import os
import shutil
import sys
import threading
import zipfile
from pathlib import Path

import numpy as np
import pytest
from asking import HOSTILE, OLD, Client, contents
from PIL import Image
from toy_runs import unsealed
from written_runs import written

import evocity
from evocity.analysis.page import Page
from evocity.analysis.page.page import PARTS
from evocity.coding.usage import usage
from evocity.errors import EvocityError, RunError
from evocity.search.preparation.trust import state_folder
from evocity.store import Birth, Member, RunWriter
from evocity.studio import picks as picking
from evocity.studio.routes import MOST_SAVED
from evocity.studio.run_watcher import RunWatcher
from evocity.studio.server import running_server


def opened(server) -> Client:
    client = Client(server)
    client.open()
    return client


@pytest.mark.parametrize("path", sorted(OLD.glob("run-*[0-9]")), ids=lambda path: path.name)
def test_runs_of_every_release_are_told_as_the_library_tells_them(path, tmp_path):
    folder = shutil.copytree(path, tmp_path / "run")
    before, run = contents(folder), evocity.open_run(folder)
    with running_server(folder) as server:
        client = opened(server)
        about, content = client.get("/api/0/births").framed
        viewed = Page(run, folder=str(folder))
        assert content == viewed.table.buffer
        assert about["columns"] == viewed.table.about["columns"]
        assert about["generation"] == run.generations[-1]
        for one in (run[0], run[-1], run[len(run) // 2]):
            told = client.get(f"/api/0/one?id={one.id}").json
            values = {m["name"]: m["value"] for m in told["measures"] if m["value"] is not None}
            assert values == one.scores
            assert told["parents"] == [parent.id for parent in one.parents]
            assert (told["operator"], told["status"]) == (one.operator, one.status)
        for name in PARTS:
            told = client.get(f"/api/0/part?name={name}").json["value"]
            assert told == json.loads(json.dumps(viewed.part(name)))
        ids = [0, 3, 999_999, 5]
        sheet, image = client.get("/api/0/tiles?ids=0,3,999999,5&side=96").framed
        assert sorted([*sheet["tiles"], *(one for one, _ in sheet["lacking"])]) == [0, 3, 5]
        right = viewed.sheet([one for one in sheet["tiles"] if one in ids], 96)
        assert np.array_equal(
            *(np.asarray(Image.open(io.BytesIO(one))) for one in (image, right.image))
        )
    assert contents(folder) == before


def test_runs_are_told_by_number_and_those_of_a_folder_as_they_come(tmp_path):
    named = [shutil.copytree(OLD / "run-6", tmp_path / one / "night") for one in ("a", "b")]
    folder = tmp_path / "all"
    shutil.copytree(OLD / "run-5", folder / "first")
    (folder / "no run").mkdir()
    os.symlink(named[0], folder / "linked")
    with running_server(*named, named[0], folder=folder) as server:
        client = opened(server)
        told = client.get("/api/runs").json
        assert [one["run"] for one in told["runs"]] == [0, 1, 2]
        assert [one["name"] for one in told["runs"]] == [*map(str, named), "first"]
        shutil.copytree(OLD / "run-4", folder / "before")  # by name it would be first
        assert client.get("/api/runs").json["runs"][3]["name"] == "before"
        (folder / "damaged").mkdir()
        (folder / "damaged" / "provenance.json").write_text("{")
        os.symlink("/dev/zero", folder / "damaged" / "lock")
        assert client.get("/api/runs").json["runs"][4]["going"] is False
        assert client.get("/api/4/changes?after=-1").status == 409
        for number, path in [(0, named[0]), (2, folder / "first"), (3, folder / "before")]:
            about, _ = client.get(f"/api/{number}/births").framed
            assert about["folder"] == str(path)
        assert client.post("/api/1/pick", {"change": "pick", "ids": [3]}).status == 200
        assert client.get("/api/0/picks").json["picks"] == []
        assert [one["id"] for one in client.get("/api/1/picks").json["picks"]] == [3]
        shutil.rmtree(folder)
        assert len(client.get("/api/runs").json["runs"]) == 5
        assert client.get("/api/2/one?id=3").status == 409


def test_pictures_and_heights_are_those_of_the_birth(asked, night):
    one = evocity.open_run(night)[3]
    told = asked.get("/api/0/picture?id=3&kind=map")
    assert told.headers["content-type"] == "image/png"
    seen, right = Image.open(io.BytesIO(told.content)), one.picture()
    assert np.array_equal(np.asarray(seen), np.asarray(right))
    assert asked.get("/api/0/picture?id=3&kind=stones").content != told.content
    about, content = asked.get("/api/0/heights?id=3").framed
    heights = np.frombuffer(content, "<f4").reshape(about["height"], about["width"])
    assert np.array_equal(heights, one.city.heights)
    assert about["metres"] == one.city.metres_per_pixel
    for count in ("pixels", "ranges"):
        about, content = asked.get(f"/api/0/calls?id=3&count={count}").framed
        values = getattr(usage(one.genome), count)
        seen = np.asarray(Image.open(io.BytesIO(content)))[: values.shape[0]]
        assert about["most"] == values.max()
        # a colour a number up to the end, the more the darker
        shades = {int(n): seen[values == n].astype(int) for n in np.unique(values)}
        assert all((shade == shade[0]).all() for shade in shades.values())
        below = [shades[n][0].sum() for n in sorted(shades) if n <= about["end"]]
        assert below == sorted(below, reverse=True)
        assert len(set(below)) == len(below) > 1


@pytest.mark.parametrize("by", ["looks", "scores", "kin"])
def test_births_are_compared_as_the_library_compares_them(asked, night, by):
    run = evocity.open_run(night)
    ids = run.columns.ids[run.columns.ok].tolist()[::-1]
    sent = [*ids, *run.columns.ids[~run.columns.ok].tolist()]
    told = asked.post("/api/0/compare", {"by": by, "ids": sent, "to": 3}).content
    found = dict(zip(sent, np.frombuffer(told, "<f4").tolist(), strict=True))
    right = run.nearest(3, n=len(ids) - 1, by=by, of=ids)["distance"]
    assert {n: found[n] for n in right.index} == pytest.approx(right.to_dict(), abs=1e-6)
    assert found[3] == 0
    assert all(np.isnan(found[n]) for n in sent[len(ids) :])
    told = asked.post("/api/0/compare", {"by": by, "ids": sorted(ids)}).content
    places = dict(zip(sorted(ids), np.frombuffer(told, "<f4").tolist(), strict=True))
    assert sorted(places.values()) == list(range(1, len(ids) + 1))
    right = run.most_different(4, of=sorted(ids), by=by).index.tolist()
    assert sorted(places, key=places.get)[:4] == right


def test_small_pictures_are_kept_for_the_user_and_never_trusted(asked, night, tmp_path):
    folder = Path(os.environ["XDG_CACHE_HOME"]) / "evocity" / "tiles"
    shutil.rmtree(folder, ignore_errors=True)
    watched = RunWatcher(night)
    first = watched.sheet([1, 2, 3], 96)
    files = sorted(folder.rglob("*.rgb"))
    assert [file.name.split("-")[0] for file in files] == ["1", "2", "3"]
    whole = files[0].read_bytes()
    for broken in (b"", whole[:3], whole[:90], whole + b"\0", bytes(4)):
        files[0].write_bytes(broken)
        assert RunWatcher(night).sheet([1], 96).ids == [1]
        assert files[0].read_bytes() == whole
    files[0].write_bytes(whole[:90])
    files[1].write_bytes(b"\x88\x13\x01\0" + bytes(5000 * 3))  # taller than any may be
    older = [folder / files[0].parent.name / one for one in ("1-96-0.0.1.rgb", "1-96-0.0.1.npy")]
    for one in older:
        one.write_bytes(whole)
    before, again = files[2].stat().st_mtime_ns, RunWatcher(night)
    assert again.sheet([1, 2, 3], 96).image == first.image
    assert files[2].stat().st_mtime_ns == before
    assert not any(one.exists() for one in older)  # of other releases
    shutil.rmtree(folder)
    folder.write_text("in the way")
    assert RunWatcher(night).sheet([3, 1], 96).ids == [3, 1]
    folder.unlink()


# -- a run that changes --------------------------------------------------------------------------


def grown(folder: Path, count: int = 3, **more) -> list[int]:
    """One more generation of a `written` run; the ids of its births."""
    run = evocity.open_run(folder)
    number, first, code = len(run.generations), len(run), run[0].genome
    births = [
        Birth(number, first + k, (0,), "mutation", "ok", None, 0.5, {"gsi": 0.5}, code, **more)
        for k in range(count)
    ]
    alive = [Member(k, one.id, 0, {"crowding": 0.0}) for k, one in enumerate(births)]
    with contextlib.closing(RunWriter.reopen(folder)) as writer:
        writer.write_generation(number, births, alive, {"births": 0, "failures": 0})
    return [one.id for one in births]


def log(folder: Path, births: int = 4) -> Path:
    return written(folder, [[{"id": k} for k in range(births)]]).path


@pytest.fixture
def unwaited(monkeypatch):
    """News are news at once."""
    monkeypatch.setattr("evocity.studio.run_watcher.FRESH", 0.0)


def test_a_run_that_grows_is_followed_each_birth_once(tmp_path, unwaited):
    folder = log(tmp_path / "run")
    with running_server(folder) as server:
        clients, seen = [opened(server) for _ in range(3)], [-1, -1, -1]
        for _ in range(4):
            for k, client in enumerate(clients[: 1 + _ % 3]):
                news = client.get(f"/api/0/changes?after={seen[k]}").json
                assert news["more"] == (news["generation"] > seen[k])
                about, content = client.get("/api/0/births").framed
                seen[k] = about["generation"]
                ids = np.frombuffer(content, "<i4", about["count"]).tolist()
                assert ids == evocity.open_run(folder).columns.ids.tolist()
            grown(folder)
        called = {client.get("/api/0/births").framed[0]["run"] for client in clients}
        assert len(called) == 1
        news = clients[0].get("/api/0/changes?after=4").json
        assert news == {
            "run": called.pop(), "generation": 4, "going": False, "problem": None, "more": False,
            "seconds_left": None, "unreachable": [], "planned": 100, "more_births": "",
        }  # fmt: skip


def test_a_run_that_is_bred_now_is_said_to_go_on(tmp_path, unwaited):
    folder = log(tmp_path / "run")
    with running_server(folder) as server, contextlib.closing(RunWriter.reopen(folder)):
        assert opened(server).get("/api/0/changes?after=0").json["going"] is True


def test_a_run_without_a_generation_is_waited_for(tmp_path, unwaited):
    run = log(tmp_path / "whole")
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    for kind in ("births", "membership"):
        for path in (folder / kind).glob("*.parquet"):
            path.unlink()
    with running_server(folder) as server:
        client = opened(server)
        assert client.get("/api/0/changes?after=-1").json["generation"] == -1
        told = client.get("/api/0/births")
        assert (told.status, "no complete generation" in told.json["error"]["found"]) == (409, True)
        for kind in ("births", "membership"):
            shutil.copytree(run / kind, folder / kind, dirs_exist_ok=True)
        assert client.get("/api/0/changes?after=-1").json["more"] is True
        assert client.get("/api/0/births").framed[0]["count"] == 4


def damaged(folder: Path) -> None:
    (path,) = (folder / "births").glob("*.parquet")
    content = bytearray(path.read_bytes())
    content[len(content) // 2 :] = b"x" * (len(content) - len(content) // 2)
    path.write_bytes(content)


def of_another_release(folder: Path) -> None:
    path = folder / "provenance.json"
    told = unsealed(path) | {"schema_version": 99}
    path.write_text(json.dumps(told))


@pytest.mark.parametrize("deed", [shutil.rmtree, damaged, of_another_release])
def test_what_happens_to_the_folder_is_told_and_what_was_seen_stays(tmp_path, unwaited, deed):
    folder, copy = log(tmp_path / "run"), tmp_path / "copy"
    shutil.copytree(folder, copy)
    with running_server(folder) as server:
        client = opened(server)
        about = client.get("/api/0/births").framed[0]
        deed(folder)
        told = client.get("/api/0/changes?after=0").json["problem"]
        if deed is damaged:  # what was read already is not read again; what was not is told
            assert told is None
            told = client.get("/api/0/one?id=3").json["error"]
        assert list(told) == ["found", "expected", "remedy"]
        assert str(folder) in told["found"]
        assert client.get("/api/0/births").framed[0] == about
        assert client.get("/api/0/picture?id=3&kind=map").status in (200, 409)
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(copy, folder)
        assert client.get("/api/0/changes?after=0").json["problem"] is None
        assert client.get("/api/0/picture?id=3&kind=map").status == 200


@pytest.mark.slow
def test_another_run_in_its_place_is_another(tmp_path, unwaited):
    folder = log(tmp_path / "run")
    with running_server(folder) as server:
        client = opened(server)
        before = client.get("/api/0/births").framed[0]
        shutil.rmtree(folder)
        values = {"crumbs": 1.0}
        written(folder, [[{"id": 9, "values": values}]], None, ({"name": "crumbs", "goal": "min"},))
        news = client.get(f"/api/0/changes?after={before['generation']}").json
        assert news["run"] != before["run"]
        assert client.get("/api/0/births").framed[0]["count"] == 1


def test_what_is_no_run_is_refused_at_once(tmp_path):
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(RunError, match="what to do"), running_server(path):
            pass


def test_a_port_that_another_has_is_refused(asked, night):
    with pytest.raises(EvocityError, match="port"), running_server(night, port=asked.server.port):
        pass


def test_strange_texts_arrive_as_texts(tmp_path):
    births = [
        {"id": 0, "operator": HOSTILE},
        {"id": 1, "status": "timeout", "error": HOSTILE, "genome": None, "values": {}},
    ]
    run = written(tmp_path / HOSTILE.replace("/", "_")[:60], [births])
    with running_server(run.path) as server:
        client = opened(server)
        assert client.get("/api/0/one?id=0").json["operator"] == HOSTILE
        told = client.get("/api/0/one?id=1").json
        assert (told["error"], told["pictured"], told["fabric"]) == (HOSTILE, False, True)
        assert client.get("/api/0/picture?id=1&kind=map").status == 409
        told = client.get("/api/0/births")
        assert told.headers["content-type"] == "application/octet-stream"
        sheet, _ = client.get("/api/0/tiles?ids=0,1&side=96").framed
        assert sheet["lacking"] == [[1, f"timeout: {HOSTILE}"]]


# -- picks ---------------------------------------------------------------------------------------


def test_picks_have_notes_and_every_change_can_be_undone(asked, night):
    before = contents(night)
    states = [asked.get("/api/0/picks").json["picks"]]
    for change in (
        {"change": "pick", "ids": [5, 3, 5]},
        {"change": "note", "ids": [3], "note": f"courtyards\n{HOSTILE}"},
        {"change": "note", "ids": [7], "note": "picked by its note"},
        {"change": "pick", "ids": [3]},  # changes nothing, and is no step
        {"change": "drop", "ids": [5, 11]},
    ):
        states.append(asked.post("/api/0/pick", change).json["picks"])
    assert [[one["id"] for one in state] for state in states] == [
        [], [5, 3], [5, 3], [5, 3, 7], [5, 3, 7], [3, 7],
    ]  # fmt: skip
    assert states[-1][0]["note"].endswith(HOSTILE)
    after = contents(night)
    assert after.pop("picks.json")
    assert after == before  # bytewise, but for the picks
    told = asked.get("/api/0/picks").json
    assert (told["undo"], told["place"]) == (4, str(night / "picks.json"))
    for state in (states[3], states[2], states[1], states[0], states[0]):
        assert asked.post("/api/0/pick", {"change": "undo"}).json["picks"] == state


def test_picks_outlive_the_server_and_do_no_harm_to_the_run(night):
    with running_server(night) as server:
        opened(server).post("/api/0/pick", {"change": "note", "ids": [4], "note": "the best"})
    with running_server(night) as server:
        assert opened(server).get("/api/0/picks").json["picks"] == [{"id": 4, "note": "the best"}]
    run = evocity.open_run(night)
    assert (len(run), run.damaged) == (24, ())


def test_picks_of_a_run_that_is_not_ones_own_are_kept_with_the_user(night, monkeypatch):
    before = contents(night)
    monkeypatch.setattr(picking, "_is_own", lambda folder: False)
    with running_server(night) as server:
        told = opened(server).post("/api/0/pick", {"change": "pick", "ids": [2]}).json
    assert Path(told["place"]).parent == state_folder() / "picks"
    with running_server(night) as server:
        assert opened(server).get("/api/0/picks").json["picks"] == [{"id": 2, "note": ""}]
    assert contents(night) == before


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[1]",
        '{"version": 2}',
        '{"picks": [{"id": "3"}]}',
        '{"picks": [{"id": 3, "x": 1}]}',
    ],
)
def test_a_damaged_file_of_picks_is_told_and_left(asked, night, text):
    (night / "picks.json").write_text(text)
    told = asked.post("/api/0/pick", {"change": "pick", "ids": [2]})
    assert (told.status, "cannot read the picked births" in told.json["error"]["found"]) == (
        409,
        True,
    )
    assert (night / "picks.json").read_text() == text


@pytest.mark.skipif(sys.platform == "win32", reason="links")
def test_picks_are_not_written_where_a_link_leads(asked, night, tmp_path):
    for content in ("mine", json.dumps({"version": 1})):
        target = tmp_path / "target"
        target.write_text(content)
        (night / "picks.json").unlink(missing_ok=True)
        (night / "picks.json").symlink_to(target)
        assert asked.post("/api/0/pick", {"change": "pick", "ids": [2]}).status == 409
        assert target.read_text() == content


def test_two_hands_at_once_lose_no_pick(asked):
    hands = [
        threading.Thread(target=asked.post, args=("/api/0/pick", {"change": "pick", "ids": [one]}))
        for one in range(12)
    ]
    for hand in hands:
        hand.start()
    for hand in hands:
        hand.join()
    assert {one["id"] for one in asked.get("/api/0/picks").json["picks"]} == set(range(12))


def test_a_run_is_asked_to_breed_from_picks_as_by_the_command(asked, night):
    told = asked.post("/api/0/steer", {"steer": "pick", "ids": [3, 5]}).json
    assert told == {"words": "picked: 3 5", "going": False}
    (line,) = (night / "commands.jsonl").read_text().splitlines()
    assert {"command": "pick", "ids": [3, 5]}.items() <= json.loads(line).items()
    assert asked.post("/api/0/steer", {"steer": "drop", "ids": [3]}).status == 200
    assert asked.post("/api/0/steer", {"steer": "drop", "ids": [9]}).status == 409
    assert asked.post("/api/0/steer", {"steer": "stop", "ids": [9]}).status == 400


# -- files ---------------------------------------------------------------------------------------


def test_chosen_births_are_files_as_the_library_writes_them(asked, night, tmp_path):
    before, run = contents(night), evocity.open_run(night)
    told = asked.post("/api/0/csv", {"ids": [3, 0, 3]})
    run.to_csv(tmp_path / "right.csv", of=[3, 0])
    assert told.content == (tmp_path / "right.csv").read_bytes()
    assert told.headers["content-type"].startswith("text/csv")
    told = asked.post("/api/0/png", {"ids": [3, 0]})
    run.save([3, 0], tmp_path / "right.png")
    right = (told.content, (tmp_path / "right.png").read_bytes())
    assert np.array_equal(*(np.asarray(Image.open(io.BytesIO(one))) for one in right))
    told = asked.post("/api/0/zip", {"ids": [3]})
    with zipfile.ZipFile(io.BytesIO(told.content)) as archive:
        names = set(archive.namelist())
        genome = archive.extract("3/genome.parquet", tmp_path)
    run.save([3], tmp_path / "right.zip")
    with zipfile.ZipFile(tmp_path / "right.zip") as archive:
        assert names == set(archive.namelist())
    assert {"3/map.tif", "3/scene.glb", "scores.csv", "ATTRIBUTION.txt"} <= names
    assert evocity.read_genome(genome) == run[3].genome
    assert asked.post("/api/0/zip", {"ids": list(range(MOST_SAVED + 1))}).status == 409
    assert asked.post("/api/0/csv", {"ids": [99_999]}).status == 409
    assert asked.post("/api/0/zip", {"ids": []}).status == 400
    assert contents(night) == before
