"""Can a code be told from a map by sight? python benchmarks/likeness.py [--town FILE]...

Every bundled district at 256², 2 m/px, beside its decoded codes. A random forest looks at patches
of 64 px and tells maps from codes; its area under the curve (AUC) is .5 where it cannot, 1 where it
always can. Beside it what measures say of each map and code. Of a --town, any map file that covers
more than two windows of 512 m, the two densest are told apart as maps and codes are: how much one
real place differs from the next.

Patches lie 32 px apart. They are described by histograms of gradients (8 directions) of the built
mask and of the heights, local binary patterns of both (8 neighbours, radius 2 and 1), a histogram
of heights, and shares of edges. Folds go by quadrants of the map: what is judged has no pixel in
common with what was learnt from.
"""

import argparse
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description
from skimage.feature import hog, local_binary_pattern
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import roc_auc_score

import evocity
from evocity import fitness
from evocity.citymap import CityMap

SIDE, STEP, TREES = 64, 32, 200
#: Metres: roofs are counted in these classes, and edges by how far they rise.
CLASSES = np.array([0, 0.05, 1.5, *range(3, 61, 3), np.inf])
RISES = (0.05, 0.5, 1.5, 3.0, 6.0)


def coded(**how):
    """What makes, of a city, the map that its code stands for."""
    return lambda city: evocity.decode(evocity.encode(city, **how).genome).city


#: How each column gets a map from a city.
CODES = {
    "B = 4, raw": coded(block=4, fit=False, settle=False),
    "B = 4, settled": coded(block=4, fit=False),
    "leaves, raw": coded(fit=False, settle=False),
    "leaves, settled": coded(fit=False),
    "default: leaves, fitted, settled": coded(),
}


def main(towns: Sequence[Path]) -> None:
    print(description())
    maps = {name: evocity.read_map(name, metres_per_pixel=2.0) for name in evocity.cities()}
    codes = {how: [make(city) for city in maps.values()] for how, make in CODES.items()}
    print(f"\nmaps and codes of {len(maps)} districts, patches of {SIDE} px: AUC")
    for how, cities in codes.items():
        print(f"{how:52}{told_apart(list(maps.values()), cities):.2f}")
    for path in towns:
        windows = densest_windows(path)
        apart = fitness.fabric_distance(*windows)
        print(
            f"{f'two windows of {path.stem}':52}{told_apart(windows[:1], windows[1:]):.2f}"
            f"    fabric distance {apart:.3f}"
        )
    table(maps, codes)


def table(maps: dict[str, CityMap], codes: dict[str, list[CityMap]]) -> None:
    rough = fitness.get("fabric_distance.roughness")
    print(f"\n{'':46}{'fabric':>8}{'+ rough':>9}{'crumbs':>8}{'gsi':>7}{'< 50 m²':>9}{'flat':>7}")
    for number, (name, map_) in enumerate(maps.items()):
        rows = {"map": map_} | {how: cities[number] for how, cities in codes.items()}
        for how, city in rows.items():
            small = np.mean(city.buildings.area < 50)
            print(
                f"{name:26}{how:20}{fitness.fabric_distance(city, map_):8.3f}"
                f"{rough(city, map_):9.3f}{fitness.crumbs(city):8.2f}{fitness.gsi(city):7.3f}"
                f"{small:9.2f}{fitness.roof_flatness(city):7.2f}"
            )


# -- the test by pictures ------------------------------------------------------------------


def told_apart(some: Sequence[CityMap], others: Sequence[CityMap]) -> float:
    """AUC of a forest that tells ``others`` from ``some``, maps of one size: of all folds."""
    corners = list(patches(some[0].shape))
    middles = [side // 2 for side in some[0].shape]
    seen = np.array([[described(city, *at) for at in corners] for city in (*some, *others)])
    truth = np.repeat([0, 1], [len(some), len(others)])[:, None] * np.ones(len(corners), int)
    judged = np.full(truth.shape, np.nan)
    for quadrant in range(4):
        inside, outside = np.array([within(*at, quadrant, middles) for at in corners]).T
        forest = RandomForestClassifier(TREES, random_state=quadrant, n_jobs=1)
        forest.fit(seen[:, outside].reshape(-1, seen.shape[2]), truth[:, outside].ravel())
        chance = forest.predict_proba(seen[:, inside].reshape(-1, seen.shape[2]))[:, 1]
        judged[:, inside] = chance.reshape(truth.shape[0], -1)
    known = ~np.isnan(judged)
    return roc_auc_score(truth[known], judged[known])


def patches(shape: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """Corners of all patches."""
    for y in range(0, shape[0] - SIDE + 1, STEP):
        for x in range(0, shape[1] - SIDE + 1, STEP):
            yield y, x


def within(y: int, x: int, quadrant: int, middles: Sequence[int]) -> tuple[bool, bool]:
    """Whether a patch lies wholly in the ``quadrant``, and whether wholly out of it."""
    parts = set()
    for v in (y, y + SIDE - 1):
        for u in (x, x + SIDE - 1):
            parts.add(2 * (v >= middles[0]) + (u >= middles[1]))
    return parts == {quadrant}, quadrant not in parts


def described(city: CityMap, y: int, x: int) -> np.ndarray:
    """What the forest is told of a patch."""
    heights = city.heights[y : y + SIDE, x : x + SIDE]
    built = city.built[y : y + SIDE, x : x + SIDE]
    cells = {"orientations": 8, "pixels_per_cell": (16, 16), "cells_per_block": (2, 2)}
    centimetres = np.round(100 * heights).astype(np.int32)
    steps = [np.abs(np.diff(heights, axis=axis)).ravel() for axis in (0, 1)]
    return np.concatenate(
        [
            hog(built.astype(float), **cells),
            hog(heights.astype(float), **cells),
            pattern(centimetres, 1),
            pattern(built.astype(np.int32), 2),
            np.histogram(heights, CLASSES)[0] / heights.size,
            [np.mean(np.concatenate(steps) > rise) for rise in RISES],
        ]
    )


def pattern(image: np.ndarray, radius: int) -> np.ndarray:
    """Shares of the local binary patterns of 8 neighbours, those of one circle of signs apart."""
    found = local_binary_pattern(image, 8, radius, "nri_uniform").astype(int)
    return np.bincount(found.ravel(), minlength=59) / image.size


def densest_windows(path: Path) -> list[CityMap]:
    """The two windows of 256² of the middle 2048 m, without a pixel in common, of which the less
    built one is built on most; they lie 16 px apart or a multiple."""
    city = evocity.read_map(path, metres_per_pixel=2.0, pixels=1024)
    sums = np.pad(city.built, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    built = sums[256:, 256:] - sums[:-256, 256:] - sums[256:, :-256] + sums[:-256, :-256]
    y, x = (16 * axis.ravel() for axis in np.mgrid[:49, :49])
    built = built[y, x]
    apart = np.maximum(np.abs(y[:, None] - y), np.abs(x[:, None] - x)) >= 256
    pair = np.argmax(np.where(apart, np.minimum(built[:, None], built), -1))
    return [
        city.replace(city.heights[y[at] : y[at] + 256, x[at] : x[at] + 256])
        for at in np.unravel_index(pair, apart.shape)
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--town", action="append", default=[], type=Path, metavar="FILE")
    main(parser.parse_args().town)
