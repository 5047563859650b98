"""What reading a long log costs, held by counting; and pedigrees against an obvious twin."""

import errno
import os
from collections import Counter
from pathlib import Path
from unittest.mock import patch

import naive
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_store_behind import short  # noqa: F401
from test_store_log import generation_of, writer  # noqa: F401
from written_runs import written

from evocity.search import archive
from evocity.search.record.aims import (
    births_without_genomes,
    iterate_generations,
    split_generations,
)
from evocity.store import RunLog, checksums
from evocity.store.run_directory import RunDirectory
from evocity.store.run_log import ancestry


@pytest.fixture
def long(writer, short):  # noqa: F811
    """Path of a run of 39 generations of 6: segments of 16, 16 and 4, and three alone."""
    for number in range(39):
        writer.write_generation(*generation_of(number, size=6))
    writer.update_provenance({"fitness": [{"name": n, "goal": "max"} for n in ("alpha", "beta")]})
    return writer.path


@pytest.fixture
def counted(monkeypatch):
    """Row groups that were read of each file, "births/…", and how often its seal was checked."""
    read, checked, opened = Counter(), Counter(), {}
    check, make = checksums.check_seal, pq.ParquetFile.__init__
    groups, one = pq.ParquetFile.read_row_groups, pq.ParquetFile.read_row_group

    def name(path):
        return f"{path.parent.name}/{path.name}"

    def checking(file):
        checked[name(Path(file.name))] += 1
        check(file)

    def making(self, source, **options):
        opened[id(self)] = name(Path(source.name))
        make(self, source, **options)

    def reading(self, numbers, *args, **options):
        read[opened[id(self)]] += len(list(numbers))
        return groups(self, numbers, *args, **options)

    def reading_one(self, number, *args, **options):
        read[opened[id(self)], "looked at"] += 1
        return one(self, number, *args, **options)

    monkeypatch.setattr(checksums, "check_seal", checking)
    monkeypatch.setattr(pq.ParquetFile, "__init__", making)
    monkeypatch.setattr(pq.ParquetFile, "read_row_groups", reading)
    monkeypatch.setattr(pq.ParquetFile, "read_row_group", reading_one)
    return read, checked


def births_read(read: Counter) -> dict[str, int]:
    return {key: count for key, count in read.items() if "births" in key}


@pytest.mark.parametrize(
    "way",
    [
        lambda run: run.births(columns=["id", "status"]),
        lambda run: run.ancestors(233),
        archive,
    ],
    ids=["births", "ancestors", "archive"],
)
def test_each_row_group_of_births_is_read_once(long, counted, way):
    read, checked = counted
    way(RunLog(long))
    pieces = births_read(read)
    assert sorted(pieces.values()) == [1, 1, 1, 4, 16, 16]
    # once to be read, and the last as the end of the run is looked for
    sealed = [count for name, count in checked.items() if name.startswith("births")]
    assert sorted(sealed) == [1, 1, 1, 1, 1, 2]


def test_an_individual_is_read_from_the_file_that_holds_it(long, counted):
    read, checked = counted
    assert RunLog(long).individuals([8])[0].generation == 1
    assert births_read(read) == {"births/segment-00000000-00000015.parquet": 1}
    assert set(checked) <= {
        "births/segment-00000000-00000015.parquet",
        "births/generation-00000038.parquet",
        "membership/generation-00000038.parquet",
    }


def test_births_of_many_generations_are_read_from_files_opened_once(long, counted):
    read, checked = counted
    born = RunLog(long).individuals([8, 200, 30, 77, 0, 9])
    assert [one.id for one in born] == [8, 200, 30, 77, 0, 9]
    groups = {  # of generations 0, 1 and 5; 12; 33
        "births/segment-00000000-00000015.parquet": 4,
        "births/segment-00000032-00000035.parquet": 1,
    }
    assert births_read(read) == groups
    assert all(checked[name] == 1 for name in groups)


@pytest.mark.slow_cases("65536")
@pytest.mark.parametrize("at_once", [1, 30, 1 << 16])  # values: a row, some, all at a time
def test_births_are_the_same_in_any_order_and_in_batches_of_any_size(long, monkeypatch, at_once):
    run = RunLog(long)
    genomes, errors = (run.births(columns=[one])[one].to_pylist() for one in ("genome", "error"))
    monkeypatch.setattr("evocity.store.read_limits._AT_ONCE", at_once)
    rng = np.random.default_rng(at_once)
    for count in (1, 5, 40):
        ids = rng.choice(len(genomes), count, replace=False).tolist()
        births = run.individuals(ids)
        assert [one.id for one in births] == ids
        assert [one.digest for one in births] == [genomes[one] for one in ids]
        assert [one.error for one in births] == [errors[one] for one in ids]


def test_every_generation_is_read_at_once_as_one_by_one(long, counted):
    read, _ = counted
    births, members = list(iterate_generations(RunLog(long))), RunLog(long).members()
    assert sorted(births_read(read).values()) == [1, 1, 1, 4, 16, 16]
    run = RunLog(long)
    assert births == [births_without_genomes(run, g) for g in run.generations]
    lived = list(split_generations(members))
    assert [one.equals(run.members(g)) for g, one in enumerate(lived)] == [True] * 39


@pytest.mark.parametrize("asked", ["generations", "written", "damaged"])
def test_files_that_are_moved_in_this_moment_are_looked_for_again(long, monkeypatch, asked):
    """As those of a log that was written anew are, once it counts."""
    expected, scan, gone = getattr(RunLog(long), asked), os.scandir, []

    def moving(place):
        if not gone:
            gone.append(place)
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(place))
        return scan(place)

    run = RunLog(long)
    monkeypatch.setattr(os, "scandir", moving)
    assert getattr(run, asked) == expected
    assert len(gone) == 1


def table_of(ids, parents) -> pa.Table:
    kinds = pa.schema([("id", pa.int64()), ("parents", pa.list_(pa.int64()))])
    half = len(ids) // 2
    return pa.concat_tables(
        pa.table([pa.array(ids[a:b], pa.int64()), pa.array(parents[a:b], kinds[1].type)], kinds)
        for a, b in ((0, half), (half, len(ids)))
    )


@given(st.integers(0, 2**32), st.integers(0, 30), st.booleans())
@settings(deadline=None)
def test_a_pedigree_is_as_walked_one_by_one(seed, count, ordered):
    """Ids in any order, some twice; parents that are not there, rings of them, and none."""
    rng = np.random.default_rng(seed)
    ids = np.arange(count) * 2 if ordered else rng.integers(0, 40, count)
    parents = [rng.integers(0, 60, rng.integers(4)).tolist() for _ in range(count)]
    for wanted in (*ids[:3].tolist(), 7, -1, 2**70):
        marked = ancestry(table_of(ids.tolist(), parents), wanted)
        expected = naive.ancestry(ids.tolist(), parents, wanted)
        assert (None if marked is None else marked.tolist()) == expected


def test_a_deep_pedigree_is_followed_to_its_end():
    ids = list(range(3000))
    marked = ancestry(table_of(ids, [[max(0, one - 1)] for one in ids]), 2999)
    assert marked.all()


def test_another_look_takes_over_the_checks_of_unchanged_files(tmp_path):
    births = [[{"id": 2 * g}, {"id": 2 * g + 1}] for g in range(3)]
    earlier = written(tmp_path / "run", births)
    assert list(earlier.generations) == [0, 1, 2]

    opened = []
    plain = RunDirectory.open

    def noting(self, part):
        opened.append(Path(part))
        return plain(self, part)

    later = RunLog(tmp_path / "run")
    later.take_over_checks(earlier)
    with patch.object(RunDirectory, "open", noting):
        assert list(later.generations) == [0, 1, 2]
    assert opened == []

    last = max((tmp_path / "run").glob("births/*"))
    last.write_bytes(last.read_bytes()[:-9])
    changed = RunLog(tmp_path / "run")
    changed.take_over_checks(later)
    assert list(changed.generations) == [0, 1]
