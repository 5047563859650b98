"""The maps of the desk: overviews, windows, areas, bounds, attribution, kept children."""

import json
import shutil
import tomllib
from urllib.parse import quote

import numpy as np
import pyogrio
import pytest
import shapely
from brought import bring, chosen, desk, footprints, is_read, wait
from test_studio_desk import at_desk
from test_studio_map_options import raster, town

import evocity
from evocity.coding import decode
from evocity.studio import desk_overview
from evocity.studio.desk_jobs import _JOBS
from evocity.studio.guard import FILE, FILE_KIND, HEADER


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """A desk without districts."""
    with at_desk(tmp_path_factory.mktemp("map") / "runs") as found:
        yield found


@pytest.fixture(scope="module")
def files(client, tmp_path_factory):
    """Two files on the desk."""
    folder = tmp_path_factory.mktemp("files")
    paths = [footprints(folder / f"{n}.geojson", n) for n in (1, 2)]
    numbers = [bring(client, path.name, path.read_bytes()).json["map"] for path in paths]
    wait(client, is_read)
    return numbers


def one(client, number) -> dict:
    return next(one for one in wait(client, is_read)["maps"] if one["map"] == number)


def box(west, south, east, north) -> list:
    return [[west, south], [east, south], [east, north], [west, north]]


def read(path, tmp_path, over=None, **options) -> dict:
    """Read a map as the process of the desk does."""
    entry = {"number": 1, "map": str(path), "options": options, "over": over}
    entry |= {"picture": str(tmp_path / "p.npy"), "overview": str(tmp_path / "o.bin")}
    found = []
    _JOBS["read"]({"maps": [entry]}, lambda **result: found.append(result))
    return found[0]


def rings_of(over, path) -> list:
    """The rings of an overview as the page reads them."""
    content = path.read_bytes()
    at = -(-int(np.prod(over["grid"] or [0])) // 4) * 4
    ends = np.frombuffer(content, "<u4", over["rings"], at + 4 * over["rings"])
    points = np.frombuffer(content, "<u2", offset=at + 8 * over["rings"]).reshape(-1, 2)
    return np.split(points * over["step"] + over["corner"], ends[:-1])


def test_an_overview_has_every_building_in_metres(tmp_path):
    path = footprints(tmp_path / "a.geojson", 1)
    over = read(path, tmp_path, pixels=16, metres_per_pixel=4.0)["over"]
    assert (over["kind"], over["count"], over["rings"]) == ("buildings", 42, 42)
    shapes = [one["geometry"] for one in json.loads(path.read_text())["features"]]
    areas = [shapely.from_geojson(json.dumps(one)).area * 111_320**2 for one in shapes]
    drawn = [shapely.Polygon(ring).area for ring in rings_of(over, tmp_path / "o.bin")]
    assert drawn == pytest.approx(areas, rel=0.02)


def test_a_window_moves_by_metres_and_says_where_it_leaves_the_file(tmp_path):
    path = footprints(tmp_path / "a.geojson", 1)
    size = {"pixels": 16, "metres_per_pixel": 4.0}
    first = read(path, tmp_path, **size)
    x, y = first["about"]["at"]
    moved = read(path, tmp_path, first["over"], at=[x + 10, y - 5], **size)
    assert moved["about"]["at"] == pytest.approx([x + 10, y - 5], abs=0.02)
    assert moved["over"]["frame"] == first["over"]["frame"]
    far = read(path, tmp_path, first["over"], at=[x + 500, y], **size)
    assert far["error"][0].startswith("the window lies outside the file, 4")
    assert far["over"]["rings"] == 42  # the page still shows the file

    path = raster(tmp_path / "a.tif", town(1))
    first = read(path, tmp_path, pixels=16, metres_per_pixel=2.0)
    assert first["over"]["grid"] == [64, 64]
    assert first["over"]["extent"] == [0, 0, 128, 128]
    moved = read(path, tmp_path, first["over"], at=[20, 100], pixels=16, metres_per_pixel=2.0)
    assert moved["about"]["at"] == [20, 100]
    left = read(path, tmp_path, first["over"], at=[10, 64], pixels=16, metres_per_pixel=2.0)
    assert left["error"][0] == "the window of 32 m leaves the raster by 6 m"


def test_a_raster_without_a_place_has_its_window_in_the_middle(tmp_path):
    np.save(tmp_path / "a.npy", town(1))
    size = {"pixels": 32, "metres_per_pixel": 2.0}
    found = read(tmp_path / "a.npy", tmp_path, **size)
    assert found["over"]["frame"]["crs"] is None
    assert found["about"]["at"] == [64, 64]
    lock = {"shapes": [box(40, 40, 60, 60)], "stem": str(tmp_path / "locked-1")}
    area = read(tmp_path / "a.npy", tmp_path, areas={"lock": lock}, **size)["about"]["areas"][
        "lock"
    ]
    assert area["share"] == 100 / 1024
    mask = np.load(tmp_path / "locked-1.npy")
    assert mask[18:28, 4:14].all()  # north is row 0


@pytest.mark.parametrize("large", [10**6, 1000], ids=["thinned", "by its index"])
def test_a_large_file_shows_what_lies_around_the_window(tmp_path, monkeypatch, large):
    corners = 20.0 * np.array(list(np.ndindex(80, 80))) + (842000, 6519000)
    pyogrio.raw.write(
        tmp_path / "a.gpkg",
        shapely.to_wkb(shapely.box(*corners.T, *(corners + 12).T)),
        [],
        [],
        geometry_type="Polygon",
        crs="EPSG:2154",
    )
    monkeypatch.setattr(desk_overview, "MOST_BUILDINGS", 3000)
    monkeypatch.setattr(desk_overview, "LARGE", large)
    size = {"pixels": 32, "metres_per_pixel": 4.0}
    over = read(tmp_path / "a.gpkg", tmp_path, **size)["over"]
    assert over["partial"]
    assert over["count"] == 6400
    assert over["extent"] == [0, 0, 1592, 1592]
    assert 0 < over["rings"] < 1000
    assert (over["grid"] is None) == (large == 1000)
    moved = read(tmp_path / "a.gpkg", tmp_path, over, at=[800, 800], **size)
    assert moved["about"]["at"] == pytest.approx([800, 800], abs=0.02)
    assert moved["over"]["grid"] == over["grid"]
    middles = np.mean(
        [ring.mean(axis=0) for ring in rings_of(moved["over"], tmp_path / "o.bin")], 0
    )
    assert middles == pytest.approx([800, 800], abs=20)


@pytest.mark.slow
def test_pictures_share_one_scale(client, files, tmp_path):
    footprints(tmp_path / "1.geojson", 1)
    before = client.get(f"/api/desk-picture?map={files[0]}").content
    high = json.loads((tmp_path / "1.geojson").read_text())
    for feature in high["features"]:
        feature["properties"]["height"] *= 5
    number = bring(client, "high.geojson", json.dumps(high).encode()).json["map"]
    wait(client, is_read)
    assert desk(client)["scale"] >= 100
    assert client.get(f"/api/desk-picture?map={files[0]}").content != before
    client.post("/api/desk-drop", {"map": number})
    assert client.get(f"/api/desk-picture?map={files[0]}").content == before


def bring_area(client, name, content) -> int:
    headers = [("Content-Type", FILE_KIND), HEADER]
    return client.ask("POST", f"{FILE}?name={quote(name)}&area=1", headers, content).json["map"]


def put_area(client, files, use, area, **more) -> dict:
    maps = [{"map": n, "chosen": True} for n in files]
    areas = {"lock": None, "within": None, use: {"map": files[0]} | area}
    told = chosen(client, [], maps=maps, **areas, **more)
    assert told.status == 200, told.json
    read = one(client, files[0])
    assert "path" not in json.dumps(read)  # no page learns a path
    return read["about"]["areas"][use]


LINE = {"type": "LineString", "coordinates": [[-0.0004, 0], [0.0004, 0.0001]]}


@pytest.mark.slow
def test_areas_that_cannot_be_used_say_why(client, files):
    x, y = one(client, files[0])["about"]["at"]
    far, flat = [box(x + 900, y, x + 950, y + 50)], [[[x, y], [x + 9, y], [x + 20, y]]]
    for use, shapes, words in [
        ("lock", [box(x - 90, y - 90, x + 90, y + 90)], "covers the whole window"),
        ("lock", far, "no pixel of the window"),
        ("within", flat, "is a line"),
    ]:
        assert words in put_area(client, files, use, {"shapes": shapes})["fault"]["found"]
    told = client.post("/api/desk-calibrate", {})
    assert (told.status, "is a line" in told.json["error"]["found"]) == (409, True)
    half = put_area(client, files, "lock", {"shapes": [box(x - 90, y - 64, x, y + 64)]})
    assert half["share"] == 0.5
    assert half["note"] == "29 % of it lies outside the window"

    for name, content in [("line.geojson", json.dumps(LINE).encode()), ("a.png", b"{}")]:
        number = bring_area(client, name, content)
        assert desk(client)["areas"][str(number)] == name
        fault = put_area(client, files, "within", {"file": number})["fault"]
        assert set(fault) == {"found", "expected", "remedy"}
        assert name in fault["found"]
    outside = chosen(client, files[1:], lock={"map": files[0], "shapes": far})
    assert outside.status == 200
    told = client.post("/api/desk-calibrate", {}).json["error"]
    assert "is not a parent" in told["found"]


@pytest.mark.slow
def test_a_band_that_no_mixture_reaches_is_told_with_the_recipe(client, files):
    """Before the night begins, and not where the parents reach it."""
    goals = [
        {"measure": "alignment", "want": "max"},
        {"measure": "fsi", "want": "band", "target": 9, "tolerance": 0.1},
        {"measure": "gsi", "want": "bounds", "max": 0.9},
    ]
    assert chosen(client, files, goals=goals, lock=None, within=None).status == 200
    wait(client, is_read)
    assert client.post("/api/desk-calibrate", {}).status == 200
    told = wait(client, lambda one: not one["busy"])
    assert told["fault"] is None
    assert told["started"] == []
    notes = [note for note in told["found"]["notes"] if note.startswith(("fsi: ", "gsi: "))]
    assert len(notes) == 1
    assert notes[0].startswith("fsi: 8.9 is more than any parent has")
    assert "choose a parent with more, or another number" in notes[0]


@pytest.mark.slow
def test_a_mask_of_pixels_marks_an_area(client, files, tmp_path):
    mask = np.zeros((32, 32), np.uint8)
    mask[4:12, 20:30] = 1
    np.save(tmp_path / "mask.npy", mask)
    number = bring_area(client, "my <mask>.npy", (tmp_path / "mask.npy").read_bytes())
    area = put_area(client, files, "lock", {"file": number})
    assert (area["share"], area["rectangle"]) == (80 / 1024, True)
    x, y = one(client, files[0])["about"]["at"]
    (ring,) = area["rings"]
    west, south, east, north = shapely.Polygon(ring).bounds
    assert (west, north) == pytest.approx((x - 64 + 80, y + 64 - 16), abs=0.1)
    assert (east - west, north - south) == pytest.approx((40, 32), abs=0.1)
    found = client.server.studio.desk_routes.desk
    assert found._locked(found.draft, found._areas(found.draft)) == {"mask": "locked.npy"}


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ({"measure": "gsi", "want": "max", "min": 0.5, "max": 0.4}, "run from 0.5 to 0.4"),
        ({"measure": "gsi", "want": "bounds", "max": 1.4}, "outside the values"),
        ({"measure": "gsi", "want": "band", "target": 0.98, "tolerance": 0.1}, "outside"),
    ],
)
def test_bounds_that_a_measure_cannot_have(client, files, goal, words):
    told = chosen(client, files, goals=[goal])
    assert told.status == 409
    assert words in told.json["error"]["found"]


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ({"measure": "gsi", "want": "band", "target": 0.4}, "is incomplete"),
        ({"measure": "gsi", "want": "bounds"}, "has no bound"),
    ],
)
def test_bounds_without_numbers_make_no_recipe(client, files, goal, words):
    goals = [goal, {"measure": "crumbs", "want": "min"}]
    assert chosen(client, files, goals=goals).status == 200
    assert words in client.post("/api/desk-calibrate", {}).json["error"]["found"]
    only = [{"measure": "gsi", "want": "bounds", "max": 0.4}]
    assert chosen(client, files, goals=only).status == 200
    assert "no goal" in client.post("/api/desk-calibrate", {}).json["error"]["found"]


@pytest.mark.slow
def test_a_locked_quarter_bands_and_attribution_reach_every_birth(tmp_path):
    with at_desk(tmp_path / "runs") as client:
        paths = [footprints(tmp_path / f"{n}.geojson", n) for n in (1, 2)]
        files = [bring(client, path.name, path.read_bytes()).json["map"] for path in paths]
        x, y = one(client, files[0])["about"]["at"]
        quarter = {"map": files[0], "shapes": [box(x - 52, y - 64, x + 12, y)]}
        first = {"map": files[0], "chosen": True, "at": [x + 12, y], "attribution": "© the town"}
        goals = [
            {"measure": "alignment", "want": "max"},
            {"measure": "fsi", "want": "band", "target": 1.2, "tolerance": 0.5, "within": True},
            {"measure": "gsi", "want": "bounds", "max": 0.6},
        ]
        told = chosen(
            client,
            [],
            maps=[first, {"map": files[1], "chosen": True}],
            lock=quarter,
            within=quarter,
            goals=goals,
        )
        assert told.status == 200
        wait(client, is_read)
        assert client.post("/api/desk-calibrate", {}).status == 200
        told = wait(client, lambda one: not one["busy"])
        assert told["fault"] is None
        raw = tomllib.loads(told["found"]["text"])
        assert raw["locked"] == {"footprints": "locked.geojson"}
        assert raw["parents"][0]["attribution"] == "© the town"
        assert raw["parents"][0]["center"] == pytest.approx([0, 0], abs=1e-3)
        assert raw["fitness"][1:3] == [
            {"name": "fsi", "within": "site.geojson", "min": 0.7, "max": 1.7},
            {"name": "gsi", "max": 0.6},
        ]
        (started,) = client.post("/api/desk-begin", {}).json["started"]
        wait(client, lambda one: not one["started"][0]["at"])
        run = evocity.open_run(started["folder"])
        lock = run.sources()[0].genome.condensation
        assert lock.mask[16:, :16].all()
        assert lock.mask.sum() == 256
        for number in range(8):
            heights = decode(run.genome(number)).city.heights
            assert (heights[lock.mask] == lock.heights[lock.mask]).all()
        assert run.sources()[0].city.attribution == "© the town"

        # children that a user kept are parents, with what they lock
        kept = tmp_path / "runs" / f"{started['name']}-children"
        kept.mkdir()
        shutil.copy(run_genome(run, tmp_path), kept / "child-3.parquet")
        (kept / "link.parquet").symlink_to(kept / "child-3.parquet")
        client.get("/api/runs")
        found = wait(client, lambda one: any(m["child"] for m in one["maps"]) and is_read(one))
        (child,) = [one for one in found["maps"] if one["child"]]
        assert child["title"] == f"child-3 of {kept.name}"
        assert (child["about"]["locked"], child["fault"]) == (0.25, None)
        both = [{"map": child["map"], "chosen": True}, {"map": files[1], "chosen": True}]
        wrong = {"window": {"pixels": 64, "metres_per_pixel": 2.0}}
        assert chosen(client, [], maps=both, goals=goals[:1], **wrong).status == 200
        assert "32 px of 4 m" in one(client, child["map"])["fault"]["found"]
        bare = {"goals": goals[:1], "lock": None, "within": None}
        assert chosen(client, [], maps=both, **bare).status == 200
        wait(client, is_read)
        assert client.post("/api/desk-calibrate", {}).status == 200
        told = wait(client, lambda one: not one["busy"])
        assert told["fault"] is None, told["said"]
        raw = tomllib.loads(told["found"]["text"])
        assert raw["parents"][0]["genome"] == f"child-{child['map']}.parquet"
        assert raw["locked"] == {"mask": "locked.npy", "heights": "locked-heights.npy"}


def run_genome(run, folder):
    run.genome(3).write(folder / "genome.parquet")
    return folder / "genome.parquet"
