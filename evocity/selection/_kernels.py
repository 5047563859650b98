"""Kernels of selection: likeness of looks, and contributions to the hypervolume of two losses.

tests/naive.py has slow versions of them.
"""

import numpy as np

from evocity.accelerate import kernel

# Cells that are counted before the next check of how many differ already.
_AT_A_TIME = 256


@kernel
def _resemble(look, other, step, most):
    """Whether two looks (n,) differ by more than ``step`` in ``most`` cells or fewer."""
    differ = 0
    for start in range(0, look.size, _AT_A_TIME):
        # the compiler makes vector code of slices and narrow numbers
        one, two, here = look[start : start + _AT_A_TIME], other[start : start + _AT_A_TIME], 0
        for i in range(one.size):
            here += np.int32(abs(np.int32(one[i]) - np.int32(two[i])) > step)
        differ += here
        if differ > most:
            return False
    return True


@kernel
def resembles(look, others, step, most):
    """Whether a ``look`` (n,) differs from one of ``others`` (k, n) in at most ``most`` cells."""
    for k in range(others.shape[0]):  # noqa: SIM110
        if _resemble(look, others[k], step, most):
            return True
    return False


@kernel
def count_differences(looks, step, counts):
    """Count for each two of the ``looks`` (n, cells) the cells that differ by more than ``step``;
    the result goes to ``counts`` (n, n)."""
    for i in range(len(looks)):
        for k in range(i):
            one, two, differ = looks[i], looks[k], 0
            for j in range(one.size):
                differ += np.int32(abs(np.int32(one[j]) - np.int32(two[j])) > step)
            counts[i, k] = counts[k, i] = differ


@kernel
def first_apart(looks, step, mosts, count):
    """Select at most ``count`` of the ``looks`` (n, cells) by their indices. For each of the
    ``mosts`` (k,) in turn, it takes every look that differs by more than ``step`` in more cells
    than that from all looks taken before."""
    chosen = np.empty(min(count, len(looks)), np.int64)
    taken = np.zeros(len(looks), np.bool_)
    found = 0
    for most in mosts:
        for i in range(len(looks)):
            if found == len(chosen):
                return chosen
            if taken[i]:
                continue
            apart = True
            for k in range(found):
                if _resemble(looks[i], looks[chosen[k]], step, most):
                    apart = False
                    break
            if apart:
                chosen[found], taken[i] = i, True
                found += 1
    return chosen[:found]


@kernel
def _adds(losses, reference, left, row):
    """Compute the area that a ``row`` of two losses adds to the rows ``left``, as moocore to the
    bit."""
    x, y = losses[row, 0], losses[row, 1]
    above, right, found = reference[1], reference[0], False
    for other in range(len(losses)):
        if left[other] and other != row:
            if losses[other, 0] <= x:
                above, found = min(above, max(losses[other, 1], y)), True
            else:
                right = min(right, losses[other, 0])
    shared = 0.0
    if found:
        shared += (reference[0] - x) * (reference[1] - above)
    if y < above:
        shared += (reference[0] - right) * (above - y)
    return max((reference[0] - x) * (reference[1] - y) - shared, 0.0)


@kernel
def least_of_two(losses, reference, known, count):
    """Drop ``count`` rows of a front of two losses as `moocore.least_first`, and update
    ``known``."""
    left, fresh = np.ones(len(losses), np.bool_), np.ones(len(losses), np.bool_)
    dropped = np.empty(count, np.int64)
    for turn in range(count):
        while True:
            row = -1
            for other in range(len(losses)):
                if left[other] and (row < 0 or known[other] <= known[row]):
                    row = other
            if fresh[row]:
                break
            known[row], fresh[row] = _adds(losses, reference, left, row), True
        dropped[turn] = row
        left[row] = False
        fresh[:] = False
    for row in range(len(losses)):
        if left[row] and not fresh[row]:
            known[row] = _adds(losses, reference, left, row)
    return dropped
