"""What a search does besides breeding and evaluation: python benchmarks/critical_path.py

Milliseconds of one generation in the thread that breeds and selects, all but breeding and
evaluation: plans, selection, hashes; then the same where that thread waits for the log's tables and
files, which are written behind it otherwise. 200 individuals of 1 024 lifs, two goals, in one
process. Wall time; processor time of that thread, by which to compare where other processes run;
and processor time of the log. Medians of the generations after the first.
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
    """What breeds and evaluates, as its engine calls it; its time is not the engine's."""

    def __init__(self, evaluator):
        self._evaluator = evaluator
        self.forget()

    def forget(self) -> None:
        self.births, self.wall, self.thread = 0, 0.0, 0.0

    def born(self, *job):
        wall, thread = time.perf_counter(), time.thread_time()
        found = self._evaluator.born(*job)
        self.wall += time.perf_counter() - wall
        self.thread += time.thread_time() - thread
        self.births += 1
        return found


class ClockedWriter:
    """The writer of the log, with its own processor time, in whichever thread it works."""

    def __init__(self, writer):
        self._writer, self.thread = writer, 0.0

    def __getattr__(self, name: str):
        return getattr(self._writer, name)

    def write_generation(self, *what) -> None:
        thread = time.thread_time()
        self._writer.write_generation(*what)
        self.thread += time.thread_time() - thread


def generations(folder: Path, count: int, adapt: bool, behind: bool) -> list[tuple[float, ...]]:
    """Milliseconds of each generation but the first: wall, of the thread that breeds, and of the
    writer."""
    path = folder / "recipe.toml"
    path.write_text(RECIPE.format(generations=count, adapt=str(adapt).lower()))
    found = []
    with evocity.Search(evocity.read_recipe(path), out=folder / "run") as search:
        search.prepare()
        # beneath the engine, so that it does not matter who else holds that
        births = search._pool._evaluator = Clocked(search._pool._evaluator)
        writer = search._writer._writer = ClockedWriter(search._writer._writer)
        told = iter(search)
        while True:
            births.forget()
            wall, thread = time.perf_counter(), time.thread_time()
            generation = next(told, None)
            if generation is None:
                break
            if not behind:
                search.flush()
            wall, thread = time.perf_counter() - wall, time.thread_time() - thread
            if births.births < 200:
                raise SystemExit(f"{births.births} births were clocked, of 200")
            search.flush()
            own = wall - births.wall, thread - births.thread, writer.thread
            writer.thread = 0.0
            if generation.number:
                found.append(tuple(1e3 * one for one in own))
    return found


def main(asked: argparse.Namespace) -> None:
    print(description())
    print("\nms a generation of 200 at 1 024 lifs, all but breeding and evaluation")
    for text, behind in (("written behind", True), ("waited for", False)):
        for adapt in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                found = generations(Path(folder), asked.generations, adapt, behind)
            told = [f"{statistics.median(column):7.1f}" for column in zip(*found, strict=True)]
            name = f"{text}{', adapt' if adapt else ''}"
            print(f"{name:28} wall {told[0]}   this thread {told[1]}   log {told[2]}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--generations", type=int, default=8)
    main(parser.parse_args())
