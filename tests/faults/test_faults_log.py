"""A log that cannot lie: what is damaged is told, put aside and bred again."""

import errno
import json
import os
import shutil
from unittest.mock import patch

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from toy_runs import unsealed, write_toy

from evocity import store
from evocity.errors import RunError
from evocity.fitness import registry
from evocity.search import Search, read_recipe
from evocity.store import RunLog
from evocity.store.checksums import open_sealed, write_sealed
from evocity.store.run_directory import RunDirectory


def bred(folder, generations=4):
    """A run of toy towns in a new ``folder``."""
    recipe = read_recipe(write_toy(folder), generations=generations)
    with Search(recipe, out=folder / "run", workers=0) as search:
        for _ in search:
            pass
    return folder / "run"


def rows(path) -> list[dict]:
    """All births and members of a run but for their seconds."""
    run = RunLog(path)
    return [*run.births().drop_columns(["seconds"]).to_pylist(), *run.members().to_pylist()]


def flipped(path, bit: int) -> None:
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


def all_that_is_read(path):
    """Births with genomes, members, summaries, sources, as texts and bytes."""
    run = RunLog(path)
    births = run.individuals(run.births(columns=["id"])["id"].to_pylist())
    told = [
        (one.id, one.values, one.error, one.made, one.genome and one.genome.digest)
        for one in births
    ]
    sources = [
        (one.city.heights.tobytes(), one.city.name, one.city.attribution, one.genome.digest)
        for one in run.sources()
    ]
    return repr((told, run.members().to_pylist(), run.history(), sources, list(run.generations)))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A small run, read only."""
    with patch.dict(registry._from_files):
        return bred(tmp_path_factory.mktemp("whole"))


@pytest.mark.slow
@pytest.mark.parametrize("count", [100, pytest.param(300, marks=pytest.mark.long)])
def test_no_bit_that_is_flipped_changes_what_is_read_silently(whole, tmp_path, count):
    """Bits drawn from all bytes of births, membership and sources, footers too."""
    expected = all_that_is_read(whole)
    files = [
        path
        for kind in ("births", "membership", "sources")
        for path in sorted((whole / kind).iterdir())
    ]
    sizes = np.array([path.stat().st_size for path in files])
    rng, copy = np.random.default_rng(5), tmp_path / "copy"
    shutil.copytree(whole, copy)
    silent, told = [], 0
    for _ in range(count):
        at = int(rng.choice(len(files), p=sizes / sizes.sum()))
        path = copy / files[at].relative_to(whole)
        bit = int(rng.integers(int(sizes[at]) * 8))
        flipped(path, bit)
        try:
            again = all_that_is_read(copy)
        except RunError:
            told += 1
        else:
            # a damaged last generation is left out, which `damaged` tells
            if again != expected and not RunLog(copy).damaged:
                silent.append((path.name, bit))
            told += bool(RunLog(copy).damaged)
        flipped(path, bit)
    assert silent == []
    assert told > 5 / 6 * count
    assert all_that_is_read(copy) == expected


def test_a_whole_file_with_one_nucleotide_changed_is_refused(whole, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(whole, copy)
    path = copy / "births" / "generation-00000002.parquet"
    with open(path, "rb") as opened, open_sealed(opened) as file:
        table = file.read()
    at = table.schema.names.index("beta")
    numbers = np.array(table["beta"].to_pylist(), dtype=np.float64)
    numbers[0, 0] += 1 / 64
    kind = table.schema.field("beta").type
    column = pa.array([list(row) for row in numbers], kind)
    table = table.set_column(at, table.schema.field("beta"), column)
    with open(path, "wb+") as file, write_sealed(file, table.schema) as writer:
        writer.write_table(table)
    run = RunLog(copy)
    first = run.births(2, columns=["id"])["id"][0].as_py()
    with pytest.raises(RunError, match="is not the one that was bred"):
        run.individuals([first])


@pytest.mark.parametrize("kind", ["births", "membership"])
def test_what_is_damaged_at_the_end_is_put_aside_and_bred_again(tmp_path, kind):
    out = bred(tmp_path)
    expected = rows(out)
    path = out / kind / "generation-00000003.parquet"
    for one in (path, out / "births" / "generation-00000004.parquet"):
        one.write_bytes(one.read_bytes()[:-200])
    run = RunLog(out)
    assert list(run.generations) == [0, 1, 2]
    assert run.status()["generation"] == 2
    assert {one.name for one in run.damaged} == {path.name, "generation-00000004.parquet"}
    with pytest.raises(RunError, match="--set-aside"):
        Search.resume(out, workers=0)
    assert path.exists()
    moved = store.set_aside(out)
    assert len(moved) == 4
    assert {one.name for one in (out / "damaged").iterdir()} == {
        f"{one.parent.name}-{one.name}" for one in moved
    }
    assert not RunLog(out).damaged
    with Search.resume(out, workers=0) as search:
        for _ in search:
            pass
    assert rows(out) == expected
    (event,) = [one for one in RunLog(out).events() if one["event"] == "set aside"]
    assert len(event["files"]) == 4
    assert store.set_aside(out) == []


def test_damage_in_the_middle_is_told_and_can_be_put_aside(tmp_path):
    out = bred(tmp_path)
    expected = rows(out)
    path = out / "births" / "generation-00000001.parquet"
    flipped(path, 8 * (path.stat().st_size // 2))
    run = RunLog(out)
    assert list(run.generations) == [0, 1, 2, 3, 4]
    with pytest.raises(RunError, match="--set-aside"):
        run.births()
    assert len(store.set_aside(out)) == 8
    with Search.resume(out, workers=0) as search:
        for _ in search:
            pass
    assert rows(out) == expected


def test_a_run_of_before_is_read_without_seals(whole, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(whole, copy)
    expected = all_that_is_read(copy)
    for kind in ("births", "membership"):
        for path in (copy / kind).iterdir():
            table = pq.read_table(path)
            pq.write_table(table, path)
    told = unsealed(copy / "provenance.json")
    del told["files"]
    (copy / "provenance.json").write_text(json.dumps(told))
    assert all_that_is_read(copy) == expected


def test_a_folder_that_is_read_only_is_told(whole, monkeypatch):
    def refused(self, part):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(part))

    monkeypatch.setattr(RunDirectory, "append", refused)
    with pytest.raises(RunError, match="cannot be written: Permission denied"):
        Search.resume(whole, generations=9, workers=0)
    with pytest.raises(RunError, match="cannot be written"):
        store.set_aside(whole)
