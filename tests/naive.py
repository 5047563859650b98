"""Slow, obvious twins of the compiled kernels. Tests compare both on awkward inputs."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import shapely
import shapely.affinity
from scipy import ndimage, optimize

from evocity import isometries
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.matches import TIE
from evocity.genome import unpacked
from evocity.selection.backends.moocore import contributions, hypervolume


def moved(before, after, tolerance, sky):
    changes = [abs(b - a) for a, b in zip(before, after, strict=True)]
    return sum(not c <= tolerance for c in changes), sum(not c < sky for c in changes)


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
            if (flat**2).sum() < (block * 1e-12 * heights.max()) ** 2:
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
    if not every or max(gain for gain, *_ in every) <= TIE * energy:
        return None
    least = max(gain for gain, *_ in every) - TIE * energy
    return next(candidate for candidate in every if candidate[0] >= least)


_BITS = (1 << 64) - 1
_ONE, _TWO, _BEYOND = 0x6A09E667F3BCC909, 0xBB67AE8584CAA73B, 0x3C6EF372FE94F82B


def _mixed(value, factor):
    value = (value ^ (value >> 32)) * factor & _BITS
    value = (value ^ (value >> 29)) * factor & _BITS
    return value ^ (value >> 32)


def hash_blocks(pixels, block, about):
    """Two hashes of the pixels of each block, uint64 (rows, columns, 2)."""
    found = np.empty((pixels.shape[0] // block, pixels.shape[1] // block, 2), np.uint64)
    for i, j, k in np.ndindex(found.shape):
        factor, shift = ((_ONE, 31), (_TWO, 29))[k]
        value = factor
        for number in about:
            value = _mixed(value ^ int(number), factor)
        for bits in pixels[i * block : (i + 1) * block, j * block : (j + 1) * block].ravel():
            value = (value ^ int(bits)) * factor & _BITS
            value ^= value >> shift
        found[i, j, k] = _mixed(value, factor)
    return found


def hash_windows(blocks, before, after):
    """Two hashes of the blocks around each, first along rows, then along columns."""
    count, found = before + after + 1, np.empty(blocks.shape, np.uint64)
    for k, (factor, other) in enumerate(((_ONE, _TWO), (_TWO, _ONE))):
        factors, value = [], factor
        for n in range(2 * count):
            value = _mixed((value + n) & _BITS, other)
            factors.append(value | 1)

        def summed(line, place, factors, factor=factor):
            total = 0
            for n, weight in enumerate(factors):
                at = place - before + n
                total += weight * (int(line[at]) if 0 <= at < len(line) else _BEYOND)
            return _mixed(total & _BITS, factor)

        lines = [
            [summed(row, j, factors[:count]) for j in range(len(row))] for row in blocks[..., k]
        ]
        for i, j in np.ndindex(blocks.shape[:2]):
            found[i, j, k] = summed([row[j] for row in lines], i, factors[count:])
    return found


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
    """W applied once: every lifs of ``genome`` on ``heights``, range block by range block."""
    p = genome.pavement
    target = np.empty(heights.shape)
    for i, (top, left, side) in enumerate(zip(*p.corners, p.side.tolist(), strict=True)):
        block = np.full((side, side), float(genome.beta[i]))
        if genome.dx[i]:
            tall, wide = genome.dy[i] // side, genome.dx[i] // side
            domain = shrunk(heights, genome.y[i], genome.x[i], tall, wide, side)
            block += isometries.apply(int(genome.iso[i]), float(genome.sigma[i]) * domain)
        target[top : top + side, left : left + side] = block
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
    """Adjoint of W without β, range block by range block."""
    p = genome.pavement
    target = np.zeros(values.shape)
    for i, (top, left, side) in enumerate(zip(*p.corners, p.side.tolist(), strict=True)):
        if genome.dx[i]:
            tall, wide = genome.dy[i] // side, genome.dx[i] // side
            block = values[top : top + side, left : left + side]
            back = isometries.apply(int(isometries.INVERSE[genome.iso[i]]), block)
            y, x = int(genome.y[i]), int(genome.x[i])
            target[y : y + tall * side, x : x + wide * side] += np.kron(
                back, np.full((tall, wide), float(genome.sigma[i]) / (tall * wide))
            )
    return target


def shared_extents(dy, dx, side, least):
    """(tall, wide, layer, kinds) as the kernel tells them."""
    extents = list(zip((dy // side).tolist(), (dx // side).tolist(), strict=True))
    kinds = sorted(e for e in set(extents) if e != (0, 0) and extents.count(e) >= least)
    layer = [kinds.index(e) if e in kinds else -1 for e in extents]
    return *zip(*extents, strict=True), layer, kinds


def area_weighted(domain, block):
    """A square domain block, averaged down to block × block pixels, seams shared by area."""
    extent = domain.shape[0]
    fine = np.kron(domain.astype(float), np.ones((block, block)))
    return fine.reshape(block, extent, block, extent).mean(axis=(1, 3))


def autosimilarity_errors(heights, block, extent, normalise="heights"):
    """µ(R, D) of every range position with the best of all domains and isometries; by the
    block's own variance, NaN where it is flat."""
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
        left = (r @ r) - explained.max(initial=0)
        if normalise == "variance":
            flat = np.ptp(heights[y : y + block, x : x + block]) == 0
            errors[y, x] = np.nan if flat else left / (r @ r)
        elif span:
            errors[y, x] = left / (block * span) ** 2
    return errors


def autosimilarity_maps(heights, block, extents, normalise="heights"):
    """(mean, least, curve): over all range blocks that hold a pixel, and D → mean of µ."""
    every = {extent: autosimilarity_errors(heights, block, extent, normalise) for extent in extents}
    errors = np.min(list(every.values()), axis=0)
    mean, least = np.full(heights.shape, np.nan), np.full(heights.shape, np.nan)
    for y, x in np.ndindex(heights.shape):
        held = errors[max(y - block + 1, 0) : y + 1, max(x - block + 1, 0) : x + 1]
        held = held[~np.isnan(held)]
        if held.size:
            mean[y, x], least[y, x] = held.mean(), held.min()
    curve = {}
    for extent, found in every.items():
        found = found[~np.isnan(found)]
        curve[extent] = found.mean() if found.size else np.nan
    return mean, least, curve


def least_errors_by_domain(heights, block, extents, normalise="heights"):
    """D → of each pixel, the least µ(R, D) of the range blocks that hold it and are not flat."""
    found = {}
    for extent in extents:
        errors = autosimilarity_errors(heights, block, extent, normalise)
        least = np.full(heights.shape, np.nan)
        for y, x in np.ndindex(errors.shape):
            if np.ptp(heights[y : y + block, x : x + block]):
                held = least[y : y + block, x : x + block]
                np.fmin(held, errors[y, x], out=held)
        found[extent] = least
    return found


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


def outline_sides(group):
    """The set of (row, column, way it faces) of a group's outer sides."""
    blocks = set(zip(*np.asarray(group).tolist(), strict=True))
    ways = {0: (-1, 0), 1: (1, 0), 2: (0, -1), 3: (0, 1)}
    return {
        (i, j, facing)
        for i, j in blocks
        for facing, (down, along) in ways.items()
        if (i + down, j + along) not in blocks
    }


def outline_step(current, brought, columns, group, start, end):
    """Mean |brought − current| over every side of a group laid from ``start`` at ``end`` that
    is not on the map's border."""
    rows = len(current) // columns
    gaps = []
    for i, j, facing in sorted(outline_sides(group)):
        y, x = i + end[0], j + end[1]
        if (y, x)[facing // 2] == (0, (rows, columns)[facing // 2] - 1)[facing % 2]:
            continue
        edge = [np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1]][facing]
        here = current[y * columns + x].astype(float)[edge]
        there = brought[(i + start[0]) * columns + j + start[1]].astype(float)[edge]
        gaps += np.abs(there - here).tolist()
    return float(np.mean(gaps)) if gaps else 0.0


def best_move(blocks, columns, group, isos, starts, ends, exchanged, tolerance, change, choice):
    """The kernel's move, each group cut out, turned by itself and laid on a copy of the map."""
    rows, found = len(blocks) // columns, []
    for k, (iso, start, end) in enumerate(zip(isos, starts, ends, strict=True)):
        tall, wide = group.max(axis=1) + 1
        table = np.arange(tall * wide).reshape(tall, wide)
        turned = isometries.apply(iso, table)
        here = [np.argwhere(turned == table[i, j])[0] for i, j in group.T]
        new = np.array(here).T
        own = (group[0] + start[0]) * columns + group[1] + start[1]
        other = (new[0] + end[0]) * columns + new[1] + end[1]
        forth, back = blocks.copy(), blocks.copy()
        forth[other] = isometries.apply(iso, blocks[own])
        back[own] = isometries.apply(isometries.INVERSE[iso], blocks[other])
        assert (new.max(axis=1) + end < (rows, columns)).all()
        step = outline_step(blocks, forth, columns, new, end, end)
        if exchanged:
            step = max(step, outline_step(blocks, back, columns, group, start, start))
        gap = np.abs(forth[other].astype(float) - blocks[other]).mean()
        if step <= tolerance and gap > change:
            found.append((step, k))
    return min(found[:choice])[1] if found else -1


def tallied(rows):
    """One dictionary label: count a row."""
    return [{one: row.count(one) for one in set(row) if one >= 0} for row in rows.tolist()]


def blocks_of(footings, count):
    """The blocks that each building of ``footings`` touches on its map of ``count`` blocks, with
    its pixels there: a dict each."""
    table = [{} for _ in footings.whole]
    for row in range(len(footings.starts) - 1):
        for k in range(footings.starts[row], footings.starts[row + 1]):
            table[footings.labels[k]][row % count] = int(footings.pixels[k])
    return table


def grown(seed, columns, owner, donor, components, buildings, standing, kept, cut, limit):
    """The kernel's region as a set, grown one rule at a time until none changes it."""
    brought = [
        set(blocks)
        for blocks, whose in zip(blocks_of(components, len(owner)), components.whose, strict=True)
        if whose == donor
    ]
    table = blocks_of(buildings, len(owner))
    region, before = set(seed.tolist()), None
    while region != before:
        before = set(region)
        for blocks in brought:
            if region & blocks:
                region |= blocks
        for one, blocks in enumerate(table):
            whose = buildings.whose[one]
            stands = {b for b in blocks if owner[b] == whose}
            hit = sum(blocks[b] for b in stands & region)
            gone = buildings.whole[one] - standing[one] + hit
            if whose != donor and hit and (kept[one] or gone > cut * buildings.whole[one]):
                region |= stands
        mask = np.zeros(len(owner), bool)
        mask[list(region)] = True
        filled = ndimage.binary_fill_holes(mask.reshape(-1, columns))
        region |= set(np.flatnonzero(filled).tolist())
    held = sum(bool(region & blocks) for blocks in brought)
    return (region, held) if len(region) <= limit else (set(), 0)


def inject_regions(
    current, brought, owner, donor, kin, size, corners, columns, components, buildings,
    kept, tolerance, cut, limit, least, most,
):  # fmt: skip
    """As the kernel, on copies: returns (current, owner, kept)."""
    current, owner, kept = current.copy(), owner.copy(), kept.copy()
    row_of = np.repeat(np.arange(len(buildings.starts) - 1), np.diff(buildings.starts))
    whose, place = np.divmod(row_of, len(owner))
    for row, column in corners.tolist():
        standing = np.zeros(len(buildings.whole), int)
        stands = owner[place] == whose
        np.add.at(standing, buildings.labels[stands], buildings.pixels[stands])
        square = [(row + i) * columns + column + j for i in range(size) for j in range(size)]
        own = kin[owner] == kin[donor]
        if own.sum() >= least:
            break
        if not 0 < (~own[square]).sum() <= most - own.sum():
            continue
        region, held = grown(
            np.array(square),
            columns,
            owner,
            donor,
            components,
            buildings,
            standing,
            kept,
            cut,
            limit,
        )
        region = sorted(region)
        if not 0 < (~own[region]).sum() <= most - own.sum():
            continue
        group = np.stack(np.divmod(region, columns))
        if (donor in components.whose and not held) or (
            outline_step(current, brought, columns, group, (0, 0), (0, 0)) > tolerance
        ):
            continue
        current[region], owner[region] = brought[region], donor
        kept[buildings.labels[(whose == donor) & np.isin(place, region)]] = True
    return current, owner, kept


def give_back(current, maps, owner, buildings):
    """As the kernel, on copies: returns (current, owner, buildings that are whole again)."""
    current, owner, mended = current.copy(), owner.copy(), 0
    row_of = np.repeat(np.arange(len(buildings.starts) - 1), np.diff(buildings.starts))
    whose, place = np.divmod(row_of, len(owner))
    for one, mine in enumerate(buildings.whose):
        blocks = np.unique(place[buildings.labels == one])
        lost = [b for b in blocks if owner[b] != mine]
        built = [b for b in lost if ((whose == owner[b]) & (place == b)).any()]
        near = np.unique(buildings.labels[(whose == mine) & np.isin(place, lost)])
        there = [(owner[place[buildings.labels == other]] == mine).any() for other in near]
        if lost and len(lost) < len(blocks) and not built and all(there):
            current[lost], owner[lost] = maps[mine][lost], mine
            mended += 1
    return current, owner, mended


def block_traits(blocks):
    """B · mean and the norm of the rest, of blocks (n, B²)."""
    side = np.sqrt(blocks.shape[1])
    rest = [np.linalg.norm(block - block.mean()) for block in blocks.astype(float)]
    return np.stack([side * blocks.mean(axis=1, dtype=float), rest], axis=1)


def alike_blocks(blocks, here, flat, flat_here, others, members, turns, slack, room):
    """The kernel's keys of each block, sorted: all pairs under the first ``turns`` isometries."""
    listed = []
    for i, block in enumerate(blocks):
        gaps = {}
        for member, other in zip(members, others, strict=True):
            for iso in range(turns):
                key = 8 * (-1 if member == here[i] else member) + iso
                gaps[key] = np.linalg.norm(block.astype(float) - isometries.apply(iso, other))
        least, level = min(gaps.values()), np.sqrt(float(flat[i]))
        if level < least or (level == least and flat_here[i]):
            listed.append([])
        else:
            listed.append(sorted(key for key in gaps if gaps[key] <= least + slack)[:room])
    return listed


def square_costs(heights, patch, weight, cell):
    """Weighted squared differences of a patch from the squares of a map that begin at each cell."""
    side = len(patch)
    rows, columns = ((extent - side) // cell + 1 for extent in heights.shape)
    costs = np.empty((rows, columns))
    for i, j in np.ndindex(costs.shape):
        cut = heights[cell * i : cell * i + side, cell * j : cell * j + side].astype(float)
        costs[i, j] = (weight * (cut - patch) ** 2).sum()
    return costs


def pair_squares(grid, maps, count, turned, index, iso, stride=1):
    """For each square: the cost of the one that ``index`` and ``iso`` (n,) chose, and the least of
    all squares of the second map that begin every ``stride`` cells from its own place. Edges of the
    map continue beyond it."""
    cell, rows, columns = grid.block, grid.rows, grid.columns
    margin = (count + 2) * cell
    beyond = np.pad(maps[1].astype(float), margin, mode="edge")
    picture, listed = np.full_like(maps[0], np.nan, dtype=float), []
    used = []

    def shown(place, turn):  # the square at a cell, with a rim of one cell
        y, x = (margin + cell * (one - 1) for one in place)
        return isometries.apply(
            turn, beyond[y : y + (count + 2) * cell, x : x + (count + 2) * cell]
        )

    def cost(place, turn, top, left, height, width):
        square = shown(place, turn)
        y, x, inner = (
            cell * top,
            cell * left,
            (slice(cell, cell * (1 + height)), slice(cell, cell * (1 + width))),
        )
        wanted = maps[0][y : y + cell * height, x : x + cell * width].astype(float)
        cut = square[inner]
        total = ((cut - wanted) ** 2).mean() + 4 * (cut.mean() - wanted.mean()) ** 2
        rim = []
        if top:
            rim.append(
                (square[:cell, inner[1]] - picture[y - cell : y, x : x + cell * width]).ravel()
            )
        if left:
            rim.append(
                (square[inner[0], :cell] - picture[y : y + cell * height, x - cell : x]).ravel()
            )
        total += (np.concatenate(rim) ** 2).mean() if rim else 0
        near = [max(abs(place[k] - one[k]) for k in (0, 1)) <= count // 2 for one in used]
        return total * (1 + 0.5 * sum(near))

    index, iso = (one.reshape(rows, columns) for one in (index, iso))
    cells = np.pad(np.arange(rows * columns).reshape(rows, columns), count, constant_values=-1)
    for top in range(0, rows, count):
        for left in range(0, columns, count):
            height, width = min(count, rows - top), min(count, columns - left)
            costs, chosen = [], []
            for turn in range(8 if turned else 1):
                for place in np.ndindex(rows + count, columns + count):
                    if any((place[k] - count - (top, left)[k]) % stride for k in (0, 1)):
                        continue
                    numbers = cells[place[0] : place[0] + count, place[1] : place[1] + count]
                    numbers = isometries.apply(turn, numbers)[:height, :width]
                    if numbers.min() < 0:
                        continue
                    at = tuple(one - count for one in place)
                    costs.append(cost(at, turn, top, left, height, width))
                    here = slice(top, top + height), slice(left, left + width)
                    if (index[here] == numbers).all() and (iso[here] == turn).all():
                        chosen.append((costs[-1], at, turn))
            (own, at, turn), *_ = chosen
            used.append(at)
            listed.append((own, min(costs)))
            cut = shown(at, turn)[cell : cell * (1 + height), cell : cell * (1 + width)]
            picture[cell * top : cell * (top + height), cell * left : cell * (left + width)] = cut
    return listed


def fabric(stones, originals, cell):
    """What a fabric of stones shows: cell by cell, −1 where nothing stands."""
    shown = np.full(np.multiply(stones.shape, cell), -1.0, np.float32)
    cuts = [
        heights[y : y + cell, x : x + cell]
        for heights in originals
        for y in range(0, heights.shape[0], cell)
        for x in range(0, heights.shape[1], cell)
    ]
    for (i, j), stone in np.ndenumerate(stones):
        if stone >= 0:
            shown[i * cell : (i + 1) * cell, j * cell : (j + 1) * cell] = isometries.apply(
                int(stone % 8), cuts[stone // 8]
            )
    return shown


def rectangle(values, iso, row, column, tall, wide):
    """What a candidate brings: tall × wide of ``values`` from (row, column) on, under ``iso``."""
    if iso in (1, 3, 4, 6):  # rows become columns
        tall, wide = wide, tall
    return isometries.apply(iso, values[row : row + tall, column : column + wide])


def cut_cost(costs, rims, laid):
    across = [
        costs[i, j, s]
        for i, j in np.ndindex(laid.shape)
        for s, (p, q) in enumerate(((i + 1, j), (i, j + 1)))
        if p < laid.shape[0] and q < laid.shape[1] and laid[i, j] != laid[p, q]
    ]
    return sum(across) + rims[laid].sum()


def least_cut(costs, rims, must, never):
    """The least cost of all ways to lay some of the blocks."""
    ways = itertools.product((False, True), repeat=must.size)
    every = (np.array(way).reshape(must.shape) for way in ways)
    return min(cut_cost(costs, rims, w) for w in every if not ((must & ~w) | (never & w)).any())


def outline_of_laid(shown, brought, top, left, laid, block):
    """Mean step along the outline of what is laid of a group, pixel by pixel.

    shown : the fabric before, −1 where nothing stands; brought : the group, from pixel (top,
    left) on. A step is |brought − shown| on either side of the outline, where both are known;
    the mean of both sides, if both are.
    """
    rows, columns = shown.shape
    high, wide = brought.shape

    def is_laid(y, x):
        inside = 0 <= y - top < high and 0 <= x - left < wide
        return inside and laid[(y - top) // block, (x - left) // block]

    def gap(y, x):
        if 0 <= y - top < high and 0 <= x - left < wide and shown[y, x] >= 0:
            return [abs(float(brought[y - top, x - left]) - float(shown[y, x]))]
        return []

    steps = []
    for y, x in np.ndindex(rows, columns):
        for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
            beside = 0 <= v < rows and 0 <= u < columns and shown[v, u] >= 0
            if beside and is_laid(y, x) and not is_laid(v, u):
                steps.append(np.mean(gap(y, x) + gap(v, u)))
    return float(np.mean(steps)) if steps else 0.0


def windows(values, side):
    """The content of each window by its corner; None where something of it is −1."""
    found = {}
    for y, x in np.ndindex(values.shape[0] - side + 1, values.shape[1] - side + 1):
        window = values[y : y + side, x : x + side]
        found[y, x] = None if (window < 0).any() else window.tobytes()
    return found


def comes_twice(values, known, exempt, side, apart, box):
    """Whether a window of ``values`` that touches the box stands at another anchor: among the
    ``known``, anchor → content, or in ``values``."""
    found = windows(values, side)
    for (y, x), content in found.items():
        touches = y + side > box[0] and x + side > box[1] and y < box[2] and x < box[3]
        if content is None or not touches or content in exempt:
            continue
        for corner, other in (*known.items(), *found.items()):
            anchored = corner[0] % apart == corner[1] % apart == 0
            if anchored and corner != (y, x) and other == content:
                return True
    return False


def mean_over_nearest(points, directions, nearest, difference):
    """Mean over all of the mean difference to the nearest, and to those as near as the last."""
    means = []
    for i, (y, x) in enumerate(points):
        gaps = {j: math.hypot(v - y, u - x) for j, (v, u) in enumerate(points) if j != i}
        reach = sorted(gaps.values())[min(nearest, len(gaps)) - 1]
        near = [j for j, gap in gaps.items() if gap <= reach + 1e-9]
        means.append(sum(difference(directions[i], directions[j]) for j in near) / len(near))
    return sum(means) / len(means)


def squared_distances(built):
    sites = np.argwhere(built)
    pixels = np.argwhere(np.ones(built.shape, bool))
    if not sites.size:
        return np.full(built.shape, -1)
    gaps = ((pixels[:, None] - sites[None]) ** 2).sum(axis=2)
    return gaps.min(axis=1).reshape(built.shape)


def nest(grounds, buildings):
    """Pixels of each ground component, the innermost built one that has it in a hole, and how
    many pixels lie in the holes of each built one."""
    corners = np.ones((3, 3))  # ground leaves a hole by a corner
    built = [buildings == k for k in range(1, buildings.max() + 1)]
    filled = [ndimage.binary_fill_holes(one, structure=corners) for one in built]
    enclosed = [int(f.sum() - one.sum()) for f, one in zip(filled, built, strict=True)]
    pixels, enclosed_by = [], []
    for label in range(1, grounds.max() + 1):
        ground = grounds == label
        around = [k for k, inside in enumerate(filled) if (inside & ground).any()]
        pixels.append(int(ground.sum()))
        enclosed_by.append(min(around, key=lambda k: filled[k].sum(), default=-1))
    return pixels, enclosed_by, enclosed


def distances(x, y, same):
    """Sum of the distances of all pairs of columns; of one table, of those of two columns."""
    pairs = itertools.combinations(x.T, 2) if same else itertools.product(x.T, y.T)
    return sum(math.dist(one, other) for one, other in pairs)


def stand_elsewhere(places, pixels, apart):
    """Whether the place of each pixel, or one around it, belongs to a pixel farther than that."""
    again = []
    for place, at in zip(places.T, pixels.T, strict=True):
        alike = (places[0] == place[0]) & (abs(places[1:].T - place[1:]).max(axis=1) <= 1)
        again.append(bool((alike & (abs(pixels.T - at).max(axis=1) > apart)).any()))
    return again


def add_moments(labels, y, x):
    """Sums of z^p z̄^q over the pixels of each building, as pairs where they are complex."""
    rows = []
    for i in range(labels.max(initial=0)):
        row, column = np.nonzero(labels == i + 1)
        z = (column - x[i]) + 1j * (row - y[i])
        back = z.conj()
        sums = [z * back, z**2, z**2 * back, z**3, (z * back) ** 2, z**3 * back, z**4]
        flat = [part for one in sums for part in (one.sum().real, one.sum().imag)]
        rows.append([flat[k] for k in (0, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13)])
    return rows


def come_again(table, slack):
    """Whether any other column differs nowhere by more than both allow."""
    count = table.shape[1]
    return [
        any(
            (abs(table[:, i] - table[:, j]) <= np.minimum(slack[:, i], slack[:, j])).all()
            for j in range(count)
            if j != i
        )
        for i in range(count)
    ]


def first_walls(built, ground, start, ray, reach):
    """How far along each ray the first built pixel is, by halves of a pixel; −1 for none."""
    distances = []
    for at, way, most in zip(start.T, ray.T, reach, strict=True):
        distances.append(-1.0)
        for far in np.arange(0, most, 0.5):
            row, column = (math.floor(one) for one in at + far * way)
            if not (0 <= row < built.shape[0] and 0 <= column < built.shape[1]):
                break
            if not ground[row, column]:
                distances[-1] = far if built[row, column] else -1.0
                break
    return distances


def distances_along(ground, lines, starts, ways, own, reach):
    """How far each ray runs to the first wall's pixel; −1 for none, or another line before. Between
    two sides of pixels that a ray crosses, its middle lies in one pixel."""
    distances = []
    rows, columns = ground.shape
    for (y, x), (down, along), number in zip(
        starts.tolist(), ways.tolist(), own.tolist(), strict=True
    ):
        distances.append(-1.0)
        sides = [
            (side - at) / step
            for at, step, most in ((y, down, rows), (x, along, columns))
            for side in np.arange(-1, most + 1) + 0.5
            if step
        ]
        begins = [0.0, *sorted(far for far in sides if far > 0)]
        for far, next_far in itertools.pairwise([*begins, begins[-1] + 1]):
            middle = (far + next_far) / 2
            row, column = math.floor(y + middle * down + 0.5), math.floor(x + middle * along + 0.5)
            inside = 0 <= row < rows and 0 <= column < columns
            if far > reach or not inside or ground[row, column] == 2:
                break
            if ground[row, column] == 1:
                distances[-1] = far
                break
            if lines[row, column] not in (0, number):
                break
    return distances


def fullest_strips(groups, width):
    """The most values of each group that lie in a strip of the width."""
    return [max(((g >= v) & (g - v <= width)).sum() for v in g) for g in groups]


def order_nearby(middles, sums, reach):
    """How much the fourfold directions of edges near each agree."""
    order = []
    for place in middles.T:
        near = [j for j, other in enumerate(middles.T) if math.dist(place, other) <= reach]
        real, imaginary, total = sums[:, near].sum(axis=1)
        order.append(math.hypot(real, imaginary) / total)
    return order


def off_squared(labels, heights, means):
    """Of each building, the squares of what its pixels are off its mean height."""
    return [((heights[labels == i + 1] - mean) ** 2).sum() for i, mean in enumerate(means)]


def sky_seen(heights, y, x, starts, down, along, slopes):
    seen = []
    for v, u in zip(y, x, strict=True):
        parts = []
        for start, end in itertools.pairwise(starts):
            steepest = 0.0
            for k in range(start, end):
                i, j = v + down[k], u + along[k]
                if 0 <= i < heights.shape[0] and 0 <= j < heights.shape[1]:
                    steepest = max(steepest, float(heights[i, j] - heights[v, u]) * slopes[k])
            parts.append(math.cos(math.atan(steepest)) ** 2)
        seen.append(sum(parts) / len(parts))
    return np.array(seen)


def count_boxes(mask, size, top, left):
    return len({((y - top) // size, (x - left) // size) for y, x in np.argwhere(mask)})


def count_around(mask, reach):
    within, room = 0, 0
    for y, x in np.argwhere(mask):
        window = mask[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1]
        within, room = within + int(window.sum()), room + window.size
    return within, room


def products(blocks, vectors):
    return np.array([[sum(b * v) for v in vectors.T] for b in blocks]).reshape(
        len(blocks), vectors.shape[1]
    )


def pool_rows(fields, window):
    return np.stack([window.astype(float) @ field for field in fields.astype(float)])


def gliding_moments(mask, size):
    boxes = np.lib.stride_tricks.sliding_window_view(mask, (size, size))
    masses = boxes.sum(axis=(2, 3))
    return int(masses.sum()), int((masses**2).sum())


def flat_zones(heights, built, step):
    """Zones in raster order, 0 on open ground, grown pixel by pixel."""
    zones = np.zeros(heights.shape, np.int32)
    for start in np.argwhere(built):
        if zones[tuple(start)]:
            continue
        number = zones.max() + 1
        zones[tuple(start)] = number
        stack = [tuple(start)]
        while stack:
            y, x = stack.pop()
            for pixel in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                inside = 0 <= pixel[0] < heights.shape[0] and 0 <= pixel[1] < heights.shape[1]
                if not inside or not built[pixel] or zones[pixel]:
                    continue
                if abs(heights[pixel] - heights[y, x]) <= step:
                    zones[pixel] = number
                    stack.append(pixel)
    return zones


def join_crumbs(heights, zones, least):
    """Rounds in which every zone too small points at a neighbour, until none has any."""
    zones = zones.copy()
    while True:
        sets = {int(a): {int(a)} for a in np.unique(zones[zones > 0])}
        for a in list(sets):
            mask = zones == a
            if mask.sum() >= least:
                continue
            facing = []
            for y, x in np.argwhere(mask):
                for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                    if 0 <= v < zones.shape[0] and 0 <= u < zones.shape[1]:
                        facing.append(int(zones[v, u]))
            claims = []
            for b in set(facing) - {0, a}:
                gap = abs(heights[zones == b].mean(dtype=float) - heights[mask].mean(dtype=float))
                claims.append((facing.count(b), -gap, int((zones == b).sum()), -b))
            if claims:
                joined = sets[a] | sets[-max(claims)[3]]
                sets |= dict.fromkeys(joined, joined)
        if all(len(joined) == 1 for joined in sets.values()):
            break
        for a, joined in sets.items():
            zones[zones == a] = -min(joined)
        zones = -zones
    for number, a in enumerate(np.unique(zones[zones > 0]), 1):
        zones[zones == a] = number
    return zones


def level(heights, zones, step):
    """Every zone at its lower median, those that then are one told apart anew, until none is."""
    zones = zones.copy()
    while True:
        roofs = heights.copy()
        numbers = np.unique(zones[zones > 0])
        for a in numbers:
            inside = sorted(heights[zones == a])
            roofs[zones == a] = inside[(len(inside) - 1) // 2]
        joined = flat_zones(roofs, zones > 0, step)
        if joined.max() == numbers.size:
            return roofs, joined
        zones = joined


def grow_zones(heights, zones, roofs):
    """The open pixel closest to a zone beside it joins it, the one that was reached first of
    equals, until no open pixel touches a zone."""
    zones, waiting = zones.copy(), []

    def reach(y, x):
        for pixel in ((y - 1, x), (y, x - 1), (y, x + 1), (y + 1, x)):
            inside = 0 <= pixel[0] < zones.shape[0] and 0 <= pixel[1] < zones.shape[1]
            if inside and zones[pixel] == -1:
                step = np.float32(abs(heights[pixel] - roofs[zones[y, x]]))
                waiting.append((step, pixel, zones[y, x]))

    for y, x in np.argwhere(zones >= 0):
        reach(y, x)
    while waiting:
        _, pixel, zone = waiting.pop(min(range(len(waiting)), key=lambda at: waiting[at][0]))
        if zones[pixel] == -1:
            zones[pixel] = zone
            reach(*pixel)
    return zones


def settled_roofs(heights, built, least, crumb_step, roof_step):
    """Roofs grown from flat zones; components without such a zone settled building by building."""
    flat = flat_zones(heights, built, roof_step)
    sizes = np.bincount(flat.ravel())
    seeds = (flat > 0) & (sizes[flat] >= least)
    parts = flat_zones(heights, built, np.inf)
    lone = built & ~np.isin(parts, parts[seeds])
    zones = np.where(seeds, flat, np.where(lone, -2, np.where(built, -1, 0)))
    medians = np.zeros(sizes.size, np.float32)
    for a in np.unique(flat[seeds]):
        inside = sorted(heights[flat == a])
        medians[a] = inside[(len(inside) - 1) // 2]
    grown = np.maximum(grow_zones(heights, zones, medians), 0)
    alone = join_crumbs(heights, flat_zones(heights, lone, crumb_step), least)
    raised = np.where(lone, heights, medians[grown]).astype(np.float32)
    zones = np.where(lone, sizes.size + alone, grown)
    return np.where(zones > 0, level(raised, zones, roof_step)[0], 0)


def outline_steps(labels, a):
    """Steps out of building a: over sides, over sides into another building, over corners."""
    padded = np.pad(labels, 1)
    sides = shared = corners = 0
    for y, x in np.argwhere(padded == a):
        for dy, dx in itertools.product((-1, 0, 1), repeat=2):
            there = padded[y + dy, x + dx]
            if there != a and dy and dx:
                corners += 1
            elif there != a:
                sides, shared = sides + 1, shared + int(there > 0)
    return sides, shared, corners


def fourfold(labels, a):
    """Σ |∇m| e^{4iθ} of the smoothed mask of building a, θ from east to south."""
    mask = np.pad(labels == a, 4, mode="edge").astype(float)
    for axis in (0, 1):
        mask = ndimage.convolve1d(mask, [1, 4, 6, 4, 1], axis=axis)
    dy, dx = np.gradient(mask)
    g = (dx + 1j * dy)[4:-4, 4:-4] * 2  # the kernel takes whole differences
    g = g[np.abs(g) > 0.5]
    return (g**4 / np.abs(g) ** 3).sum()


def least_shapes(mask):
    """Pixels of the hull, long and short side of the least box, diameter of the least circle."""
    y, x = np.nonzero(mask)
    hull = shapely.convex_hull(shapely.multipoints(np.column_stack([x, y]).astype(float)))
    grid = np.stack(np.meshgrid(*map(np.arange, mask.shape[::-1])), axis=-1).reshape(-1, 2)
    inside = int(shapely.covers(hull, shapely.points(grid.astype(float))).sum())
    boxes = [(1, -1, 1.0, 1.0)]
    corners = shapely.get_coordinates(hull).astype(int)
    if len(corners) > 1:
        boxes = []
        for dx, dy in np.diff(corners, axis=0):
            step, length = math.gcd(dx, dy), math.hypot(dx, dy)
            along = np.ptp(x * dx + y * dy) + step
            across = np.ptp(y * dx - x * dy) + step
            long, short = max(along, across), min(along, across)
            boxes.append((long * short / length**2, -long / length, long / length, short / length))
    least = min(boxes, key=lambda box: (round(box[0], 9), box[1]))
    corners = np.concatenate([np.column_stack([y + v, x + u]) for v in (0, 1) for u in (0, 1)])
    diameter = 2 * shapely.minimum_bounding_radius(shapely.multipoints(corners.astype(float)))
    return inside, least[2:], diameter


def courtyards(labels, a):
    """Holes of building a, and the pixels of open ground in them."""
    outside = np.pad(labels != a, 1, constant_values=True)
    pieces, count = ndimage.label(outside, np.ones((3, 3)))
    return count - 1, int(((pieces != pieces[0, 0])[1:-1, 1:-1] & (labels == 0)).sum())


def simple(lines, y, x):
    """Whether the ground around (y, x) is one piece that reaches a gap beside it, and its size."""
    ground = lines[y - 1 : y + 2, x - 1 : x + 2].copy()
    ground[1, 1] = False
    gaps = ~ground
    gaps[1, 1] = False
    labels, _ = ndimage.label(gaps)
    beside = {labels[0, 1], labels[1, 0], labels[1, 2], labels[2, 1]} - {0}
    pieces = ndimage.label(ground, structure=np.ones((3, 3)))[1]
    return pieces == 1 and len(beside) == 1, int(ground.sum())


def opposed(built, nearest, y, x):
    if (built[y - 1, x] and built[y + 1, x]) or (built[y, x - 1] and built[y, x + 1]):
        return True
    own = np.array([y, x]) - nearest[:, y, x]
    for v, u in itertools.product(range(y - 1, y + 2), range(x - 1, x + 2)):
        other = np.array([v, u]) - nearest[:, v, u]
        lengths = math.hypot(*own) * math.hypot(*other)
        if lengths and own @ other <= -0.5 * lengths * (1 - 1e-12):
            return True
    return False


def neighbours(lines, y, x):
    around = itertools.product(range(y - 1, y + 2), range(x - 1, x + 2))
    return [pixel for pixel in around if lines[pixel] and pixel != (y, x)]


def thin(built, squares, nearest, solid, depth):
    lines = ~built
    order = sorted((squares[p], *p) for p in np.ndindex(built.shape) if lines[p] and not solid[p])
    order = [(int(y), int(x)) for _, y, x in order]
    between = {p for p in order if opposed(built, nearest, *p)}
    for p in order:
        if p not in between and simple(lines, *p)[0]:
            lines[p] = False
    changed = True
    while changed:
        before = None
        while before is None or not np.array_equal(before, lines):
            before = lines.copy()
            for p in order:
                can, count = simple(lines, *p)
                if lines[p] and can and (count > 1 or p not in between):
                    lines[p] = False
        changed = False
        for p in order:
            if not lines[p] or len(neighbours(lines, *p)) != 1:
                continue
            path = [p, *neighbours(lines, *p)]
            while not solid[path[-1]] and len(neighbours(lines, *path[-1])) == 2:
                path += [q for q in neighbours(lines, *path[-1]) if q != path[-2]]
            end = path[-1]
            if not solid[end] and len(neighbours(lines, *end)) == 1:
                continue
            if math.dist(p, end) + math.sqrt(squares[p]) - math.sqrt(squares[end]) <= depth:
                changed = True
                for q in path[:-1]:
                    lines[q] = False
    return lines


def widths_across(squares, lines):
    root, widths = np.sqrt(np.abs(squares)), np.zeros(lines.shape)
    for y, x in np.argwhere(lines):
        down, along = root[y - 1, x] + root[y + 1, x], root[y, x - 1] + root[y, x + 1]
        widths[y, x] = min(down, along) + 1
    return widths


def link_lengths(lines):
    lengths = []
    for y, x in np.argwhere(lines):
        total = 0.0
        for v, u in neighbours(lines, y, x):
            if not (v != y and u != x and (lines[v, x] or lines[y, u])):
                total += math.dist((y, x), (v, u))
        lengths.append(total / 2)
    return np.array(lengths)


# -- pavements of leaves -------------------------------------------------------------------


def tile(sides, height, width):
    """Corners of squares laid one after the other, each at the first bare pixel; None if they do
    not tile the map."""
    index = np.full((height, width), -1)
    corners = []
    for number, side in enumerate(sides):
        bare = np.argwhere(index < 0)
        if not len(bare):
            return None
        y, x = bare[0]
        part = index[y : y + side, x : x + side]
        if part.shape != (side, side) or (part >= 0).any():
            return None
        part[:] = number
        corners.append((y, x))
    return None if (index < 0).any() else (index, corners)


def squares(raster, top, left, side):
    """The squares (top, left, side) of a raster, one after the other."""
    for y, x, s in zip(top, left, side, strict=True):
        yield raster[y : y + s, x : x + s]


def part_place(iso, whole, down, along, side):
    """(row, column) of the north-west pixel of what the square of ``side`` at (down, along) of a
    block of ``whole`` px shows, where the block shows a square of its side under ``iso``."""
    shown = isometries.apply(int(iso), np.arange(whole * whole).reshape(whole, whole))
    part = shown[down : down + side, along : along + side]
    return divmod(int(part.min()), whole)


def in_bounds(genome_of):
    """Whether a genome with these arrays (a dict, with pavement, sigma_max, cities) is legal."""
    p, g = genome_of["pavement"], genome_of
    for i, side in enumerate(p.side.tolist()):
        x, y, dx, dy = (int(g[name][i]) for name in ("x", "y", "dx", "dy"))
        if not (abs(g["sigma"][i]) <= np.float32(g["sigma_max"]) and np.isfinite(g["beta"][i])):
            return False
        if max(g["iso"][i], g["turn"][i]) > 7 or g["source"][i] < 0:
            return False
        if max(g["parent"][i], g["other"][i]) >= len(g["cities"]) or not 0 <= g["part"][i] <= 1:
            return False
        if dx == 0:
            if g["sigma"][i] or dy or x or y or g["iso"][i]:
                return False
            continue
        if dx <= side or dy <= side or dx % side or dy % side:
            return False
        if x < 0 or y < 0 or x + dx > p.width or y + dy > p.height:
            return False
    return True


def shown_pixels(genome):
    """For each pixel of a map what its lifs makes it of: σ, β, the pixels of the domain block that
    are averaged (first row, first column, rows, columns); and its stone: city, row, column, turn.
    """
    p = genome.pavement
    shown = {}
    for i, (y, x, side) in enumerate(zip(*p.corners, p.side, strict=True)):
        domain = isometries.apply(int(genome.iso[i]), np.arange(side * side).reshape(side, side))
        stone = isometries.apply(int(genome.turn[i]), np.arange(side * side).reshape(side, side))
        row, column = divmod(int(genome.source[i]), 32768)
        tall, wide = int(genome.dy[i]) // side, int(genome.dx[i]) // side
        for a in range(side):
            for b in range(side):
                v, u = divmod(int(domain[a, b]), side)
                r, c = divmod(int(stone[a, b]), side)
                read = (int(genome.y[i]) + v * tall, int(genome.x[i]) + u * wide, tall, wide)
                read = read if tall else None
                rest = genome.cities[genome.other[i]], float(genome.part[i])
                code = float(genome.sigma[i]), float(genome.beta[i]), read, rest
                from_ = genome.cities[genome.parent[i]], row + r, column + c, int(genome.turn[i])
                shown[int(y) + a, int(x) + b] = code, from_
    return shown


def whole_buildings(genome, labels):
    """The buildings, ``labels`` of each city by name, that the ``genome`` shows whole: (city,
    building, isometry, pixels in order) each; and how many pixels show any."""
    shown = {place: stone for place, (_, stone) in shown_pixels(genome).items()}
    places = {}
    for place, (city, row, column, turn) in shown.items():
        places.setdefault((city, row, column), []).append((place, turn))
    whole, built = [], 0
    for city, of_city in labels.items():
        built += sum(len(at) for (c, *at_), at in places.items() if c == city and of_city[*at_])
        for building in range(1, of_city.max() + 1):
            pixels = np.argwhere(of_city == building).tolist()
            for (y, x), turn in places.get((city, *pixels[0]), []):
                square = isometries.apply(turn, np.arange(4).reshape(2, 2)).ravel().tolist()
                corner, east, south, _ = (np.array(divmod(one, 2)) for one in square)
                laid = {}
                for pixel in pixels:
                    # a step to the south of the child goes this far in the city
                    step = np.subtract(pixel, pixels[0])
                    at = y + int(step @ (south - corner)), x + int(step @ (east - corner))
                    laid[at] = (city, *pixel, turn)
                if all(shown.get(at) == stone for at, stone in laid.items()):
                    whole.append((city, building, turn, sorted(laid)))
    return whole, built


def mergeable(genome, most):
    """Whether any four range blocks of ``genome`` that make up one of at most ``most`` px, at a
    multiple of its side, show what one lifs could show."""
    p = genome.pavement
    place = {(int(y), int(x)): i for i, (y, x) in enumerate(zip(*p.corners, strict=True))}
    for (y, x), i in place.items():
        s = int(p.side[i])
        four = [place.get((y + a * s, x + b * s)) for a in (0, 1) for b in (0, 1)]
        if 2 * s > most or y % (2 * s) or x % (2 * s) or None in four:
            continue
        if any(p.side[k] != s for k in four):
            continue
        if _continued(genome, four, s):
            return True
    return False


def _continued(genome, four, s):
    same = [
        len({getattr(genome, name)[k].item() for k in four}) == 1
        for name in ("sigma", "beta", "dx", "dy", "iso", "parent", "turn", "other", "part")
    ]
    if not all(same):
        return False
    i = four[0]
    corners = [(0, 0), (0, 1), (1, 0), (1, 1)]
    for iso, place, steps in (
        (genome.iso[i], [(genome.y[k], genome.x[k]) for k in four], (genome.dy[i], genome.dx[i])),
        (genome.turn[i], [divmod(int(genome.source[k]), 32768) for k in four], (s, s)),
    ):
        # the quadrant of the whole that each quadrant of the range block is made of
        order = isometries.apply(int(iso), np.arange(4).reshape(2, 2)).ravel()
        found = {
            (int(y) - corners[q][0] * int(steps[0]), int(x) - corners[q][1] * int(steps[1]))
            for (y, x), q in zip(place, order.tolist(), strict=True)
        }
        if len(found) > 1 or min(min(found)) < 0:
            return False
    return True


def shares_of_square(y, x, step, shape):
    """How much of a square of ``step`` px at (y, x) each pixel of a raster makes up, summing to
    1."""
    shares = np.zeros(shape)
    for i in range(shape[0]):
        for j in range(shape[1]):
            tall = max(0.0, min(y + step, i + 1) - max(y, i))
            wide = max(0.0, min(x + step, j + 1) - max(x, j))
            shares[i, j] = tall * wide / step**2
    return shares


def room(labels, built, number, facades):
    """Corner, cells, weights and built share of a street block; what lies beyond the map is no
    street."""
    whole = labels == number
    rows, columns = np.nonzero(whole)
    top, left = rows.min(), columns.min()
    within = np.s_[top : rows.max() + 1, left : columns.max() + 1]
    padded = np.pad(whole, 1, constant_values=True)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    outline, own = whole & ~inner, whole & built
    street = ndimage.binary_propagation(outline & ~own, mask=whole & ~own)
    facing = own & ndimage.binary_dilation(street)
    weights = np.zeros(labels.shape, np.float32)
    parts = [(whole, 1.0), (outline, -2.0)]
    parts += [(facing, facades), (street, -facades)] if facades else []
    for where, worth in parts:
        weights[where] += np.float32(worth / max(np.count_nonzero(where), 1))
    return (top, left), whole[within], weights[within], own.sum() / whole.sum()


def strays(heights, intended, top, left, side, grain, limit, ignored):
    """Where squares differ from the intended heights; of large squares the parts of a grid."""
    error = (heights - intended) ** 2
    where = np.zeros(error.shape, bool)
    for y, x, s in zip(top, left, side, strict=True):
        parts = [(y, x, s)]
        if s > grain:
            parts = [(v, u, grain) for v in range(y, y + s, grain) for u in range(x, x + s, grain)]
        for v, u, wide in parts:
            total = sum(error[v : v + wide, u : u + wide].ravel().tolist())
            where[v : v + wide, u : u + wide] = total > limit * wide**2
    return where & ~ignored


def block_moments(before, after, read, reads, free, top, left, side):
    """The largest move, and sums of ones, s, t, s², t² and s·t over the free pixels of squares."""
    moments = []
    for y, x, wide in zip(top, left, side, strict=True):
        within = np.s_[y : y + wide, x : x + wide]
        own = free[within]
        moved = np.abs(after - before)[within] + np.abs(reads - read)[within]
        s, t = (values[within][own].astype(float) for values in (reads, after))
        products = (np.ones(own.sum()), s, t, s * s, t * t, s * t)
        moments.append([moved[own].max(initial=0), *(sum(one.tolist()) for one in products)])
    return np.array(moments).T


@dataclass
class Fitting:
    """What `best_fit` finds: isometry, top and left; score; where buildings stay."""

    place: tuple
    score: float
    kept: np.ndarray


def best_fit(
    built, components, stale, block, weights, density, least, spread, draws, taken, step=2
):
    """Of the places of a donor, under each isometry some drawn of the best; of these, what is best
    without the components that lie partly outside."""
    (rows, columns), area, best = built.shape, block.sum(), None
    for iso in range(8):
        tall, wide = isometries.apply(int(isometries.INVERSE[iso]), block).shape
        tops, lefts = range(rows - tall + 1), range(columns - wide + 1)

        def laid(raster, top, left, iso=iso, tall=tall, wide=wide):
            return isometries.apply(iso, raster[top : top + tall, left : left + wide])

        def worth(top, left, laid=laid):
            """Before anything is left out: all sums of what cells count."""
            counts = laid(built - stale, top, left) * block
            return (weights * counts).sum() - abs(counts.sum() / area - density) / 2

        def worth_of(kept, top, left, laid=laid):
            share = kept.sum() / area
            less = (laid(stale, top, left) * kept).sum() / area
            return weights[kept].sum() - less - abs(share - density) / 2

        def free(top, left, tall=tall, wide=wide):
            inside = np.zeros(built.shape, bool)
            inside[taken[0] : taken[2], taken[1] : taken[3]] = True
            return not inside[top : top + tall, left : left + wide].any()

        every = {(y, x): worth(y, x) for y in tops for x in lefts if free(y, x)}
        coarse = {place: one for place, one in every.items() if not np.any(np.mod(place, step))}
        if not coarse:
            continue
        among = [p for p in sorted(coarse) if coarse[p] >= max(coarse.values()) - spread]
        for draw in sorted(draws[iso]):
            y, x = among[int(draw * len(among))]
            near = [p for p in sorted(every) if abs(p[0] - y) < step and abs(p[1] - x) < step]
            y, x = max(near, key=every.get)
            seen = laid(components, y, x)
            whole = [
                n
                for n in np.unique(seen[block])
                if n > 0 and (seen[block] == n).sum() == (components == n).sum()
            ]
            kept = np.isin(seen, whole) & block
            score = worth_of(kept, y, x)
            enough = kept.sum() >= max(least, 1)
            if enough and (best is None or score > best.score + 1e-7):
                best = Fitting((iso, y, x), score, kept)
    return best


def cells_laid(heights, whose, row, column, iso, cell):
    """A map of cells of others, each turned; bare ground where ``whose`` is beyond the last."""
    found = np.zeros(heights.shape[1:], np.float32)
    for i, j in np.ndindex(whose.shape):
        if whose[i, j] < len(heights):
            y, x = row[i, j] * cell, column[i, j] * cell
            square = heights[whose[i, j], y : y + cell, x : x + cell]
            here = np.s_[i * cell : (i + 1) * cell, j * cell : (j + 1) * cell]
            found[here] = isometries.apply(int(iso[i, j]), square)
    return found


def stones_of_cells(genome, cell):
    """City, row and column of the source's cell that each cell of a map shows: every lifs lays the
    pixels of its stone, turned."""
    height, width = genome.pavement.height, genome.pavement.width
    pixels = np.zeros((3, height, width), int)
    for k, (top, left, side) in enumerate(
        zip(*genome.pavement.corners, genome.pavement.side, strict=True)
    ):
        y, x = (int(one[k]) for one in unpacked(genome.source))
        stone = np.mgrid[y : y + side, x : x + side]
        here = np.s_[top : top + side, left : left + side]
        pixels[0][here] = genome.parent[k]
        for axis in (0, 1):
            pixels[axis + 1][here] = isometries.apply(int(genome.turn[k]), stone[axis])
    city = pixels[0, ::cell, ::cell]
    cells = pixels.reshape(3, height // cell, cell, width // cell, cell).min(axis=(2, 4))
    return np.stack([city, cells[1] // cell, cells[2] // cell])


def distinct(looks, apart):
    """Indices of looks, each taken that differs from all taken before by more than 3 m (30 dm) in
    more than the share ``apart`` of its cells."""
    taken = []
    for index, look in enumerate(looks):
        gaps = [np.abs(look.astype(int) - looks[other].astype(int)) for other in taken]
        if all(np.mean(gap > 30) > apart for gap in gaps):
            taken.append(index)
    return taken


def distinct_in_turn(looks, apart, count):
    """As `distinct`, at most ``count``; then, of those left, by smaller shares of ``apart``."""
    taken = []
    for share in (1.0, 0.8, 0.6, 0.4, 0.2):
        for index in range(len(looks)):
            gaps = [np.abs(looks[index].astype(int) - looks[one].astype(int)) for one in taken]
            differs = all(
                np.count_nonzero(gap > 30) > int(share * apart * gap.size) for gap in gaps
            )
            if differs and len(taken) < count and index not in taken:
                taken.append(index)
    return taken


def least_first(losses, reference, count):
    """Drop ``count`` rows of a front, each time the one that adds least to the hypervolume of those
    left, of equal ones the last; what a row adds is measured by the library, of all that are left,
    once it may be the least."""
    known = contributions(losses, reference)
    left, fresh = np.ones(len(losses), bool), np.ones(len(losses), bool)
    dropped = []

    def measure(row):
        others = np.maximum(losses[left], losses[row])[np.flatnonzero(left) != row]
        shared = hypervolume(others, reference) if len(others) else 0.0
        known[row] = max(float(np.prod(reference - losses[row])) - shared, 0.0)
        fresh[row] = True

    for _ in range(count):
        while True:
            row = min(np.flatnonzero(left), key=lambda one: (known[one], -one))
            if fresh[row]:
                break
            measure(row)
        dropped.append(row)
        left[row], fresh[:] = False, False
    for row in np.flatnonzero(left & ~fresh):
        measure(row)
    return dropped, known


def ancestry(ids, parents, identifier):
    """Which rows of a log are an individual or what it descends from, followed one by one; None if
    it is not there. Of several rows of one id the last tells its parents."""
    known = dict(zip(ids, parents, strict=True))
    if identifier not in known:
        return None
    found, further = set(), [identifier]
    while further:
        one = further.pop()
        if one in known and one not in found:
            found.add(one)
            further += known[one]
    return [one in found for one in ids]


def tournament(size, key, count, rng, drawn=2):
    """Indices of ``count`` of ``size``, each the one of so many ``drawn`` of those left with the
    least ``key``."""
    chosen, left = [], []
    for _ in range(count):
        left = left or list(range(size))
        best = min((left[one] for one in rng.integers(len(left), size=drawn)), key=key)
        chosen.append(best)
        left.remove(best)
    return chosen


def tournament_within(groups, count, rng):
    """Indices in order of goodness: the second of two drawn comes from the group of the first."""
    chosen, free = [], list(range(len(groups)))
    for _ in range(count):
        free = free or list(range(len(groups)))
        first = free[int(rng.integers(len(free)))]
        rivals = [at for at in free if groups[at] == groups[first]]
        best = min(first, rivals[int(rng.integers(len(rivals)))])
        chosen.append(best)
        free.remove(best)
    return chosen


def thin_out(pool, places, looks):
    """Of the two most similar, the worse leaves, unless it is among the best half of places."""
    stays = list(pool) if places else []
    safe = stays[: -(-places // 2)]
    while len(stays) > places:
        least = None
        for first, one in enumerate(stays):
            for other in stays[first + 1 :]:
                if other not in safe:
                    apart = sum(
                        abs(int(a) - int(b)) > 30
                        for a, b in zip(looks[one], looks[other], strict=True)
                    )
                    if least is None or apart < least[0]:
                        least = apart, other
        stays.remove(least[1])
    return stays


def fit_places(number, row, column, turns, reach):
    """The plane through the places around each pixel, by least squares."""
    height, width = number.shape
    places, slopes = np.zeros((2, height, width)), np.zeros((4, height, width))
    for y, x in np.argwhere(number >= 0).tolist():
        steps, found = [], []
        for yy in range(max(y - reach, 0), min(y + reach + 1, height)):
            for xx in range(max(x - reach, 0), min(x + reach + 1, width)):
                step = np.array([yy - y, xx - x])
                place = np.array([row[yy, xx] - row[y, x], column[yy, xx] - column[y, x]])
                far = np.hypot(*step)
                aside = place - turns[:2, y, x] * step[0] - turns[2:, y, x] * step[1]
                near = abs(np.hypot(*place) - far) <= 0.25 * far + 1.5
                near = near and np.hypot(*aside) <= 0.8 * far + 1.5
                if number[yy, xx] == number[y, x] and near:
                    steps.append([1.0, *step])
                    found.append(place)
        places[:, y, x], slopes[:, y, x] = (row[y, x], column[y, x]), turns[:, y, x]
        if len(steps) >= 9 and np.linalg.matrix_rank(np.array(steps)) == 3:
            plane = np.linalg.lstsq(np.array(steps), np.array(found), rcond=None)[0]
            places[:, y, x] += plane[0]
            slopes[:, y, x] = plane[1:].ravel()
    return places, slopes


def most_distinct(looks, apart):
    """How many of some looks differ pairwise at most, of all choices of them."""
    pairs = {
        (i, j): len(distinct([looks[i], looks[j]], apart)) == 2
        for i, j in itertools.combinations(range(len(looks)), 2)
    }
    for count in range(len(looks), 1, -1):
        for some in itertools.combinations(range(len(looks)), count):
            if all(pairs[pair] for pair in itertools.combinations(some, 2)):
                return count
    return min(len(looks), 1)


# -- walls ----------------------------------------------------------------------------------------


def pieces(values):
    """Int32 labels of pixels of one value, over 0, that touch by sides."""
    labels, count = np.zeros(values.shape, np.int32), 0
    for value in np.unique(values[values > 0]):
        found, more = ndimage.label(values == value)
        labels[found > 0] = found[found > 0] + count
        count += more
    return labels


def framed(labels):
    return np.pad(labels, 1, constant_values=-1)


def touches_itself(labels):
    """Whether a label over 0 meets itself at a pixel's corner alone."""
    inside = framed(labels)
    for y, x in np.ndindex(inside.shape[0] - 1, inside.shape[1] - 1):
        (a, b), (c, d) = inside[y : y + 2, x : x + 2]
        if (a == d > 0 and a not in (b, c)) or (b == c > 0 and b not in (a, d)):
            return True
    return False


def edge_between(labels, one, other):
    """The labels left and right of the pixel's edge from vertex ``one`` to ``other``, (x, y)."""
    inside = framed(labels)
    (x, y), (dx, dy) = one, (other[0] - one[0], other[1] - one[1])
    # the pixel whose middle lies half a pixel to the side of the edge's middle
    middle = np.array([x + dx / 2, y + dy / 2])
    left, right = middle + np.array([dy, -dx]) / 2, middle + np.array([-dy, dx]) / 2
    return tuple(
        int(inside[int(np.floor(p[1])) + 1, int(np.floor(p[0])) + 1]) for p in (left, right)
    )


def wall_edges(labels):
    """The pixels' edges between two labels of which one is over 0, as pairs of vertices (x, y)."""
    inside, edges = framed(labels), set()
    height, width = labels.shape
    for y, x in itertools.product(range(height + 1), range(width + 1)):
        for dx, dy, a, b in (
            (1, 0, (y, x + 1), (y + 1, x + 1)),
            (0, 1, (y + 1, x), (y + 1, x + 1)),
        ):
            if x + dx <= width and y + dy <= height:
                first, second = inside[a], inside[b]
                if first != second and max(first, second) > 0:
                    edges.add(frozenset([(x, y), (x + dx, y + dy)]))
    return edges


def party_walls(labels, least):
    """Pairs of labels over 0 that share ``least`` pixels' edges and more."""
    counts = {}
    for one, other in ((labels[1:], labels[:-1]), (labels[:, 1:], labels[:, :-1])):
        for a, b in zip(one.ravel().tolist(), other.ravel().tolist(), strict=True):
            if a != b and min(a, b) > 0:
                pair = min(a, b), max(a, b)
                counts[pair] = counts.get(pair, 0) + 1
    return [pair for pair, count in counts.items() if count >= least]


def links_of(lines):
    """Pairs of pixels of ``lines`` (border left free) that are linked: side by side; or at a
    corner, unless a third joins them; but of four in a square not the upper two."""
    found = set()
    for y, x in np.argwhere(lines).tolist():
        if lines[y, x + 1] and not (lines[y + 1, x] and lines[y + 1, x + 1]):
            found.add(frozenset([(y, x), (y, x + 1)]))
        if lines[y + 1, x]:
            found.add(frozenset([(y, x), (y + 1, x)]))
        for side in (-1, 1):
            if lines[y + 1, x + side] and not (lines[y + 1, x] or lines[y, x + side]):
                found.add(frozenset([(y, x), (y + 1, x + side)]))
    return found


def exits(frame, squares):
    """Of each label of ``frame`` from 1 on the pixel where ``squares`` is largest, the middle one,
    row by row, of several (the first of two)."""
    out = np.zeros(frame.shape, bool)
    for label in range(1, frame.max(initial=0) + 1):
        own = np.argwhere(frame == label)
        values = np.array([squares[y, x] for y, x in own])
        best = own[values == values.max()]
        out[tuple(best[(len(best) - 1) // 2])] = True
    return out


def spurs_taken(first, last, lengths, bound, fixed):
    """Which edges go: by length, each that ends at a node of its own, not ``fixed``, and is shorter
    than the ``bound`` at its other end, while three edges' ends and more are there."""
    alive = np.ones(len(first), bool)
    for k in np.argsort(lengths):
        ends = np.concatenate([first[alive], last[alive]])
        one, other = first[k], last[k]
        if (ends == one).sum() == 1:
            one, other = other, one
        ends_there, meets = (ends == other).sum() == 1, (ends == one).sum() >= 3
        if ends_there and meets and not fixed[other] and lengths[k] < bound[one]:
            alive[k] = False
    return alive


def straight_streets(first, last, headings, least):
    """Sets of edges that go on into each other: at each node, of all pairs of free ends the one
    that turns least, again and again."""
    groups = [{k} for k in range(len(first))]
    for node in sorted({*first.tolist(), *last.tolist()}):
        free = [(k, 0) for k in range(len(first)) if first[k] == node]
        free += [(k, 1) for k in range(len(first)) if last[k] == node]
        while True:
            pairs = [
                (-float((headings[a] * headings[b]).sum()), a, b)
                for a, b in itertools.combinations(free, 2)
            ]
            pairs = [pair for pair in pairs if pair[0] > least]
            if not pairs:
                break
            _, a, b = max(pairs)
            free.remove(a)
            free.remove(b)
            one, other = (next(g for g in groups if end[0] in g) for end in (a, b))
            if one is not other:
                groups.remove(other)
                one |= other
    return {frozenset(group) for group in groups}


def thickness(ground, squares, across, widest, spare, thick):
    """Of each pixel of ``ground`` the largest ``across`` at a pixel whose disc, of the root of its
    ``squares``, covers it: larger ones first, none that another contains but for half a pixel."""
    spare, thick = spare.astype(np.float32), thick.copy()
    rows, columns = ground.shape
    inner = [(y, x) for y, x in np.argwhere(ground).tolist() if 0 < y < rows - 1]
    centres = [(y, x) for y, x in inner if 0 < x < columns - 1 and squares[y, x] < widest]
    for y, x in sorted(centres, key=lambda at: -squares[at]):
        own = math.sqrt(squares[y, x])
        if spare[y, x] >= own - 0.5:
            thick[y, x] = max(thick[y, x], across[y, x])
            continue
        for v, u in np.argwhere(ground).tolist():
            if (v - y) ** 2 + (u - x) ** 2 < squares[y, x]:
                thick[v, u] = max(thick[v, u], across[y, x])
                spare[v, u] = max(spare[v, u], np.float32(own - math.hypot(v - y, u - x)))
    return thick


def evened(path, squares, ends, rounds):
    """The points of a line: ``ends``; between them the middles between walls next to its pixels,
    moved ``rounds`` times to the mean of twice themselves and those beside; none farther off its
    pixel than half of what is free about it, or at all where that is too little."""
    own = np.array([divmod(p, squares.shape[1]) for p in path], float)
    away = np.sqrt(squares)
    points, most = own.copy(), np.zeros(len(path))
    for i, (y, x) in enumerate(own.astype(int).tolist()):
        clear = away[y, x] - math.sqrt(0.5)
        most[i] = clear / 2 if 0.75 * clear**2 >= 0.5 else 0
        up, down, left, right = away[y - 1, x], away[y + 1, x], away[y, x - 1], away[y, x + 1]
        if left + right < up + down:
            points[i, 1] += np.clip((right - left) / 2, -0.5, 0.5)
        else:
            points[i, 0] += np.clip((down - up) / 2, -0.5, 0.5)
        points[i] = own[i] + shortened(points[i] - own[i], most[i])
    points[0], points[-1] = ends
    for _ in range(rounds):
        mean = (points[:-2] + 2 * points[1:-1] + points[2:]) / 4
        for i, point in enumerate(mean, start=1):
            points[i] = own[i] + shortened(point - own[i], most[i])
    return points


def shortened(way, most):
    length = np.hypot(*way)
    return way if length <= most else way * (most / length)


def filled(corners, height, width):
    """Of each pixel the nearest triangle at its centre, −1 for none, and its depth: every triangle
    is asked at every pixel."""
    surface = np.full((height, width), -1)
    depth = np.full((height, width), -np.inf, np.float32)
    for row in range(height):
        for column in range(width):
            point = np.array([column + 0.5, row + 0.5, 1.0])
            for k, corner in enumerate(corners):
                flat = np.column_stack([corner[:, :2], np.ones(3)]).T
                if abs(np.linalg.det(flat)) < 1e-9:
                    continue
                weights = np.linalg.solve(flat, point)
                z = np.float32(weights @ corner[:, 2])
                if weights.min() >= -1e-9 and z > depth[row, column]:
                    surface[row, column], depth[row, column] = k, z
    return surface, depth


def lit_by_the_sun(depth, surface, first, onto, seen, bias):
    """Where the sun reaches: each pixel is looked up in what the sun sees."""
    lit = np.ones(depth.shape, bool)
    for (row, column), k in np.ndenumerate(surface):
        if k >= 0:
            point = np.array([column + 0.5, first + row + 0.5, depth[row, column], 1.0])
            u, v, w = onto @ point
            inside = 0 <= u < seen.shape[1] and 0 <= v < seen.shape[0]
            if inside and seen[int(v), int(u)] > w + bias[k]:
                lit[row, column] = False
    return lit


def dark_edges(depth, surface, plane, jump, dark):
    """Share of light left at each pixel: ``dark`` at the last of a plane before what lies behind,
    what is empty, or, to the right and below, what turns off at one depth."""
    ways = {(1, 0): True, (-1, 0): False, (0, 1): True, (0, -1): False}
    edge = np.ones(depth.shape, np.float32)
    for (row, column), k in np.ndenumerate(surface):
        for (down, right), turning in ways.items():
            y, x = row + down, column + right
            if k < 0 or not (0 <= y < depth.shape[0] and 0 <= x < depth.shape[1]):
                continue
            nearer = depth[row, column] - depth[y, x]
            behind, level = nearer > jump, nearer >= -jump
            other = surface[y, x] < 0 or plane[surface[y, x]] != plane[k]
            if surface[y, x] < 0 or (other and (behind or (level and turning))):
                edge[row, column] = dark
    return edge


def paint_mixed(surface, lit, edge, colours, finer):
    """Means of ``finer`` squared pixels each, at most 255, and where any of them is a surface."""
    mixed = colours[lit.astype(int), surface] * edge[..., None]
    height, width = np.array(surface.shape) // finer
    blocks = mixed.reshape(height, finer, width, finer, 3)
    some = (surface >= 0).reshape(height, finer, width, finer)
    return np.minimum(blocks.mean(axis=(1, 3)), 255), some.any(axis=(1, 3))


def shared_areas(matrices, which, where, shapes, grounds):
    """Areas that shapes under affine maps share with grounds."""
    found = []
    for ((a, b, c), (d, e, f)), k, ground in zip(matrices, which, where, strict=True):
        laid = shapely.affinity.affine_transform(shapes[k], [a, b, d, e, c, f])
        found.append(shapely.intersection(laid, grounds[ground]).area)
    return found


def tried_by_points(
    numbers, flips, shape, where, points, inside, sides, sizes, cells, low, step, areas
):
    """IoU by points that lie on a building's cells, less four times the share on forbidden ones."""
    found = []
    for (turn, along, across, x, y), flip, j, k in zip(numbers, flips, shape, where, strict=True):
        own = points[inside[j]] * sides[j] * (along * flip, across)
        c, s = math.cos(turn), math.sin(turn)
        laid = own @ np.array([[c, s], [-s, c]]) + (x, y)
        column, row = np.floor((laid - low[k]) / step[k]).astype(int).T
        high, wide = cells.shape[1:]
        on = (row >= 0) & (row < high) & (column >= 0) & (column < wide)
        what = np.where(on, cells[k][row.clip(0, high - 1), column.clip(0, wide - 1)], 0)
        if not len(what):
            found.append(0.0)
            continue
        area = sizes[j] * along * across
        common = (what == 2).mean() * area
        found.append(common / (area + areas[k] - common) - 4 * (what == 0).mean())
    return found


def first_cells(heights, side, origins, ways):
    """What lines meet first, three times the cell and 0 for its roof, 1 for a wall that faces east
    or west, 2 north or south; -1 for nothing: every line is asked of every cell's column. Heights
    by rows from the north, NaN where nothing is; lines, (n, 3), in metres from the middle."""
    rows, columns = heights.shape
    row, column = np.nonzero(~np.isnan(heights))
    west, south = (column - columns / 2) * side, (rows / 2 - row - 1) * side
    lows = np.stack([west, south, np.zeros(len(row))])[:, None]  # (3, lines, cells)
    highs = np.stack([west + side, south + side, heights[row, column].astype(float)])[:, None]
    start, way = origins.T[..., None], ways.T[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (lows - start) / way, (highs - start) / way
    enters, leaves = np.minimum(one, other), np.maximum(one, other)
    first, last = enters.max(axis=0), leaves.min(axis=0)
    met = (first <= last) & (first > 0)
    nearest = np.where(met, first, np.inf).argmin(axis=1)
    lines = np.arange(len(origins))
    part = np.array([1, 2, 0])[enters[:, lines, nearest].argmax(axis=0)]
    return np.where(met.any(axis=1), 3 * (row * columns + column)[nearest] + part, -1)


def all_that_maps_draw(maps, depth, drawn, shared):
    """Matrix ``(M, m)`` from the points of the polygons at a level to the line, part by part."""
    parts, size = maps.shape[:2]
    step = size - shared
    whole = np.eye(step * parts ** (depth - drawn) + shared)
    for level in range(depth - drawn, depth):
        finer = np.zeros((step * parts ** (level + 1) + shared, whole.shape[1]))
        for node in range(parts**level):
            for part in range(parts):
                begin = step * (parts * node + part)
                own = whole[step * node : step * node + size]
                finer[begin : begin + size] = maps[part].T @ own
        whole = finer
    return whole


def nearest_of(whole, line, shared):
    """What ``whole`` draws nearest to a line; with shared ends those of the line stay."""
    if not shared:
        return whole @ np.linalg.lstsq(whole, line, rcond=None)[0]
    ends = whole[:, [0, -1]] @ line[[0, -1]]
    inner = whole[:, 1:-1]
    return ends + inner @ np.linalg.lstsq(inner, line - ends, rcond=None)[0]


def cell_means(heights, pixels):
    rows, columns = (-(-size // pixels) for size in heights.shape)
    means = np.empty((rows, columns))
    for y, x in np.ndindex(means.shape):
        cell = heights[y * pixels : (y + 1) * pixels, x * pixels : (x + 1) * pixels]
        means[y, x] = cell.astype(float).mean()
    return means


def domain_pool(heights, block, multiple, flat=0.0):
    """All domain blocks of one size in one pool; at least one must fit the map."""
    (pool,) = domain_pools(heights, block, [multiple], flat, memory=1 << 62)
    return pool


def fit_range(logs, below, above):
    """Exponent, its error, ends and distance of the law of sorted ``logs`` by root finding: the
    mean log is the law's, and half a size of the law lies beyond each end, at most 1."""
    n, low, high = len(logs), logs[0], logs[-1]
    inside = 1 - 1 / n

    def ends(m):
        # u = e^{−m x} is linear in the distribution
        if abs(m) * (high - low) < 1e-6:
            beyond = (high - low) * (1 / inside - 1) / 2
            return low - min(beyond, 1), high + min(beyond, 1)
        first, last = 1.0, math.exp(-m * (high - low))
        beyond = (first - last) * (1 / inside - 1) / 2
        left = -math.log(first + beyond) / m if first + beyond > 0 else -math.inf
        right = -math.log(last - beyond) / m if last - beyond > 0 else math.inf
        return low + max(left, -1), min(low + right, high + 1)

    def moments(m):
        a, b = ends(m)
        t = (np.arange(20_000) + 0.5) / 20_000 * (b - a)
        weight = np.exp(-m * t - max(-m * (b - a), 0))
        mean = (weight * t).sum() / weight.sum()
        return a + mean, (weight * (t - mean) ** 2).sum() / weight.sum()

    steepest = 60 / (high - low)
    m = optimize.brentq(lambda m: moments(m)[0] - np.mean(logs), -steepest, steepest, xtol=1e-10)
    a, b = ends(m)

    def law(x):
        return (
            (x - a) / (b - a)
            if abs(m) < 1e-9
            else math.expm1(m * (a - x)) / math.expm1(m * (a - b))
        )

    distance = 0.0
    for k in range(n):
        distance = max(distance, law(below[k]) - k / n, (k + 1) / n - law(above[k]))
    return m, 1 / math.sqrt(n * moments(m)[1]), a, b, distance


# -- plans ------------------------------------------------------------------------------------


def score_candidate(
    gene, numbers, areas, used, pixel, step, downs, alongs, inner, cell, share, coverage, slack,
    repeats,
):  # fmt: skip
    """The built share of the points of a strip, less twice the miss of the coverage."""
    if not (0 <= gene.row <= used.shape[0] - 1 and 0 <= gene.column <= used.shape[1] - 1):
        return -math.inf
    here, places = [], []
    for down, along in zip(downs, alongs, strict=True):
        off = gene.offsets(down, along)
        y, x = (
            (at + 0.5) * pixel + one for at, one in zip((gene.row, gene.column), off, strict=True)
        )
        fine = math.floor(y / step), math.floor(x / step)
        if not all(0 <= at < side for at, side in zip(fine, numbers.shape, strict=True)):
            return -math.inf
        here.append(numbers[fine])
        places.append((math.floor(y / pixel), math.floor(x / pixel)))
    stretch = gene.scale**2 if gene.axis is None else gene.scale
    enough = {
        n: n > 0 and (here[:inner].count(n) + 1) * cell >= share * areas[n] * stretch for n in here
    }
    here = [enough[n] for n in here]
    again = sum(used[place] for place, stands in zip(places[:inner], here, strict=False) if stands)
    if again > 2 * repeats * sum(here[:inner]) + 2:
        return -math.inf
    miss = abs(np.mean(here[:inner]) - coverage) - slack
    return np.mean(here[inner:]) - 2 * max(miss, 0)


def sample_polygons(lot, gene, donor):
    """The polygon with most of four samples in each pixel; the lower of two equal pairs."""
    pixel, found = donor.city.metres_per_pixel, []
    for down, along in zip(lot.down, lot.along, strict=True):
        seen = []
        for y in (-0.25, 0.25):
            for x in (-0.25, 0.25):
                place = gene.offsets(down + y * lot.pixel, along + x * lot.pixel)
                fine = [
                    math.floor((off + (at + 0.5) * pixel) / donor.step)
                    for off, at in zip(place, (gene.row, gene.column), strict=True)
                ]
                inside = all(0 <= a < n for a, n in zip(fine, donor.numbers.shape, strict=True))
                seen.append(int(donor.numbers[tuple(fine)]) if inside else 0)
        built = [number for number in sorted(seen) if number]
        most = max((built.count(number) for number in built), default=0)
        ties = [number for number in built if built.count(number) == most]
        # of three that share the pixel, or of two single ones, the lower middle one
        single = sorted(seen)[1] or sorted(seen)[2]
        found.append(0 if len(built) < 2 else single if most == 1 else ties[0])
    return np.array(found, np.int32)


def drop_pieces(numbers, areas, pixel, whole, share, least, width, tip):
    """The buildings of each pixel without parts and tips of cut buildings that are too small."""
    numbers = numbers.copy()
    for number in np.unique(numbers[numbers > 0]):
        here = numbers == number
        present = np.count_nonzero(here) * pixel**2
        if present >= whole * areas[number]:
            continue
        kept = here & (present >= share * areas[number])
        thick = ndimage.binary_opening(np.pad(kept, width), np.ones((width, width)))
        tips, _ = ndimage.label(kept & ~thick[width:-width, width:-width])
        for label, box in enumerate(ndimage.find_objects(tips), start=1):
            if max(one.stop - one.start for one in box) >= tip:
                kept &= tips != label
        parts, count = ndimage.label(kept)
        for label in range(1, count + 1):
            if np.count_nonzero(parts == label) < least:
                kept &= parts != label
        numbers[here & ~kept] = 0
    return numbers


def fill_gaps(numbers, rows, columns, inward, free, reach, gap, straight):
    """The buildings of each pixel after they grow over gaps to the outline of a lot."""
    walls = {(r, c) for r, c in zip(*np.nonzero(numbers), strict=True)}
    on_map = {(r, c) for r in range(numbers.shape[0]) for c in range(numbers.shape[1])}
    source, full = {}, set(walls)
    for k, at in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
        if at in walls or not free[k]:
            continue
        ways = []
        for wall in walls:
            down, along = wall[0] - at[0], wall[1] - at[1]
            square = down**2 + along**2
            cosine = (down * inward[0, k] + along * inward[1, k]) / np.sqrt(square)
            if square <= reach**2:
                ways.append((square, -cosine, down, along))
        if ways:
            square, cosine, down, along = min(ways)
            source[at] = numbers[at[0] + down, at[1] + along]
            if -cosine >= straight and square <= gap**2:
                full.add(at)

    def around(at):
        return {(at[0] + i, at[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)}

    closed = {at for at in source if all(around(one) & full for one in around(at) & on_map)} | full
    opened = {one for at in on_map if around(at) <= closed for one in around(at)}
    grown = numbers.copy()
    for at in (closed & opened) - walls:
        grown[at] = source[at]
    return grown


def roof_heights(points, weights, places):
    """When the edges of a convex plan, which move inwards by ``weights``, arrive at ``places``."""
    first, last = points, np.roll(points, -1, axis=0)
    way = (last - first) / np.hypot(*(last - first).T)[:, None]
    found = np.full(len(places), np.inf)
    for start, (x, y), weight in zip(first, way, weights, strict=True):
        if weight > 0:
            away = (places - start) @ (-y, x) / weight
            found = np.minimum(found, away)
    return found


def shrunk_plan(plan, time, step):
    """A plan whose walls have moved inwards by ``time``, by mitred offsets of ``step``."""
    for _ in range(round(time / step)):
        plan = shapely.buffer(plan, -step, join_style="mitre", mitre_limit=1000)
    return plan


def wall_sides(rings, spread):
    """The side of each edge of ``rings``, lists of points: from the sharpest corner on, edges
    within ``spread`` degrees of the side's first."""
    found, side = [], 0
    for ring in rings:
        count = len(ring)
        ways = []
        for k in range(count):
            x, y = np.subtract(ring[(k + 1) % count], ring[k])
            ways.append(math.atan2(y, x))

        def turn(a, b):
            return abs(math.remainder(a - b, 2 * math.pi))

        start = max(range(count), key=lambda k: (round(turn(ways[k], ways[k - 1]), 9), -k))
        own, first = [0] * count, ways[start]
        for step in range(count):
            k = (start + step) % count
            if step and turn(ways[k], first) > math.radians(spread):
                side += 1
                first = ways[k]
            own[k] = side
        side += 1
        found += own
    return found


def count_sunny(heights, ground, across, rise):
    """Count the pixels of the ground that the sun beyond row 0 reaches: a ray from each pixel."""
    count, columns = 0, heights.shape[1]
    for y, x in zip(*np.nonzero(ground), strict=True):
        line = x + math.floor(across * y + 0.5)
        lit = True
        for far in range(1, y + 1):
            u = line - math.floor(across * (y - far) + 0.5)
            if 0 <= u < columns:
                lit &= heights[y - far, u] - (far - 0.5) * rise <= heights[y, x]
        count += lit
    return count


def sky_component(horizons, azimuths, normal):
    """Vertical sky component under the overcast sky of the CIE, by numbers: of a wall with a normal
    of azimuth ``normal``, with the horizons at these azimuths, radians."""
    light, weights = 0.0, 0.0
    for horizon, azimuth in zip(horizons, azimuths, strict=True):
        facing = max(0.0, math.cos(azimuth - normal))
        edges = np.linspace(horizon, math.pi / 2, 2001)
        angle = (edges[1:] + edges[:-1]) / 2
        luminance = (1 + 2 * np.sin(angle)) / 3
        light += facing * (luminance * np.cos(angle) ** 2).sum() * (edges[1] - edges[0])
        weights += facing
    return light / weights * 2 / (7 * math.pi / 9)


def light_facades(heights, walls, normals, back, storey, starts, ways, down, along, far, pixel):
    """Vertical sky component of each façade: every pixel of every ray, from each strip."""
    sky = []
    for i, (y, x, v, u) in enumerate(walls.T):
        base, top = float(heights[y, x]), float(heights[v, u])
        strips = max(1, math.floor((top - base) / storey + 0.5))
        parts = []
        for s in range(strips):
            eye = base + (top - base) * (s + 0.5) / strips
            facing = normals[:, i] @ ways
            horizons = []
            for d, (start, end) in enumerate(itertools.pairwise(starts)):
                steepest = 0.0
                for k in range(start, end):
                    row, column = y + down[k], x + along[k]
                    if 0 <= row < heights.shape[0] and 0 <= column < heights.shape[1]:
                        away = (far[k] + back[i] * facing[d]) * pixel
                        if away > 0:
                            steepest = max(steepest, (float(heights[row, column]) - eye) / away)
                horizons.append(math.atan(steepest))
            azimuths = np.arctan2(*ways)
            parts.append(sky_component(horizons, azimuths, math.atan2(*normals[:, i])))
        sky.append(sum(parts) / strips)
    return np.array(sky)


def naive_local_density(heights, site, pixel, place, radius):
    """GSI and FSI of the disc around ``place`` (row, column), metres from the centre of the
    north-west pixel: pixel by pixel."""
    count = footprint = floors = 0
    for row in range(heights.shape[0]):
        for column in range(heights.shape[1]):
            if site is not None and not site[row, column]:
                continue
            down, along = row * pixel - place[0], column * pixel - place[1]
            if down * down + along * along > radius * radius:
                continue
            count += 1
            if heights[row, column] > 1.5:
                footprint += 1
                floors += math.floor(heights[row, column] / 3 + 0.5)
    return (footprint / count, floors / count) if count else (math.nan, math.nan)


def naive_local_patterns(image, radius):
    """Local binary patterns of 8 neighbours, pixel by pixel: 58 for more than two changes, else the
    number of the uniform pattern. Neighbours equal to the pixel up to rounding are not lower."""
    numbers, count = {}, 0
    for ones in range(9):
        for turn in range(8 if 0 < ones < 8 else 1):
            numbers[tuple((k + turn) % 8 < ones for k in range(8))] = count
            count += 1
    height, width = image.shape

    def at(row, column):
        return image[row, column] if 0 <= row < height and 0 <= column < width else 0.0

    patterns = np.empty(image.shape, np.int64)
    for row in range(height):
        for column in range(width):
            signs = []
            for k in range(8):
                y = row + round(-radius * math.sin(2 * math.pi * k / 8), 5)
                x = column + round(radius * math.cos(2 * math.pi * k / 8), 5)
                top, left = math.floor(y), math.floor(x)
                down, along = y - top, x - left
                value = (1 - down) * ((1 - along) * at(top, left) + along * at(top, left + 1))
                value += down * ((1 - along) * at(top + 1, left) + along * at(top + 1, left + 1))
                signs.append(value >= image[row, column] - 1e-6)
            patterns[row, column] = numbers.get(tuple(signs), 58)
    return patterns


def parts_of_surface(surface, depth):
    """The control points of a surface's parts, one by one: ``(N^depth, M^depth, n, m, d)``."""
    if depth == 0:
        return surface.points[None, None]
    rows = []
    for down in surface.rows:
        row = []
        for across in surface.columns:
            part = np.stack(
                [down.T @ layer @ across for layer in surface.points.transpose(2, 0, 1)]
            )
            row.append(parts_of_surface(type(surface)(part.transpose(1, 2, 0), surface.rows,
                                                      surface.columns), depth - 1))  # fmt: skip
        rows.append(np.concatenate(row, axis=1))
    return np.concatenate(rows, axis=0)


def reach_frame(first, last, starts, path, nodes, out, beside):
    """The nodes, and the hubs in the order of their numbers, that have a way to hub 1."""
    columns, count = beside.shape[1], int(beside.max(initial=1))

    def hubs_at(pixel, steps):
        places = (divmod(int(pixel) + step, columns) for step in steps)
        return {("hub", int(beside[place])) for place in places if beside[place] > 0}

    links = []
    for k, (one, other) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        links.append((("node", one), ("node", other)))
        for pixel in path[starts[k] : starts[k + 1]]:
            around = hubs_at(pixel, (0, 1, -1, columns, -columns))
            links += [(("node", one), hub) for hub in around]
    for k, pixel in enumerate(nodes):
        if out[k]:
            links.append((("node", k), ("hub", 1)))
        if k not in first and k not in last:
            links += [(("node", k), hub) for hub in hubs_at(pixel, (0,))]
    found, before = {("hub", 1)}, 0
    while len(found) > before:
        before = len(found)
        for one, other in links:
            if one in found or other in found:
                found |= {one, other}
    return (
        np.array([("node", k) in found for k in range(len(nodes))], bool),
        np.array([("hub", h) in found for h in range(1, count + 1)], bool),
    )
