"""A stranger's run folder, or a damaged one: told as such, and nothing outside is touched."""

import json
import os
import shutil
import sys

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from toy_runs import unsealed

import evocity
from evocity.errors import RunError
from evocity.report import contact_sheet, write_report
from evocity.store import RunLog, RunWriter, run_directory

posix = pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")

DEEP = "[" * 3000 + "]" * 3000


def snapshot(folder) -> dict:
    return {
        path: path.lstat().st_mtime_ns if path.is_dir() else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_dir() or path.is_file()
    }


def refused(path) -> None:
    """Reading and reopening the run either work or raise `RunError`; one of them must."""
    caught = []
    for attempt in (read_all, write_report, lambda p: contact_sheet(evocity.open_run(p)), reopen):
        try:
            attempt(path)
        except RunError as error:
            caught.append(error)
    assert caught


def read_all(path):
    run = RunLog(path)
    run.status(), run.history(), run.events(), run.sources(), run.births(), run.members()
    run.references()
    run.individuals(run.members(0)["id"].to_pylist())
    return run.recipe_text


def reopen(path):
    RunWriter.reopen(path).close()


def test_the_run_itself_is_read(whole_run):
    read_all(whole_run)
    reopen(whole_run)


@posix
@pytest.mark.parametrize(
    "part",
    ["provenance.json", "recipe.toml", "events.jsonl", "lock", "births", "membership", "sources",
     "births/generation-00000003.parquet", "membership/generation-00000003.parquet",
     "sources/00-town.npy", "sources/00-town.json", "sources/00-town.genome.parquet",
     "references", "references/00-town.npy", "references/00-town.json"],
)  # fmt: skip
def test_no_part_is_reached_through_a_link(whole_run, tmp_path, part):
    outside = tmp_path / "outside"
    outside.mkdir()
    (whole_run / part).rename(outside / "target")
    (whole_run / part).symlink_to(outside / "target")
    if (outside / "target").is_dir():
        (outside / "target" / ".bashrc-12345678.sh").write_text("mine")
        (outside / "target" / ".generation-00000001-0badcafe.parquet").write_text("mine")
    before = snapshot(outside)
    refused(whole_run)
    assert snapshot(outside) == before


@posix
def test_a_lock_is_not_made_outside(whole_run, tmp_path):
    (whole_run / "lock").unlink()
    (whole_run / "lock").symlink_to(tmp_path / "made")
    with pytest.raises(RunError, match="is a link"):
        reopen(whole_run)
    assert not (tmp_path / "made").exists()


@posix
@pytest.mark.timeout(20)
@pytest.mark.parametrize("part", ["events.jsonl", "provenance.json", "recipe.toml"])
def test_a_pipe_does_not_hang(whole_run, part):
    (whole_run / part).unlink()
    os.mkfifo(whole_run / part)
    with pytest.raises(RunError, match="not a plain file"):
        read_all(whole_run)


def test_huge_files_are_not_read(whole_run, monkeypatch):
    monkeypatch.setattr(run_directory, "MOST_BYTES", 1000)
    (whole_run / "events.jsonl").write_bytes(b" " * 1001)
    with pytest.raises(RunError, match="more than"):
        RunLog(whole_run).events()


def test_only_our_own_unfinished_files_are_deleted(whole_run):
    kept = [whole_run / ".notes-20260101.md", whole_run / "births" / ".mine-abcdefgh.parquet"]
    ours = [
        whole_run / ".provenance-0badcafe.json",
        whole_run / "births" / ".generation-00000009-0badcafe.parquet",
        whole_run / "membership" / ".segment-00000000-00000063-0badcafe.parquet",
    ]
    for path in kept + ours:
        path.write_text("x")
    reopen(whole_run)
    assert all(path.exists() for path in kept)
    assert not any(path.exists() for path in ours)


@pytest.mark.parametrize("kind", ["births", "membership"])
def test_a_lost_generation_in_the_middle_costs_nothing_behind_it(whole_run, kind):
    (whole_run / kind / "generation-00000004.parquet").unlink()
    before = snapshot(whole_run)
    with pytest.raises(RunError, match=f"{kind}.generation-00000004.parquet is missing.* up to 8"):
        reopen(whole_run)
    assert snapshot(whole_run) == before


@posix
def test_a_folder_with_a_name_that_is_not_utf8_is_read_and_written(whole_run):
    path = whole_run.with_name(os.fsdecode(b"caf\xe9"))
    try:
        whole_run.rename(path)
    except OSError:
        pytest.skip("this file system takes only names in UTF-8")
    run = RunLog(path)
    assert run.status()["generation"] == 8
    assert len(run.history()) == len(run.generations) == 9
    assert len(run.births()) == len(run.individuals(range(18))) == 18
    assert len(run.members()) == 18
    writer = RunWriter.reopen(path)
    writer.event("resume")
    writer.close()
    assert [one["event"] for one in RunLog(path).events()] == ["start", "resume"]


HEADERS = {
    "population": [0, -1, "6", 2.5, True, None],
    "attribution": [3, None],
    "origin": [[], [1], ["a", "b"], 7],
    "metres_per_pixel": ["x", 0, -2.0, float("nan"), float("inf")],
    "sigma_max": ["x", -1.0, float("nan")],
    "height": [2**40, 17, "<b>", 0],
    "block": [4, 1, 5, 10**30, "4"],
    "kind": ["curve", None, 3],
    "settle": [1, "yes", None],
    "schema_version": [1, 2, 4, "3", None],
    "cities": ["town", [3], ["a", "a"], [f"c{n}" for n in range(300)]],
    "measures": [["gsi", "fsi"], [], [1], None, ["gsi", "gsi"]],
    "seed": ["<meta http-equiv=refresh>", -1, 2**70],
}


@pytest.mark.parametrize(
    ("key", "value"), [(key, value) for key, values in HEADERS.items() for value in values]
)
def test_a_header_is_checked(whole_run, key, value):
    path = whole_run / "provenance.json"
    about = unsealed(path)
    about["header"][key] = value
    path.write_text(json.dumps(about))
    refused(whole_run)


@pytest.mark.parametrize("text", [DEEP, f'{{"schema_version": 1, "header": {DEEP}}}', "3", "null"])
def test_provenance_nested_deep_or_no_table(whole_run, text):
    (whole_run / "provenance.json").write_text(text)
    with pytest.raises(RunError):
        RunLog(whole_run)


def rewrite(path, change):
    table = change(pq.read_table(path))
    pq.write_table(table, path)


def of_type(table, name, kind):
    index = table.schema.get_field_index(name)
    return table.set_column(index, name, pa.array([None] * len(table), kind))


@pytest.mark.parametrize(
    ("file", "change"),
    [
        ("births", lambda t: t.drop_columns(["sigma"])),
        ("births", lambda t: t.drop_columns(["id"])),
        ("births", lambda t: of_type(t, "id", pa.string())),
        ("births", lambda t: of_type(t, "id", pa.int64())),
        ("births", lambda t: of_type(t, "fitness.gsi", pa.list_(pa.int8()))),
        ("births", lambda t: of_type(t, "fitness.gsi", pa.float64())),
        ("births", lambda t: of_type(t, "genome", pa.string())),
        ("births", lambda t: t.append_column("more", pa.array([1] * len(t)))),
        ("births", lambda t: t.replace_schema_metadata({})),
        ("membership", lambda t: t.drop_columns(["rank"])),
        ("membership", lambda t: of_type(t, "rank", pa.string())),
        ("membership", lambda t: of_type(t, "rank", pa.int32())),
        ("membership", lambda t: of_type(t, "crowding", pa.float64())),
        ("membership", lambda t: t.replace_schema_metadata({})),
    ],
)
def test_columns_are_checked(whole_run, file, change):
    rewrite(whole_run / file / "generation-00000000.parquet", change)
    refused(whole_run)


@pytest.mark.parametrize(
    ("file", "change"),
    [
        ("births", lambda t: of_type(t, "id", pa.int64())),
        ("births", lambda t: t.replace_schema_metadata({})),
        ("membership", lambda t: t.drop_columns(["rank"])),
        ("membership", lambda t: of_type(t, "crowding", pa.float64())),
    ],
)
def test_columns_of_the_last_generation_are_checked(whole_run, file, change):
    rewrite(whole_run / file / "generation-00000008.parquet", change)
    refused(whole_run)


@pytest.mark.parametrize(
    "summary",
    ["[]", '{"8": []}', '{"8": {"births": [1]}}', '{"8": {"hypervolume": NaN}}',
     '{"8": {"best": {"gsi": "<b>"}}}', '{"8": {"births": "<b>"}}', '{"x": {}}', DEEP],
)  # fmt: skip
def test_a_summary_is_checked(whole_run, summary):
    path = whole_run / "membership" / "generation-00000008.parquet"
    rewrite(
        path,
        lambda t: t.replace_schema_metadata(
            {**t.schema.metadata, b"evocity.generations": summary.encode()}
        ),
    )
    for read in (lambda run: run.status(), lambda run: run.history()):
        with pytest.raises(RunError):
            read(RunLog(whole_run))


def test_a_file_of_another_run_is_not_mixed_in(whole_run):
    path = whole_run / "births" / "generation-00000002.parquet"
    table = pq.read_table(path)
    about = json.loads(table.schema.metadata[b"evocity.run"]) | {"seed": 8}
    rewrite(path, lambda t: t.replace_schema_metadata({b"evocity.run": json.dumps(about)}))
    with pytest.raises(RunError, match="another run"):
        RunLog(whole_run).births()


def test_a_hidden_folder_of_a_killed_creation_goes(whole_run, tmp_path):
    place, run = whole_run.parent, RunLog(whole_run)
    left = place / ".new-0badcafe"
    shutil.copytree(whole_run, left)
    others = [place / ".new-0badcaf", place / ".newer-0badcafe", place / ".new-00000000"]
    for other in others:
        shutil.copytree(whole_run, other)
    (others[2] / "mine.txt").write_text("no part of a run")
    held = place / ".new-11111111"
    shutil.copytree(whole_run, held)
    holder = RunWriter.reopen(held)
    RunWriter.create(place / "new", "", {}, run.header, run.sources()).close()
    holder.close()
    assert not left.exists()
    assert all(path.is_dir() for path in [*others, held])


def test_more_than_a_hundred_sources_come_back_in_order(whole_run, tmp_path):
    run = RunLog(whole_run)
    (source,) = run.sources()
    many = [source] * 101
    writer = RunWriter.create(tmp_path / "many", "", {}, run.header, many)
    writer.close()
    assert len(RunLog(tmp_path / "many").sources()) == 101
