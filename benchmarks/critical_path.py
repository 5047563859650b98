"""What a search does besides breeding and evaluation: python benchmarks/critical_path.py

Milliseconds of one generation in the thread that breeds and selects, all but breeding and
evaluation, with the log's writer behind and, with --before, in turn: plans, selection, hashes,
tables, files. 200 individuals of 1 024 lifs, two goals, in one process. Wall time, and processor
time of that thread, by which to compare where other processes run; medians of the generations
after the first.
"""

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

from _machine import description

import evocity

RECIPE = """
[run]
name = "critical path"
seed = 5
population = 200
generations = {generations}
[map]
pixels = 256
metres_per_pixel = 2.0
[genome]
block = 8
fit = false
reach = 8
[[parents]]
map = "lyon-1er"
[[parents]]
map = "montpellier-pas-du-loup"
[operators]
pavement_fusion = 1
lambda_crossover = 1
[search]
adapt = {adapt}
[[fitness]]
name = "gsi"
goal = "max"
[[fitness]]
name = "mean_height"
goal = "min"
[evaluation]
workers = 0
"""


class Clocked:
    """A pool whose time is not counted."""

    def __init__(self, pool):
        self._pool, self.wall, self.thread = pool, 0.0, 0.0

    def run(self, method, jobs):
        wall, thread = time.perf_counter(), time.thread_time()
        found = self._pool.run(method, jobs)
        self.wall += time.perf_counter() - wall
        self.thread += time.thread_time() - thread
        return found

    def stream(self, method, jobs):
        return self._counted(self._pool.stream(method, self._counted(jobs, -1)), 1)

    def _counted(self, source, sign):
        """What ``source`` gives; the time it takes is added, or taken away where it is ours."""
        while True:
            wall, thread = time.perf_counter(), time.thread_time()
            try:
                one = next(source)
            except StopIteration:
                return
            finally:
                self.wall += sign * (time.perf_counter() - wall)
                self.thread += sign * (time.thread_time() - thread)
            yield one

    def close(self):
        self._pool.close()


def generations(folder: Path, count: int, adapt: bool, behind: bool) -> list[tuple[float, float]]:
    """(wall, thread) milliseconds of each generation but the first."""
    path = folder / "recipe.toml"
    path.write_text(RECIPE.format(generations=count, adapt=str(adapt).lower()))
    found = []
    with evocity.Search(evocity.read_recipe(path), out=folder / "run") as search:
        search.prepare()
        pool = search._pool = Clocked(search._pool)
        told = iter(search)
        while True:
            pool.wall = pool.thread = 0.0
            wall, thread = time.perf_counter(), time.thread_time()
            generation = next(told, None)
            if generation is None:
                break
            if not behind:
                search.flush()
            wall, thread = time.perf_counter() - wall, time.thread_time() - thread
            if generation.number:
                found.append((1e3 * (wall - pool.wall), 1e3 * (thread - pool.thread)))
    return found


def main(asked: argparse.Namespace) -> None:
    print(description())
    print("\nms a generation of 200 at 1 024 lifs, all but breeding and evaluation")
    for text, behind in (("written behind", True), ("waited for", False)):
        for adapt in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                found = generations(Path(folder), asked.generations, adapt, behind)
            wall, thread = (statistics.median(column) for column in zip(*found, strict=True))
            name = f"{text}{', adapt' if adapt else ''}"
            print(f"{name:28} wall {wall:7.1f}   this thread {thread:7.1f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=8)
    main(parser.parse_args())
