"""A Ctrl-C in the middle of a search is a KeyboardInterrupt, at once."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

# Noise leaves nothing to bounds: this goes on for long.
SEARCH = """
import sys
import numpy as np
from evocity import CityMap, encode

heights = np.random.default_rng(0).random((1024, 1024)).astype(np.float32) * 20
city = CityMap(heights, 1.0, name="noise")
how = {"block": 8, "reach": None, "fit": False}
encode(CityMap(heights[:64, :64], 1.0, name="a corner"), **how, threads=1)
print("ready", flush=True)
try:
    encode(city, **how, threads=int(sys.argv[1]))
except BaseException as error:
    print(type(error).__name__, flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="interrupts are sent otherwise there")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_search_is_interrupted_at_once(threads):
    with subprocess.Popen(
        [sys.executable, "-c", SEARCH, str(threads)],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        told = process.stdout.readline()
        waited = time.monotonic() - start
        process.kill()
    assert told == "KeyboardInterrupt\n"
    assert waited < 40
