import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from evocity.files import ProcessFolder, whole_file


def test_a_file_appears_whole(tmp_path):
    with whole_file(tmp_path / "a.txt") as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("whole")
        assert not (tmp_path / "a.txt").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "whole"


def test_a_failure_leaves_the_old_file_and_no_other(tmp_path):
    (tmp_path / "a.txt").write_text("old")

    def write_half():
        with whole_file(tmp_path / "a.txt") as temporary:
            temporary.write_text("half")
            raise RuntimeError("disk full")

    with pytest.raises(RuntimeError):
        write_half()
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_link_is_followed_and_stays(tmp_path):
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "a.txt")
    with whole_file(tmp_path / "link.txt") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "a.txt").read_text() == "new"


def test_what_is_no_file_is_left_as_it_is(tmp_path):
    """As root, a rename would put a file in the place of /dev/null."""
    pipe = tmp_path / "pipe.txt"
    os.mkfifo(pipe)
    for place in (pipe, tmp_path):
        with pytest.raises(FileExistsError, match="is not a file"), whole_file(place):
            raise AssertionError
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [p.name for p in tmp_path.iterdir()] == ["pipe.txt"]


HOLDER = """
from evocity.files import ProcessFolder
own = ProcessFolder("evocity-test-")
print(own.path, flush=True)
input()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a killed process's folder is not known there")
def test_a_temporary_folder_outlives_a_killed_process_until_the_next_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    killed, going_on = (
        subprocess.Popen(
            [sys.executable, "-c", HOLDER], env=os.environ | {"TMPDIR": str(tmp_path)}, **pipes
        )
        for _ in range(2)
    )
    folders = [Path(one.stdout.readline().strip()) for one in (killed, going_on)]
    strange, young = (tmp_path / name for name in ("evocity-test-file", "evocity-test-young"))
    strange.write_text("no folder")
    young.mkdir()
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    for folder in folders:
        (folder / "left").write_text("something")
        os.utime(folder, (1, 1))
    own = ProcessFolder("evocity-test-")
    assert [folder.exists() for folder in (*folders, strange, young, own.path)] == [
        False,
        True,
        True,
        True,
        True,
    ]
    own.remove()
    assert not own.path.exists()
    going_on.communicate("")
