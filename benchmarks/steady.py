"""How busy workers are, and how good the search: python benchmarks/steady.py

The real search, generation by generation and in ordered windows, with simulated workers on a
virtual clock. Evaluations are uneven: log-normal, the deviation as large as the mean, and one in a
hundred hangs until a deadline of 10 means. Populations have 64, NSGA-II selects, and the goals are
those of ZDT1, whose best hypervolume is known.
"""

import argparse
import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from unittest.mock import patch

import numpy as np
from _machine import description
from _virtual import Virtual, uneven

import evocity
from evocity.evaluation import Engine
from evocity.evaluation.evaluator import Outcome
from evocity.search import Search
from evocity.selection.backends.moocore import hypervolume

NUMBERS, POPULATION, DEADLINE, HANGING = 6, 64, 10.0, 0.01
REFERENCE = np.array([1.1, 1.1])
#: What all of the front of ZDT1, f2 = 1 − √f1, dominates up to the reference.
BEST = 0.1 + 2.0 / 3.0 + 0.1 * 1.1


@evocity.fitness(goal="min")
def first_goal(city) -> float:
    """Stands for a goal of the toy problem."""
    return float(city.heights.mean())


@evocity.fitness(goal="min")
def second_goal(city) -> float:
    """Stands for the other."""
    return float(city.heights.std())


@dataclass(frozen=True)
class Point:
    """Takes a genome's place: ``numbers`` (12,), 0…1."""

    numbers: np.ndarray
    made: dict = field(default_factory=dict)

    @cached_property
    def digest(self) -> str:
        return hashlib.blake2b(self.numbers.tobytes(), digest_size=16).hexdigest()

    @property
    def goals(self) -> tuple[float, float]:
        first = float(self.numbers[0])
        rest = 1.0 + 9.0 * float(self.numbers[1:].mean())
        return first, rest * (1.0 - (first / rest) ** 0.5)


def point_of(genome) -> Point:
    """A point; of a source city the one that its digest tells."""
    if isinstance(genome, Point):
        return genome
    seed = int(genome.digest[:15], 16)
    return Point(np.random.default_rng(seed).random(NUMBERS))


class Toy:
    """An engine that breeds points: each number of one parent or of the other, one or so moved."""

    size, described, notes = 1, {"engine": "toy", "workers": 0}, ()

    def run(self, method: str, jobs) -> list[Outcome]:
        return [self.born(*job) if method == "born" else Outcome("ok") for job in jobs]

    def born(self, operator, parents, rng, measured) -> Outcome:
        points = [point_of(one).numbers for one in parents]
        numbers = np.where(rng.random(NUMBERS) < 0.5, points[0], points[-1])
        moved = rng.random(NUMBERS) < 1.0 / NUMBERS
        numbers = np.where(moved, numbers + rng.normal(0.0, 0.15, NUMBERS), numbers)
        child = Point(points[0] if operator is None else np.clip(numbers, 0.0, 1.0))
        values = dict(zip(("first_goal", "second_goal"), child.goals, strict=True))
        look = (child.numbers * 1000).astype(np.uint16)
        return Outcome("ok", values=values, genome=child, look=look)

    def close(self) -> None:
        pass


def searched(workers: int, window: int | None, generations: int, seed: int = 0):
    """The engine, and by the number of births the share of the best hypervolume that the living
    had."""
    recipe = evocity.Recipe(
        parents=["lyon-1er", "montpellier-pas-du-loup"],
        map={"pixels": 64, "metres_per_pixel": 4.0},
        genome={"block": 8, "fit": False, "settle": False, "reach": 8},
        operators={"pavement_fusion": 3, "mutation": 1},
        fitness=[first_goal, second_goal],
        run={"population": POPULATION, "generations": generations, "seed": seed},
        search={"algorithm": "nsga2", "distinct": 0} | ({"window": window} if window else {}),
    )
    engine = Virtual(Toy(), workers, uneven(HANGING), DEADLINE)

    def made(*_, **__) -> Engine:
        return engine

    volumes = {}
    with patch("evocity.search.engine.start_engine", made), Search(recipe, workers=0) as search:
        for generation in search:
            losses = np.array([one.losses for one in generation.population])
            volumes[generation.births] = hypervolume(losses, REFERENCE) / BEST
    return engine, volumes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, nargs="*", default=[2, 16, 64])
    parser.add_argument("--windows", type=int, nargs="*", default=[16, 64, 128, 256, 512])
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seeds", type=int, default=1)
    asked = parser.parse_args()
    print(description())
    total = (asked.generations + 1) * POPULATION
    at = [total // 4 // POPULATION * POPULATION, total // 2 // POPULATION * POPULATION, total]
    print(f"{total} births, {asked.seeds} seeds; share of the best hypervolume at so many births")
    print(f"{'workers':>7}  {'window':>12}  busy share  {'  '.join(f'{n:>6}' for n in at)}")
    for workers in asked.workers:
        for window in (None, *asked.windows):
            found = [
                searched(workers, window, asked.generations, seed) for seed in range(asked.seeds)
            ]
            busy = np.mean([engine.busy_share for engine, _ in found])
            told = "  ".join(f"{np.mean([v[n] for _, v in found]):6.3f}" for n in at)
            name = "generational" if window is None else str(window)
            print(f"{workers:7}  {name:>12}  {busy:10.1%}  {told}", flush=True)


if __name__ == "__main__":
    main()
