"""Pairing of squares of cells of two cities: contents, amounts built, and neighbours laid before.

A single range block has a likeness almost everywhere, so a city of paired blocks is the first city
again. A square of several blocks has no such likeness, and shows buildings of the second city.
"""

import math
from collections.abc import Sequence

import numpy as np

from evocity import isometries
from evocity.operators.pairing._kernels import square_costs
from evocity.pavement import Pavement

#: How often the squared difference of mean heights counts: open ground fits everywhere, and would
#: replace scattered houses.
MEAN_WEIGHT = 4.0
#: How often the mean squared step to squares laid before counts, in a rim of one cell.
RIM_WEIGHT = 1.0
#: What each use of a square, or of one that begins within half a side of it, adds to its cost, as a
#: share of the cost: without it, a few squares would repeat all over the map.
REPEAT_WEIGHT = 0.5
#: On a map of more cells, squares begin only at every k-th row and column, at about so many places
#: or fewer: the costs of all take a time that grows with the fourth power of the map's side.
MOST_PLACES = 4096


def pair_squares(
    grid: Pavement,
    maps: Sequence[np.ndarray],
    count: int,
    *,
    turned: bool = False,
    alike: float = 0.01,
) -> tuple[np.ndarray, np.ndarray]:
    """Pair squares of ``count`` × ``count`` cells of the ``grid``, from the north-west on: for each
    cell of the first city a cell of the second and an isometry, int64 ``(n,)`` each.

    A square of the second city may begin at any cell; on a map of more than `MOST_PLACES` cells, at
    every k-th row and column from the first city's square. Its cost, m², is the mean squared
    difference of heights from the first city's square, plus `MEAN_WEIGHT` times the squared
    difference of the mean heights, plus `RIM_WEIGHT` times the mean squared difference between the
    cells around it and the squares laid before. Each earlier use of a square adds the share
    `REPEAT_WEIGHT` of its cost. Of squares whose cost exceeds the least by at most ``alike``², the
    one at the same place wins, else the first by isometry, row and column. Squares at the east and
    south border of a map end there.

    maps : decoded heights of the two cities, float32 ``(H, W)``, metres.
    turned : whether squares are compared under all 8 isometries.
    """
    cell, rows, columns = grid.block, grid.rows, grid.columns
    side = count + 2  # a rim of one cell around each square
    padded = np.pad(maps[1], cell * (count + 1), mode="edge").astype(np.float32)
    places = rows + count, columns + count  # north-west cells, in rows and columns from −count on
    stride = math.ceil(math.sqrt(rows * columns / MOST_PLACES))
    phases = _phases(padded, cell * stride)
    sums = np.pad(_cell_means(maps[1], cell), ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    wanted, numbers = _cell_means(maps[0], cell), np.arange(len(grid)).reshape(rows, columns)
    frame = np.pad(maps[0], cell).astype(np.float32)
    picture = np.full_like(frame, np.nan)
    index, iso = np.empty((2, rows, columns), np.int64)
    uses, near = np.ones(places, np.float32), count // 2
    for top in range(0, rows, count):
        for left in range(0, columns, count):
            height, width = min(count, rows - top), min(count, columns - left)
            patch, weight = _patch(frame, picture, cell, top, left, height, width, side)
            used = np.zeros((count, count), bool)
            used[:height, :width] = True
            level = wanted[top : top + height, left : left + width].mean()
            first = [(one + count) % stride for one in (top, left)]
            starts = [np.arange(first[k], places[k], stride) - count for k in (0, 1)]
            lattice = slice(first[0], None, stride), slice(first[1], None, stride)
            before = [(cell * one, 0) for one in first]  # pixels of weight 0
            costs = []
            for turn in range(8 if turned else 1):
                back = int(isometries.INVERSE[turn])
                cost = np.zeros((len(starts[0]), len(starts[1])), np.float32)
                square_costs(
                    phases,
                    np.pad(isometries.apply(back, patch), before),
                    np.pad(isometries.apply(back, weight), before),
                    cost,
                )
                cost += _level_costs(sums, isometries.apply(back, used), level, starts)
                costs.append(cost * uses[lattice])
            own = [(one + count) // stride for one in (top, left)]
            turn, *chosen = _choose(np.stack(costs), own, alike)
            row, column = (int(starts[k][chosen[k]]) for k in (0, 1))
            at = row + count, column + count
            around = (slice(max(one - near, 0), one + near + 1) for one in at)
            uses[tuple(around)] += np.float32(REPEAT_WEIGHT)
            source = np.full((count, count), -1)
            y, x = np.mgrid[row : row + count, column : column + count]
            inside = (y >= 0) & (y < rows) & (x >= 0) & (x < columns)
            source[inside] = numbers[y[inside], x[inside]]
            here = slice(top, top + height), slice(left, left + width)
            index[here] = isometries.apply(turn, source)[:height, :width]
            iso[here] = turn
            y, x = cell * (at[0] + 1), cell * (at[1] + 1)
            shown = padded[y : y + cell * count, x : x + cell * count]
            there = (slice(cell * (one.start + 1), cell * (one.stop + 1)) for one in here)
            picture[tuple(there)] = isometries.apply(turn, shown)[: cell * height, : cell * width]
    return index.ravel(), iso.ravel()


def _phases(padded: np.ndarray, step: int) -> np.ndarray:
    """Sort the pixels of a map by their places in squares of ``step`` pixels, for `square_costs`;
    its last rows and columns continue to a multiple of ``step``."""
    padded = np.pad(padded, [(0, -extent % step) for extent in padded.shape], mode="edge")
    cut = padded.reshape(padded.shape[0] // step, step, padded.shape[1] // step, step)
    return np.ascontiguousarray(cut.transpose(1, 3, 0, 2).astype(np.float32))


def _cell_means(heights: np.ndarray, cell: int) -> np.ndarray:
    rows, columns = heights.shape[0] // cell, heights.shape[1] // cell
    return heights.astype(np.float64).reshape(rows, cell, columns, cell).mean(axis=(1, 3))


def _patch(frame, picture, cell, top, left, height, width, side) -> tuple[np.ndarray, np.ndarray]:
    """Make a square with its rim, heights and weights of pixels, float32 ``(side · cell,) * 2``.

    The square has the heights of the first city, ``frame``, and the rim those of the ``picture`` so
    far; both have a margin of one cell. Weights of the square sum to 1, those of the rim to
    `RIM_WEIGHT`; pixels without heights have the weight 0.
    """
    patch, weight = np.zeros((2, side * cell, side * cell), np.float32)
    tall, wide = (min(cell * side, frame.shape[k] - cell * (top, left)[k]) for k in (0, 1))
    laid = picture[cell * top : cell * top + tall, cell * left : cell * left + wide]
    known = np.isfinite(laid)
    rim = np.ones((tall, wide), bool)
    rim[cell : cell * (1 + height), cell : cell * (1 + width)] = False
    rim[:cell, :cell] = rim[:cell, cell * (1 + width) :] = False  # no corners
    rim[cell * (1 + height) :] = False
    rim &= known
    patch[:tall, :wide][rim] = laid[rim]
    weight[:tall, :wide][rim] = RIM_WEIGHT / max(int(np.count_nonzero(rim)), 1)
    inner = slice(cell, cell * (1 + height)), slice(cell, cell * (1 + width))
    from_frame = (
        slice(cell * (top + 1), cell * (top + 1 + height)),
        slice(cell * (left + 1), cell * (left + 1 + width)),
    )
    patch[inner] = frame[from_frame]
    weight[inner] = 1 / (height * width * cell * cell)
    return patch, weight


def _level_costs(sums: np.ndarray, used: np.ndarray, level: float, starts) -> np.ndarray:
    """Return `MEAN_WEIGHT` · (mean − ``level``)² of the ``used`` cells of squares that begin in the
    rows and columns ``starts``, float32; infinite where a used cell lies beyond the map. Argument
    ``sums`` (rows + 1, columns + 1) has the sums of all means to the north-west of each corner."""
    rows, columns = np.nonzero(used)
    first, last = (rows.min(), columns.min()), (rows.max() + 1, columns.max() + 1)
    starts = [starts[k] + first[k] for k in (0, 1)]
    sizes = [last[k] - first[k] for k in (0, 1)]
    fits = [
        (start >= 0) & (start + size < sums.shape[k])
        for k, (start, size) in enumerate(zip(starts, sizes, strict=True))
    ]
    y, x = (np.where(fit, start, 0) for fit, start in zip(fits, starts, strict=True))
    y, x = y[:, None], x[None]
    total = (
        sums[y + sizes[0], x + sizes[1]]
        - sums[y, x + sizes[1]]
        - sums[y + sizes[0], x]
        + sums[y, x]
    )
    costs = MEAN_WEIGHT * (total / (sizes[0] * sizes[1]) - level) ** 2
    costs[~(fits[0][:, None] & fits[1][None])] = np.inf
    return costs.astype(np.float32)


def _choose(costs: np.ndarray, own: Sequence[int], alike: float) -> tuple[int, ...]:
    """Choose isometry, row and column of the least of ``costs`` (isometries, rows, columns), those
    of the ``own`` place if they are as good."""
    limit = costs.min() + np.float32(alike) ** 2
    if costs[(0, *own)] <= limit:
        return 0, *own
    return tuple(map(int, np.unravel_index(int(np.argmax(costs <= limit)), costs.shape)))
