"""Thousands of generations in one process: memory, files, and what the log costs to read.

``EVOCITY_SOAK=5000`` breeds so many; 400 unless told.
"""

import os
import sys
from pathlib import Path
from unittest.mock import patch

import pytest

from evocity.fitness import registry

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
with patch.dict(os.environ):
    import soak
    from _machine import seconds

#: Processor seconds that each way of reading may take at 5 000 generations.
SECONDS = {"status": 0.1, "births(id, status)": 1.0, "archive": 3.0, "ancestors": 3.0}


@pytest.mark.long
@pytest.mark.timeout(6 * 3600)
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is told by /proc")
def test_generation_after_generation_in_one_process(tmp_path):
    generations = int(os.environ.get("EVOCITY_SOAK", "400"))
    with patch.dict(registry._from_files):
        path, memory = soak.bred(tmp_path, generations)
    first, last = memory[generations // 10], memory[generations]
    assert last < 1.1 * first
    assert len(soak.files_of(path)) < 300
    ways = soak.ways(path)
    spent = {name: seconds(ways[name]) for name in SECONDS}
    assert {name: most for name, most in SECONDS.items() if spent[name] >= most} == {}, spent
