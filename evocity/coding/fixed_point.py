"""The fixed point of a map of maps, by iteration: of W, of its adjoint, of a mixture of two."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evocity.coding._kernels import moved

#: A pixel that moves by so much, metres, is taken as proof of divergence.
SKY = 1e7


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """What an iteration came to.

    values : ``(H, W)``, where it ended.
    before : ``(H, W)``, where it was a step before.
    steps : how many were made.
    settled : whether no pixel moved by more than the tolerance.
    lost : whether a pixel moved as far as the sky, or to no number at all.
    """

    values: np.ndarray
    before: np.ndarray
    steps: int
    settled: bool
    lost: bool

    @property
    def moves(self) -> np.ndarray:
        """``(H, W)``: how far each pixel moved in the last step."""
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
    again: Callable[[np.ndarray, np.ndarray], None] | None = None,
) -> FixedPoint:
    """Iterate from ``start`` (H, W) until no pixel moves by more than ``tolerance``, one moves by
    ``sky`` or more, or ``most`` steps are made.

    ``lay(before, after)`` writes the next map into ``after``; both are of the type of ``start``,
    which stays as it is. ``again``, if given, is called in its place from the third step on: by
    then it has written all of both maps, and what never changes stands in them.
    """
    before, values = np.empty(start.shape, start.dtype), start.copy(order="C")
    limits = values.dtype.type(tolerance), values.dtype.type(sky)
    steps, unsettled, lost = 0, values.size, 0
    while unsettled and not lost and steps < most:
        before, values = values, before
        (lay if steps < 2 else again or lay)(before, values)
        steps += 1
        unsettled, lost = moved(before.ravel(), values.ravel(), *limits)
    return FixedPoint(values, before, steps, not unsettled, bool(lost))
