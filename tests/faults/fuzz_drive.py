"""Inputs handed to processes that read them, `fuzz_child`, two at a time."""

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

#: Seconds of processor an input may take, and MiB of memory beside what the process had before.
SECONDS, MIB = 10.0, 600.0

CHILD = Path(__file__).with_name("fuzz_child.py")


def outcomes(
    jobs: Sequence[dict], folder: Path, children: int = 2, views: float = 1.0
) -> list[dict]:
    """What came of each of ``jobs``, in their order; ``folder`` is theirs to work in. ``views``:
    seconds that views of GeoPackages get.

    A job: ``kind``, ``path``, of folders ``base`` and ``part``, and ``seconds`` for another limit.
    An outcome: ``outcome``, which is read, refused, raised, crashed or endless; ``message``,
    ``seconds``, ``mib``, ``made``.
    """
    waiting: queue.SimpleQueue = queue.SimpleQueue()
    for number, job in enumerate(jobs):
        waiting.put({"number": number, **job})
    found: dict[int, dict] = {}
    threads = [
        threading.Thread(target=_drive, args=(waiting, found, folder / f"child-{k}", views))
        for k in range(children)
    ]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    return [found[number] for number in range(len(jobs))]


def _drive(waiting: queue.SimpleQueue, found: dict, home: Path, views: float) -> None:
    child = None
    try:
        while True:
            try:
                job = waiting.get_nowait()
            except queue.Empty:
                return
            if child is None:
                child = _Child(home, views)
            told = child.ask(job)
            if told["outcome"] in ("crashed", "endless"):
                child.close()
                child = None
            found[job["number"]] = told
    finally:
        if child is not None:
            child.close()


class _Child:
    def __init__(self, home: Path, views: float):
        for name in ("home", "tmp", "cwd"):
            (home / name).mkdir(parents=True, exist_ok=True)
        paths = os.pathsep.join([str(CHILD.parents[2]), os.environ.get("PYTHONPATH", "")])
        about = {
            "HOME": str(home / "home"),
            "TMPDIR": str(home / "tmp"),
            "PYTHONPATH": paths.rstrip(os.pathsep),
            "MALLOC_ARENA_MAX": "2",
            "NUMBA_NUM_THREADS": "2",
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "ARROW_DEFAULT_MEMORY_POOL": "system",
        }
        if "NUMBA_CACHE_DIR" in os.environ:
            about["NUMBA_CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]
        self._said = (home / "said.txt").open("ab")
        self._process = subprocess.Popen(
            [sys.executable, str(CHILD), str(home.parent), str(views)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            cwd=home / "cwd",
            env=os.environ | about,
            text=True,
        )
        if not self._process.stdout.readline():
            raise RuntimeError((home / "said.txt").read_text()[-2000:])

    def ask(self, job: dict) -> dict:
        seconds = 5 * job.get("seconds", SECONDS)  # by the clock
        late = threading.Timer(seconds, self._process.kill)
        late.start()
        try:
            self._process.stdin.write(json.dumps(job) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        finally:
            ended = not late.is_alive()
            late.cancel()
        if line:
            return json.loads(line)
        code = self._process.wait()
        outcome = "endless" if ended else "crashed"
        about = {"outcome": outcome, "message": f"exit code {code}", "made": []}
        return about | {"seconds": seconds if ended else 0.0, "mib": 0.0}

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._process.stdin.close()
        self._process.stdout.close()
        self._said.close()
