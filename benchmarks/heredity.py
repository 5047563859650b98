"""What twenty generations without selection leave of a fabric. python benchmarks/heredity.py
[--seeds N] [--generations N] [--operators NAME...] [--fill F] [--picture FILE]

Lyon, New York and Montpellier at 256², 2 m/px, coded as `evocity.encode` does by default. Each
generation are nine children, each of two parents drawn from the nine before (of the three codes at
first). Of each fourth generation the means over its children, and over the seeds: fabric distance
to the three cities, weighted by what of the child's built ground comes from each; to all three
weighted alike; crumbs a hectare of built ground; integrity of the buildings of the three; number of
buildings; alignment; share of the built ground whose stone stands nowhere else on the child; share
that has its stone where it stood in its city; the fill reached, and the time a child takes, over
all generations so far. Below them the highest of the seeds, of the last generation.
"""

import argparse
import os
import time
from collections.abc import Sequence

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description

import evocity
from evocity.fitness import alignment, crumbs, fabric_distance
from evocity.fitness.heredity import integrity_of
from evocity.fitness.reference import Reference
from evocity.genome import Genome, unpacked
from evocity.isometries import AFFINE
from evocity.operators import make

CITIES = ("lyon-1er", "new-york-west-village", "montpellier-pas-du-loup")
CHILDREN, EVERY = 9, 4
OPERATORS = {
    "quarter_fusion": {"fill": True},
    "pavement_fusion": {"fill": True},
    "region_fusion": {"fill": True},
    "lambda_crossover": {"share": False},
}
COLUMNS = (
    "distance   alike  crumbs  integrity  buildings  alignment  once  in place    fill   ms/child"
)


def main(names: Sequence[str], seeds: int, generations: int, fill: float, picture) -> None:
    print(description())
    maps = [evocity.read_map(name) for name in CITIES]
    codes = [evocity.encode(city).genome for city in maps]
    worst = max(crumbs(evocity.decode(code).city) for code in codes)
    for name in names:
        operator = make(name, **options(name, fill))
        tables = []
        for seed in range(seeds):
            table, last = series(operator, codes, maps, generations, seed)
            tables.append(table)
            if picture and seed == 0:
                save(last, picture.format(name))
        print(f"\n{operator}, {seeds} seeds\ngeneration  {COLUMNS}")
        for row in np.mean(tables, axis=0):
            print(told(row))
        print(f"{'highest':>10}" + told(np.max([table[-1] for table in tables], axis=0))[10:])
    print(
        f"\nto keep       .15 or less, crumbs {worst:.2f} or less, integrity .8 or more, fill .15"
    )


def options(name: str, fill: float) -> dict:
    return {key: fill if of_second else 1 - fill for key, of_second in OPERATORS[name].items()}


def series(operator, codes, maps, generations: int, seed: int) -> tuple[list, list[Genome]]:
    """A row each fourth generation, and the last generation."""
    rng = np.random.default_rng(seed)
    living, rows, reached, spent = list(codes), [], [], 0.0
    for generation in range(1, generations + 1):
        children = []
        for _ in range(CHILDREN):
            first, second = rng.choice(len(living), 2, replace=False)
            start = time.perf_counter()
            children.append(operator([living[first], living[second]], rng))
            spent += time.perf_counter() - start
            made = children[-1].made
            reached.append(made["fill_reached"][1] if "fill_reached" in made else np.nan)
        living = children
        if generation % EVERY == 0 or generation == generations:
            means = np.mean([measured(one, maps) for one in living], axis=0)
            rows.append([generation, *means, np.mean(reached), 1e3 * spent / len(reached)])
    return rows, living


def measured(child: Genome, maps) -> list[float]:
    city = evocity.decode(child).city
    return [
        float(fabric_distance(city, Reference.sources(maps), genome=child)),
        float(fabric_distance(city, maps)),
        float(crumbs(city)),
        integrity_of(child, maps),
        len(city.buildings),
        float(alignment(city)),
        *shown(child, city),
    ]


def shown(child: Genome, city) -> tuple[float, float]:
    """What of the built ground shows a pixel of a source city that no other does; and what lies
    where it does there, neither moved nor turned."""
    p = child.pavement
    top, left, row, column = (
        p.raster(one) for one in (*p.corners, *unpacked(child.source.astype(np.int64)))
    )
    y, x = np.indices(city.shape)
    last, a = p.raster(p.side) - 1, AFFINE.T[:, p.raster(child.turn)]
    row, column = (
        source + a[k] * last + a[k + 2] * (y - top) + a[k + 4] * (x - left)
        for k, source in enumerate((row, column))
    )
    stones = np.stack([p.raster(child.parent).astype(np.int64), row, column])[:, city.built]
    _, times = np.unique(stones, axis=1, return_counts=True)
    in_place = ((row == y) & (column == x))[city.built]
    return float((times == 1).sum() / times.sum()), float(in_place.mean())


def told(row) -> str:
    generation, near, alike, litter, whole, buildings, lined, once, still, fill, spent = row
    return (
        f"{generation:10.0f}  {near:8.3f}{alike:8.3f}{litter:8.2f}{whole:11.2f}{buildings:11.0f}"
        f"{lined:11.2f}{once:6.2f}{still:10.2f}{fill:8.2f}{spent:11.0f}"
    )


def save(genomes: Sequence[Genome], path: str) -> None:
    """The children of a generation in three rows, as PNG."""
    from PIL import Image

    from evocity.pictures.picture import render

    tiles = [render(evocity.decode(one).city, highest=40, legend=False) for one in genomes]
    side = tiles[0].width
    sheet = Image.new("RGB", (3 * side, 3 * side), "white")
    for k, tile in enumerate(tiles):
        sheet.paste(tile.convert("RGB"), (k % 3 * side, k // 3 * side))
    sheet.save(path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--operators", nargs="+", default=list(OPERATORS), choices=OPERATORS)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--generations", type=int, default=20)
    parser.add_argument("--fill", type=float, default=0.2, help="share of the second parent")
    parser.add_argument("--picture", help="PNG of the last children; {} stands for the operator")
    given = parser.parse_args()
    main(given.operators, given.seeds, given.generations, given.fill, given.picture)
