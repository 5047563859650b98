"""Twenty generations of a recipe's mixture without selection: what stays of the plans, what is new.
python benchmarks/plan_drift.py RUN... [--seeds N] [--generations N] [--real FILE...] [--save DIR]

Each RUN is a run folder of fabrics: its source cities are the founders, its recipe has the mixture.
A population of six begins with the founders. In each generation, each place gets a child of one
drawn individual; a second parent of `plan_crossing` has the same plan, that of `plan_seam` another.

Printed for each run and seed, over the last six children: the share of the faces with 100 m² of
ground for buildings or more that have other buildings than their source city, and the share of the
built ground of these faces; the smaller parent's share; mean and largest change of GSI from the
plan's source city; mean and largest `street_distance`. Then the AUC of `told_apart.py` for windows
of 256 m: fresh and by quadrants, all seeds of a run together.
"""

import argparse
import os
import warnings
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import told_apart
from _machine import description

import evocity
from evocity.fitness import smallest_share, street_distance
from evocity.operators.plans.inheritance import find_plan, founder_name
from evocity.recipe.mixture import drawing_of

CHILDREN, LEAST = 6, 100.0


def main(given) -> None:
    print(description())
    warnings.simplefilter("ignore")  # notes on maps
    places = []
    for path in given.runs:
        run = evocity.open_run(path)
        sources = [source.city for source in run.sources()]
        recipe = evocity.read_recipe(path / "recipe.toml")
        codes = [evocity.read_genome(one) for one in sorted(path.glob("sources/*.genome.parquet"))]
        maps, shares = [], []
        for seed in range(given.seeds):
            children = drift(recipe, codes, given.generations, seed)
            cities = [evocity.decode(one).city for one in children]
            maps += cities
            shares += [
                float(smallest_share(city, one, sources))
                for city, one in zip(cities, children, strict=True)
            ]
            print(described(path, seed, children, cities, codes, sources, shares), flush=True)
            if given.save:
                keep(given.save, f"{Path(path).name}-{seed}", cities)
        names = frozenset(city.name for city in sources)
        places.append(told_apart.Place(Path(path).name, names, maps, True, shares))
        places[-1].sources = sources
    judge(places, told_apart.real_places(places, given.real))


def drift(recipe, founders: list, generations: int, seed: int) -> list:
    """The children of the last generation."""
    entries = recipe.operators
    names = list(entries)
    weights = np.array([entries[name].weight for name in names])
    draws = {
        name: drawing_of(name, entries[name].parameters, recipe.genome.coding) for name in names
    }
    known = {founder_name(one): one for one in founders}
    rng = np.random.default_rng(seed)
    living = [founders[number % len(founders)] for number in range(CHILDREN)]
    for _ in range(generations):
        plans = [plan_of(one, known) for one in living]
        born = []
        for _ in range(CHILDREN):
            first = int(rng.integers(CHILDREN))
            operator = draws[names[rng.choice(len(names), p=weights / weights.sum())]](rng)
            parents = [living[first]]
            if operator.parents[0] > 1:
                others = [j for j in range(CHILDREN) if j != first]
                alike = [j for j in others if plans[j] == plans[first]]
                unlike = [j for j in others if plans[j] != plans[first]]
                fit = alike if operator.name == "plan_crossing" else unlike
                parents.append(living[rng.choice(fit or others)])
            born.append(operator([*parents, *founders], rng))
        living = born
    return living


def plan_of(genome, founders):
    """The name of a genome's plan; None for an unknown plan."""
    state = find_plan(genome, founders)[1]
    return state.key if state else None


def described(path, seed, children, cities, codes, sources, shares) -> str:
    founders = {founder_name(one): one for one in codes}
    faces, ground, steps = [], [], []
    for child, city in zip(children, cities, strict=True):
        plan, state = find_plan(child, founders)
        if state is None:
            continue
        renewed = np.zeros(len(plan), bool)
        renewed[np.array(sorted({*state.genes, *state.edited}), int) - 1] = True
        counted = ~plan.open & (plan.lot_area >= LEAST)
        faces.append(renewed[counted].mean())
        built = np.bincount(plan.lots.ravel(), (plan.heights > 1.5).ravel(), len(plan) + 1)[1:]
        ground.append(built[renewed & counted].sum() / built[counted].sum())
        own = evocity.decode(founders[state.city]).city
        steps.append(abs(float(city.built.mean() - own.built.mean())))
    streets = [float(street_distance(city, reference=sources)) for city in cities]
    return (
        f"{Path(path).name}, seed {seed}: faces renewed {np.mean(faces):.2f}, their ground "
        f"{np.mean(ground):.2f}; smaller parent {np.mean(shares[-len(children) :]):.2f}; GSI step "
        f"{np.mean(steps):.3f}, most {max(steps):.3f}; street_distance {np.mean(streets):.3f}, "
        f"most {max(streets):.3f}"
    )


def keep(folder: Path, name: str, cities) -> None:
    """Write the heights of maps."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, city in enumerate(cities):
        np.save(folder / f"{name}-{number}.npy", city.heights)


def judge(bred: list, real: list) -> None:
    for place in (*bred, *real):
        told_apart.measure(place, pictures=False)
    print(f"\n{'AUC at 256 m':34}{'fresh':>14}{'quadrant':>14}")
    rows = []
    for place in bred:
        rows.append(
            [
                told_apart.judged(place, bred, real, lambda one: one.windows[256]),
                told_apart.by_quadrants(place, bred, real, lambda one: one.windows[256]),
            ]
        )
        print(told_apart.line(place.name, rows[-1]), flush=True)
    print(told_apart.line("mean", np.nanmean(rows, axis=0)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--generations", type=int, default=20)
    parser.add_argument("--real", nargs="*", type=Path, default=[])
    parser.add_argument("--save", type=Path)
    main(parser.parse_args())
