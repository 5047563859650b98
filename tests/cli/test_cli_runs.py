"""Runs looked at on the command line: told where they are kept, running, stopped, dead."""

import json
import sys

import pytest
from cli_tools import call, contents, refused, write_recipe

import evocity


@pytest.fixture
def recipe(tmp_path):
    return write_recipe(tmp_path)


@pytest.fixture
def going_on(tmp_path, recipe):
    """A run of 9 generations in the middle of its third, held by this process."""
    chosen = evocity.read_recipe(recipe, generations=9)
    with evocity.Search(chosen, out=tmp_path / "run") as search:
        for generation in search:
            if generation.number == 2:
                search.flush()
                yield tmp_path / "run"
                break


@pytest.fixture
def stopped(tmp_path, recipe):
    """A run of 9 generations left after its first population."""
    with evocity.Search(evocity.read_recipe(recipe, generations=9), out=tmp_path / "run") as search:
        next(iter(search))
    return tmp_path / "run"


@pytest.fixture
def dead(tmp_path):
    """A run in which nobody survived the beginning."""
    own = tmp_path / "own_deadly.py"
    own.write_text(
        "import evocity\n"
        "@evocity.fitness(goal='max')\n"
        "def deadly(city):\n"
        "    raise ValueError('no taste')\n"
    )
    recipe = write_recipe(tmp_path, fitness='file = "own_deadly.py"')
    call("run", recipe, "--out", tmp_path / "run", code=1)
    return tmp_path / "run"


def line_of(text: str, name: str) -> str:
    (line,) = [line for line in text.splitlines() if line.startswith(name + " ")]
    return line.removeprefix(name).strip()


# -- where a run is kept ---------------------------------------------------------------------


@pytest.mark.slow
def test_a_run_says_where_it_is_kept_once_it_is(tmp_path, recipe, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("run", recipe, "--generations", 0)
    told = call(*words).stderr.replace("\\", "/")
    assert told.index("encoding right") < told.index("\nrun: runs/towns\n")
    assert told.index("\nrun: runs/towns\n") < told.index("generation 0/0")
    told = call(*words).stderr.replace("\\", "/")
    assert "\nrun: runs/towns-2 (runs/towns exists already)\n" in told
    assert f"\nrun: {tmp_path / 'here'}\n" in call(*words, "--out", tmp_path / "here").stderr


def test_no_run_is_told_if_a_map_is_at_fault(tmp_path, recipe):
    (tmp_path / "right.npy").write_bytes(b"no array")
    message = refused(tmp_path, "run", recipe, "--out", tmp_path / "run", says="right.npy")
    assert "run: " not in message


def test_a_refused_recipe_or_folder_tells_no_run(tmp_path, recipe):
    (tmp_path / "here").mkdir()
    message = refused(tmp_path, "run", recipe, "--out", tmp_path / "here", says="exists already")
    assert message.startswith("Error: ")
    message = refused(tmp_path, "run", tmp_path / "missing.toml", says="cannot be read")
    assert message.startswith("Error: ")


# -- status ----------------------------------------------------------------------------------


def test_a_run_that_goes_on_is_running(going_on):
    before = contents(going_on)
    text = call("status", going_on).stdout
    told = json.loads(call("status", going_on, "--json").stdout)
    assert contents(going_on) == before
    assert line_of(text, "finished").startswith("no; running, about 0:")
    assert line_of(text, "finished").endswith(" left")
    assert "resume" not in text
    assert (told["running"], told["finished"], told["generation"]) == (True, False, 2)
    paces = [one["evaluations_per_second"] for one in evocity.open_run(going_on).history()]
    assert told["seconds_left"] == pytest.approx(7 * sum(6 / pace for pace in paces[1:]) / 2)
    refused(going_on, "resume", going_on, says="another process")


def test_a_stopped_run_is_not_running(stopped):
    told = json.loads(call("status", stopped, "--json").stdout)
    assert (told["running"], told["finished"], told["seconds_left"]) == (False, False, None)
    text = call("status", stopped).stdout
    assert line_of(text, "finished") == f"no; stopped: left; go on with: evocity resume {stopped}"


def test_a_run_without_survivors_is_not_to_be_resumed(tmp_path, dead):
    message = refused(tmp_path, "resume", dead, says="no individual is alive in generation 0")
    remedy = message.split("what to do: ")[1].strip()
    text = call("status", dead).stdout
    assert line_of(text, "finished").endswith(
        f"{dead}: no individual is alive in generation 0; {remedy}"
    )
    assert "evocity resume" not in text
    assert line_of(text, "front") == "none"
    assert json.loads(call("status", dead, "--json").stdout)["front"] == []


def test_json_has_the_whole_front(stopped, monkeypatch):
    front = json.loads(call("status", stopped, "--json").stdout)["front"]
    members = evocity.open_run(stopped).members(0).to_pylist()
    assert front == sorted(one["id"] for one in members if one["rank"] == 0)
    assert len(front) > 1
    assert line_of(call("status", stopped).stdout, "front") == " ".join(map(str, front))
    monkeypatch.setattr(sys.modules["evocity.cli.status"], "_MOST_IDS", 1)
    more = f"{front[0]} and {len(front) - 1} more; all: evocity status {stopped} --json"
    assert line_of(call("status", stopped).stdout, "front") == more
    assert json.loads(call("status", stopped, "--json").stdout)["front"] == front


# -- keep, show ------------------------------------------------------------------------------


def test_which_to_keep_is_told_as_in_python(going_on):
    kept = evocity.open_run(going_on).keep(3)
    text = call("keep", going_on, "--count", 3).stdout
    for one in kept:
        assert f"{one.individual.id}  {one.role}\n    {one.why}\n    {one.gave_up}\n" in text
    told = f"\n{kept.lacking} docs/analysis.md#children-of-all-parents" in text
    assert told == bool(kept.untraced)
    first = kept[0].individual.id
    assert f"evocity decode {going_on} --id {first} -o {first}.gpkg\n" in text
    assert text.endswith(f"evocity scene {going_on} --id {first} -o {first}.glb\n")
    document = json.loads(call("keep", going_on, "--count", 3, "--json").stdout)
    told = document["kept"]
    assert document["untraced"] == kept.untraced
    assert told[0]["built"] == kept[0].built
    assert [one["id"] for one in told] == [one.individual.id for one in kept]
    assert told[0]["scores"] == kept[0].individual.scores
    assert (told[0]["why"], told[0]["gave_up"]) == (kept[0].why, kept[0].gave_up)


def test_several_of_a_run_become_a_contact_sheet(tmp_path, stopped):
    call("keep", stopped, "-o", tmp_path / "kept.png")
    run = evocity.open_run(stopped)
    run.save(run.keep(), tmp_path / "as-kept.png")
    assert (tmp_path / "kept.png").read_bytes() == (tmp_path / "as-kept.png").read_bytes()
    ids = [one.individual.id for one in run.keep()]
    run.save(ids, tmp_path / "plain.png")
    each = [word for one in ids for word in ("--id", one)]
    assert len(ids) > 1
    call("show", stopped, *each, "-o", tmp_path / "shown.png")
    assert (tmp_path / "plain.png").read_bytes() == (tmp_path / "shown.png").read_bytes()
    refused(tmp_path, "keep", stopped, "-o", tmp_path / "k.gpkg", says=".gpkg cannot be written")
    output = ("-o", tmp_path / "s.png")
    words = ("show", stopped, *each, "--id", 10**6, *output)
    refused(tmp_path, *words, says="1000000")
    refused(
        tmp_path,
        "show",
        stopped,
        *each,
        "--pixels",
        64,
        *output,
        says="--pixels cannot be used with",
    )


def test_a_run_of_nobody_has_none_to_keep(tmp_path, dead):
    refused(tmp_path, "keep", dead, says="the archive is empty")


def test_a_name_near_that_of_a_run_is_told(tmp_path, stopped):
    message = refused(tmp_path, "status", tmp_path / "rum", says="no run at")
    assert "did you mean run?" in message


# -- report ----------------------------------------------------------------------------------


def test_a_stopped_run_gets_a_report(tmp_path, stopped):
    before = contents(stopped)
    result = call("report", stopped)
    page = stopped / "report.html"
    assert result.stdout == f"report: {page}\n"
    assert ">generations</abbr></dt><dd>0</dd>" in page.read_text(encoding="utf-8")
    assert contents(stopped) == before | {page: page.read_bytes()}
    page.write_text("of yesterday")
    result = call("report", stopped, "-o", tmp_path / "so-far.html")
    assert result.stdout == f"report: {tmp_path / 'so-far.html'}\n"
    assert page.read_text() == "of yesterday"
    call("report", stopped)
    assert page.read_bytes() == (tmp_path / "so-far.html").read_bytes()


def test_a_run_that_goes_on_gets_a_report(going_on):
    call("report", going_on)
    text = (going_on / "report.html").read_text(encoding="utf-8")
    assert ">generations</abbr></dt><dd>2</dd>" in text


def test_a_run_without_survivors_gets_a_report(dead):
    call("report", dead)
    assert "no taste" in (dead / "report.html").read_text(encoding="utf-8")


def test_a_report_at_fault_is_refused(tmp_path, stopped):
    (tmp_path / "empty").mkdir()
    refused(tmp_path, "report", tmp_path / "missing", says="no run")
    refused(tmp_path, "report", tmp_path / "empty", says="no run")
    refused(tmp_path, "report", stopped, "-o", tmp_path / "r.pdf", says=".pdf cannot be written")
    (tmp_path / "folder.html").mkdir()
    refused(tmp_path, "report", stopped, "-o", tmp_path / "folder.html", says="is a folder")
    refused(tmp_path, "report", stopped, "-o", tmp_path / "no" / "r.html", says="no folder")
    for kind in ("births", "membership"):
        for part in (stopped / kind).iterdir():
            part.unlink()
    refused(tmp_path, "report", stopped, says="no complete generation yet")
    page = tmp_path / "r.html"
    refused(tmp_path, "report", stopped, "-o", page, says="no complete generation yet")
