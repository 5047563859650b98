"""Numbers for equal rows of arrays."""

import numpy as np


def number_rows(rows: np.ndarray) -> np.ndarray:
    """Number the ``rows`` from 0 on, int64 ``(n,)``: equal rows have equal numbers."""
    order = np.lexsort(rows.T[::-1])
    found = np.zeros(len(rows), np.int64)
    found[order[1:]] = np.cumsum((rows[order[1:]] != rows[order[:-1]]).any(axis=1))
    return found
