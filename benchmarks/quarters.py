"""Streets of one city, buildings of another: python benchmarks/quarters.py [--seeds N]

Quarter fusion of five pairs of districts at 256², coded as `evocity.encode` does by default, fill
.5, means over seeds: the fill reached; fabric distance of the decoded child to both cities; crumbs
a hectare of the child and of the worse of the two codes; connectivity of the open space, beside
that of the lower code; integrity. Then milliseconds of one core, median and least, of a child of
three street blocks and of one at fill .2, repair included, where the process knows the parents;
and what the core's float32 matrix product reaches at that moment, for a shared core may be slow.
"""

import argparse
import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import time

import numpy as np
from _machine import description, sgemm

import evocity
from evocity.fitness import crumbs, fabric_distance, open_space_connectivity
from evocity.fitness.heredity import integrity_of
from evocity.operators import make

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
PAIRS = (
    (LYON, NEW_YORK),
    (NEW_YORK, LYON),
    (NEW_YORK, MONTPELLIER),
    (MONTPELLIER, NEW_YORK),
    (LYON, MONTPELLIER),
)
COLUMNS = "fill  distance  crumbs (worse code)  connectivity (lower code)  integrity"


def main(seeds: int) -> None:
    print(description())
    maps = {name: evocity.read_map(name) for name in (LYON, MONTPELLIER, NEW_YORK)}
    codes = {name: evocity.encode(city).genome for name, city in maps.items()}
    fuse, rows = make("quarter_fusion", fill=0.5), []
    print(f"\n{seeds} seeds, streets x buildings{'':24}{COLUMNS}")
    for pair in PAIRS:
        parents, cities = [codes[one] for one in pair], [maps[one] for one in pair]
        own = [evocity.decode(one).city for one in parents]
        found = [measured(fuse(parents, np.random.default_rng(k)), cities) for k in range(seeds)]
        row = np.mean(found, axis=0)
        rows.append(row)
        worse, lower = max(map(crumbs, own)), min(map(open_space_connectivity, own))
        print(
            f"{' x '.join(pair):48}{row[0]:6.2f}{row[1]:10.3f}{row[2]:8.2f} ({worse:.2f}){'':6}"
            f"{row[3]:10.2f} ({lower:.2f}){'':10}{row[4]:10.2f}"
        )
    mean = np.mean(rows, axis=0)
    print(f"{'mean':48}{mean[0]:6.3f}{mean[1]:10.3f}")
    print(f"\n{'ms a child, median (least)':48}{'three blocks':>16}{'fill .2':>16}")
    for pair in PAIRS:
        parents = [codes[one] for one in pair]
        told = [spent(parents, seeds, **how) for how in ({"street_blocks": 3}, {"fill": 0.2})]
        rate = f"   SGEMM {sgemm():.0f} GFLOP/s"
        print(f"{' x '.join(pair):48}" + "".join(f"{a:9.0f} ({b:.0f})" for a, b in told) + rate)


def measured(child, cities) -> list[float]:
    city = evocity.decode(child).city
    return [
        child.made["fill_reached"][1],
        float(fabric_distance(city, cities)),
        float(crumbs(city)),
        float(open_space_connectivity(city)),
        integrity_of(child, cities),
    ]


def spent(parents, seeds: int, **how) -> tuple[float, float]:
    operator, times = make("quarter_fusion", **how), []
    for seed in range(-1, seeds):
        rng = np.random.default_rng(abs(seed))
        start = time.process_time()
        operator(parents, rng)
        times.append(1e3 * (time.process_time() - start))
    return float(np.median(times[1:])), min(times[1:])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    main(parser.parse_args().seeds)
