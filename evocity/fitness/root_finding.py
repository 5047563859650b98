"""Root finding: Brent's method for a function of one number."""

from collections.abc import Callable

import numpy as np

#: Tolerance of a root besides ``within``, as a share of the root.
_SHARE = 4 * float(np.finfo(float).eps)


def root_between(
    function: Callable[[float], float], low: float, high: float, within: float
) -> float:
    """Find where ``function`` is 0 between two numbers at which its signs differ, to ``within``.

    The function is Brent's method (Brent 1973 §4) with the steps of `scipy.optimize.brentq`, equal
    to the bit. It saves loading scipy.optimize for one number.
    """
    before, here, other = low, high, 0.0
    f_before, f_here, f_other = function(before), function(here), 0.0
    if f_before == 0:
        return before
    last = step = 0.0
    while f_here != 0:
        if f_before != 0 and (f_before < 0) != (f_here < 0):  # the root lies between these two
            other, f_other = before, f_before
            last = step = here - before
        if abs(f_other) < abs(f_here):
            before, here, other = here, other, here
            f_before, f_here, f_other = f_here, f_other, f_here
        least = (within + _SHARE * abs(here)) / 2
        half = (other - here) / 2
        if f_here == 0 or abs(half) < least:
            break
        tried = np.inf
        if abs(last) > least and abs(f_here) < abs(f_before):
            if before == other:  # a line through two points, or a parabola through three
                tried = -f_here * (here - before) / (f_here - f_before)
            else:
                one = (f_before - f_here) / (before - here)
                two = (f_other - f_here) / (other - here)
                tried = -f_here * (f_other * two - f_before * one)
                tried /= two * one * (f_other - f_before)
        if 2 * abs(tried) < min(abs(last), 3 * abs(half) - least):
            last, step = step, tried
        else:
            last = step = half
        before, f_before = here, f_here
        here += step if abs(step) > least else (least if half > 0 else -least)
        f_here = function(here)
    return here
