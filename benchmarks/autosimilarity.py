"""What a full autosimilarity map costs: python benchmarks/autosimilarity.py

µ̃ at 256², B = 8, D = 20, all range positions, all domain positions, 8 isometries, with one
thread and two, beside numpy's matrix products with a running maximum (a measured part of the
range blocks, in proportion). Both must agree on that part before a time is printed. A rate is
that of the dense count of pairs, as if nothing were searched once for many.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import time

import numpy as np
from _machine import description
from numpy.lib.stride_tricks import sliding_window_view

import evocity
from evocity import isometries
from evocity.coding import autosimilarity_maps

SIDE, BLOCK, EXTENT = 256, 8, 20
ROWS = 2 * BLOCK - 1  # of pixels; the range blocks of BLOCK rows hold the middle one


def plain_row(heights):
    """µ̃ of the map's middle row, and seconds: each domain image is a row of one matrix."""
    start = time.perf_counter()
    level = heights.astype(np.float64)
    level = (level - level.min()) / np.ptp(level)
    seams = np.arange(EXTENT + 1) * BLOCK / EXTENT
    weights = np.array(
        [np.minimum(seams[1:], k + 1) - np.maximum(seams[:-1], k) for k in range(BLOCK)]
    )
    weights = np.clip(weights, 0, None)
    shrunk = sliding_window_view(level, EXTENT, axis=1) @ weights.T
    shrunk = np.swapaxes(sliding_window_view(shrunk, EXTENT, axis=0) @ weights.T, -1, -2)
    domains = shrunk.reshape(-1, BLOCK * BLOCK)
    domains = domains - domains.mean(axis=1, keepdims=True)
    norm = np.sqrt((domains**2).sum(axis=1))
    domains = (domains[norm > 1e-9] / norm[norm > 1e-9, None]).astype(np.float32)

    top = (SIDE - ROWS) // 2
    blocks = sliding_window_view(level[top : top + ROWS], (BLOCK, BLOCK)).reshape(-1, BLOCK**2)
    blocks = blocks - blocks.mean(axis=1, keepdims=True)
    energy = (blocks**2).sum(axis=1)
    best = np.zeros(len(blocks), np.float32)
    for k in range(8):
        images = blocks[:, isometries.sources(BLOCK)[k]].astype(np.float32)
        for first in range(0, len(domains), 1024):
            product = np.abs(images @ domains[first : first + 1024].T)
            np.maximum(best, product.max(axis=1), out=best)
    errors = (energy - best.astype(np.float64) ** 2) / BLOCK**2
    sums = np.pad(errors.reshape(BLOCK, -1).sum(axis=0), BLOCK - 1)
    counts = np.pad(np.full(SIDE - BLOCK + 1, BLOCK), BLOCK - 1)
    kernel = np.ones(BLOCK)
    mean = np.convolve(sums, kernel, "valid") / np.convolve(counts, kernel, "valid")
    return mean, top + BLOCK - 1, time.perf_counter() - start


def main() -> None:
    positions = (SIDE - BLOCK + 1) ** 2 * (SIDE - EXTENT + 1) ** 2
    print(description())
    print(f"full µ̃ at {SIDE}², B = {BLOCK}, D = {EXTENT}: {8 * positions / 1e9:.1f} G pairs\n")
    print(f"{'city':28}{'1 thread':>18}{'2 threads':>18}{'numpy, 1 thread':>18}{'ratio':>8}")
    for name in evocity.cities():
        city = evocity.read_map(name, pixels=SIDE, metres_per_pixel=2.0)
        small = city.replace(city.heights[:EXTENT, :EXTENT])
        autosimilarity_maps(small, block=BLOCK, domains=EXTENT)  # compiles
        plain, row, seconds = plain_row(city.heights)
        seconds *= (SIDE - BLOCK + 1) / BLOCK
        spent = []
        for threads in (1, 2):
            found = autosimilarity_maps(city, block=BLOCK, domains=EXTENT, threads=threads)
            np.testing.assert_allclose(found.mean[row], plain, atol=1e-5)
            spent.append(found.seconds)
        cells = "".join(f"{s:8.1f} s ({8e-9 * positions / s:.1f} G)" for s in spent)
        print(f"{name:28}{cells}{seconds:16.0f} s{seconds / spent[0]:7.1f}x", flush=True)


if __name__ == "__main__":
    main()
