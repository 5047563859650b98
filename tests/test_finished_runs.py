"""Finished runs that tests share: made once, and each test has its own copy."""

import finished_runs
import pytest
from finished_runs import FinishedRuns


@pytest.fixture
def made(monkeypatch) -> list:
    """The folders in which a run named "small" was made."""
    folders = []

    def make(folder):
        folders.append(folder)
        (folder / "run").mkdir()
        (folder / "run" / "log").write_text("births")

    monkeypatch.setitem(finished_runs.MAKERS, "small", make)
    return folders


def test_a_run_is_made_once_and_copies_are_their_own(made, tmp_path):
    shared = tmp_path / "shared"
    first = FinishedRuns(shared).copy("small", tmp_path / "first")
    (first / "log").write_text("changed")
    second = FinishedRuns(shared).copy("small", tmp_path / "second")  # as another process
    assert (second / "log").read_text() == "births"
    assert made == [shared / "small"]


def test_what_a_stopped_process_left_is_made_again(made, tmp_path):
    left = tmp_path / "shared" / "small" / "run"
    left.mkdir(parents=True)
    (left / "half").touch()
    copy = FinishedRuns(tmp_path / "shared").copy("small", tmp_path / "own")
    assert [path.name for path in copy.iterdir()] == ["log"]
    assert len(made) == 1
