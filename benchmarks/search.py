"""Exact search side by side: python benchmarks/search.py [--large MAP]

On a real city and on scikit-image's camera: this package with 1 and 2 threads, numpy (matrix
product and running maximum, one thread) and a plain numba loop; encoding to leaves beside the
searches of their sides; then the growth with the map's side, and the reach of 24 px. All must have
found the same optimum before a time is printed. With --large, a tenth of the range blocks of that
map at 2048² is searched and projected.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import functools
import resource
import sys
import time

import numpy as np
import skimage.data
import skimage.transform
from _machine import description, sgemm

import evocity
from evocity import isometries
from evocity.accelerate import kernel
from evocity.coding.matching import best_matches, pairs_compared
from evocity.coding.matching.candidates import Shapes, uneven_blocks
from evocity.coding.matching.domains import domain_pools
from evocity.coding.parameters import Coding
from evocity.io import cities
from evocity.pavement import Pavement

CAP = np.float32(0.9)


def blocks_of(heights, block):
    """Range blocks that are not flat, and their corners."""
    pavement = Pavement(*heights.shape, block)
    blocks = pavement.blocks(heights)
    busy = np.flatnonzero(uneven_blocks(blocks))
    return blocks[busy], tuple(corner[busy] for corner in pavement.corners)


def ours(heights, block, threads, reach=None):
    blocks, corners = blocks_of(heights, block)
    coding = Coding(reach, sigma_max=float(CAP))
    pools = domain_pools(heights, block, (2,))
    found = best_matches(pools, blocks, corners, coding, threads=threads)
    return found.gain


def domain_blocks(heights, block):
    """Every domain block of side 2B, shrunk and zero-mean: float32 ``(n, B²)``."""
    shrunk = (heights[:-1, :-1] + heights[1:, :-1] + heights[:-1, 1:] + heights[1:, 1:]) / 4
    size = 2 * block - 1
    every = np.lib.stride_tricks.sliding_window_view(shrunk, (size, size))[:, :, ::2, ::2]
    flat = every.reshape(-1, block * block)
    return flat - flat.mean(axis=1, keepdims=True)


def range_images(blocks):
    """Each zero-mean range block under the 8 isometries: float32 ``(n, 8, B²)``."""
    centred = blocks - blocks.mean(axis=(1, 2), keepdims=True)
    images = [isometries.apply(k, centred).reshape(len(blocks), -1) for k in range(8)]
    return np.ascontiguousarray(np.stack(images, axis=1), np.float32)


def with_numpy(heights, block, chunk=64):
    """Matrix product, maximum over isometries, running best domain; in pieces that stay in the
    cache, isometries outermost so that the maximum runs along memory."""
    blocks, _ = blocks_of(heights, block)
    domains = domain_blocks(heights, block).astype(np.float32)
    energy = np.einsum("nk,nk->n", domains, domains)
    kept = energy > 1e-3
    domains, energy = domains[kept], energy[kept]
    images = np.ascontiguousarray(range_images(blocks).transpose(2, 1, 0)).reshape(block**2, -1)
    best = np.zeros(len(blocks), np.float32)
    place = np.zeros(len(blocks), np.int64)
    for start in range(0, len(domains), chunk):
        p = domains[start : start + chunk] @ images
        np.abs(p, out=p)
        p = p.reshape(len(p), 8, -1).max(axis=1)
        e = energy[start : start + chunk, None]
        slope = np.minimum(p / e, CAP)
        gain = slope * (2 * p - slope * e)
        top = gain.argmax(axis=0)
        found = np.take_along_axis(gain, top[None], axis=0)[0]
        better = found > best
        best[better], place[better] = found[better], start + top[better]
    return best


@kernel
def _plain_loop(domains, energy, images, cap, best):
    for i in range(images.shape[0]):
        for j in range(domains.shape[0]):
            for k in range(8):
                p = np.float32(0)
                for t in range(domains.shape[1]):
                    p += domains[j, t] * images[i, k, t]
                p = abs(p)
                slope = min(p / energy[j], cap)
                best[i] = max(best[i], slope * (2 * p - slope * energy[j]))


def with_plain_loop(heights, block):
    blocks, _ = blocks_of(heights, block)
    domains = domain_blocks(heights, block).astype(np.float32)
    energy = np.einsum("nk,nk->n", domains, domains)
    kept = energy > 1e-3
    best = np.zeros(len(blocks), np.float32)
    _plain_loop(domains[kept], energy[kept], range_images(blocks), CAP, best)
    return best


def clocked(call):
    start = time.perf_counter()
    result = call()
    return result, time.perf_counter() - start


def fastest(call, repeats):
    """The least time of so many calls, and of so many more as fit into a quarter of a second."""
    result, spent = clocked(call)  # compiles
    until = time.perf_counter() + 0.25
    while repeats > 0 or time.perf_counter() < until:
        _, once = clocked(call)
        spent, repeats = min(spent, once), repeats - 1
    return result, spent


def dense_pairs(heights, block, reach=None):
    """Pairs of all range blocks, the flat ones too."""
    corners = Pavement(*heights.shape, block).corners
    return pairs_compared(heights.shape, block, corners, Coding(reach))


def side_by_side(name, heights, block):
    dense = dense_pairs(heights, block)
    truth, one = fastest(lambda: ours(heights, block, 1), 3)
    _, two = fastest(lambda: ours(heights, block, 2), 3)
    rows = [("evocity, 1 thread", one), ("evocity, 2 threads", two)]
    peer, spent = fastest(lambda: with_numpy(heights, block), 1)
    np.testing.assert_allclose(peer, truth, rtol=1e-3, atol=1e-4 * truth.max())
    rows.append(("numpy GEMM, 1 thread", spent))
    if heights.size <= 1 << 16:
        peer, spent = fastest(lambda: with_plain_loop(heights, block), 0)
        np.testing.assert_allclose(peer, truth, rtol=1e-3, atol=1e-4 * truth.max())
        rows.append(("plain numba loop", spent))
    print(f"\n{name}, {heights.shape[0]}², B = {block}: {dense / 1e9:.2f} G pairs, dense count")
    gemm = dict(rows)["numpy GEMM, 1 thread"]
    for label, spent in rows:
        rate = dense / spent / 1e9
        print(f"  {label:24}{spent:9.3f} s {rate:8.2f} G pairs/s {gemm / spent:8.2f} x numpy")


def effective_rates():
    """Dense pairs a second on the bundled cities, over the ratio of range blocks to distinct
    ones that are not flat: what is left is the search's own doing."""
    print("\nbundled cities at 256², whole map: G pairs/s, dense count; the same over the ratio")
    print(f"{'':26}{'B':>3}{'distinct':>10}{'ratio':>8}{'1 thread':>18}{'2 threads':>18}")
    for block in (8, 4):
        for name in cities():
            heights = evocity.read_map(name).heights
            distinct = len(Shapes.of_blocks(blocks_of(heights, block)[0]).first)
            ratio = (heights.size // block**2) / distinct
            dense = dense_pairs(heights, block) / 1e9
            cells = ""
            for threads in (1, 2):
                _, spent = fastest(functools.partial(ours, heights, block, threads), 5)
                cells += f"{dense / spent:9.1f} ({dense / spent / ratio:5.2f})"
            print(f"  {name:24}{block:3}{distinct:10}{ratio:8.2f}  {cells}")


def growth(heights_at, block):
    print(f"\ngrowth, B = {block}, 2 threads: seconds, and the factor a doubling of the side costs")
    maps = {side: heights_at(side) for side in (128, 256, 512, 1024)}
    for reach in (None, 24):
        before = None
        for side, heights in maps.items():
            _, spent = fastest(functools.partial(ours, heights, block, 2, reach), 3)
            factor = f"x {spent / before:.1f}" if before else ""
            print(f"  reach {reach or 'all':>4}  {side:5}²{spent:9.3f} s  {factor}")
            before = spent


def by_levels():
    """The default encoding, chosen of four sides, beside the searches of these sides alone."""
    print("\nencoding to leaves of 2…16 px, reach 24, beside the sum of its sides' searches, ms")
    for name in cities():
        city = evocity.read_map(name)
        line = f"  {name:26}"
        for threads in (1, 2):
            how = {"block": (2, 16), "fit": False, "threads": threads}
            _, whole = fastest(functools.partial(evocity.encode, city, **how), 3)
            parts = [
                fastest(functools.partial(ours, city.heights, side, threads, 24), 3)[1]
                for side in (16, 8, 4, 2)
            ]
            line += f"{1e3 * whole:8.0f} /{1e3 * sum(parts):5.0f} ({whole / sum(parts):.2f} x)"
        print(line)


def large(path, block=8, side=2048):
    city = evocity.read_map(path)
    heights = skimage.transform.resize(city.heights, (side, side), order=1).astype(np.float32)
    heights[heights < 1] = 0
    blocks, corners = blocks_of(heights, block)
    pick = np.random.default_rng(0).choice(len(blocks), len(blocks) // 10, replace=False)
    pick.sort()
    part = (blocks[pick], tuple(corner[pick] for corner in corners))
    _, spent = clocked(
        lambda: best_matches(domain_pools(heights, block, (2,)), *part, Coding(None), threads=2)
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"\n{city.name} at {side}², B = {block}, whole image: {len(blocks)} range blocks not flat; "
        f"a tenth took {spent:.1f} s with 2 threads, so all {spent / 6:.1f} min; "
        f"peak memory {peak:.2f} GB"
    )


def main() -> None:
    print(description())
    print(f"SGEMM, one thread: {sgemm():.0f} GFLOP/s")
    camera = skimage.data.camera().astype(np.float32)

    def lyon(side):
        return evocity.read_map("lyon-1er", pixels=side, metres_per_pixel=512 / side).heights

    def photograph(side):
        return skimage.transform.resize(camera, (side, side), anti_aliasing=True).astype(np.float32)

    for name, image in (("lyon-1er", lyon), ("camera", photograph)):
        for side, block in ((256, 8), (256, 4), (512, 8)):
            side_by_side(name, image(side), block)
    effective_rates()
    by_levels()
    for block in (8, 4):
        growth(lyon, block)
    if "--large" in sys.argv:
        large(sys.argv[sys.argv.index("--large") + 1])


if __name__ == "__main__":
    main()
