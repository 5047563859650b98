"""What breeding costs and what children keep: python benchmarks/operators.py [NAME …] [--block B]

Every operator, or those named, with its default parameters: three pairs of districts at 256²,
coded as `evocity.encode` does by default, or with range blocks of one side. Of children after
collage repair, over ten seeds: milliseconds of one core (median); how far they decode from what was
meant, roofs not settled (root mean square); how many crumbs a hectare they have, and the map has
that was meant; how much of what is built belongs to buildings of the sources still whole; fabric
distance to the parents' cities; what share of the built ground has its stone in its own place;
lifs.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import time
from statistics import mean, median

import numpy as np
from _machine import description
from heredity import shown

import evocity
from evocity.fitness import crumbs, fabric_distance
from evocity.fitness.heredity import integrity_of
from evocity.fitness.registry import get
from evocity.operators import OPERATORS

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
PAIRS = ((LYON, MONTPELLIER), (NEW_YORK, MONTPELLIER), (LYON, NEW_YORK))
MEASURES = ("autosimilarity", "alignment", "salingaros")
SEEDS = range(10)


def evaluation(genome) -> float:
    """Milliseconds of decoding and measuring, the least of ten."""
    spent = []
    for _ in range(11):
        start = time.perf_counter()
        city = evocity.decode(genome).city
        for name in MEASURES:
            get(name)(city)
        spent.append(1e3 * (time.perf_counter() - start))
    return min(spent[1:])


def kept(operator, parents, cities, compared, seed: int) -> tuple[float, ...]:
    """A row of the table; ``compared``: the cities of the parents."""
    draft = operator.draft(parents, np.random.default_rng(seed))
    start = time.perf_counter()
    child = operator(parents, np.random.default_rng(seed))
    spent = 1e3 * (time.perf_counter() - start)
    found = evocity.decode(child)
    decoded, meant = found.city, found.city.replace(draft.intended)
    # what is meant is told of roofs before they are settled
    raw = np.maximum(found.attractor, 0)
    apart = np.sqrt(np.mean((raw - draft.intended) ** 2, dtype=np.float64))
    return (
        spent,
        float(apart),
        float(crumbs(decoded)),
        float(crumbs(meant)),
        integrity_of(child, cities),
        float(fabric_distance(decoded, compared)),
        shown(child, decoded)[1],
        len(child),
    )


def main(names: list[str], block: int | None) -> None:
    print(description())
    cities = {name: evocity.read_map(name) for pair in PAIRS for name in pair}
    how = {} if block is None else {"block": block}
    genomes = {name: evocity.encode(city, **how).genome for name, city in cities.items()}
    told = ", ".join(f"{name} {len(genome)}" for name, genome in genomes.items())
    print(f"lifs of {told}; an evaluation {evaluation(genomes[LYON]):.1f} ms")
    columns = ("ms", "distance, m", "crumbs", "meant", "integrity", "fabric", "in place", "lifs")
    for pair in PAIRS:
        print(f"\n{' x '.join(pair)}, 256², {len(SEEDS)} seeds")
        print(f"{'':20}" + "".join(f"{column:>12}" for column in columns))
        for name in sorted(names or OPERATORS):
            operator = OPERATORS[name]()
            few = pair[: operator.parents[0]]
            parents, compared = [genomes[one] for one in few], [cities[one] for one in few]
            given = operator, parents, list(cities.values()), compared
            kept(*given, 0)  # compiled, so not counted
            spent, *others = zip(*(kept(*given, seed) for seed in SEEDS), strict=True)
            row = [median(spent), *(mean(values) for values in others)]
            digits = (1, 3, 2, 2, 2, 3, 2, 0)
            cells = (f"{one:12.{k}f}" for one, k in zip(row, digits, strict=True))
            print(f"{name:20}" + "".join(cells), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(OPERATORS))
    parser.add_argument("--block", type=int, help="side of all range blocks, px")
    given = parser.parse_args()
    main(given.names, given.block)
