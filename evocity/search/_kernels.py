"""Compiled loops of the search. Slow twins stand in tests/naive.py."""

from evocity.accelerate import kernel


@kernel
def resembles(look, others, step, most):
    """Whether a ``look`` (n,) differs by more than ``step`` in ``most`` cells or fewer from one of
    the ``others`` (k, n)."""
    for k in range(others.shape[0]):
        differ = 0
        for i in range(look.size):
            # of unsigned numbers
            low, high = min(look[i], others[k, i]), max(look[i], others[k, i])
            differ += high - low > step
            if differ > most:
                break
        if differ <= most:
            return True
    return False
