"""Links in a run folder: no command writes anything outside through one, and each refusal names
the link. A second process does not enter a run whose lock file was removed."""

import contextlib
import hashlib
import itertools
import os
import shutil
import sys
import tempfile
from contextlib import nullcontext
from pathlib import Path
from unittest.mock import patch

import pytest
from click.testing import CliRunner
from toy_runs import write_toy

import evocity
from evocity.cli import main
from evocity.errors import EvocityError, RunError
from evocity.fitness import registry
from evocity.report import write_report
from evocity.search import Search, read_recipe
from evocity.store import RunLog, RunWriter
from evocity.store.lock import Lock, is_held
from evocity.store.run_directory import RunDirectory
from evocity.studio.picks import PickChange, Picks

if sys.platform == "win32":
    pytest.skip("links and pipes of POSIX", allow_module_level=True)

LONG = [pytest.mark.long, pytest.mark.timeout(3600)]

# -- links of all kinds --------------------------------------------------------------------


def link_to_file(path, outside):
    moved(path, outside / "file")
    path.symlink_to(outside / "file")


def link_to_folder(path, outside):
    (outside / "folder").mkdir()
    moved(path, outside / "folder" / "target")
    path.symlink_to(outside / "folder", target_is_directory=True)


def link_to_the_moved(path, outside):
    moved(path, outside / "moved")
    path.symlink_to(outside / "moved")


def dangling_link(path, outside):
    removed(path)
    path.symlink_to(outside / "nothing")


def loop_of_links(path, outside):
    removed(path)
    path.symlink_to(path.with_name("loop"))
    path.with_name("loop").symlink_to(path)


def link_to_a_pipe(path, outside):
    removed(path)
    os.mkfifo(outside / "pipe")
    path.symlink_to(outside / "pipe")


def a_pipe(path, outside):
    removed(path)
    os.mkfifo(path)


def link_to_another_file_system(path, outside):
    place = outside / "shm"
    moved(path, place / "file")
    path.symlink_to(place / "file")


def hard_link(path, outside):
    if path.is_dir():
        removed(path)
    if not path.exists():
        path.write_text("")
    os.link(path, outside / "hard")


KINDS = (
    link_to_file, link_to_folder, link_to_the_moved, dangling_link, loop_of_links, link_to_a_pipe,
    a_pipe, link_to_another_file_system, hard_link,
)  # fmt: skip

PLACES = (
    "recipe.toml", "recipe-1.toml", "provenance.json", "events.jsonl", "commands.jsonl", "lock",
    "report.html", "picks.json", "births", "membership", "sources", "references", "within",
    "fitness", "damaged", ".measures-0", "births/generation-00000002.parquet",
    "membership/generation-00000002.parquet", "births/generation-00000003.parquet",
    "sources/00-left.npy", "sources/00-left.genome.parquet", "sources/locked.npy",
    "fitness/toys.py", "fitness/from-2", "damaged/births-generation-00000002.parquet",
)  # fmt: skip


def removed(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def moved(path: Path, target: Path) -> None:
    """Move what is at ``path`` outside; a text if nothing is."""
    if path.exists():
        shutil.move(path, target)
    else:
        target.write_text("mine")


def digest(*folders: Path) -> str:
    """Names, kinds and bytes of all that is in ``folders``."""
    state = hashlib.blake2b()
    for path in sorted(itertools.chain(*(one.rglob("*") for one in folders))):
        about = path.lstat()
        state.update(repr((str(path), about.st_mode)).encode())
        if path.is_file() and not path.is_symlink():
            state.update(path.read_bytes())
    return state.hexdigest()


# -- all that writes -----------------------------------------------------------------------


def evocity_command(*words):
    def run(folder: Path) -> tuple[bool, str]:
        spelled = [str(word).format(run=folder, beside=folder.parent) for word in words]
        with (
            patch.dict(registry._from_files),
            patch("evocity.accelerate.watch_compiling", lambda told: nullcontext()),
        ):
            result = CliRunner().invoke(main, spelled, prog_name="evocity")
        assert isinstance(result.exception, SystemExit | None), result.exception
        assert "Traceback" not in result.output
        return result.exit_code == 0, result.output

    return run


def in_python(call):
    def run(folder: Path) -> tuple[bool, str]:
        try:
            call(folder)
        except EvocityError as error:
            return False, str(error)
        return True, ""

    return run


def save_in_a_notebook(folder):
    run = evocity.open_run(folder)
    run.save([0, 1], folder.parent / "kept" / "saved.png")
    run.to_csv(folder.parent / "kept" / "births.csv", form="design-explorer", of=[0])


COMMANDS = {
    "status": evocity_command("status", "{run}"),
    "keep": evocity_command("keep", "{run}", "-o", "{beside}/kept/sheet.png"),
    "replay": evocity_command("replay", "{run}", 0, 1, "--trust"),
    "refine": evocity_command(
        "refine", "{run}", "--id", 0, "--budget", 2, "--trust", "-o", "{beside}/kept/x.parquet"
    ),
    "pick": evocity_command("pick", "{run}", 0),
    "reweight": evocity_command("reweight", "{run}", "mutation=3"),
    "stop": evocity_command("stop", "{run}"),
    "picks": in_python(lambda run: Picks(run).change(PickChange(change="pick", ids=(1,)), {1})),
    "notebook": in_python(save_in_a_notebook),
    "report": evocity_command("report", "{run}"),
    "resume": evocity_command("resume", "{run}", "--generations", 3, "--trust"),
    "another recipe": evocity_command("resume", "{run}", "--recipe", "{beside}/other.toml"),
    "set aside": evocity_command("resume", "{run}", "--set-aside", "--trust"),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with a finished run of three generations, and another recipe for it."""
    folder = tmp_path_factory.mktemp("finished")
    recipe = write_toy(folder, population=4, generations=2)
    with (
        patch.dict(registry._from_files),
        Search(read_recipe(recipe), out=folder / "run", workers=0) as search,
    ):
        list(search)
    text = recipe.read_text().replace("mutation = 2", "mutation = 3")
    (folder / "other.toml").write_text(text.replace("generations = 2", "generations = 4"))
    return folder


@pytest.fixture
def outside(tmp_path):
    """A folder outside, in it a link to a folder of another file system."""
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / ".bashrc").write_text("mine")
    shared = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as other:
        (folder / "shm").symlink_to(other)
        yield folder


def copied(finished: Path, place: Path) -> Path:
    shutil.copytree(finished, place)
    (place / "kept").mkdir()
    return place / "run"


@pytest.fixture(scope="module")
def succeeding(finished, tmp_path_factory):
    """The commands that succeed on the run as it is."""
    run = copied(finished, tmp_path_factory.mktemp("untouched") / "copy")
    return {name for name, command in COMMANDS.items() if command(run)[0]}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.long
@pytest.mark.timeout(3600)
def test_no_link_in_a_run_folder_leads_a_command_outside(
    finished, succeeding, outside, tmp_path, place, kind
):
    assert len(succeeding) >= 12
    check_commands(COMMANDS, finished, succeeding, outside, tmp_path, place, kind)


@pytest.mark.parametrize(
    ("place", "kind", "names"),
    [
        ("report.html", link_to_file, ["report"]),
        ("report.html", hard_link, ["report"]),
        ("recipe-1.toml", link_to_file, ["another recipe"]),
        ("recipe-1.toml", dangling_link, ["another recipe"]),
        ("damaged", link_to_folder, ["set aside"]),
        ("fitness/from-2", link_to_folder, ["resume"]),
        ("picks.json", link_to_another_file_system, ["picks"]),
        ("commands.jsonl", hard_link, ["pick"]),
        ("events.jsonl", hard_link, ["resume"]),
        ("lock", link_to_a_pipe, ["resume"]),
        ("births", link_to_the_moved, ["resume", "status"]),
    ],
)
def test_links_that_matter_most(finished, outside, tmp_path, place, kind, names):
    commands = {name: COMMANDS[name] for name in names}
    check_commands(commands, finished, {*names}, outside, tmp_path, place, kind)


def check_commands(commands, finished, succeeding, outside, tmp_path, place, kind):
    run = copied(finished, tmp_path / "copy")
    (run / place).parent.mkdir(exist_ok=True)
    if place == "damaged":  # something to be moved there
        path = run / "births" / "generation-00000002.parquet"
        path.write_bytes(path.read_bytes()[:-100])
    kind(run / place, outside)
    folders = outside, (outside / "shm").resolve()
    before, last = digest(*folders), Path(place).name
    for name, command in commands.items():
        inside = digest(run)
        succeeded, told = command(run)
        assert digest(*folders) == before, f"{name} changed something outside"
        if not succeeded and name in succeeding:
            assert place.split("/")[0] in told, f"{name}: {told}"
            assert last in told or Path(place).parent.name in told, f"{name}: {told}"
            assert digest(run) == inside, f"{name} wrote before it refused"


def test_a_recipe_is_refused_before_the_former_one_is_kept(finished, outside, tmp_path):
    """A multi-line attribution could begin a line of a file of keys."""
    run = copied(finished, tmp_path / "copy")
    (run / "recipe-1.toml").symlink_to(outside / ".bashrc")
    before = digest(run)
    succeeded, told = COMMANDS["another recipe"](run)
    assert not succeeded
    assert "recipe-1.toml is a link" in told
    assert (outside / ".bashrc").read_text() == "mine"
    assert digest(run) == before


def test_a_report_that_is_a_hard_link_leaves_the_other_name_as_it_was(finished, outside, tmp_path):
    run = copied(finished, tmp_path / "copy")
    (run / "report.html").unlink(missing_ok=True)
    os.link(outside / ".bashrc", run / "report.html")
    write_report(run)
    assert (outside / ".bashrc").read_text() == "mine"
    assert (run / "report.html").read_text().startswith("<!")


def test_the_run_itself_may_be_reached_through_a_link(finished, tmp_path):
    run = copied(finished, tmp_path / "copy")
    (tmp_path / "link").symlink_to(run)
    for name in ("report", "resume"):
        succeeded, told = COMMANDS[name](tmp_path / "link")
        assert succeeded, told
    assert len(RunLog(run).generations) == 4


# -- the lock ------------------------------------------------------------------------------


@pytest.fixture
def going(tmp_path):
    """A search after its first generation."""
    recipe = read_recipe(write_toy(tmp_path, population=4, generations=4))
    with (
        patch.dict(registry._from_files),
        Search(recipe, out=tmp_path / "run", workers=0) as search,
    ):
        next(iter(search))
        search.flush()
        yield search


def test_a_run_whose_lock_was_removed_stops_with_an_event(going, tmp_path):
    (tmp_path / "run" / "lock").unlink()
    with pytest.raises(RunError, match="lock was removed or replaced") as caught:
        list(going)
    assert caught.value.expected
    assert caught.value.remedy
    last = RunLog(tmp_path / "run").events()[-1]
    assert last["event"] == "stop"
    assert "lock was removed" in last["reason"]
    assert not is_held(tmp_path / "run" / "lock")
    with Search.resume(tmp_path / "run", workers=0) as search:
        list(search)
    assert len(RunLog(tmp_path / "run").generations) == 5


def test_beside_a_run_that_took_the_lock_over_nothing_is_written(going, tmp_path):
    (tmp_path / "run" / "lock").unlink()
    second = RunWriter.reopen(tmp_path / "run")
    before = digest(tmp_path / "run")
    with pytest.raises(RunError, match="lock was removed or replaced"):
        list(going)
    assert digest(tmp_path / "run") == before
    second.event("goes on")
    second.close()


def test_a_moved_run_is_written_no_further(going, tmp_path):
    (tmp_path / "run").rename(tmp_path / "moved")
    before = digest(tmp_path / "moved")
    with pytest.raises(RunError, match=r"cannot be written.*the folder is gone"):
        list(going)
    assert digest(tmp_path / "moved") == before


def test_a_lock_is_lost_by_another_file_in_its_place(tmp_path):
    held = Lock(RunDirectory(tmp_path))
    held.check()
    os.link(tmp_path / "lock", tmp_path / "second")
    held.check()
    (tmp_path / "lock").unlink()
    assert held.is_lost
    (tmp_path / "lock").touch()
    with pytest.raises(RunError, match="removed or replaced"):
        held.check()
    os.replace(tmp_path / "second", tmp_path / "lock")
    held.check()
    with contextlib.suppress(OSError):
        held.release()
