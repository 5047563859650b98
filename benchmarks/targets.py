"""How near a search comes to five figures of a district: python benchmarks/targets.py --run
[--minutes M] [--case NAME …] [--ways NAME …] [--seeds N] [--births N] [--pixels N] [--workers N]

gsi, fsi, mean_height, alignment and autosimilarity of one district, from the fabric of two others,
as one sum of relative misses. At least half of what is built stands in whole buildings. The table
has the largest of the five misses of the best birth, after 300 births and at the end.

The folder benchmarks/targets keeps the results, a file for each case and seed. With --run, the
script breeds what is missing there, until everything is there or --minutes are over; the same
command goes on later. Without --run, the script prints the table of what is there.
"""

import argparse
import itertools
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description
from _peer_methods import chain_job

import evocity
from evocity import fitness
from evocity.search import Observer
from evocity.search.preparation.preparation import prepare
from evocity.search.preparation.startup import Crew, start_engine

KEPT = Path(__file__).parent / "targets"
#: Target and parents.
CASES = {
    "lyon": ("lyon-1er", ("montpellier-pas-du-loup", "new-york-west-village")),
    "new-york": ("new-york-west-village", ("montpellier-pas-du-loup", "cape-town-salt-river")),
    "montpellier": ("montpellier-pas-du-loup", ("lyon-1er", "villeurbanne-gratte-ciel")),
}
MEASURES = ("gsi", "fsi", "mean_height", "alignment", "autosimilarity")
#: The bound on integrity.
WHOLE = 0.5
#: Births after which the table has a column, besides the end.
EARLY = 300
#: Births of Optuna's that are bred at once.
_AT_ONCE = 12

MIXTURE = {
    "quarter_fusion": {"weight": 2, "fill": {"from": 0.1, "to": 0.6}},
    "quarter_refill": {"weight": 2, "street_blocks": {"from": 2, "to": 8}},
    "region_fusion": {"weight": 2},
    "relocation": {"weight": 2},
    "height_scaling": {"weight": 3, "share": {"from": 0.05, "to": 0.5}},
}

#: Takes the values of births as they come; raises `Over` when the minutes are over.
Tell = Callable[[list[dict[str, float]]], None]


class Over(BaseException):
    """The minutes are over; no observer catches it."""


class Births(Observer):
    def __init__(self, tell: Tell):
        self._tell = tell

    def generation(self, generation, births, members):
        self._tell([dict(born.values) if born.ok else {} for born in births])


def recipe_of(case: str, seed: int, pixels: int, targets: dict[str, float], **sections):
    sums = [
        {"name": name, "target": target, "objective": "miss", "weight": 1 / abs(target)}
        for name, target in targets.items()
    ]
    run = {"seed": seed, "population": 50, "generations": 0} | sections.pop("run", {})
    search = {"algorithm": "single"} | sections.pop("search", {})
    return evocity.Recipe(
        parents=list(CASES[case][1]),
        fitness=[*sums, {"name": "integrity", "min": WHOLE}],
        map={"pixels": pixels},
        run=run,
        search=search,
        operators=MIXTURE,
        **sections,
    )


def by_search(population: int = 50, births: int | None = None, **search):
    """A search of evocity by the algorithm `single`."""

    def way(case: str, seed: int, options, targets, tell: Tell) -> None:
        generations = -(-options.births // (births or population)) - 1
        run = {"population": population, "generations": generations}
        search_keys = search | ({} if births is None else {"births": births})
        recipe = recipe_of(case, seed, options.pixels, targets, run=run, search=search_keys)
        observers = [Births(tell)]
        with evocity.Search(recipe, workers=options.workers, observers=observers) as found:
            for _ in found:
                pass

    return way


def by_optuna(case: str, seed: int, options, targets, tell: Tell) -> None:
    """Optuna's TPE chooses a source, up to four operators in a row, and their parameters."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    recipe = recipe_of(case, seed, options.pixels, targets)
    prepared = prepare(recipe)
    sources = [one.genome for one in prepared.sources]
    sampler = optuna.samplers.TPESampler(seed=seed, constant_liar=True)
    study = optuna.create_study(sampler=sampler)
    crew = Crew(options.workers)
    pool = start_engine(prepared, crew, (), lambda text: None, lambda text: None)
    try:
        for _ in range(-(-options.births // _AT_ONCE)):
            trials = [study.ask() for _ in range(_AT_ONCE)]
            outcomes = pool.run("born", [chain_job(recipe, sources, one) for one in trials])
            values = [dict(one.values) if one.status == "ok" else {} for one in outcomes]
            tell(values)
            for trial, one in zip(trials, values, strict=True):
                study.tell(trial, largest_miss(one, targets) + broken(one))
    finally:
        pool.close()


WAYS = {
    "single": by_search(),
    "steered": by_search(16, 8, steer=0.7, tournament=3, distinct=0.0),
    "Optuna, chain of operators": by_optuna,
}


def largest_miss(values: dict[str, float], targets: dict[str, float]) -> float:
    """Return the largest relative miss of a birth; 9 for a birth without values."""
    if not all(name in values for name in targets):
        return 9.0
    return max(abs(values[name] / target - 1) for name, target in targets.items())


def broken(values: dict[str, float]) -> float:
    """Return how far a birth breaks the bound, as Optuna counts it."""
    return 10 * max(0.0, WHOLE - values.get("integrity", 0.0))


def breed(path: Path, case: str, seed: int, way: str, options, until: float) -> None:
    city = evocity.read_map(CASES[case][0], pixels=options.pixels, metres_per_pixel=2.0)
    targets = {name: float(fitness.get(name)(city)) for name in MEASURES}
    found: list[dict[str, float]] = []

    def tell(values: list[dict[str, float]]) -> None:
        found.extend(values)
        if time.monotonic() > until:
            raise Over

    start = time.perf_counter()
    try:
        WAYS[way](case, seed, options, targets, tell)
    except Over:
        return
    best, curve = 9.0, []
    for values in found[: options.births]:
        if values.get("integrity", 0.0) >= WHOLE:
            best = min(best, largest_miss(values, targets))
        curve.append(best)
    known = json.loads(path.read_text()) if path.exists() else {}
    known[way] = {
        "largest miss": [round(one, 4) for one in curve[EARLY // 4 - 1 :: EARLY // 4]],
        "seconds": round(time.perf_counter() - start),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(known, indent=1) + "\n")
    text = f"{case}, seed {seed}, {way}: {curve[min(EARLY, len(curve)) - 1]:.1%}, {curve[-1]:.1%}"
    print(f"{text} in {known[way]['seconds']} s", file=sys.stderr, flush=True)


def show(paths: dict[tuple[str, int], Path], ways: list[str], births: int) -> None:
    print(f"\n{'':14}{'':30}{'cases':>6}{f'after {EARLY}':>12}{f'after {births}':>12}")
    for case in dict.fromkeys(case for case, _ in paths):
        for way in ways:
            known = [
                json.loads(p.read_text()) for (c, _), p in paths.items() if c == case and p.exists()
            ]
            curves = [one[way]["largest miss"] for one in known if way in one]
            if curves:
                early, last = (np.median([one[at] for one in curves]) for at in (3, -1))
                print(f"{case:14}{way:30}{len(curves):6}{early:12.1%}{last:12.1%}")


def main(options: argparse.Namespace) -> None:
    print(description())
    cases, ways = options.case or list(CASES), options.ways or list(WAYS)
    paths = {
        (case, seed): KEPT / f"{case}-{options.pixels}-seed-{seed}-{options.births}.json"
        for seed, case in itertools.product(range(options.seeds), cases)
    }
    if options.run:
        until = time.monotonic() + 60 * options.minutes
        for ((case, seed), path), way in itertools.product(paths.items(), ways):
            if time.monotonic() > until:
                print("the minutes are over; the same command goes on", file=sys.stderr)
                break
            if not path.exists() or way not in json.loads(path.read_text()):
                breed(path, case, seed, way, options, until)
    show(paths, ways, options.births)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--run", action="store_true", help="breed what is missing")
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--case", nargs="*", default=[], choices=list(CASES), metavar="NAME")
    parser.add_argument("--ways", nargs="*", default=[], choices=list(WAYS), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--births", type=int, default=1500)
    parser.add_argument("--pixels", type=int, default=256)
    parser.add_argument("--workers", type=int, default=2)
    main(parser.parse_args())
