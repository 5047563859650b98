"""Fields: a few numbers over a map, smooth in between, and their weights in parts of the map."""

import numpy as np

#: The most values along a side of a field.
MOST_SIDE = 64
#: Digits after the point that values keep, so that the log has what was laid.
DIGITS = 4


def field_weights(labels: np.ndarray, numbers: np.ndarray, side: int) -> np.ndarray:
    """Compute the weight of each value of a field of ``side`` × ``side`` in each part of a map.

    Values lie in the middle of equal squares of the map, linear in between, level beyond the
    outermost.

    labels : int ``(H, W)``, the part of each cell.
    numbers : int ``(n,)``, the labels of the parts.

    Returns float64 ``(n, side²)``, values row by row from the north-west; rows of sum 1.
    """
    rows, columns = (_linear(length, side) for length in labels.shape)
    at = np.zeros(int(labels.max(initial=0)) + 1, np.int64)
    at[numbers] = np.arange(1, numbers.size + 1)
    of = at[labels]
    weights = np.zeros((numbers.size, side * side))
    for row in range(side):
        for column in range(side):
            weight = rows[:, row, None] * columns[None, :, column]
            total = np.bincount(of.ravel(), weight.ravel(), numbers.size + 1)
            weights[:, row * side + column] = total[1:]
    return weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)


def _linear(length: int, side: int) -> np.ndarray:
    """Compute the weights of ``side`` values in each of ``length`` cells, ``(length, side)``."""
    place = np.clip((np.arange(length) + 0.5) * side / length - 0.5, 0, side - 1)
    return np.maximum(0, 1 - np.abs(place[:, None] - np.arange(side)))
