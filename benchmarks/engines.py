"""How busy engines keep two workers: python benchmarks/engines.py [--repeats 15]

Generations of 64 evaluations, each of which sleeps 10 ms and computes next to nothing, so that
other programs on the machine disturb little. Busy is the sum of the evaluations' own seconds over
workers times wall seconds, from the first job handed over to the last outcome.
"""

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median
from types import SimpleNamespace

import numpy as np
from _machine import description

import evocity
from evocity import fitness
from evocity.evaluation import Workers
from evocity.evaluation.cluster.engine import Cluster
from evocity.evaluation.cluster.parcel import parcel_of
from evocity.evaluation.evaluator import Setup
from evocity.kinds import KINDS

MEASURE = """
import time
import evocity

@evocity.fitness(goal="max")
def slept(city):
    time.sleep(0.01)
    return float(city.heights[0, 0])
"""
POPULATION, WORKERS = 64, 2


def setup_in(folder: str) -> tuple[Setup, list[fitness.Measure]]:
    path = Path(folder, "slept.py")
    path.write_text(MEASURE)
    measures = fitness.load_file(path)
    header = SimpleNamespace(chromosome=KINDS["fabric"], measures=("slept",), recorded=())
    return Setup(header, (("slept", str(path)),), sides=4), measures


def busy(engine, jobs: list[tuple], repeats: int) -> list[float]:
    """Shares of each of so many generations, after two that are not counted."""
    found = []
    for _ in range(repeats + 2):
        began = time.perf_counter()
        outcomes = engine.run("evaluate", jobs)
        wall = time.perf_counter() - began
        assert all(one.status == "ok" for one in outcomes)
        found.append(sum(one.seconds for one in outcomes) / (WORKERS * wall))
    return found[2:]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=15)
    repeats = parser.parse_args().repeats
    lots = np.random.default_rng(0).integers(0, 4, (8, 8)) * 6.0
    genome = evocity.encode(
        evocity.CityMap(lots.repeat(4, 0).repeat(4, 1), 2.0, name="toy"), block=4, fit=False
    ).genome
    jobs = [(genome,)] * POPULATION
    print(description())
    print(f"busy of {WORKERS} workers, {repeats} generations of {POPULATION}; best (median)\n")
    with tempfile.TemporaryDirectory() as folder:
        setup, measures = setup_in(folder)
        makers = {
            "processes": lambda: Workers(setup, WORKERS, 60.0),
            "Dask, local:2": lambda: Cluster(
                parcel_of(setup, measures), "local:2", 1, 60.0, None, print, print
            ),
        }
        for name, make in makers.items():
            engine = make()
            try:
                shares = busy(engine, jobs, repeats)
            finally:
                engine.close()
            print(f"{name:16}{max(shares):8.1%} ({median(shares):.1%})", flush=True)


if __name__ == "__main__":
    main()
