"""Damaged and hostile inputs of every format that is read: told in one short message, in bounds."""

import sys
from collections import Counter
from pathlib import Path

import fuzz_seeds
import numpy as np
import pytest
from fuzz_bombs import bombs
from fuzz_damage import damaged, described, nested
from fuzz_drive import MIB, SECONDS, outcomes

from evocity.io import READERS

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is measured by Linux")

#: Of each kind of input, how many of a hundred. A report takes a second, and is not of the short
#: test.
SHARES = {
    "map": 40, "whole map": 6, "mask": 6, "genome": 12, "run": 13, "told": 3, "report": 1,
    "recipe": 6, "classes": 3, "kinds": 3, "types": 3, "library": 4,
}  # fmt: skip

LONGEST = 1024

#: Formats that tests/io/test_io_formats_fuzz.py damages.
ELSEWHERE = {
    ".parquet", ".geoparquet", ".fgb", ".gdb", ".geojsonl", ".geojsons", ".geojsonseq", ".ndjson",
    ".kml", ".kmz", ".gml", ".citygml", ".dxf", ".zip",
}  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    return fuzz_seeds.whole_files(folder)


def test_every_format_is_damaged(files):
    names = [path.name for path in files["map"]]
    suffixes = {suffix for suffix in READERS if any(name.endswith(suffix) for name in names)}
    alike = {".json": ".geojson", ".cityjson": ".city.json", ".pbf": ".osm.pbf", ".tiff": ".tif"}
    alike[".jsonl"] = ".city.jsonl"
    assert suffixes | set(alike) | ELSEWHERE == set(READERS)
    assert set(SHARES) == set(files)


@pytest.fixture(scope="module")
def told(files, tmp_path_factory):
    """Jobs and their outcomes, of whole files, damaged ones and bombs: read in one go, for each
    process that reads loads all readers first."""
    folder = tmp_path_factory.mktemp("told")
    jobs = {
        "whole": [
            {"kind": kind, "path": str(_whole(path, folder / f"{kind}-{path.name}"))}
            for kind, paths in files.items()
            for path in paths
            if kind != "report"
        ],
        "damaged": fuzzed(files, folder, 200, seed=1),
        "bombs": bombs(folder / "bombs", files, long=False),
    }
    found = iter(outcomes([job for several in jobs.values() for job in several], folder / "work"))
    return {name: [(job, next(found)) for job in several] for name, several in jobs.items()}


@pytest.mark.slow
def test_whole_files_are_read(told):
    for job, one in told["whole"]:
        assert one["outcome"] == "read", (job, one)
        assert one["made"] == [], job


@pytest.mark.slow
def test_damaged_inputs(told):
    check(told["damaged"])


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_2500_damaged_inputs(files, tmp_path):
    check(read(fuzzed(files, tmp_path, 2500, seed=2), tmp_path))


@pytest.mark.slow
def test_bombs(told):
    check(told["bombs"])


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_large_bombs(files, tmp_path):
    check(read(bombs(tmp_path / "bombs", files, long=True), tmp_path))


@pytest.mark.slow
def test_300_recipes_of_nested_keys(files, tmp_path):
    rng, jobs = np.random.default_rng(3), []
    for number in range(300):
        kind = ("recipe", "classes", "kinds", "types")[number % 4 if number % 2 else 0]
        whole = files[kind][number % len(files[kind])]
        path = tmp_path / "inputs" / f"nested-{number}" / whole.name
        path.parent.mkdir(parents=True)
        path.write_text(nested(rng, whole.read_text("utf-8")), "utf-8")
        jobs.append({"kind": kind, "name": path.parent.name, "path": str(path)})
    check(read(jobs, tmp_path))


def fuzzed(files, folder: Path, count: int, seed: int) -> list[dict]:
    """``count`` jobs, their inputs written below ``folder``."""
    jobs = []
    for kind, share in SHARES.items():
        if kind == "report" and count < 1000:
            continue
        for number in range(round(count * share / sum(SHARES.values()))):
            rng = np.random.default_rng([seed, list(SHARES).index(kind), number])
            place = folder / "inputs" / f"{kind.replace(' ', '-')}-{number}"
            place.mkdir(parents=True)
            path = files[kind][number % len(files[kind])]
            jobs.append({"kind": kind, "name": place.name} | _damaged(rng, path, files, place))
    return jobs


def _damaged(rng, path: Path, files, place: Path) -> dict:
    """Where a damaged file, or a folder with one damaged part, was written."""
    if path.is_dir():
        parts = sorted(one for one in path.rglob("*") if one.is_file() and one.name != "lock")
        part = parts[rng.integers(len(parts))]
        others = [one for one in parts if one.suffix == part.suffix]
        target = place / f"part{part.suffix}"
        target.write_bytes(damaged(rng, part, others, place.parent))
        return {"path": str(target), "base": str(path), "part": str(part.relative_to(path))}
    if path.suffix == ".tif" and rng.random() < 0.3:
        return {"path": str(fuzz_seeds.copied(path, place, described(rng, path)))}
    beside = path
    if path.suffix == ".shp" and rng.random() < 0.5:
        beside = path.with_suffix(str(rng.choice([".dbf", ".shx", ".prj"])))
    others = [one for paths in files.values() for one in paths if one.is_file()]
    alike = [one for one in others if one.suffix == path.suffix]
    content = damaged(rng, beside, alike if rng.random() < 0.7 else others, place.parent)
    target = fuzz_seeds.copied(path, place, path.read_bytes())
    (place / beside.name).write_bytes(content)
    return {"path": str(target)}


def _whole(path: Path, place: Path) -> Path:
    if path.is_dir():
        return path
    place.mkdir()
    return fuzz_seeds.copied(path, place, path.read_bytes())


def read(jobs: list[dict], folder: Path) -> list[tuple[dict, dict]]:
    return list(zip(jobs, outcomes(jobs, folder / "work"), strict=True))


def check(told: list[tuple[dict, dict]]) -> None:
    """List each input that was not told as it should be."""
    found = [one for _, one in told]
    wrong = [
        f"{job['kind']} {job['name']}: {fault}"
        for job, one in told
        for fault in _faults(one, job.get("seconds", SECONDS), max(MIB, job.get("mib", 0)))
    ]
    counted = Counter(told["outcome"] for told in found)
    slowest, largest = max(one["seconds"] for one in found), max(one["mib"] for one in found)
    longest = max(len(one["message"].encode()) for one in found)
    print(
        f"{len(told)} inputs: {dict(counted)}; slowest {slowest:.1f} s, largest {largest:.0f} MiB, "
        f"longest message {longest} bytes"
    )
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong[:40])


def _faults(told: dict, most_seconds: float, most_mib: float) -> list[str]:
    if told["outcome"] not in ("read", "refused"):
        return [f"{told['outcome']}: {told['message']}"]
    faults, message = [], told["message"]
    if len(message.encode()) > LONGEST:
        faults.append(f"a message of {len(message.encode())} bytes: {message[:200]}")
    strange = {one for one in message if not one.isprintable() and one != "\n"}
    if strange:
        faults.append(f"{sorted(map(ascii, strange))} in {message!r}")
    if told["outcome"] == "refused" and "\n  what to do: " not in message:
        faults.append(f"no remedy: {message!r}")
    if told["seconds"] > most_seconds:
        faults.append(f"{told['seconds']:.1f} s")
    if told["mib"] > most_mib:
        faults.append(f"{told['mib']:.0f} MiB")
    return faults + [f"made {one}" for one in told["made"]]
