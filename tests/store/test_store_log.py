"""The population log: what is written comes back, whatever the moment of a crash."""

import dataclasses
import json
import math
import re
import shutil
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from leaves import draw_leaves, draw_pavement

from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.genome import FIELDS, NEWER, NUCLEOTIDES, Genome, packed
from evocity.pavement import Pavement
from evocity.store import Birth, Header, Member, RunLog, RunWriter, Source, merge
from evocity.store.schema import STATUSES, births_of, births_table

CITIES = ("left", "right")
MEASURES = ("alpha", "beta")
HEADER = Header(16, 24, 2.0, 0.9, CITIES, "© left; © right", None, None, 7, 6, "abc", MEASURES)
#: Of a run of a release before leaves.
OLDER = dataclasses.replace(HEADER, block=4)


def genome(seed: int, cities=CITIES, pavement: Pavement | None = None) -> Genome:
    """A code on leaves, other ones for each ``seed``, unless a ``pavement`` is given."""
    leaves = pavement or draw_pavement(seed, 16, 24, root=8)
    return draw_leaves(seed, leaves, cities=len(cities)).replace(
        cities=cities,
        attribution="© left; © right",
        made={"operator": "mutation", "fill": [0.5, 0.25], "seed": seed},
    )


def older_genome(seed: int) -> Genome:
    """As those that releases before leaves bred: stones of whole range blocks, none turned."""
    pavement = Pavement(16, 24, OLDER.block)
    own = np.random.default_rng(seed).integers(0, len(pavement), len(pavement))
    stones = packed(*(corner[own] for corner in pavement.corners))
    return genome(seed, pavement=pavement).replace(
        source=stones, turn=np.zeros(own.size, int), other=None, part=None
    )


def birth(generation: int, slot: int, status="ok", drawn=genome) -> Birth:
    identifier = generation * HEADER.population + slot
    bred = None if status == "error" else drawn(identifier)
    values = {"alpha": identifier / 7, "beta": math.nan if status == "invalid" else -1.5}
    return Birth(
        generation,
        identifier,
        (0, identifier // 2),
        "mutation",
        status,
        None if status == "ok" else f"{status} – ünïcode\nsecond line",
        0.125,
        {} if status in ("error", "died") else values,
        bred,
        dict(bred.made) if bred else {"fill": 0.5},
        feasible=status == "ok" and identifier % 2 == 0,
    )


def generation_of(number: int, size: int = 2):
    births = [birth(number, slot) for slot in range(size)]
    members = [Member(slot, b.id, 0, {"crowding": math.inf}) for slot, b in enumerate(births)]
    return number, births, members, {"births": (number + 1) * size, "hypervolume": number / 3}


@pytest.fixture
def writer(tmp_path):
    city = CityMap(np.full((16, 24), 3.0), 2.0, name="le / ft", attribution="© left")
    source = Source(city, genome(1))
    writer = RunWriter.create(tmp_path / "run", "# recipe\n", {"seed": 7}, HEADER, [source])
    yield writer
    writer.close()


def same(one: Birth, other: Birth) -> bool:
    if repr({**one.__dict__, "genome": None}) != repr({**other.__dict__, "genome": None}):
        return False
    if one.genome is None or other.genome is None:
        return one.genome is other.genome
    carried = [
        (*(getattr(g, name).tobytes() for name in FIELDS), g.pavement, g.made, g.settle)
        for g in (one.genome, other.genome)
    ]
    return one.genome == other.genome and carried[0] == carried[1]


@given(
    statuses=st.lists(st.sampled_from(STATUSES), min_size=1, max_size=5),
    generation=st.integers(0, 10**6),
    value=st.floats(allow_nan=False, allow_infinity=False),
)
@pytest.mark.parametrize(
    ("header", "drawn"), [(HEADER, genome), (OLDER, older_genome)], ids=["leaves", "older"]
)
@settings(deadline=None, max_examples=25, suppress_health_check=list(HealthCheck))
def test_births_come_back_as_they_went(tmp_path, header, drawn, statuses, generation, value):
    births = [birth(generation, slot, status, drawn) for slot, status in enumerate(statuses)]
    births[0].values.update(alpha=value) if births[0].values else None
    path = tmp_path / "generation.parquet"
    pq.write_table(births_table(births, header), path)
    back = births_of(pq.read_table(path), header)
    assert len(back) == len(births)
    assert all(same(one, other) for one, other in zip(births, back, strict=True))


def test_columns_are_those_the_documents_promise(writer):
    writer.write_generation(*generation_of(0))
    path = writer.path / "births" / "generation-00000000.parquet"
    schema = pq.read_schema(path)
    plain = ["generation", "id", "parents", "operator", "made", "status", "error", "seconds"]
    measured = ["fitness.alpha", "fitness.beta", "feasible", "genome"]
    assert schema.names == [*plain, *measured, *NUCLEOTIDES, "parent", "source", *NEWER, "side"]
    assert schema.field("sigma").type == pa.list_(pa.float32())
    assert schema.field("side").type == pa.list_(pa.int16())
    about = json.loads(schema.metadata[b"evocity.run"])
    assert about["schema_version"] == 3
    assert (about["kind"], about["settle"]) == ("fabric", False)
    assert "block" not in about
    frame = pq.read_table(path).to_pandas()
    assert frame["operator"].tolist() == ["mutation", "mutation"]
    counts = [len(sides) for sides in frame["side"]]
    assert counts[0] != counts[1]
    assert [len(row) for row in frame["sigma"]] == counts
    assert [int((sides.astype(int) ** 2).sum()) for sides in frame["side"]] == [16 * 24] * 2


def test_what_a_footer_holds_twice_has_no_spaces(writer):
    writer.write_generation(*generation_of(0))
    for kind in ("births", "membership"):
        about = pq.read_schema(writer.path / kind / "generation-00000000.parquet").metadata
        for text in about.values():
            assert text == json.dumps(json.loads(text), separators=(",", ":")).encode()


def test_columns_of_an_older_run_stay_as_they_were(tmp_path):
    writer = RunWriter.create(tmp_path / "run", "", {}, OLDER, [])
    bred = [birth(0, slot, drawn=older_genome) for slot in range(2)]
    writer.write_generation(
        0, bred, [Member(b.id, b.id, 0, {"crowding": math.inf}) for b in bred], {}
    )
    writer.close()
    schema = pq.read_schema(tmp_path / "run" / "births" / "generation-00000000.parquet")
    assert schema.names[-9:] == [*NUCLEOTIDES, "parent", "source"]
    assert schema.field("sigma").type == pa.list_(pa.float32(), 24)
    about = json.loads(schema.metadata[b"evocity.run"])
    assert (about["schema_version"], about["block"]) == (1, 4)
    assert not {"kind", "settle"} & set(about)
    back = RunLog(tmp_path / "run").individuals([0, 1])
    assert all(same(one, other) for one, other in zip(bred, back, strict=True))


def test_a_folder_of_runs_tells_which_it_holds(writer):
    with pytest.raises(RunError, match=r"but 1 within it(.|\n)*for example .*run$"):
        RunLog(writer.path.parent)
    with pytest.raises(RunError, match="start a run"):
        RunLog(writer.path / "births")


def test_a_pedigree_is_all_that_an_individual_descends_from(writer):
    """Births i descend from 0 and i // 2; 0 claims to descend from itself."""
    for number in range(8):
        writer.write_generation(*generation_of(number, size=6))
    run = RunLog(writer.path)
    assert run.ancestors(47).column("id").to_pylist() == [0, 1, 2, 5, 11, 23, 47]
    assert run.ancestors(0).column("id").to_pylist() == [0]
    row = run.ancestors(47).to_pylist()[-1]
    assert list(row)[:5] == ["generation", "id", "parents", "operator", "status"]
    assert (row["generation"], row["parents"], row["fitness.alpha"]) == (7, [0, 23], 47 / 7)
    chosen = run.ancestors(9, columns=["operator", "seconds"])
    assert chosen.column_names == ["operator", "seconds"]
    assert chosen.num_rows == 5
    assert run.ancestors(np.int32(9), columns=[]).num_rows == 5
    for nobody in (48, -1, "47", [47], True, 4.0):
        with pytest.raises(RunError, match=re.escape(f"no individual {nobody!r}")):
            run.ancestors(nobody)
    with pytest.raises(RunError, match="no column 'nope'"):
        run.ancestors(9, columns=["id", "nope"])


def test_a_run_is_read_while_it_is_written(writer):
    run = RunLog(writer.path)
    assert run.status()["generation"] is None
    with pytest.raises(RunError, match="no complete generation"):
        run.births()
    for number in range(3):
        writer.write_generation(*generation_of(number))
        assert run.status()["generation"] == number
        assert run.status()["hypervolume"] == number / 3
    assert run.births()["id"].to_pylist() == [0, 1, 6, 7, 12, 13]
    assert run.births(1)["id"].to_pylist() == [6, 7]
    assert run.members(2)["id"].to_pylist() == [12, 13]
    assert run.genome(7) == genome(7)
    assert [about["births"] for about in run.history()] == [2, 4, 6]
    assert json.dumps(run.status())
    with pytest.raises(RunError, match="no individual 3"):
        run.genome(3)
    for unborn in (99999, -1):
        told = f"(?s)no individual {unborn}.*an id from 0 to {6 * run.generations[-1] + 1}\n"
        with pytest.raises(RunError, match=told):
            run.genome(unborn)
    with pytest.raises(RunError, match="no generation 3"):
        run.births(3)


def test_sources_come_back(writer):
    (source,) = RunLog(writer.path).sources()
    assert source.name == "le / ft"
    assert source.city.attribution == "© left"
    assert (source.city.heights == 3.0).all()
    assert source.genome == genome(1)


@pytest.mark.slow
def test_segments_hold_what_the_single_files_held(writer, monkeypatch):
    for number in range(70):
        if number == 63:
            before = RunLog(writer.path)
            singles = before.births(), before.members(), before.history()
            assert len(list((writer.path / "births").iterdir())) == 63
        writer.write_generation(*generation_of(number))
    run = RunLog(writer.path)
    assert sorted(p.name for p in (writer.path / "births").iterdir()) == [
        *(f"generation-{g:08d}.parquet" for g in range(64, 70)),
        "segment-00000000-00000063.parquet",
    ]
    assert len(list((writer.path / "membership").iterdir())) == 7
    assert run.births().slice(0, 126).equals(singles[0])
    assert run.members().slice(0, 126).equals(singles[1])
    assert run.history()[:63] == singles[2]
    assert run.births(63)["id"].to_pylist() == [378, 379]
    assert run.genome(378) == genome(378)
    assert run.generations == range(70)
    assert run.status()["generation"] == 69


@pytest.mark.slow_cases("births-0", "births-40", "membership-1")
@pytest.mark.parametrize(
    ("kind", "removed"), [("births", 0), ("births", 40), ("membership", 1), ("membership", 64)]
)
def test_a_crash_between_segment_and_deletion_changes_nothing(writer, removed, kind):
    for number in range(63):
        writer.write_generation(*generation_of(number))
    copy = writer.path.parent / "singles"
    shutil.copytree(writer.path, copy)
    writer.write_generation(*generation_of(63))
    expected = RunLog(writer.path).births()
    # put the single files back, as if the process had died after deleting some of them
    for path in sorted((copy / kind).iterdir())[removed:]:
        shutil.copy(path, writer.path / kind / path.name)
    run = RunLog(writer.path)
    assert run.births().equals(expected)
    assert run.generations == range(64)
    writer.close()
    RunWriter.reopen(writer.path).close()
    assert len(list((writer.path / kind).iterdir())) == 1
    assert RunLog(writer.path).births().equals(expected)


def test_reopening_drops_what_is_not_whole(writer):
    for number in range(2):
        writer.write_generation(*generation_of(number))
    late = births_table(generation_of(2)[1], HEADER)
    merge.write_single(writer.folder.directory, late, writer.folder.single("births", 2))
    half = writer.path / "births" / ".generation-00000003-0badcafe.parquet"
    half.write_bytes(b"PAR1 half a file")
    writer.close()
    assert RunLog(writer.path).generations == range(2)
    assert len(RunLog(writer.path).births()) == 4
    again = RunWriter.reopen(writer.path)
    assert not half.exists()
    assert len(list((again.path / "births").iterdir())) == 2
    again.write_generation(*generation_of(2))
    again.close()
    assert RunLog(writer.path).generations == range(3)


def test_one_process_writes_a_run_and_a_dead_one_does_not_block_it(writer):
    writer.write_generation(*generation_of(0))
    with pytest.raises(RunError, match="another process"):
        RunWriter.reopen(writer.path)
    writer.close()
    holder = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import sys, time; from evocity.store import RunWriter;"
            f"w = RunWriter.reopen({str(writer.path)!r});"
            "print('held', flush=True); time.sleep(60)",
        ],
        stdout=subprocess.PIPE,
    )
    assert holder.stdout.readline().strip() == b"held"
    with pytest.raises(RunError, match="another process"):
        RunWriter.reopen(writer.path)
    holder.kill()
    holder.communicate()
    RunWriter.reopen(writer.path).close()


def test_an_existing_folder_is_not_touched(writer, tmp_path):
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(RunError, match="exists already"):
        RunWriter.create(writer.path, "other", {}, HEADER, [])
    assert sorted(tmp_path.rglob("*")) == before
    assert RunLog(writer.path).recipe_text == "# recipe\n"


def test_a_run_that_cannot_be_created_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="cannot be written"):
        RunWriter.create(tmp_path / "file" / "run", "", {}, HEADER, [])
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_vanished_folder_is_told(writer):
    writer.write_generation(*generation_of(0))
    shutil.rmtree(writer.path / "births")
    with pytest.raises(RunError, match=r"cannot be written.*generations 0…0 stay"):
        writer.write_generation(*generation_of(1))
    shutil.rmtree(writer.path)
    with pytest.raises(RunError, match="the folder is gone"):
        writer.write_generation(*generation_of(1))
    with pytest.raises(RunError):
        writer.event("stop")


def test_a_full_disk_keeps_the_generations_before(writer, monkeypatch):
    writer.write_generation(*generation_of(0))

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "ParquetWriter", full)
    with pytest.raises(RunError, match="No space left on device"):
        writer.write_generation(*generation_of(1))
    monkeypatch.undo()
    assert RunLog(writer.path).generations == range(1)
    assert len(list((writer.path / "births").iterdir())) == 1


def test_a_cut_event_line_costs_that_line_alone(writer):
    writer.event("start", seed=7)
    with open(writer.path / "events.jsonl", "ab") as file:
        file.write(b'{"time": "2026-01-01T00:0')
    run = RunLog(writer.path)
    assert [e["event"] for e in run.events()] == ["start"]
    writer.event("finish")
    assert [e["event"] for e in run.events()] == ["start", "finish"]
    assert run.status()["finished"]


def read_all(path):
    run = RunLog(path)
    return run.sources(), run.status(), run.births(0), run.genome(0), run.recipe_text


@pytest.mark.parametrize(
    "damage",
    [
        lambda run: (run / "provenance.json").unlink(),
        lambda run: (run / "provenance.json").write_text(""),
        lambda run: (run / "provenance.json").write_text("[1, 2]"),
        lambda run: (run / "provenance.json").write_bytes(b"\xff\xfe\x00"),
        lambda run: (run / "provenance.json").write_text('{"schema_version": 99}'),
        lambda run: (run / "provenance.json").write_text('{"schema_version": 1, "header": {}}'),
        lambda run: shutil.rmtree(run / "births"),
        lambda run: (run / "births" / "generation-00000000.parquet").write_bytes(b"PAR1"),
        lambda run: pq.write_table(
            pa.table({"id": [1]}), run / "births" / "generation-00000000.parquet"
        ),
        lambda run: (run / "events.jsonl").unlink(),
        lambda run: (run / "membership" / "generation-00000000.parquet").write_bytes(b""),
        lambda run: np.save(
            run / "sources" / "00-le-ft.npy", np.array([{"a": 1}], object), allow_pickle=True
        ),
        lambda run: (run / "recipe.toml").unlink(),
    ],
)
def test_a_damaged_or_foreign_folder_gives_a_run_error(writer, damage):
    writer.write_generation(*generation_of(0))
    writer.close()
    damage(writer.path)
    with pytest.raises(RunError) as caught:
        read_all(writer.path)
    assert caught.value.remedy


def test_columns_that_births_have_not_are_refused(writer):
    writer.write_generation(*generation_of(0))
    writer.close()
    run = RunLog(writer.path)
    chosen = run.births(0, columns=["seconds", "id"])
    assert chosen.column_names == ["seconds", "id"]
    for wrong, hint in (
        (["id", "secnods"], "did you mean seconds"),
        (["alpha"], "did you mean fitness.alpha"),
        (["fitness"], "did you mean fitness."),
        ([3], "choose from these columns"),
        ("id", r"write columns=\['id'\]"),
    ):
        with pytest.raises(RunError) as caught:
            run.births(columns=wrong)
        assert caught.match(hint)
        assert repr(wrong[-1] if isinstance(wrong, list) else wrong) in caught.value.found
        assert isinstance(wrong, str) or "generation, id, parents" in caught.value.expected


def test_a_closed_writer_writes_no_more(writer):
    writer.write_generation(*generation_of(0))
    writer.close()
    for write in (
        lambda: writer.write_generation(*generation_of(1)),
        lambda: writer.event("stop"),
        lambda: writer.update_provenance({}),
    ):
        with pytest.raises(RunError, match="this writer was closed"):
            write()
    assert len(RunLog(writer.path).generations) == 1


def test_no_run_at_all(tmp_path):
    for path in (tmp_path, tmp_path / "missing"):
        with pytest.raises(RunError, match="no run at"):
            RunLog(path)


def test_an_adopted_genome_speaks_of_the_runs_cities():
    other = genome(3, cities=("right", "left"))
    adopted = HEADER.chromosome.adopt(other, HEADER, None)
    assert adopted.cities == CITIES
    assert adopted == other
    names = [np.array(g.cities)[g.parent] for g in (other, adopted)]
    assert (names[0] == names[1]).all()


@pytest.mark.parametrize("identifier", [1.0, True, "1", None])
def test_an_individual_is_named_by_a_whole_number(writer, identifier):
    writer.write_generation(*generation_of(0))
    with pytest.raises(RunError, match="a whole number"):
        RunLog(writer.path).genome(identifier)
