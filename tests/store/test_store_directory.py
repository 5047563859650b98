"""`RunDirectory`: whatever is not a plain file or folder is refused before anything is written."""

import os
import sys

import pytest

from evocity.errors import RunError
from evocity.store import run_directory
from evocity.store.run_directory import FILE, FOLDER, LINK, OTHER, RunDirectory

posix = pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")


@pytest.fixture(params=[True, False], ids=["by descriptor", "by path"])
def directory(tmp_path, request, monkeypatch):
    if not request.param:
        monkeypatch.setattr(run_directory, "_BY_DESCRIPTOR", False)
    (tmp_path / "run").mkdir()
    return RunDirectory(tmp_path / "run")


def listed(path) -> dict:
    return {one.name: one.is_file() and one.read_bytes() for one in path.iterdir()}


def test_what_is_written_is_read(directory):
    directory.make_folder("a/b", exist_ok=True)
    directory.make_folder("a/b", exist_ok=True)
    directory.write_bytes("a/b/file.txt", b"old")
    directory.write_bytes(directory.root / "a" / "b" / "file.txt", b"new")
    with directory.append("a/b/file.txt") as file:
        file.write(b"er")
    assert directory.read("a/b/file.txt") == b"newer"
    assert directory.entries("a") == {"b": FOLDER}
    assert directory.entries("a/b") == {"file.txt": FILE}
    directory.rename("a/b/file.txt", "a/moved.txt")
    directory.rename("a/b", "c")
    assert directory.entries("a") == {"moved.txt": FILE}
    assert directory.exists("c")
    directory.remove("a/moved.txt")
    directory.remove("a/moved.txt")
    directory.remove_folder("a")
    assert directory.entries() == {"c": FOLDER}


def test_after_an_error_a_file_is_as_before(directory):
    directory.write_bytes("file.txt", b"old")
    with pytest.raises(TypeError), directory.write("file.txt") as file:
        file.write("new")
    assert listed(directory.root) == {"file.txt": b"old"}


@pytest.mark.parametrize("part", ["../x", "a/../../x", "/etc/x"])
def test_no_part_lies_outside(directory, part):
    with pytest.raises(ValueError):
        directory.write_bytes(part, b"x")
    with pytest.raises(ValueError):
        directory.read(directory.root.parent / "x")


WRITERS = {
    "write": lambda one, part: one.write_bytes(part, b"x"),
    "append": lambda one, part: one.append(part).close(),
    "rename": lambda one, part: one.rename(part, "elsewhere"),
    "make_folder": lambda one, part: one.make_folder(part, exist_ok=True),
    "remove_folder": lambda one, part: one.remove_folder(part),
}


def make_link(path, outside):
    path.symlink_to(outside / "file")


def make_folder_link(path, outside):
    path.symlink_to(outside, target_is_directory=True)


def make_dangling_link(path, outside):
    path.symlink_to(outside / "made")


def make_loop(path, outside):
    path.symlink_to(path)


def make_pipe(path, outside):
    os.mkfifo(path)


@posix
@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize("make", [make_link, make_folder_link, make_dangling_link, make_loop,
                                  make_pipe])  # fmt: skip
@pytest.mark.parametrize("part", ["part", "part/inner"])
def test_nothing_is_written_through_a_link(directory, tmp_path, write, make, part):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "file").write_bytes(b"mine")
    make(directory.root / "part", outside)
    before = listed(outside), os.lstat(directory.root / "part").st_ino
    with pytest.raises(RunError, match="part is"):
        write(directory, part)
    with pytest.raises(RunError, match="part is"):
        directory.read(part)
    assert (listed(outside), os.lstat(directory.root / "part").st_ino) == before
    assert list(directory.entries().values()) == [OTHER if make is make_pipe else LINK]


@posix
def test_a_hard_link_is_replaced_and_never_appended_to(directory, tmp_path):
    (tmp_path / "outside").write_bytes(b"mine")
    os.link(tmp_path / "outside", directory.root / "part")
    with pytest.raises(RunError, match="hard link"):
        directory.append("part")
    assert directory.read("part") == b"mine"
    directory.write_bytes("part", b"new")
    assert (tmp_path / "outside").read_bytes() == b"mine"
    assert directory.read("part") == b"new"


@posix
def test_a_link_removed_leaves_its_target(directory, tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "file").write_bytes(b"mine")
    directory.make_folder("folder")
    (directory.root / "folder" / "link").symlink_to(tmp_path / "outside")
    (directory.root / "link").symlink_to(tmp_path / "outside")
    directory.remove("link")
    directory.remove_folder("folder")
    assert listed(tmp_path / "outside") == {"file": b"mine"}


@posix
def test_a_held_folder_stays_the_folder_that_was_opened(tmp_path):
    (tmp_path / "run").mkdir()
    directory = RunDirectory(tmp_path / "run")
    directory.hold()
    (tmp_path / "run").rename(tmp_path / "moved")
    (tmp_path / "run").mkdir()
    directory.write_bytes("file", b"x")
    directory.release()
    assert listed(tmp_path / "moved") == {"file": b"x"}
    assert listed(tmp_path / "run") == {}


@posix
def test_the_run_folder_itself_may_be_a_link(directory, tmp_path):
    (tmp_path / "link").symlink_to(directory.root)
    RunDirectory(tmp_path / "link").write_bytes("file", b"x")
    assert directory.read("file") == b"x"
