"""Maps that the desk reads again: the process stays, and files that did not change stay read."""

import dataclasses
import os
import signal
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from brought import bring, chosen, footprints, is_read, wait
from test_studio_desk import at_desk
from test_studio_map_options import raster, town

from evocity.io import map_reader, read_map
from evocity.studio import kept_sources
from evocity.studio.kept_sources import KeptSources, keep_sources

_READERS = dict(map_reader.READERS)


@pytest.fixture
def reads(monkeypatch):
    """The names of the files that readers of this process read while sources are kept."""
    read = []
    noting = {}
    for suffix, reader in map_reader.READERS.items():

        def note(path, request, reader=reader):
            read.append(Path(path).name)
            return reader.read(path, request)

        noting[suffix] = dataclasses.replace(reader, read=note)
    monkeypatch.setattr(map_reader, "READERS", noting)
    keep_sources()
    return read


def same(one, other) -> bool:
    return (one.heights.tobytes(), one.origin, one.attribution, one.taken) == (
        other.heights.tobytes(),
        other.origin,
        other.attribution,
        other.taken,
    )


def files(folder: Path) -> list[Path]:
    """A file of each way of reading: whole, by the window, and a raster."""
    corners = 20.0 * np.array(list(np.ndindex(12, 12))) + (842000, 6519000)
    boxes = shapely.to_wkb(shapely.box(*corners.T, *(corners + 12).T))
    options = {"geometry_type": "Polygon", "crs": "EPSG:2154"}
    pyogrio.raw.write(folder / "b.gpkg", boxes, [], [], **options)
    np.save(folder / "d.npy", town(1))
    return [
        footprints(folder / "a.geojson", 1),
        folder / "b.gpkg",
        raster(folder / "c.tif", town(2)),
        folder / "d.npy",
    ]


def test_kept_files_give_the_same_maps(tmp_path, reads, monkeypatch):
    """Whatever the window, options and order, a kept file is read as a fresh process reads it."""
    paths = files(tmp_path)
    ways = [{}, {"pixels": 16}, {"pixels": 16, "default_height": 9.0}, {"name": "other"}]
    ways = [{"metres_per_pixel": 2.0, **way} for way in ways]
    expected = {}
    with monkeypatch.context() as fresh:
        fresh.setattr(map_reader, "READERS", _READERS)
        for path in paths:
            expected[path] = [read_map(path, **way) for way in ways]
    for _ in range(2):
        for path in paths:
            for way, city in zip(ways, expected[path], strict=True):
                assert same(read_map(path, **way), city)
    assert reads.count("a.geojson") == reads.count("c.tif") == reads.count("d.npy") == 1


def test_a_changed_file_is_read_again(tmp_path, reads):
    path = footprints(tmp_path / "a.geojson", 1)
    before = read_map(path, pixels=16)
    footprints(path, 2)
    os.utime(path, ns=(1, 1))
    after = read_map(path, pixels=16)
    assert before.attribution == "drawn by 1"
    assert after.attribution == "drawn by 2"
    assert len(reads) == 2


def test_a_reader_that_looks_at_the_window_reads_each_window(tmp_path):
    kept, calls = KeptSources(), []
    data, _ = map_reader.data_of(footprints(tmp_path / "a.geojson", 1), map_reader.Request())
    path = tmp_path / "a.geojson"

    def read(path, request):
        calls.append(request.pixels)
        return data

    for pixels in (8, 16, 8, 16):
        kept.read(read, path, map_reader.Request(pixels=pixels, center=(0, 0)))
        kept.read(read, path, map_reader.Request(pixels=pixels, center=(1, 1)))
    assert calls == [8, 16]


def test_what_is_kept_has_a_bound(tmp_path, monkeypatch):
    path = footprints(tmp_path / "a.geojson", 1)
    data, _ = map_reader.data_of(path, map_reader.Request())
    one = kept_sources._size_of(data)
    monkeypatch.setattr(kept_sources, "MOST_KEPT", 2 * one)
    kept, calls = KeptSources(), []

    def read(path, request):
        calls.append(request.layer)
        return data

    for layer in ("a", "b", "c", "c", "b", "a"):
        kept.read(read, path, map_reader.Request(layer=layer))
    assert calls == ["a", "b", "c", "a"]
    assert len(kept._kept) == 2
    monkeypatch.setattr(kept_sources, "MOST_KEPT", one - 1)
    kept.read(read, path, map_reader.Request(layer="d"))
    assert not kept._kept


@pytest.mark.slow
def test_one_process_reads_all_moves_of_a_window(tmp_path):
    with at_desk(tmp_path / "runs") as client:
        content = footprints(tmp_path / "a.geojson", 1).read_bytes()
        number = bring(client, "a.geojson", content).json["map"]
        told = wait(client, is_read)
        (x, y), turns = told["maps"][0]["about"]["at"], []
        job = client.server.studio.desk_routes.desk.maps._job
        processes = []
        for by in range(2, 40, 2):
            chosen(client, [], maps=[{"map": number, "chosen": True, "at": [x + by, y]}])
            told = wait(client, is_read)["maps"][0]
            assert told["fault"] is None
            assert told["about"]["at"] == pytest.approx([x + by, y], abs=0.02)
            turns.append(told["turn"])
            processes.append(job._process.pid)
            if len(processes) > 2 and len(set(processes[-3:])) == 1:
                break
        assert turns == sorted(set(turns))
        # a process that compiled kernels may be too large to go on after its first maps
        first = processes[-1]
        assert processes[-3:] == [first, first, first]
        os.killpg(first, signal.SIGKILL)  # as where memory ran out between two moves
        job._process.wait()
        chosen(client, [], maps=[{"map": number, "chosen": True, "at": [x, y + 5]}])
        assert wait(client, is_read)["maps"][0]["fault"] is None
        last = job._process
        assert last.pid != first
    assert last.poll() is not None  # it ends with the desk
