"""The filter desk, maps of autosimilarity, growth and the switches of 3D views, by requests."""

import io
import json
import shlex
import time
from urllib.parse import quote

import numpy as np
import pytest
from asking import Client, contents
from PIL import Image

import evocity
from evocity.coding import autosimilarity_maps, high_pass, low_pass, usage
from evocity.errors import RunError
from evocity.growth import grow
from evocity.operators import Interpolation
from evocity.pictures.colours import field_colours
from evocity.scene import Library
from evocity.studio.background_job import BackgroundJob, Cache, JobSlot
from evocity.studio.filters import SEED
from evocity.studio.run_watcher import RunWatcher
from evocity.studio.server import running_server


def framed(client: Client, name: str, request: dict):
    told = client.get(f"/api/0/{name}?request={quote(json.dumps(request))}")
    assert told.status == 200, told.content
    return told.framed


def heights_in(about: dict, content: bytes) -> np.ndarray:
    return np.frombuffer(content, "<f4").reshape(about["height"], about["width"])


def ended(client: Client, name: str, request: dict) -> dict:
    """The state of a job after its end."""
    end = time.monotonic() + 120
    while (state := client.post(f"/api/0/{name}", request).json)["at"]:
        assert time.monotonic() < end
        time.sleep(0.05)
    return state


# -- the filter desk ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sliders", "right"),
    [
        ({}, lambda ours, theirs: evocity.decode(ours)),
        ({"low": 3}, lambda ours, theirs: evocity.decode(low_pass(ours, 3))),
        ({"high": 2}, lambda ours, theirs: evocity.decode(high_pass(ours, 2))),
        (
            {"low": 9, "high": 1, "count": "domains"},
            lambda ours, theirs: evocity.decode(
                low_pass(high_pass(ours, 1, count="domains"), 9, count="domains")
            ),
        ),
        ({"zoom": 1.5}, lambda ours, theirs: evocity.decode(ours, zoom=1.5)),
        (
            {"beside": 20, "share": 0.6, "low": 4, "zoom": 2},
            lambda ours, theirs: evocity.decode(
                low_pass(Interpolation(share=0.6)([ours, theirs], np.random.default_rng(SEED)), 4),
                zoom=2,
            ),
        ),
    ],
)
def test_a_filtered_map_is_that_of_the_library(asked, night, sliders, right):
    run = evocity.open_run(night)
    about, content = framed(asked, "filtered", {"id": 3, **sliders})
    city = right(run[3].genome, run[20].genome).city
    assert np.array_equal(heights_in(about, content), city.heights)
    assert about["metres"] == city.metres_per_pixel
    if "share" not in sliders:
        count = sliders.get("count", "pixels")
        assert about["most"] == getattr(usage(run[3].genome), count).max()


def test_a_filtered_genome_is_kept_as_children_are(asked, night):
    before = contents(night)
    request = {"id": 3, "beside": 20, "share": 0.4, "low": 5, "zoom": 2}
    told = asked.post("/api/0/filter-keep", {**request, "picks": [7]})
    assert told.status == 200, told.content
    folder = night.parent / "night-children"
    assert told.json["folder"] == str(folder)
    genome = evocity.read_genome(folder / "child-0.parquet")
    about, content = framed(asked, "filtered", {**request, "zoom": 1})
    assert np.array_equal(heights_in(about, content), evocity.decode(genome).city.heights)
    assert genome.made["low_pass"] == {"f_c": 5.0, "count": "pixels"}
    assert genome.made["studio"]["parents"] == [3, 20]
    recipe = evocity.read_recipe(folder / "recipe.toml")
    assert next(parent.name for parent in recipe.parents) == "child-0"
    assert contents(night) == before
    assert asked.post("/api/0/filter-keep", {**request, "picks": [99999]}).status == 409


@pytest.mark.parametrize(
    "request_text",
    ["", "{", '{"id": -1}', '{"id": 3, "zoom": 100}', '{"id": 3, "share": 2}', '{"id": 3, "a": 1}',
     '{"id": 3, "low": NaN}', '{"id": 3, "count": "__class__"}', '{"id": "3"}'],
)  # fmt: skip
def test_a_filter_of_nothing_is_refused(asked, request_text):
    told = asked.get(f"/api/0/filtered?request={quote(request_text)}")
    assert told.status == 400
    assert set(told.json["error"]) == {"found", "expected", "remedy"}


def test_a_map_that_is_too_large_after_the_zoom_is_refused(asked, monkeypatch):
    monkeypatch.setattr("evocity.studio.filters.MOST_PIXELS", 100)
    told = asked.get(f"/api/0/filtered?request={quote(json.dumps({'id': 3, 'zoom': 2}))}")
    assert told.status == 409
    assert "zoom 2" in told.json["error"]["found"]


# -- autosimilarity -------------------------------------------------------------------------------

SEARCH = {"ids": [3, 20], "block": 4, "domains": [8, 12], "normalise": "heights"}


def test_maps_of_autosimilarity_are_those_of_the_library(asked, night):
    run = evocity.open_run(night)
    assert ended(asked, "fields", SEARCH)["ready"]
    maps = {n: autosimilarity_maps(run[n].city, block=4, domains=(8, 12)) for n in (3, 20)}
    for measure in ("mean", "least", "domain"):
        pictures = {
            n: framed(asked, "field", {**SEARCH, "place": [3, 20].index(n), "measure": measure})
            for n in maps
        }
        ends = {about["end"] for about, _ in pictures.values()}
        assert len(ends) == 1  # both births have the same colours
        for n, (about, content) in pictures.items():
            values = getattr(maps[n], measure)
            seen = np.asarray(Image.open(io.BytesIO(content)))[: values.shape[0]]
            assert np.array_equal(seen, field_colours(values, *ends))
            assert about["curve"] == [[d, pytest.approx(e)] for d, e in maps[n].curve.items()]
            assert about["unit"] == ("px" if measure == "domain" else "")


def test_a_search_that_is_impossible_names_the_reason(asked):
    assert "64" in ended(asked, "fields", SEARCH | {"block": 15, "domains": [9]})["error"]
    told = asked.get(
        f"/api/0/field?request={quote(json.dumps({**SEARCH, 'place': 0, 'measure': 'x'}))}"
    )
    assert told.status == 400
    assert asked.post("/api/0/fields", SEARCH | {"domains": []}).status == 400


# -- growth ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_fabric_grows_as_the_command_grows_it(asked, night):
    request = {"id": 3, "times": 2, "seed": 5, "streets": False, "straight": True}
    state = ended(asked, "grow", request)
    assert state["ready"], state
    assert state["done"] == state["total"] > 0
    about, content = framed(asked, "grown", request)
    run = evocity.open_run(night)
    right = grow(run[3].genome, 128, 128, np.random.default_rng(5), turned=False)
    seen = heights_in(about, content)
    assert np.array_equal(seen, right.city().heights)
    (top, left), (height, width) = (about["top"], about["left"]), about["window"]
    window = seen[top : top + height, left : left + width]
    assert np.array_equal(window, run[3].city.heights)
    words = shlex.split(state["command"])
    assert words[:3] == ["evocity", "grow", str(night)]
    assert {"--straight", "--seed", "--id"} <= set(words)
    told = asked.post("/api/0/grow-save", {**request, "suffix": "tif"}).json
    end = time.monotonic() + 120
    while (told := asked.get("/api/0/growth-file").json)["at"]:
        assert time.monotonic() < end
        time.sleep(0.1)
    assert told["code"] == 0, told
    assert told["path"] == str(night.parent / "night-grown" / "grown-3.tif")
    assert np.array_equal(evocity.read_map(told["path"]).heights, seen)


def test_a_growth_that_is_stopped_leaves_nothing(asked, night):
    before = contents(night.parent)
    request = {"id": 3, "times": 3}
    assert asked.post("/api/0/grow", request).json["at"]
    assert asked.post("/api/0/grow-stop", {}).status == 200
    told = asked.get(f"/api/0/grown?request={quote(json.dumps({**request, 'times': 1}))}")
    assert told.status == 400
    assert contents(night.parent) == before
    assert asked.get("/api/0/growth-file").json == {}


# -- 3D views -------------------------------------------------------------------------------------


def test_streets_classes_and_objects_are_switched_on(night, tmp_path):
    run = evocity.open_run(night)
    city, highest = run[3].city, RunWatcher(night).moment.thumbnails.highest
    Library.of(run[20].city, licence="CC0-1.0").write(tmp_path / "library")
    library = Library.read(tmp_path / "library")
    with running_server(night, library=tmp_path / "library") as server:
        client = Client(server)
        client.open()
        assert client.get("/api/0/scene-options").json == {"library": True}
        for query, how, colours in (
            ("", {}, "heights"),
            ("&streets=1", {"streets": True}, "heights"),
            ("&classes=1", {}, "classes"),
            ("&library=1&classes=1&streets=1", {"library": library, "streets": True}, "classes"),
        ):
            about, content = client.get(f"/api/0/solids?id=3{query}").framed
            scene = evocity.scene(city, **how)
            corners, shades = scene.triangles(colours, highest=highest)
            assert content == corners.astype("<f4").tobytes() + shades.tobytes()
            counts = {group.name: len(group) for group in scene.groups}
            assert all(counts[name] == count for name, _, count in about["groups"])
            if colours == "classes":
                assert {name for name, _, _ in about["groups"]} == {
                    k for k, n in counts.items() if n
                }
        assert client.get("/api/0/solids?id=3&streets=2").status == 400


# -- jobs -----------------------------------------------------------------------------------------


def test_a_newer_job_replaces_the_one_before():
    slot, ends = JobSlot(), []

    def work(job: BackgroundJob):
        job.at_stop.append(lambda: ends.append(job.key))
        while True:
            job.progress(1, 2)
            time.sleep(0.005)

    assert slot.begin("first", work)["at"]
    assert slot.begin("first", work)["at"]
    first = slot.job
    slot.begin("second", lambda job: {"b": 2})
    first.join(60)
    slot.job.join(60)
    assert ends == ["first"]
    assert first.result is None
    assert slot.begin("second", work)["ready"]
    assert slot.result("second", "maps") == {"b": 2}
    slot.begin("third", lambda job: 1 / 0)
    if slot.job is not None:
        slot.job.join(5)
    assert slot.job is None or "division" in slot.begin("third", work)["error"]
    assert slot.job is None  # the next call tries again
    with pytest.raises(RunError, match="not ready"):
        slot.result("third", "maps")


def test_the_last_results_are_kept():
    cache, made = Cache(2), []
    for key in "abaca":
        assert cache.get(key, lambda key=key: made.append(key) or key) == key
    assert made == ["a", "b", "c"]
