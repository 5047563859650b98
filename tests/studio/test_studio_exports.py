"""Births and children as files of other programs, by the page's own requests."""

import io
import json
import shutil
import zipfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from asking import OLD, Client, contents
from codes import uniformly

import evocity
from evocity.citymap import CityMap
from evocity.errors import EvocityError
from evocity.store import Birth, Header, Member, RunWriter, Source
from evocity.studio import exports
from evocity.studio.server import running_server

CREDIT = "© the survey of left; © the survey of right"


def placed_run(folder: Path):
    """A run of two cities at two places of France, whose birth 2 has both."""
    rng = np.random.default_rng(1)
    cities = [
        CityMap(
            np.kron(rng.integers(0, 3, (4, 4)) * 6.0, np.pad(np.ones((12, 12)), 2)),
            2.0,
            name=name,
            attribution=f"© the survey of {name}",
            origin=origin,
            crs="EPSG:2154",
        )
        for name, origin in (
            ("left", (842_000.0, 6_520_000.0)),
            ("right", (770_000.0, 6_280_000.0)),
        )
    ]
    header = Header(64, 64, 2.0, 0.9, ("left", "right"), CREDIT, None, None, 7, 4, "hash", ("gsi",))
    genomes = [header.chromosome.adopt(uniformly(city).genome, header, None) for city in cities]
    child = evocity.operators.make("pavement_fusion")(genomes, np.random.default_rng(1))
    sources = [Source(city, genome) for city, genome in zip(cities, genomes, strict=True)]
    about = {"fitness": [{"name": "gsi", "goal": "min"}]}
    writer = RunWriter.create(folder, "[run]\n", about, header, sources)
    parents, operators = ((), (), (0, 1)), ("source", "source", "pavement_fusion")
    births = [
        Birth(0, n, parents[n], operators[n], "ok", None, 0.5, {"gsi": 0.4}, genome)
        for n, genome in enumerate([*genomes, child])
    ]
    alive = [Member(n, n, 0, {"crowding": 0.0}) for n in range(3)]
    writer.write_generation(0, births, alive, {"births": 0, "failures": 0})
    writer.close()
    return evocity.open_run(folder)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    run = placed_run(tmp_path_factory.mktemp("runs") / "night")
    before = contents(run.path)
    with running_server(run.path) as server:
        found = Client(server)
        found.open()
        found.run = run
        yield found
    assert contents(run.path) == before


@contextmanager
def in_this_process(monkeypatch):
    """Without a process for each file, which takes seconds."""

    def run(job, request, receive):
        receive_all = []
        exports.write_exports(
            json.loads(json.dumps(request)), lambda **one: receive_all.append(one)
        )
        for one in receive_all:
            receive(one)

    monkeypatch.setattr(exports.DeskJob, "run", run)
    yield


def exported(client, **request):
    return client.post("/api/0/export", {"ids": [2], **request})


def test_every_format_has_the_attribution(client, monkeypatch):
    pytest.importorskip("ezdxf")
    with in_this_process(monkeypatch):
        listed = client.get("/api/0/formats").json
        assert listed["places"] == ["left", "right"]
        for one in listed["formats"]:
            answer = exported(client, format=one["name"], at="left" if one["placed"] else None)
            assert answer.status == 200, answer.json
            content = answer.content
            if one["name"] == "3dm":
                strings = pytest.importorskip("rhino3dm").File3dm.FromByteArray(content).Strings
                content = "".join(strings[k][1] for k in range(len(strings))).encode()
            elif content.startswith(b"PK"):
                with zipfile.ZipFile(io.BytesIO(content)) as archive:
                    content = b"".join(map(archive.read, archive.namelist()))
            found = [word.encode() in content for word in ("survey of left", "survey of right")]
            assert all(found), one["name"]


def test_a_file_is_what_python_writes(client, monkeypatch, tmp_path):
    with in_this_process(monkeypatch):
        answer = exported(client, format="cityjson", at="right", crs="EPSG:32631", level="2.2")
        assert answer.headers["content-disposition"] == 'attachment; filename="night-2.city.json"'
        client.run[2].save(tmp_path / "plain.city.json", "right", "EPSG:32631")
        here, plain = (json.loads(text) for text in (
            answer.content, (tmp_path / "plain.city.json").read_bytes()
        ))  # fmt: skip
        for part in ("referenceSystem", "geographicalExtent"):
            assert here["metadata"][part] == plain["metadata"][part] or part != "referenceSystem"
        levels = {
            geometry["lod"] for one in here["CityObjects"].values() for geometry in one["geometry"]
        }
        assert "2.2" in levels
        both = exported(client, format="geojson", ids=[1, 2], at="left")
        with zipfile.ZipFile(io.BytesIO(both.content)) as archive:
            names = archive.namelist()
        assert names == ["night-1.geojson", "night-2.geojson", "ATTRIBUTION.txt"]


@pytest.mark.parametrize(
    ("request_of", "text"),
    [
        ({"format": "glb", "at": "left", "crs": "EPSG:4326"}, "has degrees"),
        ({"format": "glb", "at": "left", "crs": "EPSG:0"}, "is unknown"),
        ({"format": "glb", "at": "left", "crs": "/etc/passwd"}, "is unknown"),
        ({"format": "glb", "crs": "EPSG:2154"}, "no place on Earth"),
        ({"format": "geojson"}, "no position"),
        ({"format": "glb", "at": "nowhere"}, "is not a source city"),
        ({"format": "fgb", "streets": True}, "streets cannot go"),
        ({"format": "gpkg", "level": "2.2"}, "LoD 2.2"),
        ({"format": "glb", "level": "9"}, "unknown"),
        ({"format": "../glb"}, "is unknown"),
        ({"format": "glb", "ids": []}, "no births"),
        ({"format": "glb", "ids": [99]}, "no individual 99"),
        ({"format": "glb", "ids": [], "children": [0], "brood": 7}, "children"),
    ],
)
def test_a_refusal_is_a_sentence(client, monkeypatch, request_of, text):
    with in_this_process(monkeypatch):
        answer = exported(client, **request_of)
    assert answer.status == 409
    assert text in answer.json["error"]["found"]


def test_a_missing_library_is_a_sentence(client, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ezdxf", None)
    with in_this_process(monkeypatch):
        answer = exported(client, format="dxf")
    assert answer.status == 409
    assert "cad" in json.dumps(answer.json)


@pytest.mark.parametrize(
    "body",
    [
        {"format": "glb", "ids": list(range(21))},
        {"format": "glb", "ids": ["2"]},
        {"format": "glb", "ids": [2], "file": "x.glb"},
        {"format": "glb", "ids": [2], "crs": "x" * 201},
        {"ids": [2]},
    ],
)
def test_exports_have_one_form(client, body):
    assert client.post("/api/0/export", body).status == 400


@pytest.mark.slow
def test_a_drawn_child_is_exported_by_a_process(tmp_path):
    night = shutil.copytree(OLD / "run-6", tmp_path / "night")
    brood = {"operators": ["pavement_fusion"], "parents": [3, 20], "count": 1, "board": True}
    with running_server(night) as server:
        client = Client(server)
        client.open()
        assert client.post("/api/0/breed", brood).status == 200
        wait_for = "/api/0/brood?board=1"
        while client.get(wait_for).json["busy"]:
            pass
        request = {"format": "glb", "brood": 1, "children": [0], "board": True, "streets": True}
        answer = client.post("/api/0/export", request)
        assert answer.headers["content-disposition"] == 'attachment; filename="night-child-0.glb"'
        assert answer.content.startswith(b"glTF")


@pytest.mark.slow
def test_an_export_ends_at_its_limits(client, monkeypatch):
    monkeypatch.setattr(exports, "SECONDS", 0.05)
    answer = exported(client, format="glb")
    assert answer.status == 409
    assert "seconds" in answer.json["error"]["found"]
    assert answer.json["error"]["expected"] == "a smaller map, or a coarser level of detail"


def test_one_export_at_a_time(client):
    exporter = exports.Exports()
    exporter._lock.acquire()
    request = exports.ExportRequest(format="glb", ids=(2,))
    with pytest.raises(EvocityError, match="already writing"):
        exporter.write(client.run, [], request)
