"""Fixed points of maps of maps by iteration: of W, of its adjoint, of a mixture of two W."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evocity.coding._kernels import moved

#: A move of a pixel by so much, metres, counts as divergence.
SKY = 1e7


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """The end of an iteration: the last map and the map ``before``, ``(H, W)``; the number of
    ``steps``; whether the last step ``converged``, and whether it ``diverged`` (reached the sky, or
    NaN)."""

    values: np.ndarray
    before: np.ndarray
    steps: int
    converged: bool
    diverged: bool

    @property
    def moves(self) -> np.ndarray:
        """``(H, W)``: the move of each pixel in the last step."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.abs(self.values - self.before)

    @property
    def change(self) -> float:
        """The largest move of a pixel in the last step."""
        return float(self.moves.max())


def fixed_point(
    lay: Callable[[np.ndarray, np.ndarray], None],
    start: np.ndarray,
    *,
    tolerance: float,
    most: int = 500,
    sky: float = SKY,
    repeat: Callable[[np.ndarray, np.ndarray], None] | None = None,
) -> FixedPoint:
    """Iterate from ``start`` (H, W) until no pixel moves by more than ``tolerance``, one moves by
    ``sky`` or more, or ``most`` steps are made.

    ``lay(before, after)`` writes the next map into ``after``. ``repeat`` replaces ``lay`` from the
    third step on, when ``lay`` has written both maps once, and may skip constant parts.
    """
    before, values = np.empty(start.shape, start.dtype), start.copy(order="C")
    limits = values.dtype.type(tolerance), values.dtype.type(sky)
    steps, moving, diverging = 0, values.size, 0
    while moving and not diverging and steps < most:
        before, values = values, before
        (lay if steps < 2 else repeat or lay)(before, values)
        steps += 1
        moving, diverging = moved(before.ravel(), values.ravel(), *limits)
    return FixedPoint(values, before, steps, not moving, bool(diverging))
