"""Compiled loops over buildings. Slow twins stand in tests/naive.py."""

import heapq

import numpy as np

from evocity.accelerate import kernel
from evocity.views._kernels import _number, _root, _unite


@kernel
def flat_zones(heights, built, step, zones):
    """Quasi-flat zones: built pixels that touch by sides are in one zone where their heights
    differ by at most ``step``. ``zones`` is overwritten; returns how many there are."""
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    one = np.uintp(1)
    parent = np.empty(heights.size + 1, np.int32)
    count = 0
    for y in range(rows):
        for x in range(columns):
            if built[y, x] == 0:
                zones[y, x] = 0
                continue
            here, a = heights[y, x], np.int32(0)
            if x and built[y, x - one] and abs(here - heights[y, x - one]) <= step:
                a = zones[y, x - one]
            if y and built[y - one, x] and abs(here - heights[y - one, x]) <= step:
                above = zones[y - one, x]
                if a == 0:
                    a = above
                elif a != above:
                    a = np.int32(_unite(parent, a, above))
            if a == 0:
                count += 1
                a = np.int32(count)
                parent[np.uintp(count)] = a
            zones[y, x] = a
    return _number(zones, parent, count)


@kernel
def _facing(zones, pixels, least, sides):
    """Pairs of zones that face each other across a pixel side, one of them at least of fewer
    than ``least`` pixels, into ``sides`` (n, 2) where there is room; returns how many."""
    number, room = 0, sides.shape[0]
    rows, columns = zones.shape
    for y in range(rows):
        line, below = zones[y], zones[min(y + 1, rows - 1)]
        for x in range(columns):
            a, east, south = line[x], line[min(x + 1, columns - 1)], below[x]
            if a == 0 or (east == a and south == a):
                continue
            for b in (east, south):
                if b != a and b and min(pixels[np.uintp(a)], pixels[np.uintp(b)]) < least:
                    if number < room:
                        sides[number, 0], sides[number, 1] = a, b
                    number += 1
    return number


@kernel
def _sides(zones, count, pixels, least):
    """The pairs that `_facing` tells, (n, 2), of ``count`` zones."""
    sides = np.empty((8 * count + 1024, 2), np.int32)  # one pass will do for most maps
    number = _facing(zones, pixels, least, sides)
    if number > sides.shape[0]:
        sides = np.empty((number, 2), np.int32)
        _facing(zones, pixels, least, sides)
    return sides[:number]


@kernel
def _neighbour(a, facing, pixels, means, shared):
    """Of the zones that zone ``a`` is ``facing``, once a pixel side, the one to give it to; 0 if
    it faces none. ``shared`` is 0 throughout, before and after."""
    for b in facing:
        shared[b] += 1
    best, chosen = (0, 0.0, 0, 0), 0
    for b in facing:
        if shared[b]:
            claim = (shared[b], -abs(means[b] - means[a]), pixels[b], -np.int64(b))
            if claim > best:
                best, chosen = claim, np.int64(b)
            shared[b] = 0
    return chosen


@kernel
def join_crumbs(heights, zones, count, least):
    """Give every zone of fewer than ``least`` pixels to the neighbour with which it shares most
    pixel sides; of equals, to that closest in mean height, then the largest, then the lowest
    number. All at once, and again until none is left that has a neighbour: so two zones that are
    large enough never become one. ``zones`` is renumbered; returns how many are left."""
    pixels, total = np.zeros(count + 1, np.int64), np.zeros(count + 1)
    for y in range(np.uintp(zones.shape[0])):
        for x in range(np.uintp(zones.shape[1])):
            a = np.uintp(zones[y, x])
            pixels[a] += 1
            total[a] += heights[y, x]
    sides = _sides(zones, count, pixels, least)
    parent = np.arange(count + 1).astype(np.int32)
    chosen, shared = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    starts, facing = np.empty(count + 2, np.int64), np.empty(2 * sides.shape[0], np.int32)
    while True:
        # facing[starts[a] : starts[a + 1]]: what the small zone a faces, once a pixel side
        starts[:] = 0
        kept = np.uintp(0)
        for k in range(np.uintp(sides.shape[0])):
            root, other = _root(parent, sides[k, 0]), _root(parent, sides[k, 1])
            a, b = np.uintp(root), np.uintp(other)
            if a != b and min(pixels[a], pixels[b]) < least:
                starts[a + np.uintp(1)] += pixels[a] < least
                starts[b + np.uintp(1)] += pixels[b] < least
                sides[kept, 0], sides[kept, 1] = root, other
                kept += np.uintp(1)
        sides = sides[:kept]
        for a in range(count + 1):
            starts[a + 1] += starts[a]
        ends = starts.copy()
        for k in range(np.uintp(sides.shape[0])):
            for i in range(np.uintp(2)):
                a, b = np.uintp(sides[k, i]), np.uintp(sides[k, np.uintp(1) - i])
                if pixels[a] < least:
                    facing[np.uintp(ends[a])] = b
                    ends[a] += 1
        means = total / np.maximum(pixels, 1)
        joined = False
        for a in range(1, count + 1):
            chosen[a] = _neighbour(a, facing[starts[a] : ends[a]], pixels, means, shared)
            joined |= chosen[a] > 0
        if not joined:
            return _number(zones, parent, count)
        for a in range(1, count + 1):
            b, c = _root(parent, a), _root(parent, chosen[a])
            if chosen[a] and b != c:
                low = _unite(parent, b, c)
                pixels[low], total[low] = pixels[b] + pixels[c], total[b] + total[c]


@kernel
def tally(labels, heights, counts, bounds, total, first):
    """What one pass over the pixels tells of each building a, in row a − 1 of the results.

    ``labels`` (H + 2, W + 2) have a border of 0. counts (n, 6): pixels, Σ y, Σ x; steps out of
    the building over the sides of its pixels, how many of them into another, and steps out over
    their corners. bounds (n, 4): first row, first column, and those after the last. total (n,):
    Σ heights. first (n,): flat index of its first pixel. ``counts`` and ``total`` come in as 0.
    """
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    one, two = np.uintp(1), np.uintp(2)
    for i in range(bounds.shape[0]):
        bounds[i, 0], bounds[i, 1], bounds[i, 2], bounds[i, 3] = rows, columns, 0, 0
    for y in range(rows):
        for x in range(columns):
            a = labels[y + one, x + one]
            if a == 0:
                continue
            i = np.uintp(a - 1)
            if counts[i, 0] == 0:
                first[i] = y * columns + x
            counts[i, 0] += 1
            counts[i, 1] += y
            counts[i, 2] += x
            total[i] += heights[y, x]
            straight = (
                labels[y, x + one],
                labels[y + one, x],
                labels[y + one, x + two],
                labels[y + two, x + one],
            )
            diagonal = (
                labels[y, x],
                labels[y, x + two],
                labels[y + two, x],
                labels[y + two, x + two],
            )
            for b in straight:
                counts[i, 3] += b != a
                counts[i, 4] += (b != a) & (b > 0)
            for b in diagonal:
                counts[i, 5] += b != a
            bounds[i, 0] = min(bounds[i, 0], y)
            bounds[i, 1] = min(bounds[i, 1], x)
            bounds[i, 2] = max(bounds[i, 2], y + one)
            bounds[i, 3] = max(bounds[i, 3], x + one)


#: Reach of the gradient of a building's mask, px: 2 of the smoothing, 1 of the difference.
REACH = 3


@kernel
def fourfold(labels, bounds, site, sums):
    """sums[i] = Σ |∇m| e^{4iθ} as (real, imaginary), m the mask of building i + 1 smoothed by
    the binomial (1, 4, 6, 4, 1) / 16 along both axes, θ its gradient's angle from east to south.

    ``labels`` (H + 6, W + 6): the edges repeated, so that the map's border is no wall.
    ``site`` (H, W): where gradients count; of no size where all do.
    """
    rows, columns = labels.shape[0] - 2 * REACH, labels.shape[1] - 2 * REACH
    mask = np.empty((2 * REACH + 1, columns + 2 * REACH), np.int32)
    smooth, slope = np.empty(mask.shape[1], np.int32), np.empty(mask.shape[1], np.int32)
    along_x, along_y = np.empty(columns, np.int32), np.empty(columns, np.int32)
    everywhere = site.size == 0
    for i in range(bounds.shape[0]):
        a = i + 1
        top, bottom = max(bounds[i, 0] - REACH, 0), min(bounds[i, 2] + REACH, rows)
        left, right = max(bounds[i, 1] - REACH, 0), min(bounds[i, 3] + REACH, columns)
        wide = np.uintp(right - left)
        real = imaginary = 0.0
        for y in range(top, bottom):
            # row y of the map is row y + 3 of labels; mask[k] is row y + k − 3
            first = 2 * REACH if y > top else 0
            for k in range(first, 2 * REACH + 1):
                source = labels[y + k, left : right + 2 * REACH]
                target = mask[(y + k) % (2 * REACH + 1)]
                for x in range(np.uintp(source.size)):
                    target[x] = source[x] == a
            m0, m1, m2 = mask[y % 7], mask[(y + 1) % 7], mask[(y + 2) % 7]
            m3, m4 = mask[(y + 3) % 7], mask[(y + 4) % 7]
            m5, m6 = mask[(y + 5) % 7], mask[(y + 6) % 7]
            for x in range(wide + np.uintp(2 * REACH)):
                smooth[x] = m1[x] + m5[x] + 4 * (m2[x] + m4[x]) + 6 * m3[x]
                slope[x] = m6[x] - m0[x] + 4 * (m5[x] - m1[x]) + 5 * (m4[x] - m2[x])
            for x in range(wide):
                x1, x2, x3 = x + np.uintp(1), x + np.uintp(2), x + np.uintp(3)
                x4, x5, x6 = x + np.uintp(4), x + np.uintp(5), x + np.uintp(6)
                along_y[x] = slope[x1] + slope[x5] + 4 * (slope[x2] + slope[x4]) + 6 * slope[x3]
                along_x[x] = (
                    smooth[x6]
                    - smooth[x]
                    + 4 * (smooth[x5] - smooth[x1])
                    + 5 * (smooth[x4] - smooth[x2])
                )
            for x in range(wide):
                dy, dx = along_y[x], along_x[x]
                if (dx or dy) and (everywhere or site[y, np.uintp(left) + x]):
                    # |g| e^{4iθ} = g⁴ / |g|³
                    re, im, square = dx * dx - dy * dy, 2 * dx * dy, dx * dx + dy * dy
                    re, im, square = np.float64(re), np.float64(im), np.float64(square)
                    scale = 1 / (square * np.sqrt(square))
                    real += (re * re - im * im) * scale
                    imaginary += 2 * re * im * scale
        sums[i, 0], sums[i, 1] = real, imaginary


@kernel
def count_corners(labels, corners):
    """corners[i]: corners of building i + 1 that turn outwards, less those that turn inwards. Of
    one piece by sides that is 4 for its outline and −4 for each hole: 4 times Euler's number.

    ``labels`` (H + 2, W + 2) have a border of 0; ``corners`` come in as 0.
    """
    rows, columns = np.uintp(labels.shape[0] - 2), np.uintp(labels.shape[1] - 2)
    one, two = np.uintp(1), np.uintp(2)
    for y in range(rows):
        for x in range(columns):
            a = labels[y + one, x + one]
            if a == 0:
                continue
            i = np.uintp(a - 1)
            west, east = labels[y + one, x] == a, labels[y + one, x + two] == a
            for v in (y, y + two):
                beside = labels[v, x + one] == a
                for along, b in ((west, labels[v, x]), (east, labels[v, x + two])):
                    corners[i] += not (beside or along)
                    corners[i] -= beside and along and b != a


@kernel
def courtyards(labels, bounds, corners, ground):
    """ground[i]: pixels of open ground (label 0) from which every way to the rim of the map, over
    sides and corners of pixels, crosses building i + 1; ``corners`` as `count_corners` has them.

    Only buildings with holes are looked into: what is outside of them is flooded.
    """
    most = 0
    for i in range(bounds.shape[0]):
        if corners[i] != 4:
            most = max(most, (bounds[i, 2] - bounds[i, 0]) * (bounds[i, 3] - bounds[i, 1]))
    reached, stack = np.zeros(most, np.bool_), np.empty(most, np.int64)
    for i in range(bounds.shape[0]):
        ground[i] = 0
        if corners[i] == 4:
            continue
        a, top, left = i + 1, bounds[i, 0], bounds[i, 1]
        tall, wide = bounds[i, 2] - top, bounds[i, 3] - left
        reached[: tall * wide] = False
        size = 0
        for y in range(tall):
            step = 1 if y == 0 or y == tall - 1 else max(wide - 1, 1)
            for x in range(0, wide, step):
                if labels[top + y, left + x] != a and not reached[y * wide + x]:
                    reached[y * wide + x] = True
                    stack[size] = y * wide + x
                    size += 1
        while size:
            size -= 1
            y, x = stack[size] // wide, stack[size] % wide
            for v in range(max(y - 1, 0), min(y + 2, tall)):
                for u in range(max(x - 1, 0), min(x + 2, wide)):
                    if not reached[v * wide + u] and labels[top + v, left + u] != a:
                        reached[v * wide + u] = True
                        stack[size] = v * wide + u
                        size += 1
        count = 0
        for y in range(tall):
            for x in range(wide):
                count += labels[top + y, left + x] == 0 and not reached[y * wide + x]
        ground[i] = count


@kernel
def _lower_median(values):
    """The lower of the middle two of ``values``, which are put into another order (Hoare)."""
    low, high = 0, values.size - 1
    middle = high // 2
    while low < high:
        pivot, i, j = values[middle], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if j < middle:
            low = i
        if middle < i:
            high = j
    return values[middle]


@kernel
def level(heights, zones, count, step, roofs):
    """Every zone takes its lower median height; zones that then touch by sides and differ by at
    most ``step`` are one, with a median of their own: all at once, and again until none do.
    ``roofs`` (H, W) takes the medians, and stays as it is on ground (zone 0); ``zones`` is
    renumbered; returns how many are left."""
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    pixels = np.zeros(count + 1, np.int64)
    for y in range(rows):
        for x in range(columns):
            pixels[np.uintp(zones[y, x])] += 1
    pixels[0] = 0
    ends = np.zeros(count + 1, np.int64)  # where zone a begins in by_zone, and once filled ends
    for a in range(1, count + 1):
        ends[a] = ends[a - 1] + pixels[a - 1]
    by_zone = np.empty(heights.size, np.float32)
    for y in range(rows):
        for x in range(columns):
            a = np.uintp(zones[y, x])
            if a:
                by_zone[np.uintp(ends[a])] = heights[y, x]
                ends[a] += 1
    medians = np.empty(count + 1, np.float32)
    for a in range(1, count + 1):
        medians[a] = _lower_median(by_zone[ends[a] - pixels[a] : ends[a]])
    sides = _sides(zones, count, pixels, heights.size + 1)
    parent = np.arange(count + 1).astype(np.int32)
    before, grown = parent.copy(), np.empty(count + 1, np.bool_)
    sizes, places = np.empty(count + 1, np.int64), np.empty(count + 1, np.int64)
    together = np.empty(heights.size, np.float32)
    while True:
        kept, united = np.uintp(0), False
        for k in range(np.uintp(sides.shape[0])):
            a, b = before[np.uintp(sides[k, 0])], before[np.uintp(sides[k, 1])]
            if a != b:
                if abs(medians[np.uintp(a)] - medians[np.uintp(b)]) <= step:
                    _unite(parent, a, b)
                    united = True
                else:
                    sides[kept, 0], sides[kept, 1] = a, b
                    kept += np.uintp(1)
        if not united:
            break
        sides = sides[:kept]
        sizes[:], grown[:] = 0, False
        for a in range(1, count + 1):
            root = _root(parent, a)
            sizes[root] += pixels[a]
            grown[root] |= before[a] != root
            before[a] = root
        # the pixels of each set that grew are laid side by side, places[root] is where they end
        size = np.int64(0)
        for root in range(1, count + 1):
            if grown[root]:
                places[root] = size
                size += sizes[root]
        for a in range(1, count + 1):
            root = before[a]
            if grown[root]:
                end = places[root] + pixels[a]
                together[places[root] : end] = by_zone[ends[a] - pixels[a] : ends[a]]
                places[root] = end
        for root in range(1, count + 1):
            if grown[root]:
                medians[root] = _lower_median(together[places[root] - sizes[root] : places[root]])
    for y in range(rows):
        for x in range(columns):
            a = np.uintp(zones[y, x])
            if a:
                roofs[y, x] = medians[np.uintp(before[a])]
    return _number(zones, parent, count)


@kernel
def keep_large(zones, count, least):
    """Number the ``count`` zones of at least ``least`` pixels from 1, in their order; others become
    ground, 0. Returns how many stay."""
    numbers = np.zeros(count + 1, np.int32)
    for y in range(zones.shape[0]):
        for x in range(zones.shape[1]):
            numbers[np.uintp(zones[y, x])] += 1
    left = 0
    for a in range(count + 1):
        large = a > 0 and numbers[a] >= least
        left += large
        numbers[a] = left if large else 0
    for y in range(zones.shape[0]):
        for x in range(zones.shape[1]):
            zones[y, x] = numbers[np.uintp(zones[y, x])]
    return left


@kernel
def mark_open(built, raised, parts, count, zones, medians, lone):
    """Mark the ``built`` pixels without a zone for `grow_zones`, in ``zones``: −1, or −2 where none
    of the ``count`` components ``parts`` has a zone. There ``lone`` is true, elsewhere false.
    ``medians`` gets the height of each zone in ``raised``. Returns how many pixels are lone."""
    filled = np.zeros(count + 1, np.bool_)
    for y in range(zones.shape[0]):
        for x in range(zones.shape[1]):
            a = np.uintp(zones[y, x])
            if a:
                filled[np.uintp(parts[y, x])] = True
                medians[a] = raised[y, x]
    left = 0
    for y in range(zones.shape[0]):
        for x in range(zones.shape[1]):
            alone = built[y, x] and not filled[np.uintp(parts[y, x])]
            lone[y, x] = alone
            left += alone
            if built[y, x] and zones[y, x] == 0:
                zones[y, x] = -2 if alone else -1
    return left


@kernel
def grow_zones(heights, zones, roofs):
    """Open pixels, of zone −1, join zones that they touch by sides: again and again the pixel whose
    height is closest to the roof of such a zone; of equals, the one that was reached first, row by
    row. Zone 0 is ground, and grows too. ``zones`` (H, W) is overwritten; zones below −1 do not
    grow. ``roofs``: float32 (n + 1,), heights of all zones."""
    rows, columns = zones.shape
    left = 0
    for y in range(rows):
        for x in range(columns):
            left += zones[y, x] == -1
    if left == 0:
        return
    # a visit: the pixel that was reached, and from which zone; each side of a pixel counts once
    place, origin = np.empty(4 * left, np.int64), np.empty(4 * left, np.int32)
    nearest = np.full(zones.shape, np.inf, np.float32)  # smallest step of the visits of a pixel
    step = np.empty(1, np.float32)
    bits = step.view(np.int32)  # in the order of the steps, which are not negative
    queue = [np.int64(0)]  # the bits of a step, then the number of its visit
    queue.pop()
    number, at, most = 0, 0, zones.size
    while True:
        # first the borders of all zones, row by row; then each pixel that joins
        if at < most:
            y, x = at // columns, at % columns
            at += 1
            if zones[y, x] < 0:
                continue
        elif len(queue):
            visit = heapq.heappop(queue) & 0xFFFFFFFF
            y, x = place[visit] // columns, place[visit] % columns
            if zones[y, x] != -1:
                continue
            zones[y, x] = origin[visit]
        else:
            break
        zone = zones[y, x]
        for side in range(4):
            v, u = y - (side == 0) + (side == 3), x - (side == 1) + (side == 2)
            if 0 <= v < rows and 0 <= u < columns and zones[v, u] == -1:
                step[0] = abs(heights[v, u] - roofs[zone])
                if step[0] < nearest[v, u]:  # a later visit with an equal step comes too late
                    nearest[v, u] = step[0]
                    place[number], origin[number] = v * columns + u, zone
                    heapq.heappush(queue, (np.int64(bits[0]) << 32) | np.int64(number))
                    number += 1
