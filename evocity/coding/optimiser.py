"""Minimisation of a function of numbers by NLopt; only this file uses NLopt."""

from collections.abc import Callable
from dataclasses import dataclass

import nlopt
import numpy as np

#: Replaces a missing value for the optimiser: worse than any value, yet finite.
HOPELESS = 1e30

#: NLopt's algorithms by name; MMA (Svanberg 2002) takes gradients.
_ALGORITHMS = {
    "sbplx": nlopt.LN_SBPLX,
    "cobyla": nlopt.LN_COBYLA,
    "bobyqa": nlopt.LN_BOBYQA,
    "mma": nlopt.LD_MMA,
}
#: The algorithms without gradients: Rowan's Subplex, Powell's COBYLA (1994) and BOBYQA (2009).
WITHOUT_GRADIENTS = ("sbplx", "cobyla", "bobyqa")


@dataclass(frozen=True)
class Least:
    """The best ``point`` (n,) tried, its ``value``, and the number of ``evaluations``."""

    point: np.ndarray
    value: float
    evaluations: int


class Enough(Exception):
    """A function raises this to end its own minimisation with the least so far."""


def minimise(
    function: Callable[[np.ndarray, np.ndarray], float | None],
    start: np.ndarray,
    *,
    algorithm: str,
    most: int,
    lower: np.ndarray | None = None,
    upper: np.ndarray | None = None,
    step: float | np.ndarray | None = None,
) -> Least:
    """Minimise a ``function`` near ``start`` in at most ``most`` evaluations, 1 or more. Equal
    arguments give equal results, bit for bit, if the function does so.

    function : called with a point ``(n,)`` and an array to fill with the gradient there, ``(n,)``
        for "mma", else empty. Returns the value; None, NaN and infinity are worse than any value.
        Its exceptions, Ctrl-C too, are raised here, except `Enough`.
    start : float ``(n,)``, n ≥ 1, within the bounds.
    algorithm : "sbplx", "cobyla", "bobyqa" or "mma". COBYLA replaces BOBYQA for a single number.
    lower, upper : bounds, ``(n,)``; None for no bounds.
    step : distance of the first tries from the start, a number or ``(n,)``; None leaves it to
        NLopt.

    Without any value, the result is the start and infinity.
    """
    start = np.asarray(start, np.float64)
    best, least, evaluations = start, np.inf, 0
    raised: BaseException | None = None
    if algorithm == "bobyqa" and start.size < 2:
        algorithm = "cobyla"

    def guarded(point: np.ndarray, gradient: np.ndarray) -> float:
        nonlocal best, least, evaluations, raised
        if raised is not None:  # some algorithms evaluate once more
            return HOPELESS
        try:
            value = function(point, gradient)
        except BaseException as fault:  # Ctrl-C too: some of NLopt's algorithms swallow exceptions
            raised = fault
            optimiser.force_stop()
            return HOPELESS
        evaluations += 1
        if value is None or not np.isfinite(value):
            gradient[:] = 0
            return HOPELESS
        if value < least:
            best, least = point.copy(), float(value)
        return float(value)

    optimiser = nlopt.opt(_ALGORITHMS[algorithm], start.size)
    optimiser.set_min_objective(guarded)
    optimiser.set_maxeval(most)
    if lower is not None:
        optimiser.set_lower_bounds(lower)
    if upper is not None:
        optimiser.set_upper_bounds(upper)
    if step is not None:
        most_step = np.inf if lower is None or upper is None else (upper - lower) / 2
        steps = np.minimum(np.broadcast_to(step, start.shape).astype(np.float64), most_step)
        optimiser.set_initial_step(steps)
    try:
        optimiser.optimize(start)
    except Exception:  # NLopt's own types, one for each reason to stop
        if not evaluations and raised is None:
            raise
    if raised is not None and not isinstance(raised, Enough):
        raise raised
    return Least(best, least, evaluations)
