"""How far one search scales: python benchmarks/scale.py

Measures here, in CPU time, what a birth costs the workers (breeding and evaluation) and the main
process (planning, messages, selection, writing), and carries these by simulation to many workers:
one main process that does one thing after the other, workers whose evaluations are log-normal with
a deviation as large as the mean, births in an ordered window of 16 for each worker.
"""

import argparse
import heapq
import tempfile
import time
from collections import deque
from pathlib import Path

import numpy as np
from _machine import description

import evocity
from evocity.evaluation import Here
from evocity.evaluation.frames import LENGTH, unpickle, write_frame
from evocity.search.breeding.archipelago import Archipelago
from evocity.search.breeding.birth_plans import UNGUIDED
from evocity.search.breeding.births import stream_offspring
from evocity.search.preparation.preparation import prepare
from evocity.selection.fronts import not_dominated
from evocity.store.merge import write_single
from evocity.store.run_directory import RunDirectory
from evocity.store.schema import births_table

POPULATION, PER_WORKER, SPREAD = 64, 16, np.log(2.0)
BIRTHS = 10_000_000


class Clock:
    """CPU seconds that parts took, by their names."""

    def __init__(self):
        self.spent: dict[str, list[float]] = {}

    def timed(self, name: str, call, *args):
        start = time.process_time()
        found = call(*args)
        self.spent.setdefault(name, []).append(time.process_time() - start)
        return found

    def mean(self, name: str) -> float:
        return float(np.mean(self.spent[name]))


def measured(pixels: int, births: int) -> tuple[Clock, float]:
    """What parts of a birth take, seconds, and the bytes that it has in the log."""
    recipe = evocity.Recipe(
        parents=["lyon-1er", "montpellier-pas-du-loup"],
        map={"pixels": pixels, "metres_per_pixel": 2.0},
        genome={"block": 4, "fit": False},
        fitness=["alignment", "autosimilarity"],
        run={"population": POPULATION, "generations": 1},
        search={"window": POPULATION},
    )
    prepared = prepare(recipe)
    engine, population, clock = Here(prepared.setup), Archipelago(prepared), Clock()
    island = population.single
    first = list(stream_offspring(engine, iter(population.plans(0, UNGUIDED))))
    rows = [one.birth(0, prepared.aims) for one in first]
    population.begin_with(rows)
    for one, row in zip(first, rows, strict=True):
        island.admit_birth(row, {row.id: one.look})
    children = []
    for identifier in range(POPULATION, POPULATION + births):
        plan = clock.timed("planning", island.plan, identifier, UNGUIDED)
        job = plan.operator, plan.genomes, plan.rng, True
        clock.timed("message", write_frame, job)
        (one,) = clock.timed(
            "birth", lambda plan: list(stream_offspring(engine, iter([plan]))), plan
        )
        answer = write_frame(("answer", identifier, one.evaluation or one.breeding, False))
        clock.timed("answer", unpickle, answer[LENGTH.size :])
        row = one.birth(1, prepared.aims)
        looks = {} if one.look is None else {row.id: one.look}
        clock.timed("selection", island.admit_birth, row, looks)
        children.append(row)
    with tempfile.TemporaryDirectory() as folder:
        path, directory = Path(folder) / "births.parquet", RunDirectory(folder)

        def write() -> None:
            write_single(directory, births_table(children, prepared.header), path)

        for _ in range(3):
            clock.timed("writing", write)
            size = path.stat().st_size / births
            path.unlink()
    clock.spent["writing"] = [one / births for one in clock.spent["writing"]]
    return clock, size


def simulated(
    workers: int, seconds: float, main: dict[str, float], births: int, seed: int = 0
) -> tuple[float, float, float]:
    """Births a second, and the shares of the time in which workers and the main process work."""
    rng, window = np.random.default_rng(seed), PER_WORKER * workers
    takes = (seconds * rng.lognormal(-SPREAD / 2, SPREAD**0.5, births + window)).tolist()
    ready, idle, clock, worked = deque(range(min(window, births))), workers, 0.0, 0.0
    at_work: list[tuple[float, int]] = []
    early: set[int] = set()
    let_in, busy = 0, 0.0
    while let_in < births:
        while idle and ready:
            identifier = ready.popleft()
            clock += main["send"]
            worked += main["send"]
            heapq.heappush(at_work, (clock + takes[identifier], identifier))
            busy += takes[identifier]
            idle -= 1
        done, identifier = heapq.heappop(at_work)
        idle += 1
        early.add(identifier)
        spent = main["receive"]
        while let_in in early:
            early.remove(let_in)
            spent += main["let in"]
            if let_in + window < births:
                ready.append(let_in + window)
            let_in += 1
        clock = max(clock, done) + spent
        worked += spent
    return births / clock, busy / (clock * workers), worked / clock


def archive_seconds(births: int) -> float:
    """CPU seconds to find who of so many is dominated by nobody, of two goals."""
    losses = np.random.default_rng(0).random((births, 2))
    start = time.process_time()
    not_dominated(losses)
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pixels", type=int, default=128)
    parser.add_argument("--births", type=int, default=64)
    asked = parser.parse_args()
    print(description())
    clock, size = measured(asked.pixels, asked.births)
    names = ("birth", "planning", "message", "answer", "selection", "writing")
    print(f"a birth at {asked.pixels}², B = 4; milliseconds of CPU: ", end="")
    print(", ".join(f"{name} {1e3 * clock.mean(name):.2f}" for name in names))
    costs = {
        "send": clock.mean("message"),
        "receive": clock.mean("answer"),
        "let in": clock.mean("selection") + clock.mean("planning") + clock.mean("writing"),
    }
    most = 1.0 / sum(costs.values())
    print(f"the main process: {1e3 / most:.2f} ms a birth, {most:.0f} births a second at most")
    whole = size * BIRTHS / 1e9
    print(f"the log: {size / 1e3:.1f} kB a birth, {whole:.0f} GB of {BIRTHS:,} births")
    found = archive_seconds(BIRTHS)
    print(f"the archive of {BIRTHS:,} births, two goals: {found:.1f} s to compare their values\n")
    print("evaluation  workers  births/s  workers busy  main busy  hours of 10⁷ births")
    for seconds in (clock.mean("birth"), 1.0, 10.0):
        for workers in (16, 256, 4096):
            births = max(8 * PER_WORKER * workers, 20_000)  # beginning and end count little
            rate, busy, main_busy = simulated(workers, seconds, costs, births)
            print(
                f"{seconds:8.3f} s  {workers:7}  {rate:8.1f}  {busy:12.1%}  {main_busy:9.1%}  "
                f"{BIRTHS / rate / 3600:19.1f}"
            )


if __name__ == "__main__":
    main()
