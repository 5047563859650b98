"""How many buildings of bred children objects of a library fit: python benchmarks/substitution.py
[--maps FOLDER] [--seeds N]

Children of all ten pairs of districts, by two operators; numbers of the search were chosen on those
of seed 0. The library of each pair has the buildings of all other districts, and of the maps in a
folder whose names tell of none of the parents; without a folder it is small. Told: objects;
buildings of 24 m² and more that stand by themselves, how many of them an object fits, and by what
intersection over union; of these, those that the map's border does not cut; attached ones; seconds
of CPU, the least of three; m² by which buildings overlap.
"""

import argparse
import os
import time
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import shapely
from _machine import description

import evocity
from evocity.errors import EvocityError
from evocity.operators import make
from evocity.scene.library import LEAST, Library
from evocity.scene.substitution import substituted

PAIRS = (
    ("lyon-1er", "montpellier-pas-du-loup"),
    ("montpellier-pas-du-loup", "villeurbanne-gratte-ciel"),
    ("cape-town-salt-river", "new-york-west-village"),
    ("villeurbanne-gratte-ciel", "new-york-west-village"),
    ("cape-town-salt-river", "lyon-1er"),
    ("montpellier-pas-du-loup", "new-york-west-village"),
    ("cape-town-salt-river", "villeurbanne-gratte-ciel"),
    ("lyon-1er", "villeurbanne-gratte-ciel"),
    ("cape-town-salt-river", "montpellier-pas-du-loup"),
    ("lyon-1er", "new-york-west-village"),
)
OPERATORS = ("quarter_fusion", "pavement_fusion")
REPEATS = 3


def main(folder: Path | None, seeds: int) -> None:
    print(description())
    libraries = {name: taken(name, 512, 1.0) for name in evocity.cities()}
    for path in sorted(folder.iterdir()) if folder else ():
        if path.stem in libraries or path.suffix == ".md":
            continue
        pixel = 2.5 if path.suffix == ".tif" else 1.0
        try:
            libraries[path.stem] = taken(path, 1000, pixel)
        except EvocityError as error:
            print(f"left out: {str(error).splitlines()[0]}")
    print(", ".join(f"{name} {len(one)}" for name, one in libraries.items()))
    every: dict[int, list] = {seed: [] for seed in range(seeds)}
    for pair in PAIRS:
        codes = [evocity.encode(evocity.read_map(name)).genome for name in pair]
        words = {name.partition("-")[0] for name in pair}  # original-lyon-1er is of Lyon too
        others = [one for name, one in libraries.items() if not words & set(name.split("-"))]
        library = Library.joined(others)
        for operator in OPERATORS:
            for seed in range(seeds):
                child = make(operator)(codes, np.random.default_rng(seed))
                found, seconds = timed(evocity.decode(child).city, library)
                every[seed].append(found)
                print(f"{' x '.join(pair)}, {operator} {seed}: {len(library)} objects")
                told([found])
                print(
                    f"    {len(found)} buildings in {seconds:.2f} s, overlap {overlap(found):.1g}"
                )
    for seed, found in every.items():
        print(f"all of seed {seed} together")
        told(found)


def taken(source, pixels: int, pixel: float) -> Library:
    city = evocity.read_map(source, pixels=pixels, metres_per_pixel=pixel)
    return Library.of(city, licence="as the file tells")


def timed(city, library: Library):
    city.walls, city.classes  # noqa: B018 - not what is measured
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        found = substituted(city, library, np.random.default_rng(1))
        spent.append(time.process_time() - began)
    return found, min(spent)


def told(found: list) -> None:
    """The rates of one or several substitutions together."""
    iou, attached, large, whole = (
        np.concatenate(one) for one in zip(*map(rows, found), strict=True)
    )
    for name, chosen in (
        ("isolated", ~attached & large),
        ("isolated, whole", ~attached & large & whole),
        ("attached", attached & large),
    ):
        fitted = iou[chosen & np.isfinite(iou)]
        if chosen.any():
            median = np.median(fitted) if len(fitted) else np.nan
            print(
                f"    {name:16} {len(fitted):5d} of {chosen.sum():5d}, "
                f"{len(fitted) / chosen.sum():.3f}, median IoU {median:.3f}"
            )


def rows(found) -> tuple[np.ndarray, ...]:
    polygons = np.array(found.walls.polygons)
    west, south, east, north = shapely.bounds(polygons).T
    low, high = (west.min(), south.min()), (east.max(), north.max())
    whole = (west > low[0]) & (south > low[1]) & (east < high[0]) & (north < high[1])
    return found.iou, found.attached, shapely.area(polygons) >= LEAST, whole


def overlap(found) -> float:
    return float(shapely.area(found.polygons).sum() - shapely.union_all(found.polygons).area)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--maps", type=Path, help="folder of more map files for the library")
    parser.add_argument("--seeds", type=int, default=2, help="children of each pair and operator")
    given = parser.parse_args()
    main(given.maps, given.seeds)
