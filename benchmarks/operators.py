"""What breeding costs and what children keep: python benchmarks/operators.py [NAME …]

Every operator, or those named, with its default parameters, on leaves (the default partition)
beside range blocks of one side, B = 4: three pairs of districts at 256², reach 24, codes neither
fitted nor settled. Of children after collage repair, over seeds: how far they decode from what was
meant (root mean square), how many crumbs a hectare they have, and the stitched map has that was
meant, and how much of what is built belongs to buildings of the sources still whole. And
milliseconds of one core.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import sys
import time
from statistics import mean, median

import numpy as np
from _machine import description

import evocity
from evocity.fitness import crumbs
from evocity.fitness.heredity import integrity_of
from evocity.fitness.registry import get
from evocity.operators import OPERATORS

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
PAIRS = ((LYON, MONTPELLIER), (NEW_YORK, MONTPELLIER), (LYON, NEW_YORK))
PARTITIONS = {"B = 4": {"block": 4}, "leaves": {}}
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


def kept(operator, parents, cities, seed: int) -> tuple[float, ...]:
    """Milliseconds, distance, crumbs of the child, crumbs meant, integrity, lifs."""
    draft = operator.draft(parents, np.random.default_rng(seed))
    start = time.perf_counter()
    child = operator(parents, np.random.default_rng(seed))
    spent = 1e3 * (time.perf_counter() - start)
    decoded = evocity.decode(child).city
    meant = decoded.replace(draft.intended)
    apart = np.sqrt(np.mean((decoded.heights - meant.heights) ** 2, dtype=np.float64))
    whole = integrity_of(child, cities)
    return spent, float(apart), float(crumbs(decoded)), float(crumbs(meant)), whole, len(child)


def main(names: list[str]) -> None:
    print(description())
    cities = {name: evocity.read_map(name) for pair in PAIRS for name in pair}
    codes = {
        partition: {
            name: evocity.encode(city, **how, fit=False, settle=False).genome
            for name, city in cities.items()
        }
        for partition, how in PARTITIONS.items()
    }
    for partition, genomes in codes.items():
        told = ", ".join(f"{name} {len(genome)}" for name, genome in genomes.items())
        print(f"{partition}: lifs of {told}; an evaluation {evaluation(genomes[LYON]):.1f} ms")
    columns = ("ms", "distance, m", "crumbs", "meant", "integrity", "lifs")
    for pair in PAIRS:
        print(f"\n{' x '.join(pair)}, 256², {len(SEEDS)} seeds, B = 4 / leaves")
        print(f"{'':20}" + "".join(f"{column:>16}" for column in columns))
        for name in sorted(names or OPERATORS):
            kind = OPERATORS[name]
            rows = {}
            for partition, genomes in codes.items():
                operator, few = kind(), [genomes[one] for one in pair][: kind.parents[0]]
                kept(operator, few, list(cities.values()), 0)  # compiled, so not counted
                found = [kept(operator, few, list(cities.values()), seed) for seed in SEEDS]
                spent, *others = zip(*found, strict=True)
                rows[partition] = [median(spent), *(mean(values) for values in others)]
            line = [f"{name:20}"]
            for k, digits in enumerate((1, 3, 2, 2, 2, 0)):
                cell = " /".join(f"{rows[one][k]:.{digits}f}".rjust(6) for one in PARTITIONS)
                line.append(cell.rjust(16))
            print("".join(line))


if __name__ == "__main__":
    main(sys.argv[1:])
