"""A birth beside another one, beside its parents' buildings, and all its ancestors."""

import io

import numpy as np
import pytest
from PIL import Image

import evocity
from evocity.citymap import CityMap
from evocity.errors import EvocityError
from evocity.pictures import Change, render_change
from evocity.pictures.colours import change_colours, scale_end
from evocity.scene import Scene
from evocity.studio import birth_details as ones
from evocity.studio.birth_details import MOST_POINTS, Solids
from evocity.studio.run_watcher import RunWatcher

CITY = CityMap(np.array([[0, 6, 0], [9, 9, 0]], np.float32), 2.0, name="a", attribution="© A")


def test_a_change_is_what_the_second_has_more():
    more = np.array([[0, 0, 4], [-9, 1, 0]], np.float32)
    other = CITY.replace(CITY.heights + more, name="b", attribution="© B")
    change = Change(CITY, other)
    assert (change.metres == more).all()
    assert (Change(other, CITY).metres == -change.metres).all()
    assert change.apart == pytest.approx(2 / 6)
    assert change.attribution == "© A; © B"
    assert Change(CITY, CITY).apart == 0
    with pytest.raises(EvocityError, match="the same number and size of pixels"):
        Change(CITY, CityMap(CITY.heights, 1.0))
    low, middle, high = change_colours(np.array([-1.0, 0.0, 1.0]), 1.0).astype(int)
    assert low[2] > low[0]  # blue
    assert high[0] > high[2]  # red
    assert middle.min() > 220
    assert render_change(change, zoom=8).size[0] > 24


def test_two_maps_are_on_one_scale_and_their_difference_is_the_librarys(asked, night):
    run = evocity.open_run(night)
    first, other = run[3], run[21]
    highest = scale_end(first.city, other.city)
    assert scale_end(first.city) != scale_end(other.city)
    for a, b in ((first, other), (other, first)):
        told = asked.get(f"/api/0/picture?id={a.id}&kind=map&beside={b.id}").content
        seen, right = Image.open(io.BytesIO(told)), a.picture(highest=highest)
        assert np.array_equal(np.asarray(seen), np.asarray(right))
    about, png = asked.get("/api/0/difference?id=3&beside=21").framed
    change = Change(other.city, first.city)
    assert about["apart"] == change.apart > 0
    assert about["more"] == pytest.approx(float(change.metres.mean()), abs=1e-6)
    assert np.array_equal(
        np.asarray(Image.open(io.BytesIO(png))), np.asarray(render_change(change))
    )
    assert asked.get("/api/0/difference?id=3&beside=3").framed[0] == {"apart": 0, "more": 0}
    ends = {
        (n, m): asked.get(f"/api/0/calls?id={n}&count=pixels&beside={m}").framed[0]["end"]
        for n, m in ((3, 21), (21, 3), (3, -1), (21, -1))
    }
    assert ends[3, 21] == ends[21, 3] == max(ends[3, -1], ends[21, -1])
    assert ends[3, -1] != ends[21, -1]


@pytest.mark.parametrize("of", ["area", "height", "perimeter", "volume"])
def test_buildings_are_those_of_birth_parents_cities_and_the_pinned(asked, night, of):
    run = evocity.open_run(night)
    child = next(one for one in run if len(one.parents) == 2 and one.status == "ok")
    told = asked.get(f"/api/0/buildings?id={child.id}&of={of}&beside=0").json
    cities = {source.city.name: source.city for source in run.sources()}
    cities |= {f"parent {parent.id}": parent.city for parent in child.parents}
    cities |= {f"individual {child.id}": child.city}
    if 0 not in [parent.id for parent in child.parents]:
        cities |= {"birth 0": run[0].city}
    assert [line["name"] for line in told["listed"]][-1] == f"individual {child.id}"
    assert {line["name"] for line in told["listed"]} == set(cities)
    for line in told["listed"]:
        values = np.sort(getattr(cities[line["name"]].buildings, of).astype(float))
        assert line["count"] == len(values) > 0
        assert line["quartiles"][1] == np.median(values)
        assert len(line["values"]) == len(line["shares"]) <= MOST_POINTS
        shares = np.searchsorted(values, line["values"], side="right") / len(values)
        assert (shares >= np.array(line["shares"]) - 1e-12).all()
        assert line["shares"][-1] == 1
        assert line["values"][-1] == values[-1]


def test_solids_are_the_scenes_triangles_and_are_made_once(asked, night, monkeypatch):
    run = evocity.open_run(night)
    highest = RunWatcher(night).moment.thumbnails.highest
    for one in (3, 20):
        about, content = asked.get(f"/api/0/solids?id={one}").framed
        assert about["groups"] == [] or about["groups"][0][0] == "ground"
        corners, colours = run[one].scene().triangles(highest=highest)
        count = len(colours)
        assert len(content) == 39 * count > 0
        seen = np.frombuffer(content[: 36 * count], "<f4").reshape(count, 3, 3)
        assert np.array_equal(seen, corners)
        assert content[36 * count :] == colours.tobytes()
    monkeypatch.setattr(Scene, "triangles", None)  # they are at hand
    assert asked.get("/api/0/solids?id=20").framed[1] == content
    monkeypatch.undo()
    monkeypatch.setattr(ones, "MOST_TRIANGLES", 10)
    told = asked.get("/api/0/solids?id=5")
    assert told.status == 409
    assert "at most 10" in told.json["error"]["expected"]


def test_solids_of_many_births_are_not_all_kept(night, monkeypatch):
    monkeypatch.setattr(ones, "MOST_KEPT", 2)
    found = Solids(RunWatcher(night))
    first = found.of(3)
    for one in (5, 3, 20):
        found.of(one)
    assert [one for _, one, _ in found._cache._kept] == [3, 20]
    assert found.of(3) == first


def test_a_failed_birth_has_no_buildings_and_no_difference(asked, night):
    run = evocity.open_run(night)
    failed = run.columns.ids[~run.columns.ok].tolist()
    missing = [one for one in failed if run[one].birth.genome is None] or [99_999]
    for question in (f"buildings?id={missing[0]}&of=area", f"difference?id=3&beside={missing[0]}"):
        told = asked.get(f"/api/0/{question}")
        assert told.status == 409
        assert set(told.json["error"]) == {"found", "expected", "remedy"}
