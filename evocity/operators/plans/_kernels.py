"""Compiled loops over the points of a lot. Their slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel

#: Rows and columns of the cells by which `score_candidates` orders its work.
CELLS = 8


@kernel
def _rim(down, along):
    """List the points that lie farthest in each of eight directions, int64 ``(8,)``; none if there
    are no points."""
    rim = np.zeros(8 if down.size else 0, np.int64)
    for k in range(rim.size):
        v, u = np.sin(k * np.pi / 4), np.cos(k * np.pi / 4)
        most = -np.inf
        for i in range(down.size):
            if v * down[i] + u * along[i] > most:
                most, rim[k] = v * down[i] + u * along[i], i
    return rim


@kernel
def _score(
    numbers, areas, used, pixel, step, down, along, inner, cell, share, coverage, slack, repeats,
    row, column, angle, mirror, scale, axis, floor, rim, pixels, seen, counts,
):  # fmt: skip
    """Score one candidate, see `score_candidates`. ``rim`` lists points of the outline, see `_rim`.
    Scratch: ``pixels`` uint32 and ``seen`` int32, ``(inner,)``, and ``counts``, int32 ``(n + 1,)``,
    zeros before and after."""
    height, width = numbers.shape
    flat = numbers.ravel()
    tall, wide = used.shape
    if row < 0 or row > tall - 1 or column < 0 or column > wide - 1:
        return -np.inf
    # fine pixels down and along that a metre down and a metre along the plan become: the stretch
    # along the axis comes first, then the turn
    size, more, v, u = scale * step, 0.0, 0.0, 0.0
    if not np.isnan(axis):
        size, more, v, u = step, 1 / scale - 1, np.sin(axis), np.cos(axis)
    cosine, sine = np.cos(angle) / size, np.sin(angle) / size
    first, both, last = 1 + more * v * v, more * v * u, 1 + more * u * u
    sign = -1.0 if mirror > 0 else 1.0
    a, b = cosine * first - sine * both, cosine * both - sine * last
    c, d = sign * (sine * first + cosine * both), sign * (sine * both + cosine * last)
    ratio = pixel / step
    top, left = (row + 0.5) * ratio, (column + 0.5) * ratio
    # share of a building's area in points of the lot, at its size on the ground
    least = share * (scale if not np.isnan(axis) else scale * scale) / cell
    for i in rim:  # most places that leave the source city do so here
        y, x = top + a * down[i] + b * along[i], left + c * down[i] + d * along[i]
        if not (0 <= y < height and 0 <= x < width):
            return -np.inf
    within = 0
    for i in range(down.size):  # without branches, so it becomes vector code
        y, x = top + a * down[i] + b * along[i], left + c * down[i] + d * along[i]
        within += np.int64((y >= 0) & (y < height) & (x >= 0) & (x < width))
    if within < down.size:
        return -np.inf
    for i in range(inner):
        y, x = top + a * down[i] + b * along[i], left + c * down[i] + d * along[i]
        pixels[i] = np.int32(y) * width + np.int32(x)
    for i in range(inner):
        n = flat[np.uintp(pixels[i])]
        seen[i] = n
        counts[n] += 1
    all_built, front, again = 0, 0, 0
    for i in range(inner):  # without branches, as these would be unpredictable
        n = seen[i]
        all_built += (n > 0) & (counts[n] + 1 >= least * areas[n])
    strip = down.size - inner
    less = 2 * max(abs(all_built / max(inner, 1) - coverage) - slack, 0)
    needed = (floor + less) * strip - 1e-6  # points of the strip, or the score is below the floor
    inside = not strip < needed  # a floor of −∞ may make needed NaN
    for i in range(inner if inside else 0):
        n = seen[i]
        if n and counts[n] + 1 >= least * areas[n]:
            y, x = top + a * down[i] + b * along[i], left + c * down[i] + d * along[i]
            again += used[min(int(y / ratio), tall - 1), min(int(x / ratio), wide - 1)]
    # points are few, so the whole lot decides on small shares
    inside &= again <= 2 * repeats * all_built + 2
    k = inner
    while k < down.size and inside:
        if front + down.size - k < needed:
            inside = False
            break
        y, x = top + a * down[k] + b * along[k], left + c * down[k] + d * along[k]
        n = flat[np.uintp(np.int32(y) * width + np.int32(x))]
        front += n > 0 and counts[n] + 1 >= least * areas[n]
        k += 1
    for i in range(inner):
        counts[seen[i]] = 0
    if not inside:
        return -np.inf
    score = front / strip if strip else 1.0
    return score - less


@kernel
def _near_each_other(candidates, shape):
    """Order the candidates by square cells of a map of this ``shape``, row by row and to and fro:
    those of a cell read memory that is in the cache."""
    cells = np.empty(len(candidates), np.int64)
    for k in range(cells.size):
        i = min(max(int(candidates[k, 0] * CELLS / shape[0]), 0), CELLS - 1)
        j = min(max(int(candidates[k, 1] * CELLS / shape[1]), 0), CELLS - 1)
        cells[k] = i * CELLS + (CELLS - 1 - j if i % 2 else j)
    ends = np.zeros(CELLS * CELLS + 1, np.int64)
    for k in range(cells.size):
        ends[cells[k] + 1] += 1
    for n in range(CELLS * CELLS):
        ends[n + 1] += ends[n]
    order = np.empty(cells.size, np.int64)
    for k in range(cells.size):
        order[ends[cells[k]]] = k
        ends[cells[k]] += 1
    return order


@kernel
def score_candidates(
    numbers, areas, used, pixel, step, down, along, inner, cell, share, coverage, slack, repeats,
    candidates, floor, scores,
):  # fmt: skip
    """Score candidates: float64 ``scores`` ``(k,)``, the built share of points of a strip, less
    twice the difference of the coverages beyond ``slack``.

    A building counts only if about the ``share`` of its area stands in the lot. The score is −∞
    where a point lies beyond the source city, where the place does, and where more than twice the
    share ``repeats`` of the built points, and two more, are used. It may be −∞, too, where it is
    below the ``floor``.

    numbers : int32 ``(h, w)``, the building on each fine pixel of the source city, 0 on ground.
    areas : float64 ``(n + 1,)``, m², of the n buildings. used : bool ``(H, W)``, pixels that stand
    on the map already. pixel, step : sides of the pixels and of the fine pixels, metres.
    down, along : float64 ``(n,)``, offsets of points from the centre of the face, metres; the first
    ``inner`` are points of the whole lot, the others of the strip along its outline. cell : area of
    the lot for each of its points, m². coverage : built share of the lot that is wanted.
    candidates : float64 ``(k, 6)``, row and column of the place, px; angle; mirror, 0 or 1; scale;
    axis, NaN for all directions.
    """
    pixels, seen = np.empty(inner, np.uint32), np.empty(inner, np.int32)
    counts, rim = np.zeros(areas.size, np.int32), _rim(down, along)
    for k in _near_each_other(candidates, used.shape):
        row, column, angle, mirror, scale, axis = candidates[k]
        scores[k] = _score(
            numbers, areas, used, pixel, step, down, along, inner, cell, share, coverage, slack,
            repeats, row, column, angle, mirror, scale, axis, floor, rim, pixels, seen, counts,
        )  # fmt: skip


@kernel
def improve_candidates(
    numbers, areas, used, pixel, step, down, along, inner, cell, share, coverage, slack, repeats,
    candidates, moves, trials, low, high,
):  # fmt: skip
    """Move each of the ``candidates`` to the best place, and then to the best size; changes them.

    moves : float64 ``(m, 2)``, ways, px. trials : float64 ``(t, 3)``, ways and factors of the size,
    which stays within ``low`` and ``high`` if it changes. The first of equally good ones wins. The
    other arguments are those of `score_candidates`.
    """
    pixels, seen = np.empty(inner, np.uint32), np.empty(inner, np.int32)
    counts, rim = np.zeros(areas.size, np.int32), _rim(down, along)
    for k in range(len(candidates)):
        row, column, angle, mirror, scale, axis = candidates[k]
        best, at = -np.inf, 0
        for m in range(len(moves)):
            score = _score(
                numbers, areas, used, pixel, step, down, along, inner, cell, share, coverage,
                slack, repeats, row + moves[m, 0], column + moves[m, 1], angle, mirror, scale,
                axis, best, rim, pixels, seen, counts,
            )  # fmt: skip
            if score > best:
                best, at = score, m
        row, column = row + moves[at, 0], column + moves[at, 1]
        best, at, sized = -np.inf, 0, scale
        for t in range(len(trials)):
            size = scale
            if trials[t, 2] != 1:
                size = min(max(scale * trials[t, 2], low), high)
            score = _score(
                numbers, areas, used, pixel, step, down, along, inner, cell, share, coverage,
                slack, repeats, row + trials[t, 0], column + trials[t, 1], angle, mirror, size,
                axis, best, rim, pixels, seen, counts,
            )  # fmt: skip
            if score > best:
                best, at, sized = score, t, size
        candidates[k, 0], candidates[k, 1] = row + trials[at, 0], column + trials[at, 1]
        candidates[k, 4] = sized


@kernel
def sum_squares(places, radius, sums, totals):
    """Sum a raster ``(H, W)`` in a square of half the side ``radius`` around each of the ``places``
    (n, 2), row and column, px: complex ``totals`` ``(n,)``.

    sums : complex ``(H + 1, W + 1)``, the sums of the raster north-west of each corner.
    """
    height, width = sums.shape[0] - 1.0, sums.shape[1] - 1.0
    for k in range(len(places)):
        row, column = places[k]
        top = np.int64(min(max(np.rint(row - radius), 0.0), height))
        left = np.int64(min(max(np.rint(column - radius), 0.0), width))
        bottom = np.int64(min(max(np.rint(row + radius) + 1, 0.0), height))
        right = np.int64(min(max(np.rint(column + radius) + 1, 0.0), width))
        totals[k] = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]


@kernel
def sample_polygons(numbers, step, down, along, row, column, turns, half, found):
    """Find the polygon that covers most of each pixel of a lot: int32 ``found`` ``(n,)``.

    0, ground, stands where less than half of a pixel is built.

    numbers : int32 ``(h, w)``, polygon of each fine pixel, 0 on ground. step : side of the fine
    pixels, metres. down, along : float64 ``(n,)``, offsets of pixels from the centre of the face,
    metres. row, column : place of that centre in the source city, metres. turns : float64
    ``(4,)``, metres down and then along in the source city that a metre down and a metre along the
    plan become. half : a quarter of the side of a pixel, metres: four samples in each pixel.
    """
    height, width = numbers.shape
    seen = np.zeros(4, np.int32)
    for i in range(down.size):
        for k in range(4):
            y = down[i] + (half if k >= 2 else -half)
            x = along[i] + (half if k % 2 else -half)
            fine_y = int(np.floor((row + turns[0] * y + turns[1] * x) / step))
            fine_x = int(np.floor((column + turns[2] * y + turns[3] * x) / step))
            value = np.int32(0)
            if 0 <= fine_y < height and 0 <= fine_x < width:
                value = numbers[fine_y, fine_x]
            j = k
            while j > 0 and seen[j - 1] > value:
                seen[j] = seen[j - 1]
                j -= 1
            seen[j] = value
        most = seen[2]
        if 0 < seen[1] < most and (seen[0] == seen[1] or seen[3] != most):
            most = seen[1]
        found[i] = most


@kernel
def _collect(state, allowed, first, mark, top, left, bottom, right, queue):
    """Collect the pixels of ``state`` that connect by sides to the pixel ``first``, within a box,
    through pixels of the values from ``allowed[0]`` to ``allowed[1]``; they get the value ``mark``.
    Writes them into ``queue`` and returns their number."""
    columns = state.shape[1]
    flat = state.ravel()
    flat[first] = mark
    queue[0] = first
    done, count = 0, 1
    while done < count:
        at = queue[done]
        done += 1
        row, column = at // columns, at % columns
        for k in range(4):
            r = row + (k == 0) - (k == 1)
            c = column + (k == 2) - (k == 3)
            if r < top or r >= bottom or c < left or c >= right:
                continue
            beside = r * columns + c
            if allowed[0] <= flat[beside] <= allowed[1]:
                flat[beside] = mark
                queue[count] = beside
                count += 1
    return count


@kernel
def drop_pieces(numbers, areas, pixel, whole, share, least, width, tip):
    """Remove those parts of cut buildings that are too small or too slender.

    numbers : int32 ``(h, w)``, changed: the building of each pixel, 0 on ground. areas : float64
    ``(n + 1,)``, m², the areas of the whole buildings. pixel : side of a pixel, metres. whole :
    share of its area from which on a building counts as whole. share : least share that stands.
    least : fewest pixels of a part. width : parts and tips narrower than this square go, px. tip :
    least length of a tip that goes, px.
    """
    height, columns = numbers.shape
    boxes = np.empty((areas.size, 4), np.int32)
    sizes = np.zeros(areas.size, np.int64)
    for r in range(height):
        for c in range(columns):
            n = numbers[r, c]
            if n == 0:
                continue
            if sizes[n] == 0:
                boxes[n] = r, c, r + 1, c + 1
            sizes[n] += 1
            boxes[n, 1] = min(boxes[n, 1], c)
            boxes[n, 2] = r + 1
            boxes[n, 3] = max(boxes[n, 3], c + 1)
    # 0 elsewhere, 1 thin, 2 thick, 3 thin and seen, 4 a tip that goes, 5 seen as a part
    state = np.empty((height, columns), np.uint8)
    queue = np.empty(height * columns, np.int64)
    thin, stays = (1, 1), (2, 3)
    for n in range(1, areas.size):
        present = sizes[n] * pixel**2
        if sizes[n] == 0 or present >= whole * areas[n]:
            continue
        top, left, bottom, right = boxes[n]
        if present < share * areas[n]:
            for r in range(top, bottom):
                for c in range(left, right):
                    if numbers[r, c] == n:
                        numbers[r, c] = 0
            continue
        for r in range(top, bottom):
            for c in range(left, right):
                state[r, c] = numbers[r, c] == n
        for r in range(top, bottom - width + 1):
            for c in range(left, right - width + 1):
                full = True
                for i in range(r, r + width):
                    for j in range(c, c + width):
                        if state[i, j] == 0:
                            full = False
                            break
                    if not full:
                        break
                if full:
                    for i in range(r, r + width):
                        for j in range(c, c + width):
                            state[i, j] = 2
        for r in range(top, bottom):
            for c in range(left, right):
                if state[r, c] != 1:
                    continue
                count = _collect(state, thin, r * columns + c, 3, top, left, bottom, right, queue)
                low, high, first, last = r, r, c, c
                for k in range(count):
                    row, column = queue[k] // columns, queue[k] % columns
                    low, high = min(low, row), max(high, row)
                    first, last = min(first, column), max(last, column)
                if max(high - low, last - first) + 1 >= tip:
                    for k in range(count):
                        state[queue[k] // columns, queue[k] % columns] = 4
                        numbers[queue[k] // columns, queue[k] % columns] = 0
        for r in range(top, bottom):
            for c in range(left, right):
                if state[r, c] != 2 and state[r, c] != 3:
                    continue
                count = _collect(state, stays, r * columns + c, 5, top, left, bottom, right, queue)
                if count < least:
                    for k in range(count):
                        numbers[queue[k] // columns, queue[k] % columns] = 0


@kernel
def _full_square(numbers, added, r, c):
    """Whether all 3 × 3 pixels around a pixel are on the map, and built or ``added``."""
    if r < 1 or c < 1 or r + 1 >= numbers.shape[0] or c + 1 >= numbers.shape[1]:
        return False
    for i in range(r - 1, r + 2):
        for j in range(c - 1, c + 2):
            if numbers[i, j] == 0 and added[i, j] == 0:
                return False
    return True


@kernel
def _any_near(numbers, added, r, c):
    """Whether a pixel of the 3 × 3 around a pixel is built or ``added``."""
    for i in range(max(r - 1, 0), min(r + 2, numbers.shape[0])):
        for j in range(max(c - 1, 0), min(c + 2, numbers.shape[1])):
            if numbers[i, j] > 0 or added[i, j] == 1:
                return True
    return False


@kernel
def fill_gaps(numbers, rows, columns, inward, free, shifts, gap, straight):
    """Let buildings grow over narrow gaps towards the outline of a lot.

    A pixel of the gap is filled if the way to its nearest wall is at most ``gap`` px, and has with
    the way from the outline a cosine of at least ``straight``. Of equally near walls, the one with
    the largest cosine counts. Then notches of less than 3 px are filled, and teeth of less than
    3 px go.

    numbers : int32 ``(h, w)``, changed: the building of each pixel, 0 on ground. rows, columns :
    int64 ``(k,)``, pixels near the outline. inward : float64 ``(2, k)``, unit vectors from the
    outline. free : bool ``(k,)``, pixels on which buildings may grow. shifts : int64 ``(m, 2)``,
    short ways from a pixel, the shortest first.
    """
    height, width = numbers.shape
    many = rows.size
    # 1 full, 2 closed
    added = np.zeros((height, width), np.uint8)
    source = np.zeros(many, np.int32)
    for k in range(many):
        r, c = rows[k], columns[k]
        if numbers[r, c] > 0 or not free[k]:
            continue
        best, nearest = -2.0, 0
        for m in range(shifts.shape[0]):
            down, along = shifts[m, 0], shifts[m, 1]
            square = down * down + along * along
            if source[k] > 0 and square > nearest:
                break
            y, x = r + down, c + along
            if y < 0 or x < 0 or y >= height or x >= width or numbers[y, x] == 0:
                continue
            cosine = (down * inward[0, k] + along * inward[1, k]) / np.sqrt(square)
            if cosine > best:
                best, nearest, source[k] = cosine, square, numbers[y, x]
        if source[k] > 0 and best >= straight and nearest <= gap * gap:
            added[r, c] = 1
    for k in range(many):
        r, c = rows[k], columns[k]
        if source[k] == 0 or added[r, c] == 1 or not _any_near(numbers, added, r, c):
            continue
        closed = True
        for i in range(max(r - 1, 0), min(r + 2, height)):
            for j in range(max(c - 1, 0), min(c + 2, width)):
                closed = closed and _any_near(numbers, added, i, j)
        if closed:
            added[r, c] = 2
    grown = np.zeros(many, np.bool_)
    for k in range(many):
        r, c = rows[k], columns[k]
        if source[k] > 0 and added[r, c] > 0:
            for i in range(r - 1, r + 2):
                for j in range(c - 1, c + 2):
                    grown[k] = grown[k] or _full_square(numbers, added, i, j)
    for k in range(many):
        if grown[k]:
            numbers[rows[k], columns[k]] = source[k]
