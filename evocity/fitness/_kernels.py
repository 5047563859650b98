"""Compiled loops over whole maps and lists of sizes: horizons, counts, sums, fitted laws."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def sky_seen(heights, y, x, starts, down, along, slopes, highest, seen):
    """seen[i] = mean cos² of the horizon angle at pixel (y[i], x[i]), over all directions.

    Direction d passes the pixels ``down``, ``along`` of starts[d] : starts[d + 1], relative to
    where it starts; a height there times ``slopes`` is the tangent it is seen under. What lies
    beyond the map does not rise. No roof is above ``highest``.
    """
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    directions = starts.size - 1
    for i in range(y.size):
        own = heights[y[i], x[i]]
        most = highest - own
        total = 0.0
        for d in range(directions):
            steepest = np.float32(0)
            for k in range(starts[d], starts[d + 1]):
                slope = slopes[np.uintp(k)]
                if most * slope <= steepest:  # nothing farther off can be seen above
                    break
                v = np.uintp(y[i] + down[np.uintp(k)])  # past the border on any side: huge
                u = np.uintp(x[i] + along[np.uintp(k)])
                if v >= rows or u >= columns:
                    break
                steepest = max(steepest, (heights[v, u] - own) * slope)
            tangent = np.float64(steepest)
            total += 1.0 / (1.0 + tangent * tangent)
        seen[i] = total / directions


@kernel
def sum_corner(mask, sums):
    """sums[y, x] = pixels of ``mask`` in rows before y and columns before x."""
    rows, columns = mask.shape
    sums[0] = 0
    for y in range(rows):
        sums[y + 1, 0] = 0
        line = 0
        for x in range(columns):
            line += mask[y, x]
            sums[y + 1, x + 1] = sums[y, x + 1] + line


@kernel
def count_boxes(sums, size, top, left):
    """Boxes of ``size`` px that hold a pixel of the mask of ``sums``, of a grid of which one box
    begins in row ``top``, column ``left``, each in 1 − size … 0."""
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    count = 0
    for y in range(top, rows, size):
        a, b = max(y, 0), min(y + size, rows)
        for x in range(left, columns, size):
            c, d = max(x, 0), min(x + size, columns)
            if sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c] > 0:
                count += 1
    return count


@kernel
def count_around(sums, reach):
    """(pixels of the mask of ``sums``, pixels at all) within ``reach`` rows and columns of each
    pixel of the mask, on the map, in all."""
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    within, room = 0, 0
    for y in range(rows):
        a, b = np.uintp(max(y - reach, 0)), np.uintp(min(y + reach + 1, rows))
        tall = np.int64(b) - np.int64(a)
        for x in range(columns):
            east = np.uintp(x + 1)
            if sums[y + 1, east] - sums[y, east] == sums[y + 1, x] - sums[y, x]:
                continue
            c, d = np.uintp(max(x - reach, 0)), np.uintp(min(x + reach + 1, columns))
            within += sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c]
            room += tall * (np.int64(d) - np.int64(c))
    return within, room


@kernel
def gliding_moments(sums, size):
    """(ΣM, ΣM²) over all places of a box of ``size`` px on the map, M the pixels of the mask of
    ``sums`` in it."""
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    first, second = 0, 0.0  # the squares of large boxes are too many for whole numbers
    for y in range(rows - size + 1):
        for x in range(columns - size + 1):
            mass = (sums[y + size, x + size] - sums[y, x + size]) - (sums[y + size, x] - sums[y, x])
            first += mass
            second += np.float64(mass) * np.float64(mass)
    return first, second


@kernel
def fourfold(structure, fields):
    """``fields`` (3, H, W) get w cos 4θ, w sin 4θ and w of a ``structure`` (2, H, W), w cos 2θ and
    w sin 2θ: w e^{4iθ} = (w e^{2iθ})² / w. Returns the largest w."""
    _, rows, columns = structure.shape
    none, most, two = np.float32(0), np.float32(0), np.float32(2)
    for y in range(rows):
        for x in range(columns):
            real, imaginary = structure[0, y, x], structure[1, y, x]
            w = np.sqrt(real * real + imaginary * imaginary)
            turned = two * real / w if w > none else none
            fields[0, y, x] = real * turned - w
            fields[1, y, x] = imaginary * turned
            fields[2, y, x] = w
            most = max(most, w)
    return most


@kernel
def pool_rows(fields, window, pooled):
    """pooled[f, i] += Σ window[i, y] · fields[f, y]: rows under windows, zeros of these left out.

    ``fields`` is (n, H, W), ``window`` (samples, H), ``pooled`` (n, samples, W). BLAS would do the
    same, but in threads of its own, which wait for each other on a busy machine.
    """
    count, rows, columns = fields.shape
    for f in range(count):
        for i in range(window.shape[0]):
            for y in range(rows):
                weight = window[i, y]
                if weight != 0:
                    for x in range(columns):
                        pooled[f, i, x] += weight * fields[f, y, x]


@kernel
def trace_copies(top, left, side, row, column, turn, affine, labels, first, table, copies, shown):
    """Which copy of which building each pixel of a map shows that is laid of stones of a city.

    The squares of ``side`` px at (top, left) of the map show those at (row, column) of the city
    under the isometries ``turn``; ``affine`` is `isometries.AFFINE`. ``labels`` (H, W) are the
    city's buildings, 0 where there is none. Pixels that show one building under one isometry and
    one translation are a copy of it: ``copies`` (5, room) gets of each the isometry, the
    translation (rows, columns), the building, and how many pixels show it; ``shown``, of the map's
    size, at each of these pixels, the copy's number and ``first``, numbers from 1.

    ``table`` finds copies again: zeros, a power of two of them, more than room. Returns how many
    copies there are, or -1 if there is no room for them.
    """
    room, mask = copies.shape[1], np.int64(table.size - 1)
    count = 0
    for k in range(side.size):
        a, s = affine[turn[k]], side[k]
        # pixel (i, j) of the map shows (down + a[2] i + a[4] j, across + a[3] i + a[5] j)
        down = row[k] + a[0] * (s - 1) - a[2] * top[k] - a[4] * left[k]
        across = column[k] + a[1] * (s - 1) - a[3] * top[k] - a[5] * left[k]
        building, copy = 0, 0
        for i in range(top[k], top[k] + s):
            for j in range(left[k], left[k] + s):
                b = labels[down + a[2] * i + a[4] * j, across + a[3] * i + a[5] * j]
                if b == 0:
                    continue
                if b != building:
                    mixed = ((down * 65_599 + across) * 8 + turn[k]) * 1_000_003 + b
                    at = (mixed * -7_046_029_254_386_353_131 >> 32) & mask  # 2⁶⁴ / golden ratio
                    while table[at] != 0:
                        c = table[at] - 1
                        if (
                            copies[3, c] == b
                            and copies[1, c] == down
                            and copies[2, c] == across
                            and copies[0, c] == turn[k]
                        ):
                            break
                        at = (at + 1) & mask
                    if table[at] == 0:
                        if count == room:
                            return -1
                        copies[0, count], copies[1, count] = turn[k], down
                        copies[2, count], copies[3, count] = across, b
                        copies[4, count] = 0
                        count += 1
                        table[at] = count
                    building, copy = b, table[at]
                copies[4, copy - 1] += 1
                shown[i, j] = first + copy
    return count


@kernel
def distances(x, y, ends, same, sums):
    """Sums over all pairs of a column of ``x`` (F, n) and one of ``y`` (F, m) of the Euclidean
    distance: sums[0] counts rows 0 : ends[0], sums[k] those and ends[k − 1] : ends[k].

    If they are the ``same``, each pair of different columns counts once. In float32.
    """
    near, far = np.empty(y.shape[1], np.float32), np.empty(y.shape[1], np.float32)
    totals = np.zeros((ends.size, y.shape[1]), np.float32)
    for i in range(x.shape[1]):
        count = np.uintp(i if same else y.shape[1])
        near[:] = np.float32(0)
        for row in range(ends[0]):
            here, there = x[row, i], y[row]
            for j in range(count):
                near[j] += (here - there[j]) ** 2
        total = totals[0]
        for j in range(count):
            total[j] += np.sqrt(near[j])
        for k in range(1, ends.size):
            far[:] = near
            for row in range(ends[k - 1], ends[k]):
                here, there = x[row, i], y[row]
                for j in range(count):
                    far[j] += (here - there[j]) ** 2
            total = totals[k]
            for j in range(count):
                total[j] += np.sqrt(far[j])
    for k in range(ends.size):
        sums[k] = 0.0
        for j in range(np.uintp(y.shape[1])):
            sums[k] += totals[k, j]


@kernel
def off_squared(labels, heights, means, squares):
    """squares[i] += Σ (h − means[i])² over the pixels of building i + 1."""
    for y in range(np.uintp(labels.shape[0])):
        for x in range(np.uintp(labels.shape[1])):
            i = np.uintp(labels[y, x] - 1)
            if labels[y, x]:
                squares[i] += (heights[y, x] - means[i]) ** 2


@kernel
def nearest(y, x, distances, which):
    """``distances`` and ``which`` (n, k) get how far the k points are that are nearest to each of
    n, itself among them, and their numbers, rising. Returns whether any two of the k + 1 nearest
    are equally far: then others may stand in another order."""
    count, most = distances.shape
    squares, numbers = np.empty(most + 1), np.empty(most + 1, np.int64)
    tied = False
    for i in range(count):
        kept = 0
        for j in range(count):
            down, across = y[j] - y[i], x[j] - x[i]
            square = down * down + across * across
            if kept <= most:
                kept += 1
            elif square >= squares[most]:
                continue
            k = kept - 1
            while k > 0 and squares[k - 1] > square:
                squares[k], numbers[k] = squares[k - 1], numbers[k - 1]
                k -= 1
            squares[k], numbers[k] = square, j
        for k in range(1, kept):
            tied |= squares[k] == squares[k - 1]
        for k in range(most):
            distances[i, k], which[i, k] = np.sqrt(squares[k]), numbers[k]
    return tied


@kernel
def law_beyond(m, wide, rank):
    """How far the ends of a law of exponent ``m`` lie beyond the smallest and the largest of the
    sizes, which are ``wide`` apart; all are natural logarithms.

    The share ``rank`` of the law lies beyond each. No end lies more than 1 beyond.
    """
    steep = abs(m)
    if steep * wide < 1e-6:
        near = far = rank * wide / (1.0 - 2.0 * rank)
    else:
        last = np.exp(-steep * wide)  # density at the thin end, if it is 1 at the other
        share = rank * (1.0 - last) / (1.0 - 2.0 * rank)
        near = np.log1p(share) / steep
        far = -np.log1p(-share / last) / steep if share < last else 1.0
    near, far = min(near, 1.0), min(far, 1.0)
    return (near, far) if m >= 0 else (far, near)


@kernel
def law_moments(y):
    """(mean, variance) of the law on [0, 1] with the density ∝ e^{−y t}."""
    if abs(y) < 1e-2:
        return 0.5 - y / 12.0 + y**3 / 720.0, 1.0 / 12.0 - y * y / 240.0
    half = 2.0 * np.sinh(y / 2.0)
    return 1.0 / y - 1.0 / np.expm1(y), 1.0 / (y * y) - 1.0 / (half * half)


@kernel
def fit_ranges(logs, below, above, starts, stops, least, fits):
    """fits[:, i, j] = (exponent, its standard error, lower end, upper end, Kolmogorov-Smirnov
    distance) of the law of the sizes starts[i] : stops[j]; NaN if these are fewer than ``least``,
    or all alike.

    ``logs`` are the natural logarithms of the sizes, sorted. Each size is only known to lie
    between ``below`` and ``above``. The ends are logarithms too; half a size lies beyond each.
    """
    sums = np.zeros(logs.size + 1)
    for k in range(logs.size):
        sums[k + 1] = sums[k] + logs[k] - logs[0]
    for i in range(starts.size):
        for j in range(stops.size):
            first, n = starts[i], stops[j] - starts[i]
            fits[:, i, j] = np.nan
            if n < least or logs[stops[j] - 1] <= logs[first]:
                continue
            low, wide = logs[first], logs[stops[j] - 1] - logs[first]
            mean = logs[0] - low + (sums[stops[j]] - sums[first]) / n
            m, length, near = 0.0, wide, 0.0
            for _ in range(100):  # Newton's steps; the ends follow the exponent
                near, far = law_beyond(m, wide, 0.5 / n)
                length = near + wide + far
                at, variance = law_moments(m * length)
                before = m
                m += (at - (mean + near) / length) / (variance * length)
                m = min(max(m, -60.0 / wide), 60.0 / wide)
                if abs(m - before) * wide < 1e-10:
                    break
            a, steep = low - near, abs(m) * length > 1e-9
            whole = np.expm1(-m * length) if steep else length
            distance = 0.0
            for k in range(n):
                down, up = below[first + k] - a, above[first + k] - a
                if steep:
                    down, up = np.expm1(-m * down), np.expm1(-m * up)
                distance = max(distance, down / whole - k / n, (k + 1) / n - up / whole)
            fits[0, i, j], fits[4, i, j] = m, distance
            fits[1, i, j] = 1.0 / (length * np.sqrt(n * law_moments(m * length)[1]))
            fits[2, i, j], fits[3, i, j] = a, a + length


@kernel
def order_nearby(middles, sums, reach, order):
    """order[i] = |Σ (sums[0] + i sums[1])| / Σ sums[2] over the points of ``middles`` (2, n) within
    ``reach`` of point i, itself among them."""
    count, most = order.size, reach * reach
    for i in range(count):
        real, imaginary, total = 0.0, 0.0, 0.0
        for j in range(count):
            across, up = middles[0, j] - middles[0, i], middles[1, j] - middles[1, i]
            if across * across + up * up <= most:
                real += sums[0, j]
                imaginary += sums[1, j]
                total += sums[2, j]
        order[i] = np.sqrt(real * real + imaginary * imaginary) / total


@kernel
def trace_origins(index, built, city, top, left, side, source, turn, affine, pixels, places, lifs):
    """Find the place of origin of each ``built`` pixel that shows a source city, row by row.

    index : number of the lifs at each pixel; city : the number of its source city, or below 0.
    top, left, side : its range block; source, turn : the packed corner and the isometry of its
    place; affine : `isometries.AFFINE`. ``pixels`` (2, n) get row and column, ``places`` (3, n)
    city, row and column, and ``lifs`` (n,) the number of the lifs. Returns the number of pixels.
    """
    count = 0
    for y in range(index.shape[0]):
        for x in range(index.shape[1]):
            k = index[y, x]
            if not built[y, x] or city[k] < 0:
                continue
            a, last = affine[turn[k]], side[k] - 1
            down, along = y - top[k], x - left[k]
            pixels[0, count], pixels[1, count] = y, x
            places[0, count], lifs[count] = city[k], k
            places[1, count] = source[k] // 32768 + a[0] * last + a[2] * down + a[4] * along
            places[2, count] = source[k] % 32768 + a[1] * last + a[3] * down + a[5] * along
            count += 1
    return count


@kernel
def stand_elsewhere(places, pixels, apart, heads, following, again):
    """again[i] = whether the place of pixel i, or one around it, belongs to a pixel that is more
    than ``apart`` px from pixel i, along rows or columns.

    ``places`` (3, n) are the city, row and column of each pixel, ``pixels`` (2, n) its row and
    column on the map. ``heads``, zeros, a square whose side is a power of two, and ``following``
    (n,) become lists of the pixels whose places lie alike in the square.
    """
    mask = np.int64(heads.shape[0] - 1)
    count = again.size
    for i in range(count):
        v, u = places[1, i] & mask, places[2, i] & mask
        following[i] = heads[v, u]
        heads[v, u] = i + 1
    for i in range(count):
        seen = False
        for v in range(places[1, i] - 1, places[1, i] + 2):
            for u in range(places[2, i] - 1, places[2, i] + 2):
                j = np.int64(0) if seen else np.int64(heads[v & mask, u & mask])
                while j > 0:
                    k = j - 1
                    if places[1, k] == v and places[2, k] == u and places[0, k] == places[0, i]:
                        down = abs(pixels[0, k] - pixels[0, i])
                        along = abs(pixels[1, k] - pixels[1, i])
                        if max(down, along) > apart:
                            seen = True
                            break
                    j = np.int64(following[k])
        again[i] = seen


@kernel
def add_moments(labels, y, x, sums):
    """Adds to ``sums`` (n, 12), over the pixels of each building i + 1 of ``labels``, with z = x +
    i y from its centroid (x[i], y[i]): |z|², z², z²z̄, z³, |z|⁴, z³z̄, z⁴, complex ones in pairs."""
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            label = labels[row, column]
            if label == 0:
                continue
            i = np.uintp(label - 1)
            b, a = row - y[i], column - x[i]
            square = a * a + b * b
            real, imaginary = a * a - b * b, 2 * a * b
            sums[i, 0] += square
            sums[i, 1] += real
            sums[i, 2] += imaginary
            sums[i, 3] += square * a
            sums[i, 4] += square * b
            sums[i, 5] += real * a - imaginary * b
            sums[i, 6] += real * b + imaginary * a
            sums[i, 7] += square * square
            sums[i, 8] += square * real
            sums[i, 9] += square * imaginary
            sums[i, 10] += real * real - imaginary * imaginary
            sums[i, 11] += 2 * real * imaginary


@kernel
def come_again(table, slack, again):
    """again[i] = whether another column of ``table`` (F, n), whose first row rises, differs in no
    row from column i by more than the smaller ``slack`` (F, n) of both."""
    rows, count = table.shape
    for i in range(count):
        for j in range(i + 1, count):
            if table[0, j] - table[0, i] > slack[0, i]:
                break
            equal = True
            for row in range(rows):
                least = min(slack[row, i], slack[row, j])
                if abs(table[row, j] - table[row, i]) > least:
                    equal = False
                    break
            if equal:
                again[i] = again[j] = True


@kernel
def first_walls(built, ground, start, ray, reach, distance):
    """distance[i] = how far the first built pixel is from start[:, i], row and column, px, along
    ray[:, i], in steps of half a pixel; −1 if it is ``reach[i]`` or more, or beyond the map or its
    open ``ground``."""
    rows, columns = built.shape
    for i in range(reach.size):
        distance[i] = -1.0
        for k in range(np.int64(np.ceil(2 * reach[i]))):
            row = np.int64(np.floor(start[0, i] + 0.5 * k * ray[0, i]))
            column = np.int64(np.floor(start[1, i] + 0.5 * k * ray[1, i]))
            if row < 0 or column < 0 or row >= rows or column >= columns:
                break
            if built[row, column]:
                distance[i] = 0.5 * k
            if not ground[row, column]:
                break


@kernel
def fullest_strips(values, starts, width, most):
    """most[g] = how many of the rising values[starts[g] : starts[g + 1]] lie at most ``width``
    apart."""
    for g in range(most.size):
        first, best = starts[g], 0
        for last in range(starts[g], starts[g + 1]):
            while values[last] - values[first] > width:
                first += 1
            best = max(best, last - first + 1)
        most[g] = best


@kernel
def count_sunny(heights, ground, across, rise, shadow):
    """Count the pixels of ``ground`` that the sun reaches, which stands beyond row 0.

    With each row towards the sun, a ray passes ``across`` columns, −1…1, and rises by ``rise``. It
    is in the shade if it meets a higher pixel. ``shadow`` (columns + rows) holds the height of the
    shadow on each line of pixels towards the sun. No shadow comes from beyond the map.
    """
    rows, columns = heights.shape
    half = rise / np.float32(2)  # a ray meets a pixel half a row before its middle
    left = max(np.int64(0), -np.int64(np.floor(across * (rows - 1) + 0.5)))
    shadow[:] = np.float32(0)
    count = 0
    for y in range(rows):
        line = shadow[np.uintp(left + np.int64(np.floor(across * y + 0.5))) :]
        for x in range(np.uintp(columns)):
            own = heights[y, x]
            shade = line[x] - rise
            count += ground[y, x] & (shade <= own)
            line[x] = max(shade, own + half)
    return count


@kernel
def light_facades(
    heights, walls, normals, back, storey, starts, ways, down, along, distance, pixel, highest, sky
):
    """sky[i] = mean over façade i of the light on it, as a share of that on open ground under the
    overcast sky of the CIE: the vertical sky component.

    ``walls`` (4, n) are row and column of the pixel before each façade, and of the wall's pixel. A
    façade reaches from the height of the former to that of the latter, in strips of about a
    ``storey``, each seen from its middle. ``normals`` (2, n) are unit vectors out of the wall, in
    rows and columns; the wall is ``back`` (n,) px behind the middle of the pixel before it.

    Direction d, the unit vector ways[:, d], passes the pixels ``down``, ``along`` of starts[d] :
    starts[d + 1] from that middle, each entered after ``distance`` px. Beyond the map nothing
    rises. No roof is above ``highest``; pixels have sides of ``pixel`` metres.
    """
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    directions = starts.size - 1
    tops, fars = np.empty(rows + columns), np.empty(rows + columns)
    for i in range(sky.size):
        y, x = walls[0, i], walls[1, i]
        base = np.float64(heights[y, x])
        whole = np.float64(heights[walls[2, i], walls[3, i]]) - base
        strips = max(np.int64(1), np.int64(np.floor(whole / storey + 0.5)))
        each = whole / strips
        below = 0  # strips that any roof can rise above
        while below < strips and base + each * (below + 0.5) < highest:
            below += 1
        last = base + each * (below - 0.5)
        light, weights = 0.0, 0.0
        for d in range(directions):
            facing = normals[0, i] * ways[0, d] + normals[1, i] * ways[1, d]
            if facing <= 0.0:
                continue
            weights += facing
            light += facing * (strips - below) * (np.pi / 4.0 + 2.0 / 3.0)
            behind = back[i] * facing
            # Only roofs above all nearer ones can hide more of the sky, from whichever strip.
            count, most, reach = 0, heights[y, x], np.inf
            for k in range(starts[d], starts[d + 1]):
                far = distance[np.uintp(k)] + behind
                v = np.uintp(y + down[np.uintp(k)])  # past the border on any side: huge
                u = np.uintp(x + along[np.uintp(k)])
                if far >= reach or v >= rows or u >= columns:
                    break
                if heights[v, u] > most:
                    most = heights[v, u]
                    tops[count], fars[count] = most, far * pixel
                    count += 1
                    if most >= highest:
                        break
                    if most > last:  # beyond the reach no roof rises higher, seen from any strip
                        reach = min(reach, far * (highest - last) / (most - last))
            for s in range(below):
                eye = base + each * (s + 0.5)
                steepest = 0.0
                for k in range(count):
                    steepest = max(steepest, (tops[k] - eye) / fars[k])
                cosine = 1.0 / np.sqrt(1.0 + steepest * steepest)
                hidden = np.arctan(steepest) + steepest * cosine * cosine
                light += facing * (np.pi / 4.0 - hidden / 2.0 + 2.0 / 3.0 * cosine**3)
        # 2/3 of the sum, on a wall, of the 7π/9 on open ground
        sky[i] = light / (weights * strips) * 6.0 / (7.0 * np.pi)


@kernel
def shorten_ways(first, last, length, distance):
    """Lower ``distance`` of each node to the shortest way along edges: from the distances given,
    over edges from ``first`` to ``last`` of a ``length``."""
    changed = True
    while changed:
        changed = False
        for k in range(first.size):
            one, other = first[k], last[k]
            if distance[one] + length[k] < distance[other]:
                distance[other] = distance[one] + length[k]
                changed = True
            if distance[other] + length[k] < distance[one]:
                distance[one] = distance[other] + length[k]
                changed = True


@kernel
def fit_places(number, row, column, turns, reach, places, slopes):
    """Fit a plane through the places of origin around each pixel of a map.

    ``number`` (h, w) has the city of each pixel, −1 for none; ``row`` and ``column`` (h, w) its
    place; ``turns`` (4, h, w) its isometry, as columns 2 to 5 of `AFFINE`. Pixels of the same city
    within ``reach`` count if their places suit the isometry, turned by at most an eighth. The
    fitted place goes to ``places`` (2, h, w), its steps down and along to ``slopes`` (4, h, w).
    """
    height, width = number.shape
    for y in range(height):
        for x in range(width):
            if number[y, x] < 0:
                continue
            down, along = turns[:2, y, x], turns[2:, y, x]
            n = sy = sx = syy = sxx = sxy = 0.0
            sr = sc = syr = sxr = syc = sxc = 0.0
            for yy in range(max(y - reach, 0), min(y + reach + 1, height)):
                for xx in range(max(x - reach, 0), min(x + reach + 1, width)):
                    if number[yy, xx] != number[y, x]:
                        continue
                    dy, dx = float(yy - y), float(xx - x)
                    r, c = row[yy, xx] - row[y, x], column[yy, xx] - column[y, x]
                    far = np.hypot(dy, dx)
                    aside = np.hypot(
                        r - down[0] * dy - along[0] * dx, c - down[1] * dy - along[1] * dx
                    )
                    if abs(np.hypot(r, c) - far) > 0.25 * far + 1.5 or aside > 0.8 * far + 1.5:
                        continue
                    n, sy, sx, sr, sc = n + 1, sy + dy, sx + dx, sr + r, sc + c
                    syy, sxx, sxy = syy + dy * dy, sxx + dx * dx, sxy + dx * dy
                    syr, sxr, syc, sxc = syr + dy * r, sxr + dx * r, syc + dy * c, sxc + dx * c
            a, b, e = syy - sy * sy / n, sxx - sx * sx / n, sxy - sx * sy / n
            det = a * b - e * e
            places[0, y, x], places[1, y, x] = row[y, x], column[y, x]
            slopes[:, y, x] = turns[:, y, x]
            if n < 9 or det < 1e-6 * n * n:
                continue
            pr, qr = syr - sy * sr / n, sxr - sx * sr / n
            pc, qc = syc - sy * sc / n, sxc - sx * sc / n
            slopes[0, y, x], slopes[1, y, x] = (pr * b - qr * e) / det, (pc * b - qc * e) / det
            slopes[2, y, x], slopes[3, y, x] = (qr * a - pr * e) / det, (qc * a - pc * e) / det
            places[0, y, x] += (sr - slopes[0, y, x] * sy - slopes[2, y, x] * sx) / n
            places[1, y, x] += (sc - slopes[1, y, x] * sy - slopes[3, y, x] * sx) / n
