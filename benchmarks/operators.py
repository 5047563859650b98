"""What breeding costs and what children keep: python benchmarks/operators.py

Every operator with its default parameters on New York and Montpellier at 256², B = 4, reach 24:
milliseconds of one core without and with collage repair, beside an evaluation; and, over seeds, how
far children decode from what was meant, their excess of crumbs, and how much of what is built
belongs to buildings still whole.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import dataclasses
import time
from statistics import mean, median

import numpy as np
from _machine import description

import evocity
from evocity.fitness.heredity import heritability, integrity_of
from evocity.fitness.registry import get
from evocity.operators import OPERATORS

CITIES = ("new-york-west-village", "montpellier-pas-du-loup")
MEASURES = ("autosimilarity", "alignment", "salingaros")
SEEDS = range(10)


def milliseconds(call, seeds) -> list[float]:
    call(np.random.default_rng(0))  # compiled, so not counted
    spent = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        start = time.perf_counter()
        call(rng)
        spent.append(1e3 * (time.perf_counter() - start))
    return spent


def evaluation(genome) -> float:
    def once(_):
        city = evocity.decode(genome).city
        for name in MEASURES:
            get(name)(city)

    return min(milliseconds(once, SEEDS))


def main() -> None:
    print(description())
    parents = [evocity.encode(evocity.read_map(name)).genome for name in CITIES]
    print(f"\n{' x '.join(CITIES)}, 256², B = 4, reach 24, {len(SEEDS)} seeds")
    print(f"an evaluation (decode, {', '.join(MEASURES)}): {evaluation(parents[0]):.1f} ms\n")
    print(
        f"{'':20}{'no repair':>12}{'repaired':>12}{'distance, m':>22}"
        f"{'crumbs, 1/ha':>22}{'integrity':>11}"
    )
    print(f"{'':20}{'ms':>12}{'ms':>12}{'crumbled':>12}{'repaired':>10}", end="")
    print(f"{'crumbled':>12}{'repaired':>10}")
    for name, kind in sorted(OPERATORS.items()):
        repairing = kind()
        crumbling = dataclasses.replace(repairing, repair=None)
        few = parents[: kind.parents[0]]
        drafts = [repairing.draft(few, np.random.default_rng(seed)) for seed in SEEDS]
        children = [repairing(few, np.random.default_rng(seed)) for seed in SEEDS]
        pairs = list(zip(drafts, children, strict=True))
        crumbled = [heritability(draft.genome, draft.intended) for draft, _ in pairs]
        repaired = [heritability(child, draft.intended) for draft, child in pairs]
        kept = mean(integrity_of(child, few) for child in children)
        plain = median(milliseconds(lambda rng, op=crumbling, of=few: op(of, rng), SEEDS))
        whole = median(milliseconds(lambda rng, op=repairing, of=few: op(of, rng), SEEDS))
        print(
            f"{name:20}{plain:12.1f}{whole:12.1f}"
            f"{mean(h.distance for h in crumbled):12.2f}{mean(h.distance for h in repaired):10.2f}"
            f"{mean(h.crumbs for h in crumbled):+12.2f}{mean(h.crumbs for h in repaired):+10.2f}"
            f"{kept:11.2f}"
        )


if __name__ == "__main__":
    main()
