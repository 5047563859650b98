"""What refinement gains: python benchmarks/refinement.py [--seeds N] [--births N] [--budget N]
[--draws N] [--ways NAME …]

For five pairs of cities a search with the demonstration's measures, guard and operators; then its
birth with the least sum of losses, each over its range in the first generation, is refined: by
each way and algorithm, and by a (1+1) search, which replaces the birth by a child of the search's
own operators, parameters drawn, whenever that is no worse. All have the same evaluations. Of each
way the mean of several draws counts. Runs are kept in runs/refinement; what is there is not bred
again.
"""

import argparse
import itertools
import multiprocessing
import os
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description

import evocity
from evocity.search.breeding.birth_plans import founder_indices
from evocity.search.preparation.startup import Crew, start_engine
from evocity.search.resume.prepared_run import read_preparation
from evocity.search.resume.refine import score_of

PAIRS = (
    ("lyon-1er", "montpellier-pas-du-loup"),
    ("new-york-west-village", "cape-town-salt-river"),
    ("villeurbanne-gratte-ciel", "lyon-1er"),
    ("montpellier-pas-du-loup", "new-york-west-village"),
    ("cape-town-salt-river", "villeurbanne-gratte-ciel"),
)
POPULATION = 48
KEPT = Path("runs/refinement")
OWN = "(1+1), own operators"
#: What is compared: a name, and what `evocity.refine` is told.
WAYS = {
    "lambda_field, sbplx": {},
    "lambda_field, 40 rounds": {"rounds": 40},
    "lambda_field, 10 rounds": {"rounds": 10},
    "lambda_field, one round": {"rounds": 1},
    "lambda_field, cobyla": {"algorithm": "cobyla"},
    "lambda_field, bobyqa": {"algorithm": "bobyqa"},
    "lambda_field 6 x 6, sbplx": {"side": 6},
    "heights, sbplx": {"way": "heights"},
    "parameters, sbplx": {"way": "parameters"},
}


def main(asked: argparse.Namespace) -> None:
    print(description())
    names = [OWN, *(name for name in WAYS if not asked.ways or name in asked.ways)]
    cases = list(itertools.product(PAIRS, range(asked.seeds)))
    jobs = [(*case, asked.births, asked.budget, asked.draws, names) for case in cases]
    with multiprocessing.get_context("spawn").Pool(asked.processes) as pool:
        found = []
        for case, one in zip(cases, pool.imap(run_one, jobs), strict=True):
            found.append(one)
            told = ", ".join(f"{name} {one[name][0]:.3f}" for name in names)
            print(f"{' x '.join(case[0])}, seed {case[1]}: {told}", flush=True)
    print(
        f"\ngain: by how much the sum of the losses fell in {asked.budget} evaluations, after a "
        f"search of {asked.births} births, {len(cases)} cases, mean of {asked.draws} draws"
    )
    print(f"{'':28}{'better':>8}{'mean':>8}{'median':>8}{'worst':>8}{'best':>8}{'s':>8}")
    for name in names:
        gains = np.array([one[name][0] for one in found])
        seconds = np.mean([one[name][1] for one in found])
        print(
            f"{name:28}{np.count_nonzero(gains > 0):>5}/{len(gains):<2}{gains.mean():8.3f}"
            f"{np.median(gains):8.3f}{gains.min():8.3f}{gains.max():8.3f}{seconds:8.1f}"
        )


def run_one(job) -> dict[str, tuple[float, float]]:
    """Of one case: each way's gain, and how many seconds it took."""
    pair, seed, births, budget, draws, names = job
    recipe = evocity.read_recipe("demo")
    goals = [one.model_dump(exclude_none=True) for one in recipe.fitness]
    generations = -(-births // POPULATION) - 1
    recipe = evocity.Recipe(
        parents=list(pair),
        fitness=goals,
        run={"seed": seed, "population": POPULATION, "generations": generations},
        evaluation={"max_failures": 1.0},
    )
    folder = KEPT / f"{'-x-'.join(pair)}-{seed}-{births}"
    if not folder.exists():
        with evocity.Search(recipe, out=folder.with_suffix(".part"), workers=0) as search:
            for _ in search:
                pass
        folder.with_suffix(".part").rename(folder)
    run = evocity.open_run(folder)
    prepared, _ = read_preparation(run)
    score = score_of(run, prepared)
    ids = run.members(run.generations[-1]).column("id").to_pylist()
    living = run.individuals(ids)
    best = min(living, key=lambda one: score(one.values))
    found = {}
    for name in names:
        start = time.perf_counter()
        gains = []
        for draw in range(draws):
            if name == OWN:
                rng = np.random.default_rng([seed, 1 + draw])
                gains.append(own_search(prepared, score, best, living, budget, rng))
            else:
                refined = evocity.refine(run, best.id, budget=budget, seed=draw, **WAYS[name])
                gains.append(refined.score_before - refined.score)
        found[name] = float(np.mean(gains)), (time.perf_counter() - start) / draws
    return found


def own_search(prepared, score, best, living, budget: int, rng) -> float:
    """The gain of a (1+1) search from the individual ``best``."""
    recipe = prepared.recipe
    pool = start_engine(prepared, Crew(0), (), print, print)
    sources = [source.genome for source in prepared.sources]
    genome, now = best.genome, score(best.values)
    names = list(recipe.operators)
    weights = np.array([recipe.operators[name].weight for name in names])
    for _ in range(budget):
        name = names[rng.choice(len(names), p=weights / weights.sum())]
        operator = recipe.operator_drawn(name, rng)
        others = rng.permutation(len(living))[: operator.parents[0] - 1]
        parents = [genome, *(living[at].genome for at in others)]
        parents += [sources[at] for at in founder_indices(operator, len(sources))]
        (outcome,) = pool.run("born", [(operator, parents, rng)])
        if outcome.status == "ok" and score(outcome.values) <= now:
            genome, now = outcome.genome, score(outcome.values)
    return score(best.values)[1] - now[1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--births", type=int, default=960)
    parser.add_argument("--budget", type=int, default=200)
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--ways", nargs="*", default=[], metavar="NAME")
    main(parser.parse_args())
