"""What one evaluation costs, beside the plain way: python benchmarks/evaluation.py

An evaluation decodes a genome and takes the three measures of the papers, as a worker does,
on one core. The plain way does the same with numpy, scipy and scikit-image's `regionprops`.
Both must agree before a time is printed.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description, timed
from scipy import ndimage, optimize, special
from skimage.measure import label, regionprops

import evocity
from evocity import isometries
from evocity.citymap import BUILT_ABOVE
from evocity.evaluation.evaluator import Evaluator, Setup
from evocity.fitness import directions, sizes

BLOCK, REACH = 4, 12


def plain_decode(genome, tolerance=0.01):
    """The attractor with fancy indexing: every pixel from the mean of the four it is made of."""
    p, source = genome.pavement, isometries.sources(BLOCK)[genome.iso]
    top, left = p.corners
    y = genome.y[:, None] + 2 * (source // BLOCK)
    x = genome.x[:, None] + 2 * (source % BLOCK)
    rows = (top[:, None] + np.arange(BLOCK * BLOCK) // BLOCK).ravel()
    columns = (left[:, None] + np.arange(BLOCK * BLOCK) % BLOCK).ravel()
    sigma, beta = (np.repeat(values, BLOCK * BLOCK) for values in (genome.sigma, genome.beta))
    heights, change = np.zeros((p.height, p.width)), np.inf
    while change > tolerance:
        before = heights
        shrunk = (heights[:-1, :-1] + heights[1:, :-1] + heights[:-1, 1:] + heights[1:, 1:]) / 4
        heights = np.empty_like(before)
        heights[rows, columns] = sigma * shrunk[y.ravel(), x.ravel()] + beta
        change = np.abs(heights - before).max()
    return np.maximum(heights, 0)


def plain_autosimilarity(heights):
    """Correlation of every range block with all domains in reach: a matrix product a block."""
    shrunk = (heights[:-1, :-1] + heights[1:, :-1] + heights[:-1, 1:] + heights[1:, 1:]) / 4
    domains = np.lib.stride_tricks.sliding_window_view(shrunk, (7, 7))[:, :, ::2, ::2]
    rho2 = []
    for top, left in np.ndindex(heights.shape[0] // BLOCK, heights.shape[1] // BLOCK):
        y, x = top * BLOCK, left * BLOCK
        block = heights[y : y + BLOCK, x : x + BLOCK]
        if np.ptp(block) <= 0.1:
            continue
        near = domains[max(y - REACH, 0) : y + REACH + 1, max(x - REACH, 0) : x + REACH + 1]
        near = near.reshape(-1, BLOCK * BLOCK)
        near = near - near.mean(axis=1, keepdims=True)
        energy = (near**2).sum(axis=1)
        images = np.stack([isometries.apply(k, block - block.mean()).ravel() for k in range(8)])
        product = near @ images.T
        kept = energy > 0.1**2 / 2
        best = (product[kept] ** 2 / energy[kept, None]).max(initial=0)
        rho2.append(best / ((block - block.mean()) ** 2).sum())
    return np.mean(rho2)


def plain_alignment(heights, pixel):
    """R4 with scipy's filters."""
    scharr = np.array([[-3, 0, 3], [-10, 0, 10], [-3, 0, 3]]) / (32 * pixel)
    binomial = special.binom(8, np.arange(9)) / 2**8

    def smoothed(field):
        return ndimage.correlate(field, np.outer(binomial, binomial), mode="nearest")

    dx, dy = (
        smoothed(ndimage.correlate(heights, kernel, mode="nearest"))
        for kernel in (scharr, scharr.T)
    )
    real, imaginary = smoothed(dx**2 - dy**2), smoothed(2 * dx * dy)
    weight = np.hypot(real, imaginary)
    field = weight * np.exp(2j * np.arctan2(imaginary, real))
    settings = {"sigma": directions.NEIGHBOURHOOD / pixel, "mode": "constant", "truncate": 2.0}
    cosine, sine, total = (
        ndimage.gaussian_filter(part, **settings) for part in (field.real, field.imag, weight)
    )
    return np.hypot(cosine, sine).sum() / total.sum()


def plain_salingaros(heights, pixel):
    """Sizes by regionprops, the exponent by a scalar minimiser."""
    regions = regionprops(label(heights > BUILT_ABOVE, connectivity=1))
    x = np.sqrt([region.area * pixel**2 for region in regions])
    a, b = sizes.SMALLEST, sizes.LARGEST
    logs, length = np.sort(np.log(x[(x >= a) & (x <= b)] / a)), np.log(b / a)
    if logs.size < sizes.FEWEST:
        return np.nan

    def cost(m):
        return m * logs.mean() - np.log(m / -np.expm1(-m * length))

    m = optimize.minimize_scalar(
        cost, bounds=(-20, 20), method="bounded", options={"xatol": 1e-8}
    ).x
    law, n = np.expm1(-m * logs) / np.expm1(-m * length), logs.size
    ks = np.sqrt(n) * max((law - np.arange(n) / n).max(), ((np.arange(n) + 1) / n - law).max())
    classes = np.unique(np.minimum(logs.astype(int), 3)).size / 4
    off = max(1 - m, 0, m - 2)
    agreement = np.exp(-0.5 * (off / 0.25) ** 2) * np.exp(-((ks / 1.5) ** 2))
    return agreement * min(1, (logs[-1] - logs[0]) / 3) * classes


def plain_evaluation(genome):
    heights, pixel = plain_decode(genome), genome.metres_per_pixel
    return {
        "autosimilarity": plain_autosimilarity(heights),
        "alignment": plain_alignment(heights, pixel),
        "salingaros": plain_salingaros(heights, pixel),
    }


def main() -> None:
    names = ("autosimilarity", "alignment", "salingaros")
    # what a worker has installed; the header, which breeding needs, is not asked for
    worker = Evaluator(Setup(None, tuple((name, None) for name in names)))
    print(description())
    print("one evaluation at 256², B = 4, D = 8; milliseconds of one core, fastest (median)\n")
    print(f"{'city':28}{'evocity':>16}{'plain':>18}{'ratio':>9}")
    for city in evocity.cities():
        genome = evocity.encode(evocity.read_map(city, pixels=256, metres_per_pixel=2.0)).genome
        ours, plain = worker.evaluate(genome).values, plain_evaluation(genome)
        for name in names:
            np.testing.assert_allclose(ours[name], plain[name], atol=0.02, err_msg=name)
        fast = timed(lambda genome=genome: worker.evaluate(genome))
        slow = timed(lambda genome=genome: plain_evaluation(genome), repeats=3)
        print(
            f"{city:28}{fast[0]:8.1f} ({fast[1]:.1f}){slow[0]:10.0f} ({slow[1]:.0f})"
            f"{slow[1] / fast[1]:8.1f}x"
        )


if __name__ == "__main__":
    main()
