"""The recipe desk, asked as its page asks: files, goals, a recipe, a run that is begun, killed and
taken up."""

import contextlib
import errno
import http.client
import json
import os
import signal
import tempfile
import threading
import time
import tomllib
from typing import ClassVar
from unittest.mock import patch

import pytest
from asking import HOSTILE, Client, contents
from brought import KIND, bring, chosen, desk, ending, footprints, is_read, wait
from toy_runs import forgotten, unsealed, write_toy  # noqa: F401

import evocity
from evocity.errors import EvocityError, RunError
from evocity.search.calibration.calibration import GUARD
from evocity.studio import desk_maps, guard, subprocesses
from evocity.studio.desk import BeginRequest, MapNumber
from evocity.studio.desk_draft import Draft
from evocity.studio.desk_maps import MapChoice, Maps, Window
from evocity.studio.request_fields import RequestError, parse_body
from evocity.studio.server import running_server
from evocity.studio.subprocesses import DeskJob, LastingJob, ResumeRequest, RunProcesses, log_of

CITIES = ("cape-town-salt-river", "lyon-1er")


@contextlib.contextmanager
def at_desk(folder, cities=(), **told):
    """A client of a studio whose runs go into ``folder``, with some ``cities``."""
    with (
        patch.object(desk_maps, "DISTRICTS", dict.fromkeys(cities)),
        running_server(folder=folder, fresh=True, **told) as server,
        ending(server),
    ):
        client = Client(server)
        client.open()
        yield client


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    return [footprints(folder / f"{n}.geojson", n) for n in (1, 2)]


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """Its folder of maps lies where no other process lays any."""
    folder, own = tmp_path_factory.mktemp("desk") / "runs", tmp_path_factory.mktemp("own")
    with at_desk(folder, CITIES) as found:
        with patch.object(tempfile, "tempdir", str(own)):
            assert found.server.studio.desk_routes.desk.maps.folder.parent == own
        yield found
    assert not folder.exists()  # it comes with the first run


def test_the_desk_has_cities_and_measures_without_a_run(client):
    told = wait(client, is_read)
    assert client.get("/api/runs").json["runs"] == []
    assert [one["title"] for one in told["maps"]] == list(CITIES)
    by_name = {one["title"]: one for one in told["maps"]}
    lyon = by_name["lyon-1er"]
    assert lyon["about"]["metres"] == [512.0, 512.0]
    assert sum(lyon["about"]["rules"].values()) == 771
    assert "IGN" in lyon["about"]["attribution"]
    picture = client.get(f"/api/desk-picture?map={lyon['map']}&turn=1")
    assert (picture.headers["content-type"], picture.content[:4]) == ("image/png", b"\x89PNG")
    measures = {one["name"]: one for one in client.get("/api/desk-measures").json["measures"]}
    assert set(measures) == {
        one.name for one in evocity.fitness.measures() if one.origin == "evocity"
    }
    assert all(one["told"] for one in measures.values())
    assert {one["measure"] for one in told["draft"]["goals"]} == {
        name for name, one in measures.items() if one["usual"]
    }


@pytest.mark.parametrize(
    ("name", "title"),
    [
        (f"{HOSTILE}.geojson", None),
        ("../../../etc/passwd.geojson", "etc-passwd"),
        ("/tmp/x.GeoJSON", "tmp-x"),
        ("C:\\a\\b.json", "C--a-b"),
        ("\0\n\u202e.geojson", None),
        (".geojson.geojson", "geojson"),
        ("..geojson", "map"),
        ("é" * 400 + ".geojson", None),
        ("CON.geojson", "CON"),
    ],
    ids=range(9),
)
def test_a_name_is_text_and_never_a_path(client, two, name, title):
    folder = client.server.studio.desk_routes.desk.maps.folder
    before = set(folder.parent.iterdir())
    told = bring(client, name, two[0].read_bytes())
    assert told.status == 200
    number = told.json["map"]
    laid = next(one for one in desk(client)["maps"] if one["map"] == number)
    assert not set('/\\:<>|"*?\n\0\u202e') & set(laid["title"])
    assert title is None or laid["title"].endswith(title)
    suffix = ".json" if name.endswith(".json") else ".geojson"
    assert (folder / f"map-{number}{suffix}").is_file()
    assert set(folder.parent.iterdir()) == before
    assert client.post("/api/desk-drop", {"map": number}).status == 200
    # a process may be reading the map just now
    until(lambda: not [one for one in folder.iterdir() if str(number) in one.stem])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.shp", "Shapefile"),
        ("a.dbf", "GeoPackage"),
        ("a.toml", "not a map"),
        ("a.py", "not a map"),
        ("geojson", "not a map"),
        ("a.geojson/", "not a map"),
    ],
)
def test_what_is_no_map_by_its_name_is_refused(client, name, said):
    told = bring(client, name, b"{}")
    assert told.status == 409
    assert said in json.dumps(told.json["error"])


def test_a_file_that_is_refused_by_its_name_is_heard_out(client):
    # else a browser that still sends it is cut off, and does not see the answer
    connection = http.client.HTTPConnection("127.0.0.1", client.server.port, timeout=120)
    connection.putrequest("POST", f"{guard.FILE}?name=a.shp")
    said = [("Cookie", client.cookie), KIND, guard.HEADER, ("Content-Length", str(20 << 16))]
    for one in said:
        connection.putheader(*one)
    connection.endheaders()
    for _ in range(20):
        time.sleep(0.02)
        connection.send(b" " * (1 << 16))
    answer = connection.getresponse()
    assert (answer.status, "Shapefile" in answer.read().decode()) == (409, True)
    connection.close()


@pytest.mark.slow
def test_what_a_file_holds_is_told_as_its_reader_says(client, two):
    content = two[0].read_bytes()
    wrong = {
        "a.geojson": b"",
        "b.geojson": content[:-30],
        "c.png": content,
        "d.tif": b"II*\0" + bytes(100),
        "e.gpkg": b"SQLite format 3\0" + bytes(1000),
        "f.geojson": b"[" * 100_000,
    }
    numbers = {name: bring(client, name, held).json["map"] for name, held in wrong.items()}
    told = {one["map"]: one for one in wait(client, is_read)["maps"]}
    for name, number in numbers.items():
        one = told[number]
        assert set(one["fault"]) == {"found", "expected", "remedy"}, name
        assert one["about"] is None
        assert client.get(f"/api/desk-picture?map={number}").status == 400
        client.post("/api/desk-drop", {"map": number})
    assert "PNG" in told[numbers["c.png"]]["fault"]["expected"]


def test_a_file_that_is_too_long_leaves_nothing(client, two, monkeypatch):
    folder = client.server.studio.desk_routes.desk.maps.folder
    before = contents(folder)
    monkeypatch.setattr(guard, "MOST_FILE", 1 << 17)
    chunk = b"10000\r\n" + b" " * 65536 + b"\r\n"
    headers = [("Content-Type", guard.FILE_KIND), guard.HEADER]
    told = bring(client, "a.geojson", chunk * 5, [*headers, ("Transfer-Encoding", "chunked")])
    assert told.status == 413
    assert told.json["error"]["expected"] == "131 kB at most"
    told = bring(client, "a.geojson", b" " * 200_000)
    assert told.status == 413
    assert told.json["error"]["expected"] == "131 kB at most"
    assert desk(client)["longest"] == 1 << 17
    assert contents(folder) == before
    monkeypatch.setattr(desk_maps, "MOST_MAPS", 0)
    assert bring(client, "a.geojson", two[0].read_bytes()).status == 409
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("memory", "seconds", "said"), [(1 << 20, 60.0, "of memory"), (4 << 30, 0.0, "0 seconds")]
)
def test_reading_ends_where_it_takes_more_than_it_may(two, tmp_path, memory, seconds, said):
    one = {"number": 1, "map": str(two[0]), "options": {}, "picture": str(tmp_path / "p.png")}
    told: list[dict] = []
    with pytest.raises(EvocityError, match=said):
        DeskJob(memory, seconds, "reading").run({"job": "read", "maps": [one]}, told.append)
    assert told == []


@pytest.mark.slow
def test_a_process_that_is_slow_to_end_has_no_fault(two, tmp_path, monkeypatch):
    """Where the machine is busy, Python itself ends late; the results are there."""
    monkeypatch.setattr(subprocesses, "_PATIENCE", 0.0)
    one = {"number": 1, "map": str(two[0]), "options": {}, "picture": str(tmp_path / "p.png")}
    told: list[dict] = []
    DeskJob(4 << 30, 60.0, "reading").run({"job": "read", "maps": [one]}, told.append)
    assert [one["map"] for one in told] == [1]


class Scripted(LastingJob):
    """An errand that does what `does` says in place of reading, for each time."""

    does: ClassVar[list] = []

    def run(self, errand, told):
        Scripted.does.pop(0)(errand, told)


@pytest.fixture
def laid(tmp_path, monkeypatch):
    """Maps on no desk, of two files that a `Scripted` reads."""
    monkeypatch.setattr(desk_maps, "DISTRICTS", {})
    monkeypatch.setattr(desk_maps, "LastingJob", Scripted)
    found = Maps()
    for number in (1, 2):
        path, suffix = found.begin(f"{number}.geojson")
        path.write_bytes(b"{}")
        found.add(path, f"{number}.geojson", suffix)
    yield found
    found.close()


def read(laid) -> dict:
    until(lambda: not any(one["reading"] for one in laid.states()))
    return {one["title"]: one for one in laid.states()}


def tell_all(errand, told):
    for one in errand["maps"]:
        told({"map": one["number"], "about": {}})


def test_reading_goes_on_after_any_error(laid):
    def fail(errand, told):
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    Scripted.does = [fail, *[tell_all] * 3]
    told = read(laid)
    assert "Resource temporarily unavailable" in told["1"]["fault"]["found"]
    assert told["2"]["fault"] is None
    laid.place(Window(pixels=64), {})
    assert read(laid)["1"]["fault"] is None


def test_a_disk_without_room_is_told_at_each_map(laid):
    def fail(*args, **kwargs):
        raise OSError(errno.ENOSPC, "No space left on device")

    Scripted.does = [tell_all, tell_all]
    with patch.object(desk_maps, "ProcessFolder", fail):
        found = Maps()
        found._entries = dict(laid._entries)
        told = read(found)
        assert all("No space left" in one["fault"]["found"] for one in told.values())
    found.place(Window(pixels=64), {})
    assert all(one["fault"] is None for one in read(found).values())
    found.close()


def test_the_fault_of_a_map_that_was_taken_away_is_no_others(laid):
    def fail(errand, told):
        laid.drop(errand["maps"][0]["number"])
        raise EvocityError("it died", "a map", "another")

    Scripted.does = [fail, tell_all]
    told = read(laid)
    assert (list(told), told["2"]["fault"]) == (["2"], None)


@pytest.mark.parametrize(
    "wrong",
    [
        {"name": "../x"},
        {"name": "a/b"},
        {"name": ".hidden"},
        {"name": "a\nb"},
        {"name": "é" * 100 + "x"},
        {"name": "\ud800"},
        {"seed": -1},
        {"population": 1},
        {"generations": 0},
        {"minutes": 0},
        {"window": {"pixels": 1, "metres_per_pixel": 2.0}},
        {"window": {"pixels": 64, "metres_per_pixel": 0}},
        {"goals": [{"measure": "none", "want": "max"}]},
        {"goals": [{"measure": "/tmp/own.py", "want": "max"}]},
        {"goals": [{"measure": "gsi", "want": "max", "file": "own.py"}]},
        {"goals": [{"measure": "gsi", "want": "max"}] * 2},
        {"maps": [{"map": 99}]},
        {"maps": [{"map": 0}, {"map": 0}]},
        {"maps": [{"map": 0, "map_file": "/etc/passwd"}]},
        {"maps": [{"map": "../../x.geojson"}]},
        {"maps": [{"map": 0, "at": [1e9, 0]}]},
        {"maps": [{"map": 0, "center": [4, 45]}]},
        {"lock": {"map": 0, "shapes": [[[0, 0], [1, 1]]]}},
        {"lock": {"map": 0, "file": 0}},
        {"within": {"map": 99}},
        {"within": {"map": 0, "shapes": [], "path": "/etc/passwd"}},
        {"notify": {"on_end": "touch x"}},
        {"cluster": "tcp://evil.example:1"},
    ],
    ids=str,
)
def test_a_draft_names_no_file_and_nothing_that_is_not_there(client, wrong):
    before = desk(client)["draft"]
    told = client.post("/api/desk-change", before | wrong)
    assert told.status == 400
    assert set(told.json["error"]) == {"found", "expected", "remedy"}
    assert desk(client)["draft"] == before


@pytest.mark.parametrize(
    ("wrong", "found", "expected"),
    [
        ({"name": "a/b"}, "name of the run = 'a/b'", "without any of / "),
        ({"generations": 1.5}, "generations = 1.5", "a whole number from 1 to 1000000"),
        ({"generations": None}, "generations: nothing was typed", "a whole number"),
        ({"generations": "x" * 1000}, "generations = 'xxx", "a whole number"),
        ({"minutes": 0}, "minutes = 0", "from 1 to 525600"),
        ({"population": 1}, "individuals alive = 1", "from 2 to 1000000"),
        ({"seed": -1}, "seed = -1", "from 0 to 9007199254740991"),
        (
            {"window": {"pixels": 1, "metres_per_pixel": 2.0}},
            "width of the square map in pixels = 1",
            "8 to",
        ),
        ({"maps": [{"map": 0, "at": [1e9, 0]}]}, "place of the window = ", "metres"),
        ({"maps": [{"map": 0, "attribution": "x" * 100_000}]}, "attribution = 'xx", "1 to 1000"),
        ({"maps": [{"map": 0, "default_height": 0}]}, "default height = 0", "metres"),
        ({"goals": [{"measure": "gsi", "want": "target", "target": "a"}]}, "target = 'a'", "a num"),
    ],
    ids=str,
)
def test_a_field_at_fault_is_told_by_its_name_with_what_is_right(client, wrong, found, expected):
    told = client.post("/api/desk-change", desk(client)["draft"] | wrong).json["error"]
    assert told["found"].startswith(found)
    assert expected in told["expected"]
    assert told["remedy"].startswith("type another ")
    assert len(told["found"]) < 100


def test_a_body_that_no_page_sends_is_told_as_such(client):
    before = desk(client)["draft"]
    told = client.post("/api/desk-change", before | {"generation": 1})
    assert told.json["error"]["remedy"] == "load the page again"
    with pytest.raises(RequestError, match="to generation = 0"):
        parse_body(ResumeRequest, b'{"generations": 0}')


def test_without_maps_or_goals_or_a_recipe_nothing_begins(client):
    chosen(client, [])
    for name in ("desk-calibrate", "desk-begin"):
        assert client.post(f"/api/{name}", {}).status == 409
    assert client.post("/api/desk-begin", {"given": True}).status == 409
    assert chosen(client, [0], goals=[]).status == 200
    assert client.post("/api/desk-calibrate", {}).status == 409
    assert chosen(client, [0], goals=[{"measure": "gsi", "want": "target"}]).status == 200
    assert client.post("/api/desk-calibrate", {}).status == 409
    assert client.post("/api/desk-end", {"map": 0}).status == 400


def test_a_map_that_is_taken_away_meanwhile_stays_in_no_draft(client, two, monkeypatch):
    number = bring(client, "gone.geojson", two[0].read_bytes()).json["map"]
    found, of_number = client.server.studio.desk_routes.desk, Maps.__getitem__
    dropping = threading.Thread(target=found.drop, args=(MapNumber(map=number),))

    def looked(self, number):
        laid = of_number(self, number)
        if not dropping.ident:  # a second tab, as soon as the map is seen to be there
            dropping.start()
            dropping.join(0.5)
        return laid

    monkeypatch.setattr(Maps, "__getitem__", looked)
    found.change(Draft(maps=(MapChoice(map=number, chosen=True),)))
    dropping.join()
    told = desk(client)
    assert number not in [one["map"] for one in told["maps"]]
    assert number not in [one["map"] for one in told["draft"]["maps"]]
    found.draft = Draft(maps=(MapChoice(map=number, chosen=True),))
    assert desk(client)["usual"] == "run"
    found.draft = Draft()


def test_calibrating_is_stopped(client):
    assert chosen(client, [0, 1]).status == 200
    assert client.post("/api/desk-calibrate", {}).json["busy"]
    assert client.post("/api/desk-change", desk(client)["draft"]).status == 409
    client.post("/api/desk-stop", {})
    told = wait(client, lambda one: not one["busy"])
    assert (told["found"], told["fault"], told["said"][-1]) == (None, None, "stopped")


# -- a whole run ----------------------------------------------------------------------------------


def of(client, path="/api/0/changes?after=-1") -> dict:
    return client.get(path).json


def until(ready) -> None:
    end = time.monotonic() + 120
    while not ready():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.fixture
def given(two, tmp_path):
    """A recipe of two files that names no goal but its own."""
    for number, file in enumerate(two):
        (tmp_path / f"{number}.geojson").write_bytes(file.read_bytes())
    path = tmp_path / "given.toml"
    path.write_text(
        '# as it is\n[run]\nname = "my night"\npopulation = 2\ngenerations = 99999\n'
        "[map]\npixels = 32\n[genome]\nblock = 4\nfit = false\n[evaluation]\nworkers = 0\n"
        '[[parents]]\nmap = "0.geojson"\n[[parents]]\nmap = "1.geojson"\n'
        '[operators]\nmutation = 1\n[[fitness]]\nname = "gsi"\ngoal = "max"\n'
    )
    return path


@pytest.mark.slow
def test_a_night_is_begun_killed_taken_up_and_stopped_and_outlives_studio(given, tmp_path):
    runs = tmp_path / "runs"
    with at_desk(runs, recipe=given) as client:
        assert desk(client)["given"]["text"].startswith("# as it is")
        (started,) = client.post("/api/desk-begin", {"given": True}).json["started"]
        assert started["at"]
        told = client.post("/api/desk-begin", {"given": True}).json["started"][1]
        assert told["name"] == "my night-2"  # nothing is written over
        client.post("/api/desk-end", {"map": 1})
        told = wait(client, lambda one: one["started"][0]["has"] and not one["started"][1]["at"])
        assert told["started"][1]["code"] in (143, -signal.SIGTERM)
        assert (told["started"][0]["run"], told["started"][1]["run"]) == (0, None)

        process, _ = client.server.studio.desk_routes.processes._of[runs / "my night"]
        os.killpg(process.pid, signal.SIGKILL)
        until(lambda: not of(client)["going"])
        assert of(client)["process"]["code"] == -signal.SIGKILL
        assert client.post("/api/0/stop-run", {}).status == 409
        before = of(client)["generation"]
        assert client.post("/api/0/resume", {"generations": 10**8}).status == 400
        assert client.post("/api/0/resume", {"generations": 99_999_000}).status == 200
        assert client.post("/api/0/resume", {}).status == 409  # a process is at it
        until(lambda: of(client)["generation"] > before)

    with at_desk(runs) as client:  # it goes on without studio
        assert of(client)["going"]
        assert "process" not in of(client)
        assert client.post("/api/0/stop-run", {}).status == 200
        until(lambda: not of(client)["going"])
    assert sorted(one.name for one in runs.iterdir()) == ["my night"]
    assert not (runs / "my night" / "picks.json").exists()


@pytest.mark.slow
def test_the_fault_of_a_run_that_cannot_begin_is_told(given, tmp_path):
    (tmp_path / "1.geojson").write_text("{}")
    with at_desk(tmp_path / "runs", recipe=given) as client:
        client.post("/api/desk-begin", {"given": True})
        (one,) = wait(client, lambda told: not told["started"][0]["at"])["started"]
        assert (one["code"], one["run"]) == (2, None)
        assert "1.geojson" in one["said"]
        given.write_text("[run]\n")
        told = client.post("/api/desk-begin", {"given": True})
        assert told.status == 409
        assert "given.toml" in told.json["error"]["found"]


def test_a_strangers_run_is_not_taken_up_where_it_brings_measures(tmp_path):
    path = write_toy(tmp_path, generations=1, workers=0)
    with evocity.Search(evocity.read_recipe(path), out=tmp_path / "run") as search:
        list(search)
    provenance = tmp_path / "run" / "provenance.json"
    provenance.write_text(json.dumps(unsealed(provenance) | {"marks": []}))
    before = contents(tmp_path)
    with running_server(tmp_path / "run") as server:
        client = Client(server)
        client.open()
        told = client.post("/api/0/resume", {"generations": 2})
        assert told.status == 409
        assert "toys.py" in told.json["error"]["found"]
        assert "--trust" in told.json["error"]["remedy"]
        assert desk(client)["home"] == str(tmp_path)  # beside the run that was named
    assert contents(tmp_path) == before


@pytest.mark.parametrize("linked", ["folder", "log"])
def test_what_lies_beside_a_strangers_run_is_not_written_to(tmp_path, monkeypatch, linked):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    run, beside = tmp_path / "run", tmp_path / "run-recipe"
    path = write_toy(tmp_path, generations=1, workers=0)
    with evocity.Search(evocity.read_recipe(path), out=run) as search:
        list(search)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "recipe.toml").touch()
    victim = tmp_path / "elsewhere" / "run.log"
    victim.write_text("mine")
    if linked == "folder":
        beside.symlink_to(tmp_path / "elsewhere")
        assert tmp_path / "state" in log_of(run).parents
    else:
        beside.mkdir()
        (beside / "recipe.toml").touch()
        assert log_of(run) == beside / "run.log"  # begun here
        (beside / "run.log").symlink_to(victim)
        with pytest.raises(RunError, match=r"run.log"):
            RunProcesses().begin(run, ["--version"], log_of(run))
        provenance = run / "provenance.json"
        provenance.write_text(json.dumps(unsealed(provenance) | {"marks": []}))
        assert tmp_path / "state" in log_of(run).parents
    assert victim.read_text() == "mine"


@pytest.mark.slow
def test_measures_of_a_file_come_from_the_command_line_alone(two, tmp_path):
    file = tmp_path / "own.py"
    file.write_text(
        "import evocity\n@evocity.fitness(goal=None)\ndef mean(city):\n"
        '    """Mean height."""\n    return city.heights.mean()\n'
    )
    measures = evocity.fitness.load_file(file)
    with at_desk(tmp_path / "runs", files=[(str(file), measures)]) as client:
        (own,) = [one for one in of(client, "/api/desk-measures")["measures"] if one["own"]]
        assert (own["name"], own["goal"], own["told"]) == ("mean", None, "Mean height.")
        numbers = [bring(client, "a b.geojson", one.read_bytes()).json["map"] for one in two]
        goals = [
            {"measure": "mean", "want": "first"},
            {"measure": "gsi", "want": "target", "target": 0.25},
            {"measure": "crumbs", "want": "max"},
        ]
        assert chosen(client, numbers, goals=goals, minutes=1.0).status == 200
        client.post("/api/desk-calibrate", {})
        told = wait(client, lambda one: one["found"] or one["fault"])
        assert told["fault"] is None
        assert told["said"][-1] == "breeding trial children to estimate the duration"
        wait(client, lambda one: not one["busy"])
        assert (
            desk(client)["found"]["text"] == told["found"]["text"]
        )  # a page that is loaded again has it
        assert all(
            one.is_file() for one in client.server.studio.desk_routes.desk.maps.folder.iterdir()
        )
        raw = tomllib.loads(told["found"]["text"])
        assert [one["name"] for one in raw["parents"]] == ["a b", "a b 2"]
        assert {one["name"] for one in raw["fitness"][3:]} <= set(GUARD)
        assert raw["run"]["generations"] == told["found"]["generations"] > 1
        assert 30 < told["found"]["duration"] <= 61
        words = "gsi: 0.25 is less than any parent has"  # told before the night
        assert any(note.startswith(words) for note in told["found"]["notes"])
        first, second, third = raw["fitness"][:3]
        assert (first["file"], first["target"] > 0) == (str(file), True)
        assert second == {"name": "gsi", "target": 0.25}
        assert third == {"name": "crumbs", "goal": "max"}


# -- a machine that has no room -------------------------------------------------------------------


def full(*args, **kwargs):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_is_told_when_a_recipe_is_made_and_leaves_nothing(client, two):
    number = bring(client, "full.geojson", two[0].read_bytes()).json["map"]
    assert chosen(client, [number]).status == 200
    folder = client.server.studio.desk_routes.desk.maps.folder
    with patch.object(desk_maps.shutil, "copyfile", full):
        told = client.post("/api/desk-calibrate", {})
    assert told.status == 409
    assert "No space left" in told.json["error"]["found"]
    assert not [one for one in folder.iterdir() if one.is_dir()]
    client.post("/api/desk-drop", {"map": number})


@pytest.mark.parametrize(
    ("place", "said"),
    [("subprocess.Popen", "process"), ("RunDirectory.append", "run.log cannot be written")],
)
def test_a_run_that_cannot_begin_leaves_nothing(tmp_path, place, said):
    runs = tmp_path / "runs"
    with at_desk(runs, CITIES) as client:
        assert chosen(client, [0]).status == 200
        found = client.server.studio.desk_routes.desk
        found._result = {"text": "x"}
        with (
            patch("evocity.studio.output_files.read_recipe"),
            patch(f"evocity.studio.subprocesses.{place}", full, create=True),
            pytest.raises(RunError, match=said),
        ):
            found.begin(BeginRequest())
        assert list(runs.iterdir()) == []
        found._result = None
