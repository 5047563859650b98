"""The budget of a case: what counts, and who fails."""

import subprocess
import sys
from types import SimpleNamespace
from unittest.mock import patch

import budget
import pytest

BUSY = "import time\nwhile time.process_time() < .5: pass\n"


def spent(act) -> float:
    start = budget.seconds()
    act()
    return budget.seconds() - start


def test_child_processes_count():
    assert spent(lambda: subprocess.run([sys.executable, "-c", BUSY], check=True)) > 0.4


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks /proc")
def test_child_processes_that_go_on_count():
    text = f"{BUSY}print(flush=True)\ninput()"
    words = [sys.executable, "-c", text]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert spent(child.stdout.readline) > 0.2
        child.communicate(b"\n")


def test_loading_a_module_does_not_count(tmp_path, monkeypatch):
    text = BUSY.replace("time.process_time() < .5", "time.process_time() - start < .5")
    (tmp_path / "heavy_to_load.py").write_text(
        text.replace("import time\n", "import time\nstart = time.process_time()\n")
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert spent(lambda: __import__("heavy_to_load")) < 0.3


def called(seconds: float, pace: float = 1.0, mark: str | None = None) -> dict:
    """What a case tells that takes so many ``seconds``; raises if it fails."""
    item = SimpleNamespace(user_properties=[], get_closest_marker=lambda name: name == mark)
    with (
        patch.object(budget, "seconds", iter([10.0, 10.0 + seconds]).__next__),
        patch.object(budget, "_paced", lambda: pace * budget.USUAL),
    ):
        calling = budget.pytest_runtest_call(item)
        next(calling)
        with pytest.raises(StopIteration):
            calling.send(None)
    return dict(item.user_properties)


def test_a_dear_case_without_a_mark_fails():
    assert called(4.9) == {budget.COST: 4.9}
    with pytest.raises(pytest.fail.Exception, match=r"took 5\.1 s of processor"):
        called(5.1)
    for mark in budget.MARKS:
        assert called(31.0, mark=mark) == {budget.COST: 31.0}


def test_a_slower_machine_gives_more_time():
    assert called(9.9, pace=2.0) == {budget.COST: 9.9}
    with pytest.raises(pytest.fail.Exception, match=r"10\.0 s are the most"):
        called(10.1, pace=2.0)
    with pytest.raises(pytest.fail.Exception, match=r"5\.0 s are the most"):
        called(5.1, pace=0.5)
