"""The least of a function of numbers: NLopt, here alone."""

from collections.abc import Callable
from dataclasses import dataclass

import nlopt
import numpy as np

#: What an optimiser is told where there is no value: worse than all there is, yet finite.
HOPELESS = 1e30

#: By name: NLopt's algorithms without gradients, and MMA (Svanberg 2002), which takes them.
_ALGORITHMS = {
    "sbplx": nlopt.LN_SBPLX,
    "cobyla": nlopt.LN_COBYLA,
    "bobyqa": nlopt.LN_BOBYQA,
    "mma": nlopt.LD_MMA,
}
#: Those that take no gradients: Rowan's Subplex, Powell's COBYLA (1994) and BOBYQA (2009).
WITHOUT_GRADIENTS = ("sbplx", "cobyla", "bobyqa")


@dataclass(frozen=True)
class Least:
    """The best ``point`` (n,) that was tried, its ``value``, and how often the function was
    asked."""

    point: np.ndarray
    value: float
    asked: int


class Enough(Exception):
    """Raised by a function to end its own minimisation: the least until then is returned."""


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
    """The least of a ``function`` near ``start``, as far as ``most`` evaluations find one.

    The same arguments give the same result, bit for bit, with a function that does so.

    Parameters
    ----------
    function : called with a point ``(n,)`` and an array to be filled in place with the gradient
        there, ``(n,)`` for "mma", else empty. Returns the value; None, NaN and infinity stand for
        no value, worse than any. What it raises, Ctrl-C too, is raised here; `Enough` ends the
        search well.
    start : float ``(n,)``, n ≥ 1, within the bounds.
    algorithm : "sbplx", "cobyla", "bobyqa" or "mma". BOBYQA needs two numbers or more; of one it is
        COBYLA that is asked.
    most : evaluations, 1 or more.
    lower, upper : bounds, ``(n,)``; None where there are none.
    step : how far from the start the first tries lie, one number or ``(n,)``; NLopt's own choice
        unless told.

    Returns
    -------
    Least : the start with an infinite value where no point had a value.
    """
    start = np.asarray(start, np.float64)
    best, least, asked = start, np.inf, 0
    raised: BaseException | None = None
    if algorithm == "bobyqa" and start.size < 2:
        algorithm = "cobyla"

    def guarded(point: np.ndarray, gradient: np.ndarray) -> float:
        nonlocal best, least, asked, raised
        if raised is not None:  # some algorithms ask once more
            return HOPELESS
        try:
            value = function(point, gradient)
        except BaseException as fault:  # Ctrl-C too: some of NLopt's algorithms swallow all
            raised = fault
            optimiser.force_stop()
            return HOPELESS
        asked += 1
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
    except Exception:  # NLopt's own types, one for each reason it got no further
        if not asked and raised is None:
            raise
    if raised is not None and not isinstance(raised, Enough):
        raise raised
    return Least(best, least, asked)


__all__ = ["HOPELESS", "WITHOUT_GRADIENTS", "Enough", "Least", "minimise"]
