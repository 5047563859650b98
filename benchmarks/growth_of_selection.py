"""What selection costs as it grows: python benchmarks/growth_of_selection.py [--most N]

Milliseconds of one generation, all but breeding and evaluation: the algorithm's survivors among
the living and as many newly born, and the parents of the next; the least of three. 48, 200 and
1000 individuals, 2 to 6 goals, random losses on a sphere, so that nobody dominates anybody: the
worst case. Beside them pymoo's survival by rank and crowding, and by reference directions. Then
what writing the generation down costs, births of the demonstration.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description

import evocity
from evocity.selection.algorithms import algorithms
from evocity.selection.algorithms.algorithm import First
from evocity.selection.individual import Individual
from evocity.store import RunLog
from evocity.store.membership import Member, membership_table
from evocity.store.schema import births_of, births_table

SIZES, GOALS = (48, 200, 1000), (2, 3, 4, 5, 6)


class Named:
    def __init__(self, digest: str):
        self.digest = digest


def losses_of(count: int, goals: int) -> np.ndarray:
    """Random points of a sphere: none dominates another."""
    found = np.abs(np.random.default_rng(goals).normal(size=(count, goals)))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def ours(name: str, size: int, goals: int):
    """One generation of an algorithm, to be clocked."""
    kind = algorithms()[name]
    keys = {"distinct": 0} if "distinct" in kind.Keys.model_fields else {}
    algorithm = kind(size, kind.Keys(**keys))
    losses = losses_of(2 * size, 1 if name in ("single", "map_elites") else goals)
    values = np.random.default_rng(1).random((2 * size, 2))
    everybody = [
        Individual(k, Named(str(k)), {"gsi": float(a), "alignment": float(b)}, tuple(row))
        for k, (row, (a, b)) in enumerate(zip(losses.tolist(), values, strict=True))
    ]
    sources = [{"gsi": 0.0, "alignment": 0.0}, {"gsi": 1.0, "alignment": 1.0}]
    algorithm.begin(First(losses[:size], sources, {}))
    rng = np.random.default_rng(0)
    if kind.replays:
        algorithm.settings(0, 2, rng)
        algorithm.survivors(everybody[:size], None, rng)

    def generation() -> None:
        if kind.replays:
            algorithm.settings(size, 2, rng)
        living = algorithm.survivors(everybody, None, rng)
        for _ in range(size):
            algorithm.parents(living, 2, rng)

    return generation


def theirs(which: str, size: int, goals: int):
    """One survival of pymoo's."""
    from pymoo.algorithms.moo.nsga3 import ReferenceDirectionSurvival
    from pymoo.core.population import Population
    from pymoo.core.problem import Problem
    from pymoo.operators.survival.rank_and_crowding import RankAndCrowding
    from pymoo.util.ref_dirs import get_reference_directions

    problem = Problem(n_var=1, n_obj=goals, xl=0, xu=1)
    everybody = Population.new(F=losses_of(2 * size, goals), G=np.zeros((2 * size, 0)))
    for one in everybody:
        one.evaluated.update(("F", "G", "H"))
    if which == "crowding":
        survival = RankAndCrowding()
    else:
        divisions = 1
        while len(get_reference_directions("uniform", goals, n_partitions=divisions + 1)) <= size:
            divisions += 1
        points = get_reference_directions("uniform", goals, n_partitions=divisions)
        survival = ReferenceDirectionSurvival(points)
    state = np.random.default_rng(0)

    def generation() -> None:
        survival.do(problem, everybody, n_survive=size, random_state=state)

    return generation


def spent(generation, most: float) -> float:
    """Milliseconds; NaN where the first of them takes more than ``most`` seconds."""
    start = time.perf_counter()
    generation()
    first = time.perf_counter() - start
    if first > most:
        return 1e3 * first
    times = [first]
    for _ in range(2):
        start = time.perf_counter()
        generation()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def written(size: int) -> float:
    """Milliseconds to make and write the tables of a generation of so many births."""
    import pyarrow.parquet as pq

    with tempfile.TemporaryDirectory() as folder:
        recipe = evocity.read_recipe("demo", generations=0, population=12)
        with evocity.Search(recipe, out=Path(folder) / "run", workers=0) as search:
            list(search)
        run = RunLog(Path(folder) / "run")
        few = births_of(run.births(0), run.header)
        births = [few[k % len(few)] for k in range(size)]
        marks = dict.fromkeys(run.header.marks, 0.0)
        members = [Member(k, k, 0, marks) for k in range(size)]

        def generation() -> None:
            pq.write_table(births_table(births, run.header), Path(folder) / "b.parquet")
            table = membership_table(0, members, {}, run.header)
            pq.write_table(table, Path(folder) / "m.parquet")

        return spent(generation, 60)


def main(asked: argparse.Namespace) -> None:
    print(description())
    rows = [(name, lambda s, g, n=name: ours(n, s, g)) for name in algorithms()]
    rows += [(f"pymoo, {w}", lambda s, g, w=w: theirs(w, s, g)) for w in ("crowding", "niches")]
    head = "".join(f"{goals:>10}" for goals in GOALS)
    print(f"\nms a generation, by goals{'':13}{head}")
    for name, make in rows:
        for size in SIZES:
            cells = ""
            for goals in GOALS:
                if name in ("single", "map_elites") and goals > GOALS[0]:
                    continue
                cells += f"{spent(make(size, goals), asked.most):10.1f}"
            print(f"{name:28}{size:>10}{cells}", flush=True)
    print("\nms to write a generation down: " + ", ".join(f"{n}: {written(n):.0f}" for n in SIZES))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--most", type=float, default=5, help="seconds, above which one is enough")
    main(parser.parse_args())
