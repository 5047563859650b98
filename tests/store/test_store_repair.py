"""Labels of files, and repair of a log whose segments are damaged."""

import shutil

import pytest
from test_store_behind import short  # noqa: F401
from test_store_log import generation_of, writer  # noqa: F401

from evocity.errors import RunError
from evocity.store import RunLog, RunWriter, merge, set_aside
from evocity.store.label import read_label
from evocity.store.run_directory import RunDirectory


def names(path, kind) -> list[str]:
    return sorted(one.name for one in (path / kind).iterdir())


def label_at(path):
    with path.open("rb") as file:
        return read_label(file)


def test_every_file_states_what_it_holds(writer, short):  # noqa: F811
    chains = []
    for number in range(9):
        writer.event("differs", id=number)
        writer.write_generation(*generation_of(number))
        chains.append(writer._events.chain)
    assert len(set(chains)) == 9
    for kind in ("births", "membership"):
        for path in (writer.path / kind).iterdir():
            label = label_at(path)
            single = "segment" not in path.name
            assert label.kind == kind
            assert path.stem == (
                f"generation-{label.first:08d}"
                if single
                else f"segment-{label.first:08d}-{label.last:08d}"
            )
            assert label.chain == (chains[label.last] if kind == "membership" else None)
    assert RunDirectory(writer.path).exists("membership/segment-00000004-00000007.parquet")


def test_a_segment_under_another_name_is_damage(writer, short):  # noqa: F811
    for number in range(9):
        writer.write_generation(*generation_of(number))
    writer.close()
    first, second = (writer.path / "births" / one for one in names(writer.path, "births")[1:])
    shutil.copy(first, second)
    run = RunLog(writer.path)
    assert run.generations == range(4)
    assert second in run.damaged
    with pytest.raises(RunError, match="--set-aside"):
        RunWriter.reopen(writer.path)


@pytest.mark.parametrize("lost", [False, True])
def test_of_a_segment_before_the_damage_generations_are_kept(writer, short, monkeypatch, lost):  # noqa: F811
    for number in range(8):
        writer.write_generation(*generation_of(number))
    size = max(path.stat().st_size for path in (writer.path / "membership").iterdir())
    monkeypatch.setattr(merge, "MOST_BYTES", 8 * size)  # births are merged once only
    for number in range(8, 18):
        writer.write_generation(*generation_of(number))
    writer.close()
    assert "segment-00000000-00000015.parquet" in names(writer.path, "membership")
    path = writer.path / "births" / "segment-00000008-00000011.parquet"
    before = [RunLog(writer.path).members(number) for number in range(8)]
    if lost:
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:-100])
    set_aside(writer.path)
    run = RunLog(writer.path)
    assert run.generations == range(8)
    assert run.damaged == run.missing == ()
    assert [run.members(number) for number in range(8)] == before
    assert len(run.history()) == 8
    again = RunWriter.reopen(writer.path)
    for number in range(8, 18):
        again.write_generation(*generation_of(number))
    again.close()
    assert len(RunLog(writer.path).births()) == 36
    assert RunLog(writer.path).unverified() == []
