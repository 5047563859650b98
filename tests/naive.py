"""Slow, obvious twins of the compiled kernels. Tests compare both on awkward inputs."""

import itertools

import numpy as np

from evocity import isometries
from evocity.coding.search.matches import TIE


def box_means(heights, tall, wide):
    rows, columns = heights.shape
    means = np.empty((rows - tall + 1, columns - wide + 1))
    for y, x in np.ndindex(means.shape):
        means[y, x] = heights[y : y + tall, x : x + wide].mean()
    return means


def shrunk(heights, y, x, tall, wide, block):
    """The domain block at (y, x), averaged down to block × block pixels."""
    domain = heights[y : y + tall * block, x : x + wide * block].astype(float)
    return domain.reshape(block, tall, block, wide).mean(axis=(1, 3))


def candidates(heights, block, corner, domains, reach, range_block, sigma_max):
    """Yield (gain, (multiple, y, x, iso), σ, β) of every domain and isometry, in tie order."""
    height, width = heights.shape
    for multiple in sorted(domains):
        rows, columns = height - multiple * block + 1, width - multiple * block + 1
        for y, x in itertools.product(range(rows), range(columns)):
            if reach is not None and max(abs(y - corner[0]), abs(x - corner[1])) > reach:
                continue
            domain = shrunk(heights, y, x, multiple, multiple, block)
            flat = domain - domain.mean()
            if (flat**2).sum() < 1e-10 * heights.max() ** 2:
                continue
            for iso, (gain, sigma) in enumerate(gains(range_block, domain, sigma_max)):
                beta = range_block.mean(dtype=float) - sigma * domain.mean()
                yield gain, (multiple, y, x, iso), sigma, beta


def gains(range_block, domain, sigma_max):
    """Energy explained and σ under each of the 8 isometries, |σ| at most ``sigma_max``."""
    centred = range_block.astype(float) - range_block.mean(dtype=float)
    flat = domain - domain.mean()
    energy = (flat**2).sum()
    for iso in range(8):
        p = (centred * isometries.apply(iso, flat)).sum()
        s = min(abs(p) / energy, sigma_max)
        yield s * (2 * abs(p) - s * energy), s if p >= 0 else -s


def best_match(heights, block, corner, domains, reach, range_block, sigma_max):
    """Exhaustive search for one range block: (gain, (multiple, y, x, iso), σ, β), or None."""
    centred = range_block.astype(float) - range_block.mean(dtype=float)
    energy = (centred**2).sum()
    every = list(candidates(heights, block, corner, domains, reach, range_block, sigma_max))
    if not every or max(gain for gain, *_ in every) <= 0:
        return None
    least = max(gain for gain, *_ in every) - TIE * energy
    return next(candidate for candidate in every if candidate[0] >= least)


def best_correlations(heights, block=4, domains=(2,), reach=12, flat=0.1):
    """ρ² of every range block of the pavement with its best domain, and which are uniform."""
    rows, columns = heights.shape[0] // block, heights.shape[1] // block
    rho2, uniform = np.zeros(rows * columns), np.zeros(rows * columns, bool)
    for i, (row, column) in enumerate(np.ndindex(rows, columns)):
        y, x = row * block, column * block
        range_block = heights[y : y + block, x : x + block].astype(float)
        uniform[i] = np.ptp(range_block) <= flat
        if uniform[i]:
            continue
        centred = range_block - range_block.mean()
        for multiple in domains:
            for dy, dx in np.ndindex(
                heights.shape[0] - multiple * block + 1, heights.shape[1] - multiple * block + 1
            ):
                if reach is not None and max(abs(dy - y), abs(dx - x)) > reach:
                    continue
                domain = shrunk(heights, dy, dx, multiple, multiple, block)
                domain -= domain.mean()
                energy = (domain**2).sum()
                if energy <= max(flat**2 / 2, 1e-10 * heights.max() ** 2):
                    continue
                for iso in range(8):
                    p = (centred * isometries.apply(iso, domain)).sum()
                    rho2[i] = max(rho2[i], p * p / energy / (centred**2).sum())
    return rho2, uniform


def collage(genome, heights):
    """W applied once: every lifs of ``genome`` on ``heights``, block by block."""
    p = genome.pavement
    target = np.empty(heights.shape)
    for i, (top, left) in enumerate(zip(*p.corners, strict=True)):
        block = np.full((p.block, p.block), float(genome.beta[i]))
        if genome.dx[i]:
            tall, wide = genome.dy[i] // p.block, genome.dx[i] // p.block
            domain = shrunk(heights, genome.y[i], genome.x[i], tall, wide, p.block)
            block += isometries.apply(int(genome.iso[i]), float(genome.sigma[i]) * domain)
        target[top : top + p.block, left : left + p.block] = block
    return target


def outline_difference(current, brought, top, left, tall, wide):
    rows, columns = current.shape
    gaps = []
    for y in range(top, top + tall):
        for x in range(left, left + wide):
            gap = abs(float(brought[y, x]) - float(current[y, x]))
            gaps += [gap] * int(y == top and top > 0)
            gaps += [gap] * int(y == top + tall - 1 and top + tall < rows)
            gaps += [gap] * int(x == left and left > 0)
            gaps += [gap] * int(x == left + wide - 1 and left + wide < columns)
    return float(np.mean(gaps)) if gaps else 0.0


def inject(current, brought, owner, donor, size, block, rows, columns, tolerance, least, most):
    """As the kernel, on copies: returns (current, owner, blocks owned)."""
    current, owner = current.copy(), owner.copy()
    for row, column in zip(rows, columns, strict=True):
        if (owner == donor).sum() >= least:
            break
        blocks = np.s_[row : row + size, column : column + size]
        pixels = np.s_[row * block : (row + size) * block, column * block : (column + size) * block]
        gained = (owner[blocks] != donor).sum()
        side = size * block
        if gained == 0 or (owner == donor).sum() + gained > most:
            continue
        if (
            outline_difference(current, brought, row * block, column * block, side, side)
            > tolerance
        ):
            continue
        current[pixels] = brought[pixels]
        owner[blocks] = donor
    return current, owner, int((owner == donor).sum())


def spread_means(means, tall, wide, rows, columns):
    """Adjoint of `box_means`: every mean goes back to the pixels it was taken of."""
    heights = np.zeros((rows, columns))
    for y, x in np.ndindex(rows - tall + 1, columns - wide + 1):
        heights[y : y + tall, x : x + wide] += means[y, x] / (tall * wide)
    return heights


def collage_transposed(genome, values):
    """Adjoint of W without β, block by block."""
    p = genome.pavement
    target = np.zeros(values.shape)
    for i, (top, left) in enumerate(zip(*p.corners, strict=True)):
        if genome.dx[i]:
            tall, wide = genome.dy[i] // p.block, genome.dx[i] // p.block
            block = values[top : top + p.block, left : left + p.block]
            back = isometries.apply(int(isometries.INVERSE[genome.iso[i]]), block)
            y, x = int(genome.y[i]), int(genome.x[i])
            target[y : y + tall * p.block, x : x + wide * p.block] += np.kron(
                back, np.full((tall, wide), float(genome.sigma[i]) / (tall * wide))
            )
    return target


def area_weighted(domain, block):
    """A square domain block, averaged down to block × block pixels, seams shared by area."""
    extent = domain.shape[0]
    fine = np.kron(domain.astype(float), np.ones((block, block)))
    return fine.reshape(block, extent, block, extent).mean(axis=(1, 3))


def autosimilarity_errors(heights, block, extent):
    """µ(R, D) of every range position with the best of all domains and isometries."""
    span = np.ptp(heights.astype(float))
    rows, columns = (side - block + 1 for side in heights.shape)
    images = []
    for y, x in np.ndindex(*(side - extent + 1 for side in heights.shape)):
        domain = area_weighted(heights[y : y + extent, x : x + extent], block)
        domain -= domain.mean()
        if (domain**2).sum() > 1e-20 * (block * span) ** 2:
            images += [isometries.apply(k, domain).ravel() for k in range(8)]
    images = np.array(images).reshape(-1, block * block)
    errors = np.zeros((rows, columns))
    for y, x in np.ndindex(rows, columns):
        r = heights[y : y + block, x : x + block].astype(float).ravel()
        r -= r.mean()
        explained = (images @ r) ** 2 / (images**2).sum(axis=1)
        if span:
            errors[y, x] = ((r @ r) - explained.max(initial=0)) / (block * span) ** 2
    return errors


def autosimilarity_maps(heights, block, extents):
    """(mean, least, curve): over all range blocks that hold a pixel, and D → mean of µ."""
    every = {extent: autosimilarity_errors(heights, block, extent) for extent in extents}
    errors = np.min(list(every.values()), axis=0)
    mean, least = np.empty(heights.shape), np.empty(heights.shape)
    for y, x in np.ndindex(heights.shape):
        top, left = max(y - block + 1, 0), max(x - block + 1, 0)
        held = errors[top : y + 1, left : x + 1]
        mean[y, x], least[y, x] = held.mean(), held.min()
    return mean, least, {extent: found.mean() for extent, found in every.items()}


def closest_neighbourhood(heights, block, corners, candidates, rings=16, domain_heights=None):
    """Ring after ring, whole squares cut from maps that are NaN beyond their borders."""
    others = heights if domain_heights is None else domain_heights
    least_seen = (1e-6 * max(heights.max(), others.max())) ** 2
    chosen = []
    for i, (top, left) in enumerate(zip(*corners, strict=True)):
        error = dict.fromkeys(range(candidates.starts[i], candidates.starts[i + 1]), 0.0)
        compared = 0
        for k in range(1, rings + 1):
            side = block + 2 * k
            on_ring = np.ones((side, side), bool)
            on_ring[1:-1, 1:-1] = False
            around = np.pad(heights.astype(float), k, constant_values=np.nan)
            ring = around[top : top + side, left : left + side][on_ring]
            compared += np.isfinite(ring).sum()
            means = {}
            for c in error:
                m, y, x = candidates.multiple[c], candidates.y[c], candidates.x[c]
                around = np.pad(others.astype(float), m * k, constant_values=np.nan)
                square = isometries.apply(int(candidates.iso[c]), shrunk(around, y, x, m, m, side))
                brought = candidates.sigma[c] * square[on_ring] + candidates.beta[c]
                squares = (brought - ring) ** 2
                if np.isfinite(squares).any():
                    means[c] = np.nanmean(squares)
            if not means:
                break
            error = {c: error[c] + np.isfinite(ring).sum() * means[c] for c in means}
            least = min(error.values())
            limit = least + 1e-9 * least + least_seen * compared
            error = {c: e for c, e in error.items() if e <= limit}
        chosen.append(min(error, default=-1))
    return np.array(chosen)
