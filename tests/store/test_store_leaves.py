"""Leaves in files: what tiles the map is read, what does not is damage and told as such."""

import dataclasses
import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from leaves import draw_leaves, draw_pavement

import evocity
from evocity.citymap import CityMap
from evocity.errors import GenomeError, RunError
from evocity.genome import FIELDS, packed, read_genome
from evocity.report import contact_sheet, write_report
from evocity.store import Birth, Header, Member, RunLog, RunWriter, Source

CITY = CityMap(np.kron(np.eye(2), np.full((16, 24), 6.0)), 2.0, name="town")
HEADER = Header(32, 48, 2.0, 0.9, ("town",), "", None, None, 7, 2, "h", ("gsi",), settle=True)


def drawn(seed: int):
    """A code on other leaves for each ``seed``, settled as the run's."""
    genome = draw_leaves(seed, draw_pavement(seed), cities=1)
    return genome.replace(cities=("town",), attribution="", settle=True)


@pytest.fixture
def run(tmp_path):
    """Path of a closed run: three generations of two births each, all on leaves of their own."""
    path = tmp_path / "run"
    writer = RunWriter.create(path, "[run]\n", {}, HEADER, [Source(CITY, drawn(99))])
    for number in range(3):
        births = [
            Birth(number, i, (), "mutation", "ok", None, 0.1, {"gsi": 0.5}, drawn(i))
            for i in (2 * number, 2 * number + 1)
        ]
        members = [Member(s, one.id, 0, {"crowding": math.inf}) for s, one in enumerate(births)]
        writer.write_generation(number, births, members, {"births": 2 * number + 2})
    writer.close()
    return path


def test_leaves_come_back_bit_for_bit(run):
    log = RunLog(run)
    assert log.header == HEADER
    assert log.provenance["schema_version"] == 3
    for birth in log.individuals(range(6)):
        meant = drawn(birth.id)
        assert birth.genome.digest == meant.digest
        assert birth.genome.pavement == meant.pavement
        assert birth.genome.settle is True
        for name in FIELDS:
            assert getattr(birth.genome, name).tobytes() == getattr(meant, name).tobytes()
    assert log.sources()[0].genome == drawn(99)


def test_each_birth_has_leaves_of_its_own_that_tile_the_map(run):
    sides = RunLog(run).births(columns=["side"])["side"]
    assert len({tuple(row.as_py()) for row in sides}) == 6
    areas = [int((row.values.to_numpy().astype(int) ** 2).sum()) for row in sides]
    assert areas == [32 * 48] * 6


def test_a_birth_without_a_genome_has_no_leaves(tmp_path):
    writer = RunWriter.create(tmp_path / "run", "", {}, HEADER, [Source(CITY, drawn(99))])
    failed = Birth(0, 1, (), "mutation", "error", "it failed", 0.1, {}, None)
    births = [Birth(0, 0, (), "mutation", "ok", None, 0.1, {"gsi": 0.5}, drawn(0)), failed]
    writer.write_generation(0, births, [Member(0, 0, 0, {"crowding": math.inf})], {})
    writer.close()
    log = RunLog(tmp_path / "run")
    assert log.births()["side"].is_valid().to_pylist() == [True, False]
    assert [one.genome for one in log.individuals([1])] == [None]
    with pytest.raises(RunError, match="breeding failed"):
        log.genome(1)


def lists(table, name: str, change) -> pa.Table:
    """``table`` with the first row of a column of lists changed."""
    rows = table[name].to_pylist()
    rows[0] = change(rows[0])
    at = table.schema.get_field_index(name)
    return table.set_column(at, table.schema.field(name), pa.array(rows, table[name].type))


DAMAGE = [
    ("side", lambda sides: sides[::-1]),
    ("side", lambda sides: [*sides, 2]),
    ("side", lambda sides: sides[:-1]),
    ("side", lambda sides: [16, *sides[1:]] if sides[0] != 16 else [8, *sides[1:]]),
    ("side", lambda sides: [0] * len(sides)),
    ("side", lambda sides: [-2, *sides[1:]]),
    ("side", lambda sides: []),
    ("side", lambda sides: None),
    ("side", lambda sides: [None, *sides[1:]]),
    ("sigma", lambda values: values[:-1]),
    ("sigma", lambda values: [7.0] * len(values)),
    ("beta", lambda values: [math.nan, *values[1:]]),
    ("x", lambda values: [2000] * len(values)),
    ("dy", lambda values: [3] * len(values)),
    ("iso", lambda values: [9] * len(values)),
    ("turn", lambda values: [8, *values[1:]]),
    ("parent", lambda values: [3, *values[1:]]),
    ("source", lambda values: [-1, *values[1:]]),
    ("source", lambda values: None),
]


@pytest.mark.parametrize(("column", "change"), DAMAGE)
def test_births_whose_leaves_are_damaged_are_told(run, column, change):
    path = run / "births" / "generation-00000002.parquet"
    table = pq.read_table(path)
    pq.write_table(lists(table, column, change), path)
    log = RunLog(run)
    assert log.genome(0) == drawn(0)
    opened = evocity.open_run(run)
    for read in (lambda: log.genome(4), lambda: contact_sheet(opened), lambda: write_report(run)):
        with pytest.raises(RunError) as caught:
            read()
        assert caught.value.remedy


@pytest.mark.slow
def test_ids_are_found_in_generations_of_any_number_of_births(tmp_path):
    """By the file's own statistics, single or merged: not by the population."""
    path = tmp_path / "run"
    writer = RunWriter.create(path, "", {}, HEADER, [Source(CITY, drawn(99))])
    counts, first, ids = [5, 1, 0, 9, 2] + [1] * 61, 0, []
    for number, count in enumerate(counts):
        chosen = range(first, first + 3 * count, 3)  # and numbers are left out
        births = [
            Birth(number, i, (), "mutation", "ok", None, 0.1, {"gsi": 0.5}, drawn(i % 7))
            for i in chosen
        ]
        writer.write_generation(number, births, [], {})
        first, ids = first + 3 * count, [*ids, *chosen]
    writer.close()
    log = RunLog(path)
    assert len(list((path / "births").glob("segment-*"))) == 1
    assert [one.id for one in log.individuals(ids)] == ids
    assert log.genome(ids[-1]).digest == drawn(ids[-1] % 7).digest
    wanted = [ids[7], ids[0], ids[-1], ids[7]]
    assert [one.id for one in log.individuals(wanted)] == wanted
    for unborn in (ids[0] + 1, ids[-1] + 1, -1):
        with pytest.raises(RunError, match=f"no individual {unborn}"):
            log.individuals([unborn])


def written(genome, path, change):
    """A genome file with its table changed."""
    genome.write(path)
    table = change(pq.read_table(path))
    pq.write_table(table, path)
    return path


def column(table, name: str, change) -> pa.Table:
    values = change(table[name].to_numpy().copy())
    at = table.schema.get_field_index(name)
    return table.set_column(at, table.schema.field(name), pa.array(values, table[name].type))


def moved(values):
    values[0] += 2
    return values


def outside(values):
    values[np.flatnonzero(values)[:1]] = 30000
    return values


FILE_DAMAGE = {
    "leaves in another order": lambda t: t.take(np.arange(len(t))[::-1]),
    "a gap": lambda t: t.slice(0, len(t) - 1),
    "an overlap": lambda t: pa.concat_tables([t, t.slice(len(t) - 1)]),
    "a side that does not tile": lambda t: column(t, "side", moved),
    "a top that does not agree": lambda t: column(t, "top", moved),
    "a left that does not agree": lambda t: column(t, "left", moved),
    "sides of 0": lambda t: column(t, "side", lambda v: v * 0),
    "sides below 0": lambda t: column(t, "side", lambda v: -v),
    "a domain block outside the map": lambda t: column(t, "y", outside),
    "domain blocks that are no multiple": lambda t: column(t, "dx", lambda v: v + 1),
    "a turn that is none": lambda t: column(t, "turn", lambda v: v + 8),
    "no column of sides": lambda t: t.drop_columns(["side"]),
    "no column of tops": lambda t: t.drop_columns(["top"]),
    "no turns": lambda t: t.drop_columns(["turn"]),
    "sides that are text": lambda t: t.set_column(
        t.schema.get_field_index("side"), "side", pa.array(["4"] * len(t))
    ),
    "a side without a value": lambda t: t.set_column(
        t.schema.get_field_index("side"), "side", pa.array([None] * len(t), pa.int16())
    ),
}


@pytest.mark.parametrize("damage", FILE_DAMAGE)
def test_a_genome_file_whose_leaves_are_damaged_is_told(tmp_path, damage):
    path = written(drawn(3), tmp_path / "leaves.parquet", FILE_DAMAGE[damage])
    with pytest.raises(GenomeError) as caught:
        read_genome(path)
    assert str(path) in caught.value.found
    assert caught.value.remedy


def test_the_genome_file_itself_is_read(tmp_path):
    genome = drawn(3)
    back = read_genome(written(genome, tmp_path / "leaves.parquet", lambda table: table))
    assert back == genome
    assert back.settle is True
    assert back.pavement == genome.pavement
    for name in FIELDS:
        assert getattr(back, name).tobytes() == getattr(genome, name).tobytes()


def test_what_older_releases_can_hold_is_written_for_them(tmp_path):
    """Uniform, not settled, stones of whole range blocks, none turned: schema 1; settled roofs: 4;
    else 3."""
    pavement = draw_pavement(1, finest=4, root=4)
    corners = packed(*(corner[::-1] for corner in pavement.corners))
    plain = draw_leaves(1, pavement, cities=1)
    plain = plain.replace(
        source=corners, turn=np.zeros(len(pavement), int), part=plain.part * 0 + 1
    )
    for genome, version in (
        (plain, b'"schema_version": 1'),
        (plain.replace(settle=True), b'"schema_version": 3'),
        (plain.replace(settle="roofs"), b'"schema_version": 4'),
        (plain.replace(turn=np.ones(len(pavement), int)), b'"schema_version": 3'),
        (plain.replace(source=corners + 1), b'"schema_version": 3'),
        (plain.replace(part=plain.part / 2), b'"schema_version": 3'),
    ):
        genome.write(tmp_path / "one.parquet")
        about = pq.read_schema(tmp_path / "one.parquet").metadata[b"evocity.genome"]
        assert version in about
        back = read_genome(tmp_path / "one.parquet")
        assert back == genome
        assert np.array_equal(back.source, genome.source)
        assert np.array_equal(back.turn, genome.turn)


def test_a_run_of_leaves_is_no_run_of_one_side(run):
    """A header that tells a block it cannot have had is damage."""
    path = run / "births" / "generation-00000001.parquet"
    table = pq.read_table(path)
    told = dataclasses.replace(HEADER, block=4).to_json()
    pq.write_table(table.replace_schema_metadata({b"evocity.run": told}), path)
    with pytest.raises(RunError, match="another run"):
        RunLog(run).births()
