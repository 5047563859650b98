"""What ends a run from outside leaves an event, an exit code, and a run that goes on."""

import os
import signal
import subprocess
import sys
import time

import pytest
from toy_runs import write_toy

from evocity.search import Search
from evocity.store import open_run

if os.name == "nt":
    pytest.skip("Windows has no such signals", allow_module_level=True)


# A process inherits what is ignored, as SIGHUP below `nohup`.
_HEARS_ALL = """
import signal
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from evocity.cli import main
main(prog_name="evocity")
"""


def begun(folder, **settings):
    """`evocity run` in a process of its own, once its first generation is written."""
    recipe = write_toy(folder, generations=400, workers=1, **settings)
    words = [sys.executable, "-c", _HEARS_ALL, "run", str(recipe), "--out", str(folder / "run")]
    run = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    until = time.monotonic() + 120
    while not (folder / "run" / "membership" / "generation-00000001.parquet").exists():
        assert run.poll() is None, run.stderr.read()
        assert time.monotonic() < until
        time.sleep(0.05)
    return run


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129), (signal.SIGINT, 130)]
)
def test_a_signal_ends_a_run_that_goes_on_later(tmp_path, number, code):
    run = begun(tmp_path)
    run.send_signal(number)
    _, told = run.communicate(timeout=60)
    assert run.returncode == code
    assert "Go on with: evocity resume" in told
    assert "Traceback" not in told
    opened = open_run(tmp_path / "run")
    last = opened.events()[-1]
    reason = "interrupted" if number == signal.SIGINT else signal.Signals(number).name
    assert (last["event"], last["reason"]) == ("stop", reason)
    whole = len(opened.generations)
    with Search.resume(tmp_path / "run", generations=whole, workers=0) as search:
        assert [generation.number for generation in search] == [whole]


def test_a_signal_is_told_to_the_user_by_a_command(tmp_path):
    ask = f"{sys.executable} -c 'import sys; open(sys.argv[1], chr(119)).write(sys.argv[2])'"
    run = begun(tmp_path, recipe=f'[notify]\non_end = "{ask} {tmp_path}/told {{reason}}"\n')
    run.send_signal(signal.SIGTERM)
    run.communicate(timeout=60)
    assert run.returncode == 143
    assert (tmp_path / "told").read_text() == "SIGTERM"
    assert [one["code"] for one in open_run(tmp_path / "run").events()[-1:]] == [0]
