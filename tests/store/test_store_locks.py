"""The layer locked in a run: kept once, attached to every genome read, never another."""

import json

import numpy as np
import pytest
from codes import uniformly

import evocity
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import RunError
from evocity.report import contact_sheet, write_report
from evocity.store import Birth, Header, Member, RunLog, RunWriter, Source

CITY = CityMap(np.kron(np.eye(4), np.full((4, 4), 6.0)), 2.0, name="town")
MASK = np.arange(256).reshape(16, 16) % 5 == 0
LAYER = Condensation(np.full((16, 16), 9.5), MASK)


def header(locked: str | None, block: int | None = None) -> Header:
    about = (16, 16, 2.0, 0.9, ("town",), "", None, None, 7, 2, "hash", ("gsi",))
    return Header(*about, locked=locked, block=block)


def written(path, layer: Condensation | None, block: int | None = None):
    """A closed run of two births, one of an older release if ``block`` is given; its path."""
    genome = uniformly(CITY, block=4, condensation=layer).genome
    told = header(None if layer is None else layer.digest, block)
    writer = RunWriter.create(path, "[run]\n", {}, told, [Source(CITY, genome)], layer)
    births = [Birth(0, s, (), "source", "ok", None, 0.1, {"gsi": 0.5}, genome) for s in (0, 1)]
    about = {"births": 2, "failures": 0, "hypervolume": 1.0, "best": {"gsi": 0.5}}
    writer.write_generation(0, births, [Member(s, s, 0, {"crowding": 1.0}) for s in (0, 1)], about)
    writer.close()
    return path


@pytest.fixture
def locked_run(tmp_path):
    return written(tmp_path / "run", LAYER)


def test_every_genome_read_has_it(locked_run):
    run = RunLog(locked_run)
    assert run.condensation == LAYER
    for birth in run.individuals([0, 1]):
        assert birth.genome.condensation is run.condensation
        assert birth.genome.digest == run.births()["genome"][0].as_py()
    assert run.genome(1) == run.sources()[0].genome
    RunWriter.reopen(locked_run).close()
    assert RunLog(locked_run).condensation == LAYER


def test_births_do_not_repeat_it(locked_run, tmp_path):
    bare = written(tmp_path / "bare", None)
    assert RunLog(locked_run).births().column_names == RunLog(bare).births().column_names


def test_it_is_one_array_that_numpy_reads(locked_run):
    raster = np.load(locked_run / "sources" / "locked.npy", allow_pickle=False)
    assert raster.dtype == np.float32
    assert np.array_equal(~np.isnan(raster), MASK)
    assert (raster[MASK] == 9.5).all()


@pytest.mark.parametrize("block", [None, 4])
def test_a_run_without_it_has_no_trace_of_it(tmp_path, block):
    run = RunLog(written(tmp_path / "run", None, block))
    assert run.condensation is None
    assert run.genome(0).condensation is None
    told = json.loads(header(None, block).to_json())
    assert told["schema_version"] == run.provenance["schema_version"] == (1 if block else 3)
    assert "locked" not in told
    assert not (run.path / "sources" / "locked.npy").exists()


@pytest.mark.parametrize(("block", "version"), [(None, 3), (4, 2)])
def test_a_run_with_it_is_refused_by_releases_without(tmp_path, block, version):
    path = written(tmp_path / "run", LAYER, block)
    assert RunLog(path).provenance["schema_version"] == version
    told = header(LAYER.digest, block)
    assert json.loads(told.to_json())["schema_version"] == version
    assert Header.from_json(told.to_json(), path) == told
    assert RunLog(path).genome(1).condensation == LAYER


def another(path):
    np.save(path, np.where(MASK, np.float32(9), np.float32(np.nan)))


def of_another_size(path):
    np.save(path, np.ones((4, 4), np.float32))


def of_another_type(path):
    np.save(path, np.where(MASK, 9.5, np.nan))


def of_no_numbers(path):
    np.save(path, np.array([{"a": 1}]), allow_pickle=True)


def through_a_link(path):
    path.rename(path.with_name("elsewhere.npy"))
    path.symlink_to(path.with_name("elsewhere.npy"))


@pytest.mark.parametrize(
    "damage",
    [another, of_another_size, of_another_type, of_no_numbers, through_a_link,
     lambda path: path.unlink(), lambda path: path.write_bytes(path.read_bytes()[:200])],
)  # fmt: skip
def test_another_layer_or_a_damaged_one_is_refused(locked_run, damage):
    damage(locked_run / "sources" / "locked.npy")
    run = RunLog(locked_run)
    assert len(run.births()) == 2
    for attempt in (
        lambda: run.condensation,
        lambda: run.genome(0),
        lambda: write_report(locked_run),
        lambda: contact_sheet(evocity.open_run(run.path)),
    ):
        with pytest.raises(RunError, match=r"locked\.npy"):
            attempt()
