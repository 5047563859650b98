"""Seals of genome files, and the child process that parses files without one."""

import json
import os
import signal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import evocity
from evocity import parquet_child
from evocity.citymap import CityMap
from evocity.errors import EvocityError, GenomeError
from evocity.genome import read_genome
from evocity.kinds.form_files import read_chromosome, read_form
from evocity.sealed_parquet import FILE_SEAL


@pytest.fixture(scope="module")
def genome():
    heights = np.zeros((32, 32), np.float32)
    heights[4:20, 6:18] = 9
    return evocity.encode(CityMap(heights, 2.0, name="square", attribution="nobody")).genome


@pytest.fixture
def path(genome, tmp_path):
    genome.write(tmp_path / "genome.parquet")
    return tmp_path / "genome.parquet"


def unsealed(path, table=None, **options):
    """Write the file again as releases without seals do."""
    table = pq.read_table(path) if table is None else table
    pq.write_table(table, path, **options)
    return path


def test_a_written_file_is_sealed(path, genome, monkeypatch):
    monkeypatch.setattr(parquet_child, "rewrite", None)  # no child
    assert read_genome(path) == read_chromosome(path) == genome
    assert path.read_bytes().count(FILE_SEAL) == 1


def test_a_seal_takes_no_more_room_than_statistics(path, tmp_path):
    """Releases without seals wrote statistics, which nobody reads."""
    size = path.stat().st_size
    assert size <= unsealed(path, compression="zstd").stat().st_size


def test_a_seal_that_damage_hides_is_missed(path):
    content = path.read_bytes()
    at = content.rindex(FILE_SEAL)
    path.write_bytes(content[:at] + b"E" + content[at + 1 :])
    with pytest.raises(GenomeError, match="is damaged: its seal is missing"):
        read_genome(path)


def test_a_file_without_a_seal_is_read_by_a_child(path, genome, monkeypatch):
    jobs = []
    request = parquet_child._child.request
    monkeypatch.setattr(
        parquet_child._child, "request", lambda *a: (jobs.append(a), request(*a))[1]
    )
    assert read_genome(unsealed(path)) == genome
    assert [content for _, content in jobs] == [path.read_bytes()]


def test_a_child_that_ends_costs_one_file(path, genome, monkeypatch):
    unsealed(path)
    aborting = ["sh", "-c", "read line; kill -ABRT $$"]
    with monkeypatch.context() as patched:
        patched.setattr(parquet_child._child, "_process", None)
        patched.setattr(
            parquet_child,
            "python_command",
            lambda *a, **k: aborting,
        )
        with pytest.raises(GenomeError, match="is not a genome file, or is damaged"):
            read_genome(path)
    assert read_genome(path) == genome


def test_a_child_that_cannot_start_is_no_damage(path, monkeypatch):
    unsealed(path)
    monkeypatch.setattr(parquet_child._child, "_process", None)
    monkeypatch.setattr(parquet_child, "python_command", lambda *a, **k: ["/missing/python"])
    with pytest.raises(parquet_child.ChildStartError, match="cannot start the child process"):
        read_genome(path)
    parquet_child.try_to_read(path.read_bytes())  # the caller reads the file itself


def test_a_killed_child_starts_again(path, genome):
    assert read_genome(unsealed(path)) == genome
    os.kill(parquet_child._child._process.pid, signal.SIGKILL)
    assert read_genome(path) == genome


def test_a_late_child_is_refused(path, monkeypatch):
    unsealed(path)
    monkeypatch.setattr(parquet_child, "SECONDS", 0.2)
    monkeypatch.setattr(parquet_child._child, "_process", None)
    monkeypatch.setattr(parquet_child, "python_command", lambda *a, **k: ["sleep", "60"])
    with pytest.raises(GenomeError, match="is not a genome file"):
        read_genome(path)
    assert parquet_child._child._process is None


def test_a_table_too_large_is_refused_by_the_child(path):
    table = pq.read_table(path)
    with pytest.raises(parquet_child.UnreadableParquetError, match="rows"):
        parquet_child.rewrite(
            unsealed(path, table).read_bytes(), [b"evocity.genome"], len(table) - 1
        )


@pytest.mark.parametrize(
    "values",
    [
        lambda n: pa.array([1] * n, pa.time64("us")),
        lambda n: pa.array([1] * n, pa.timestamp("s")),
        lambda n: pa.array(["a"] * n).dictionary_encode(),
        lambda n: pa.array([None] * n),
        lambda n: pa.array([b"a"] * n, pa.binary()),
        lambda n: pa.array([[1]] * n),
        lambda n: pa.array([{"a": 1}] * n),
        lambda n: pa.array([1] * n, pa.decimal128(9, 2)),
        lambda n: pa.array([1] * n, pa.duration("s")),
    ],
    ids=["time", "stamp", "words", "null", "bytes", "list", "struct", "decimal",
         "duration"],
)  # fmt: skip
def test_columns_of_strange_types_are_refused(path, values):
    table = pq.read_table(path)
    for name in ("sigma", "iso"):
        at = table.column_names.index(name)
        unsealed(path, table.set_column(at, name, values(len(table))))
        with pytest.raises(GenomeError, match="lacks data of a genome"):
            read_genome(path)


def test_a_name_that_is_not_utf_8_is_read(path, genome):
    other = os.fsencode(path.parent) + b"/\xff.parquet"
    try:
        os.rename(path, other)
    except OSError:
        pytest.skip("names are UTF-8 here")
    assert read_genome(os.fsdecode(other)) == genome
    genome.write(os.fsdecode(other))
    assert read_genome(os.fsdecode(unsealed_bytes(other))) == genome


def unsealed_bytes(name: bytes) -> bytes:
    with open(name, "rb") as file:
        table = pq.read_table(file)
    with open(name, "wb") as file:
        pq.write_table(table, file)
    return name


def test_a_pipe_is_not_opened(tmp_path):
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes")
    os.mkfifo(tmp_path / "a.parquet")
    for read in (read_genome, read_form, read_chromosome):
        with pytest.raises(EvocityError):
            read(tmp_path / "a.parquet")


def test_the_child_passes_metadata_of_other_tables(path):
    table = pa.table({"geometry": [b"x"]}).replace_schema_metadata({"geo": "{}"})
    with pytest.raises(GenomeError, match="is GeoParquet"):
        read_genome(unsealed(path, table))


def test_an_endless_attribution_is_refused(path, genome):
    table = pq.read_table(path)
    about = json.loads(table.schema.metadata[b"evocity.genome"]) | {"attribution": "a" * 5_000_000}
    table = table.replace_schema_metadata({"evocity.genome": json.dumps(about)})
    with pytest.raises(GenomeError, match="text of at most") as refused:
        read_genome(unsealed(path, table))
    assert len(str(refused.value)) < 1000
    with pytest.raises(GenomeError, match="text of at most"):
        genome.replace(attribution=about["attribution"])
