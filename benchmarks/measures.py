"""What measures cost: python benchmarks/measures.py

Every measure of the package on the bundled cities at 256², as maps and as decoded codes:
milliseconds of one core. A measure is timed alone on a map that was never measured, its views
included, and after all views are there; the sums are of all measures in turn on one new map, and of
the three of the papers. Measures that compare cities compare with new-york-west-village.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import time

from _machine import description

import evocity
from evocity.io import cities

SOURCES = [evocity.read_map(name) for name in cities()]
BESIDE = evocity.fitness.Reference.of(evocity.read_map("new-york-west-village"))
THREE = ("autosimilarity", "alignment", "salingaros")
REPEATS = 12


def seconds(measure, city, genome) -> float:
    given = {"genome": genome, "parents": [genome], "sources": SOURCES, "reference": BESIDE}
    start = time.perf_counter()
    measure(city, **given)
    return time.perf_counter() - start


def in_turn(measures, city, genome) -> float:
    fresh = city.replace(city.heights)
    return sum(seconds(measure, fresh, genome) for measure in measures)


def main() -> None:
    print(description())
    every = [one for one in evocity.fitness.measures() if one.origin == "evocity"]
    three = [one for one in every if one.name in THREE]
    maps = []
    for name in cities():
        city = evocity.read_map(name)
        genome = evocity.encode(city).genome
        maps += [(name, city, genome), (f"{name}, coded", evocity.decode(genome).city, genome)]
    for _, city, genome in maps:
        in_turn(every, city, genome)  # compiles
    print(f"\n{'milliseconds at 256²':36}{f'all {len(every)}':>10}{'three':>10}{'sky view':>10}")
    (sky,) = (one for one in every if one.name == "sky_view_factor")
    for name, city, genome in maps:
        sums = [
            1e3 * min(in_turn(chosen, city, genome) for _ in range(REPEATS))
            for chosen in (every, three, [sky])
        ]
        print(f"{name:36}" + "".join(f"{spent:10.1f}" for spent in sums))
    print(f"\n{'on lyon-1er, coded':28}{'alone':>10}{'views there':>14}")
    _, city, genome = maps[cities().index("lyon-1er") * 2 + 1]
    in_turn(every, city, genome)
    rows = []
    for measure in every:
        alone = min(in_turn([measure], city, genome) for _ in range(REPEATS))
        after = min(seconds(measure, city, genome) for _ in range(REPEATS))
        rows.append((1e3 * alone, 1e3 * after, measure.name))
    for alone, after, name in sorted(rows, reverse=True):
        print(f"{name:28}{alone:10.2f}{after:14.2f}")


if __name__ == "__main__":
    main()
