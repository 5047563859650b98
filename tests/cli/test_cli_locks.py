"""Locks from the command line: what is kept, what is told, what is refused."""

import json

import numpy as np
import pytest
from cli_tools import AT_2_M, PLAIN, call, refused, write_recipe, write_town
from PIL import Image

import evocity
from evocity.condensation import Condensation

SMALL = ("--pixels", 64)


@pytest.fixture
def town_file(tmp_path):
    return write_town(tmp_path / "town.npy", side=32)


def write_mask(path, rows=slice(5, 20), columns=slice(9, 27), side=32):
    mask = np.zeros((side, side), bool)
    mask[rows, columns] = True
    np.save(path, mask)
    return path


def square(path, lon, lat, half=0.0005):
    """Footprints of one square about a place, degrees."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    ring = [[lon + x * half, lat + y * half] for x, y in corners]
    shape = {"type": "Polygon", "coordinates": [ring]}
    feature = {"type": "Feature", "properties": {"height": 33.0}, "geometry": shape}
    path.write_text(
        json.dumps({"type": "FeatureCollection", "features": [feature], "attribution": "the plan"})
    )
    return path


LYON = (4.834374, 45.768472)


# -- what works -------------------------------------------------------------------------------


def test_encode_keeps_what_a_mask_covers(tmp_path, town_file):
    mask = write_mask(tmp_path / "mask.npy")
    path = tmp_path / "g.parquet"
    told = call("encode", town_file, *AT_2_M, "--lock", mask, "-o", path)
    assert "locked: 270 of 1024 px" in told.stdout
    city = evocity.read_map(town_file, metres_per_pixel=2)
    layer = Condensation.cut(city, np.load(mask))
    assert evocity.read_genome(path) == evocity.encode(city, condensation=layer).genome
    call("decode", path, "-o", tmp_path / "back.npy")
    back = np.load(tmp_path / "back.npy")
    assert np.array_equal(back[layer.mask], city.heights[layer.mask])


def test_several_locks_are_all_kept(tmp_path, town_file):
    river = write_mask(tmp_path / "river.npy", slice(20, 24), slice(0, 32))
    park = write_mask(tmp_path / "park.npy", slice(2, 22), slice(8, 12))
    locks = ("--lock", river, "--lock", park)
    path = tmp_path / "g.parquet"
    told = call("encode", town_file, *AT_2_M, *locks, "--lock-heights", 0, "-o", path)
    both = np.load(river) | np.load(park)
    assert f"locked: {both.sum()} of 1024 px" in told.stdout
    call("decode", path, "-o", tmp_path / "back.npy")
    assert not np.load(tmp_path / "back.npy")[both].any()
    refused(tmp_path, "encode", town_file, *AT_2_M, *locks[:3], tmp_path / "none.npy", "-o", path,
            says="none.npy")  # fmt: skip


def test_encode_keeps_what_footprints_cover_and_show_draws_it(tmp_path):
    plan = square(tmp_path / "plan.geojson", *LYON)
    path = tmp_path / "g.parquet"
    call("encode", "lyon-1er", *SMALL, "--lock", plan, "-o", path)
    genome, city = evocity.read_genome(path), evocity.read_map("lyon-1er", pixels=64)
    kept = genome.condensation
    assert 0 < len(kept) < kept.mask.size
    assert kept == Condensation.cut(city, kept.mask)
    assert genome.attribution == f"{city.attribution}; the plan"
    call("decode", path, "--zoom", 2, "-o", tmp_path / "twice.npy")
    finer = kept.resampled(128, 128)
    assert np.array_equal(np.load(tmp_path / "twice.npy")[finer.mask], finer.heights[finer.mask])
    call("show", path, "-o", tmp_path / "g.png")
    assert (tmp_path / "g.png").stat().st_size > 1000


@pytest.mark.parametrize("heights", ["0", "12.5", "plan.geojson", "dsm.npy"])
def test_encode_imports_what_shall_stand_there(tmp_path, heights):
    plan = square(tmp_path / "plan.geojson", *LYON)
    np.save(tmp_path / "dsm.npy", np.full((64, 64), 7.0))
    expected = {"plan.geojson": 33.0, "dsm.npy": 7.0}.get(heights) or float(heights)
    named = tmp_path / heights if "." in heights and not heights[0].isdigit() else heights
    path = tmp_path / "g.parquet"
    words = ("--lock", plan, "--lock-heights", named, "--json", "-o", path)
    assert json.loads(call("encode", "lyon-1er", *SMALL, *PLAIN, *words).stdout)["lifs"] == 256
    kept = evocity.read_genome(path).condensation
    assert set(kept.heights[kept.mask]) == {expected}


@pytest.mark.slow
def test_run_and_resume_keep_it(tmp_path):
    write_mask(tmp_path / "mask.npy")
    recipe = write_recipe(tmp_path, locked='mask = "mask.npy"\ncity = "right"')
    out = tmp_path / "run"
    call("run", recipe, "--out", out, "--generations", 1)
    call("resume", out, "--generations", 2)
    right, mask = np.load(tmp_path / "right.npy"), np.load(tmp_path / "mask.npy")
    for number in range(18):
        call("decode", out, "--id", number, "-o", tmp_path / "one.npy")
        assert np.array_equal(np.load(tmp_path / "one.npy")[mask], right[mask])
    call("show", out, "-o", tmp_path / "run.png")


# -- what is refused --------------------------------------------------------------------------


def of_a_missing_file(folder):
    return folder / "missing.geojson", "no file"


def of_a_folder(folder):
    return folder, "is a folder"


def of_an_empty_file(folder):
    (folder / "a.geojson").touch()
    return folder / "a.geojson", "is empty"


def of_cut_json(folder):
    (folder / "a.geojson").write_text('{"type": "Feature')
    return folder / "a.geojson", "not complete JSON"


def of_no_polygon(folder):
    (folder / "a.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    return folder / "a.geojson", "has no polygon"


def of_another_town(folder):
    return square(folder / "a.geojson", 2.35, 48.85), "the footprints (1 in all) cover no pixel"


def of_less_than_a_pixel(folder):
    return square(
        folder / "a.geojson", *LYON, half=1e-9
    ), "the footprints (1 in all) cover no pixel"


def of_another_size(folder):
    return write_mask(folder / "a.npy"), "a has 32 × 32 px, but lyon-1er has 64 × 64 px"


def of_nothing(folder):
    return write_mask(folder / "a.npy", slice(0), side=64), "no value above 0 on the map lyon-1er"


def of_colours(folder):
    Image.fromarray(np.ones((64, 64, 3), np.uint8)).save(folder / "a.png")
    return folder / "a.png", "picture in colour"


def of_an_unknown_suffix(folder):
    (folder / "a.doc").write_text("a letter")
    return folder / "a.doc", "no reader for .doc"


BAD = [of_a_missing_file, of_a_folder, of_an_empty_file, of_cut_json, of_no_polygon,
       of_another_town, of_less_than_a_pixel, of_another_size, of_nothing, of_colours,
       of_an_unknown_suffix]  # fmt: skip


@pytest.mark.parametrize("bad", BAD)
def test_a_bad_lock_is_refused(tmp_path, bad):
    lock, says = bad(tmp_path)
    words = ("encode", "lyon-1er", *SMALL, "--lock", lock, "-o", tmp_path / "g.parquet")
    refused(tmp_path, *words, says=says)


def test_footprints_ask_for_a_map_with_a_place(tmp_path, town_file):
    plan = square(tmp_path / "plan.geojson", *LYON)
    words = ("encode", town_file, *AT_2_M, "--lock", plan, "-o", tmp_path / "g.parquet")
    refused(tmp_path, *words, says="town has no position in a coordinate reference system, but")


@pytest.mark.parametrize(
    ("heights", "says"),
    [
        ("-3", "the fixed height of -3 m"),
        ("nan", "the fixed height of nan m"),
        ("1e9", "0 m (ground) to 1000 m"),
        ("missing.tif", "no file 'missing.tif'"),
        ("levels.png", "grey levels"),
    ],
)
def test_bad_heights_are_refused(tmp_path, monkeypatch, heights, says):
    monkeypatch.chdir(tmp_path)
    Image.fromarray(np.ones((64, 64), np.uint8)).save("levels.png")
    plan = square(tmp_path / "plan.geojson", *LYON)
    words = ("--lock", plan, "--lock-heights", heights, "-o", tmp_path / "g.parquet")
    refused(tmp_path, "encode", "lyon-1er", *SMALL, *words, says=says)


def test_heights_alone_lock_nothing(tmp_path):
    words = ("--lock-heights", 0, "-o", tmp_path / "g.parquet")
    refused(tmp_path, "encode", "lyon-1er", *SMALL, *words, says="without --lock")


def test_the_lock_is_never_the_output(tmp_path, town_file):
    mask = write_mask(tmp_path / "mask.npy")
    for words in (("--lock", mask), ("--lock", town_file, "--lock-heights", mask)):
        refused(tmp_path, "encode", "lyon-1er", *words, "-o", mask, says="the input and the output")


@pytest.mark.parametrize(
    ("locked", "says"),
    [
        ('mask = "missing.npy"', "locked.mask: 'missing.npy' is not a file"),
        ('city = "left"', "locked: neither footprints nor mask"),
        ('mask = "left.npy"\nfootprints = "right.npy"', "locked: footprints and mask"),
        ('mask = "mask.npy"\ncity = "middle"', "'middle' is not a source"),
        ('mask = "big.npy"', "big has 64 × 64 px, but left has 32 × 32 px"),
        ('mask = "none.npy"', "no value above 0 on the map left"),
        ('mask = "all.npy"', "covers every pixel of left"),
        ('footprints = "plan.geojson"', "left has no position in a"),
        ('mask = "mask.npy"\nheights = -1', "locked.heights: -1"),
    ],
)
def test_a_bad_table_is_refused_by_run(tmp_path, locked, says):
    write_mask(tmp_path / "mask.npy")
    write_mask(tmp_path / "big.npy", side=64)
    write_mask(tmp_path / "none.npy", slice(0))
    write_mask(tmp_path / "all.npy", slice(None), slice(None))
    square(tmp_path / "plan.geojson", *LYON)
    recipe = write_recipe(tmp_path, locked=locked)
    before = set(tmp_path.rglob("*"))
    message = call("run", recipe, "--out", tmp_path / "run", code=2).stderr
    assert says in message
    assert "Traceback" not in message
    assert message.count("expected:") == message.count("what to do:") == 1
    assert set(tmp_path.rglob("*")) == before
