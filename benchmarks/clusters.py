"""Which distance of maps makes sensible clusters? python benchmarks/clusters.py

Cuts windows out of the bundled districts, so that the right cluster of each window is known: its
district. Windows of one district overlap (they begin up to 48 m apart), or have no pixel in common
(quarters). Compared are the distances of `Run.clusters(by="looks")`, by cells that differ by more
than a storey; of structural similarity (SSIM); and of phase correlation, the height of the highest
peak over all shifts. Printed is the adjusted Rand index of five k-medoids with the districts: 1 for
the same clusters, 0 for chance; and the time of a pair.
"""

import itertools
import time
from collections.abc import Callable

import numpy as np
from _machine import description
from scipy import fft
from skimage.metrics import structural_similarity

import evocity
from evocity.analysis.clusters import label_clusters, medoids
from evocity.citymap import CityMap
from evocity.selection.thumbprints import SIDE, STOREY, look_of


def looks(one: np.ndarray, other: np.ndarray) -> float:
    """The share of cells that differ by more than a storey."""
    return float(np.mean(abs(one - other) > STOREY))


def structure(one: np.ndarray, other: np.ndarray) -> float:
    """One minus the structural similarity, over two."""
    return (1 - structural_similarity(one, other, data_range=30.0)) / 2


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """One minus the highest peak of phase correlation."""
    product = fft.rfft2(one - one.mean()) * fft.rfft2(other - other.mean()).conj()
    return 1 - float(fft.irfft2(product / np.maximum(abs(product), 1e-12)).max())


def windows(city: CityMap, apart: bool) -> list[CityMap]:
    """Six overlapping windows of 192², or the four quarters."""
    offsets = (0, 128) if apart else (0, 24)
    side = 128 if apart else 192
    corners = list(itertools.product(offsets, offsets)) + ([] if apart else [(12, 12), (12, 0)])
    cuts = [city.heights[y : y + side, x : x + side] for y, x in corners]
    return [CityMap(cut, city.metres_per_pixel) for cut in cuts]


def rand_index(one: np.ndarray, other: np.ndarray) -> float:
    """The adjusted Rand index of two labellings."""
    table = np.zeros((one.max() + 1, other.max() + 1))
    np.add.at(table, (one, other), 1)

    def pairs(counts: np.ndarray) -> float:
        return float((counts * (counts - 1) / 2).sum())

    both, rows, columns = pairs(table), pairs(table.sum(1)), pairs(table.sum(0))
    chance = rows * columns / pairs(np.array([len(one)]))
    return (both - chance) / ((rows + columns) / 2 - chance)


def compare(title: str, apart: bool, ways: dict[str, Callable]) -> None:
    """Print how well each way finds the districts of the windows."""
    cities = [evocity.read_map(name, pixels=256, metres_per_pixel=2.0) for name in evocity.cities()]
    lists = [windows(city, apart) for city in cities]
    truth = np.repeat(np.arange(len(lists)), [len(one) for one in lists])
    points = [look_of(one).reshape(SIDE, SIDE) / 10 for several in lists for one in several]
    print(f"\n{title}: {len(points)} windows of {len(lists)} districts")
    for name, way in ways.items():
        began = time.process_time()
        distances = np.zeros((len(points), len(points)))
        for i, j in itertools.combinations(range(len(points)), 2):
            distances[i, j] = distances[j, i] = way(points[i], points[j])
        spent = (time.process_time() - began) / (len(points) * (len(points) - 1) / 2)
        found = label_clusters(distances, medoids(distances, len(lists)))
        index = rand_index(truth, found)
        print(f"{name:22} {index:5.2f}   {1e3 * spent:.2f} ms a pair", flush=True)


if __name__ == "__main__":
    print(description())
    several = {"looks": looks, "structural similarity": structure, "phase correlation": correlation}
    compare("overlapping windows", False, several)
    compare("quarters", True, several)
