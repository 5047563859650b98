"""Changed bytes in files outside runs: refused by name, or without effect on what is read.

A short part of each trial is unmarked; the whole, of 300 changes for each kind of file, is long.
"""

import os
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import evocity
from evocity import parquet_child
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import EvocityError
from evocity.genome import RoofTable
from evocity.io import read_map, write_map
from evocity.io.writers import write_field, write_windows
from evocity.kinds import CurveForm, ShapeForm, Site
from evocity.kinds.form_files import read_chromosome
from evocity.pictures.field import Field
from evocity.sealed_parquet import FILE_SEAL
from evocity.shapes import Curve, Detailed, known, read_curve, read_shape, write_curve, write_shape
from evocity.shapes.curve_fit import bezier_maps

OLD = Path(__file__).parents[1] / "old"
WHOLE, SHORT = 300, 12


def town() -> CityMap:
    rng = np.random.default_rng(0)
    lots = np.where(rng.random((16, 16)) < 0.5, rng.integers(3, 20, (16, 16)), 0)
    heights = lots.repeat(4, 0).repeat(4, 1).astype(np.float32)
    place = {"origin": (770000.0, 6270000.0), "crs": "EPSG:2154"}
    return CityMap(heights, 2.0, name="town", attribution="© nobody", **place)


def chromosome(path):
    found = read_chromosome(path)
    more = [getattr(found, name, None) for name in ("cities", "sigma_max", "settle", "name")]
    return found.digest, found.attribution, found.origin, found.crs, dict(found.made), more


def map_of(path):
    found = read_map(path)
    about = found.name, found.attribution, found.origin, found.crs, found.metres_per_pixel
    return found.heights.tobytes(), about


def shape_of(path):
    found = read_shape(path)
    return found.maps.tobytes(), found.primitive, found.language.table.tobytes(), found.mix


def curve_of(path):
    found = read_curve(path)
    line = found.detailed.line().tobytes()
    return line, found.detailed.depth, found.detailed.kept, found.crs, found.attribution


class Windows:
    """The town by windows."""

    shape, metres_per_pixel, name, attribution = (64, 64), 2.0, "town", "nobody"
    origin = crs = None

    def window(self, top, left, height, width):
        return town().heights[top : top + height, left : left + width]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Sealed files of each kind, by name, with what reads them."""
    folder = tmp_path_factory.mktemp("sealed")
    city = town()
    mask = city.heights > 12
    wide = {"block": 4, "reach": 8, "threads": 1, "fit": False}
    fabric = evocity.encode(city, **wide).genome
    locked = evocity.encode(city, **wide, condensation=Condensation.cut(city, mask)).genome
    roofs = RoofTable.of_raster(np.arange(64 * 64).reshape(64, 64).astype(np.uint8) % 6)
    made = Curve.bezier([[2, 2], [60, 80], [120, 120]])
    window = {"pixels": 64, "metres_per_pixel": 2.0}
    course = CurveForm(points=made.points, maps=made.maps, breadth=4.0, **window)
    line = np.cumsum(np.random.default_rng(2).normal(0.3, 1, (3 * 32 + 1, 2)), axis=0)
    detailed = Detailed.of(line, bezier_maps(4, 2))
    writers = {
        "fabric.parquet": evocity.encode(city, threads=1).genome.write,
        "uniform.parquet": fabric.write,
        "locked.parquet": locked.write,
        "roofed.parquet": fabric.replace(roofs={fabric.cities[0]: roofs}).write,
        "shape.parquet": ShapeForm.of(known("koch"), 32, 1.0, "k").write,
        "curve.parquet": course.write,
        "site.parquet": Site.of(locked, (course,)).write,
        "words.parquet": lambda path: write_shape(known("fern"), path),
        "line.parquet": lambda path: write_curve(detailed, path, "EPSG:2154"),
        "map.tif": lambda path: write_map(city, path),
        "windows.tif": lambda path: write_windows(Windows(), path),
        "field.tif": lambda path: write_field(Field(city, city.heights, "a", "b", "m"), path),
    }  # fmt: skip
    readers = {"words.parquet": shape_of, "line.parquet": curve_of}
    for name, write in writers.items():
        write(folder / name)
    return {
        folder / name: readers.get(name, map_of if name.endswith(".tif") else chromosome)
        for name in writers
    }


def changes(content: bytes, count: int, seed: int):
    """Changed copies: mostly one bit, sometimes bytes, a part filled with zeros, or a cut."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        changed, at = bytearray(content), int(rng.integers(len(content)))
        if number % 6 < 4:
            changed[at] ^= 1 << int(rng.integers(8))
        elif number % 6 == 4:
            length = int(rng.integers(1, 9))
            changed[at : at + length] = rng.bytes(min(length, len(content) - at))
        else:
            length = min(int(rng.integers(1, 200)), len(content) - at)
            changed[at : at + length] = bytes(length)
        if changed != content:
            yield at, bytes(changed)


def silent(path: Path, read, folder: Path, count: int, seed: int) -> list:
    """List the changes of a file that give something else, and the errors that are no refusal."""
    whole, faults = read(path), []
    for at, content in changes(path.read_bytes(), count, seed):
        target = folder / path.name
        target.write_bytes(content)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", PendingDeprecationWarning)  # of rasterio
                if read(target) != whole:
                    faults.append((path.name, at, "read as another"))
        except EvocityError as error:
            if path.stem not in str(error) or len(str(error)) > 1000:
                faults.append((path.name, at, str(error)))
        except Exception as error:
            faults.append((path.name, at, repr(error)))
    return faults


def all_silent(files, folder: Path, count: int, seed: int) -> list:
    """List the faults of all ``files``, see `silent`."""
    return [one for path, read in files.items() for one in silent(path, read, folder, count, seed)]


def test_a_few_changes_of_sealed_files(files, tmp_path):
    assert all_silent(files, tmp_path, SHORT, 0) == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_300_changes_of_each_sealed_file(files, tmp_path):
    assert all_silent(files, tmp_path, WHOLE, 1) == []


def unsealed_faults(folder: Path, count: int, seed: int) -> list:
    """List the errors of changed files without seals that are no refusal; what they hold may
    differ."""
    faults = []
    for path in sorted(OLD.glob("genome-[12]*.parquet")):
        found = silent(path, chromosome, folder, count, seed)
        faults += [one for one in found if one[2] != "read as another"]
    return faults


def test_a_few_changes_of_files_without_seals(tmp_path):
    assert unsealed_faults(tmp_path, SHORT // 3, 2) == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_300_changes_of_files_without_seals(tmp_path):
    assert unsealed_faults(tmp_path, WHOLE, 3) == []


def births_faults(folder: Path, count: int, seed: int) -> list:
    """List the errors of changed births of a run without seals that are no refusal."""
    run, faults = folder / "run", []
    shutil.copytree(OLD / "run-1", run)
    path = sorted((run / "births").iterdir())[1]
    content = path.read_bytes()
    for at, changed in changes(content, count, seed):
        path.write_bytes(changed)
        os.utime(path, ns=(at, at))  # another file
        try:
            opened = evocity.open_run(run)
            opened.births(), opened.members()
        except EvocityError:
            pass
        except Exception as error:
            faults.append((path.name, at, repr(error)))
    return faults


def test_a_few_changes_of_births_without_seals(tmp_path):
    assert births_faults(tmp_path, SHORT, 4) == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_300_changes_of_births_without_seals(tmp_path):
    assert births_faults(tmp_path, WHOLE, 5) == []


def test_births_that_end_the_child_are_damage(tmp_path, monkeypatch):
    shutil.copytree(OLD / "run-1", tmp_path / "run")
    aborting = ["sh", "-c", "read line; kill -ABRT $$"]
    monkeypatch.setattr(parquet_child._child, "_process", None)
    monkeypatch.setattr(parquet_child, "python_command", lambda *a, **k: aborting)
    damaged = [path.name for path in evocity.open_run(tmp_path / "run").damaged]
    assert "generation-00000000.parquet" in damaged


def test_kept_files_are_sealed(tmp_path):
    kept = evocity.open_run(OLD / "run-6")[2]
    kept.save(tmp_path / "kept.parquet")
    kept.save(tmp_path / "kept.tif")
    assert FILE_SEAL in (tmp_path / "kept.parquet").read_bytes()
    for name, read in (("kept.parquet", chromosome), ("kept.tif", map_of)):
        assert silent(tmp_path / name, read, _folder(tmp_path), SHORT, 6) == []


def _folder(place: Path) -> Path:
    (place / "changed").mkdir(exist_ok=True)
    return place / "changed"
