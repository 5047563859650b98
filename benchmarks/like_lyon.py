"""How near a search comes to five figures of a city: python benchmarks/like_lyon.py [--seeds N]
[--births N] [--without OPERATOR …]

runs/like-lyon.toml: gsi, fsi, mean_height, alignment and autosimilarity of Lyon, from the stone of
Montpellier and New York, as one sum. Printed: the largest of the five relative misses of the best
individual, after each 1200 births and at the end. Runs are kept in runs/like-lyon-N and taken up
where they stopped. --without tells the same once more, with each of these operators taken away, or
several at once, joined by +: quarter_fusion+quarter_refill.
"""

import argparse
import os
import tomllib
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import tomli_w
from _machine import description

import evocity
from evocity.search.record.aims import aims_of_run

RECIPE = Path(__file__).parent.parent / "runs" / "like-lyon.toml"


def main(asked: argparse.Namespace) -> None:
    print(description())
    for left in [None, *asked.without]:
        print(f"\n{'all operators' if left is None else f'without {left}'}", flush=True)
        worst = [bred(seed, left, asked.births) for seed in range(asked.seeds)]
        print(f"median of the largest miss: {np.median(worst):.1%}", flush=True)


def bred(seed: int, left: str | None, births: int) -> float:
    """Breed, and tell, the run of a ``seed`` without the operator that is ``left`` out; its largest
    miss at the end."""
    recipe = evocity.read_recipe(RECIPE)
    generations = -(-births // recipe.run.population) - 1
    folder = Path("runs") / f"like-lyon-{seed}{'' if left is None else f'-without-{left}'}"
    if folder.exists():
        search = evocity.Search.resume(folder, generations=generations)
    else:
        chosen = evocity.read_recipe(recipe_without(left), seed=seed, generations=generations)
        search = evocity.Search(chosen, out=folder)
    with search:
        for _ in search:
            pass
    return told(folder, recipe, seed, births)


def recipe_without(left: str | None) -> Path:
    """The recipe, or a copy whose operator ``left``, or each of several, has the weight 0."""
    if left is None:
        return RECIPE
    recipe = tomllib.loads(RECIPE.read_text())
    for name in left.split("+"):
        entry = recipe["operators"][name]
        recipe["operators"][name] = (entry if isinstance(entry, dict) else {}) | {"weight": 0}
    path = Path("runs") / f"like-lyon-without-{left}.toml"
    path.write_text(tomli_w.dumps(recipe))
    return path


def told(folder: Path, recipe, seed: int, births: int) -> float:
    """Print how near the best came in time; its largest miss at the end."""
    run = evocity.open_run(folder)
    aims = aims_of_run(run)
    names = [one.measure.name for one in aims.wanted if one.objective is not None]
    targets = [one.objective.target for one in aims.wanted if one.objective is not None]
    everybody = [one for one in run.individuals(run.births()["id"].to_pylist()) if one.ok]
    everybody.sort(key=lambda one: one.id)
    found = []
    for count in dict.fromkeys([*range(1200, births, 1200), births]):
        so_far = [one for one in everybody if one.id < count]
        best = min(so_far, key=lambda one: (aims.violation(one.values), aims.losses(one.values)))
        misses = [abs(best.values[n] / t - 1) for n, t in zip(names, targets, strict=True)]
        found.append((count, max(misses)))
    steps = ", ".join(f"{count}: {miss:.1%}" for count, miss in found)
    each = ", ".join(f"{name} {miss:.1%}" for name, miss in zip(names, misses, strict=True))
    print(f"seed {seed}, id {best.id}: largest miss after {steps}; at the end {each}", flush=True)
    return found[-1][1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--without", nargs="*", default=[], metavar="OPERATOR")
    parser.add_argument("--births", type=int, default=5000)
    main(parser.parse_args())
