"""What ends a run from outside leaves an event, an exit code, and a run that goes on."""

import os
import signal
import subprocess
import sys
import time

import pytest
from toy_runs import write_toy

from evocity.search import Search
from evocity.store import RunLog

if os.name == "nt":
    pytest.skip("Windows has no such signals", allow_module_level=True)


# A process inherits what is ignored, as SIGHUP below `nohup`.
_HEARS_ALL = """
import signal
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from evocity.cli import main
main(prog_name="evocity")
"""


def begun(folder, workers, **settings):
    """`evocity run` in a process of its own, once its first generation is written."""
    recipe = write_toy(folder, generations=400, workers=workers, **settings)
    words = [sys.executable, "-c", _HEARS_ALL, "run", str(recipe), "--out", str(folder / "run")]
    run = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    until = time.monotonic() + 240
    while not (folder / "run" / "membership" / "generation-00000001.parquet").exists():
        assert run.poll() is None, run.stderr.read()
        assert time.monotonic() < until
        time.sleep(0.05)
    return run


def stopped_by(run, number: int, code: int, folder) -> None:
    """Send a signal: the run ends with ``code``, tells it, and leaves an event."""
    run.send_signal(number)
    _, told = run.communicate(timeout=120)
    assert run.returncode == code, told
    assert "Go on with: evocity resume" in told
    assert "Traceback" not in told
    last = [one for one in RunLog(folder).events() if one["event"] == "stop"][-1]
    assert last["reason"] == signal.Signals(number).name


def goes_on(folder) -> None:
    whole = len(RunLog(folder).generations)
    with Search.resume(folder, generations=whole, workers=0) as search:
        assert [generation.number for generation in search] == [whole]


# SIGINT: tests/cli/test_cli_process.py
@pytest.mark.slow
def test_a_terminal_that_is_closed_ends_a_run_that_goes_on_later(tmp_path):
    stopped_by(begun(tmp_path, workers=0), signal.SIGHUP, 129, tmp_path / "run")
    goes_on(tmp_path / "run")


@pytest.mark.slow
def test_a_signal_ends_a_run_with_workers_and_the_user_is_told_by_a_command(tmp_path):
    ask = f"{sys.executable} -c 'import sys; open(sys.argv[1], chr(119)).write(sys.argv[2])'"
    note = f'[notify]\non_end = "{ask} {tmp_path}/told {{reason}}"\n'
    run = begun(tmp_path, workers=1, recipe=note)
    stopped_by(run, signal.SIGTERM, 143, tmp_path / "run")
    assert (tmp_path / "told").read_text() == "SIGTERM"
    assert [one["code"] for one in RunLog(tmp_path / "run").events()[-1:]] == [0]
    goes_on(tmp_path / "run")
