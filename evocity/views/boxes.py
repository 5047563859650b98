"""Do boxes fill a space, and does any point lie in two of them? Exact, for half-open boxes."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

#: A box: its lowest corner, which is of it, and its highest, which is not; float64 ``(d,)`` each.
Box = tuple[np.ndarray, np.ndarray]


def meet(one: Box, other: Box) -> Box | None:
    """What two boxes have in common; None if that is nothing."""
    low, high = np.maximum(one[0], other[0]), np.minimum(one[1], other[1])
    return (low, high) if (low < high).all() else None


def left_over(space: Box, boxes: Iterable[Box]) -> Box | None:
    """A part of ``space`` that lies in none of the ``boxes``; None if they fill it.

    One box after the other is cut out of what is left, each cut along the sides of the box.
    """
    rest = [space]
    for box in boxes:
        rest = [part for piece in rest for part in _without(piece, box)]
    return rest[0] if rest else None


def corner_near(box: Box, usual: Sequence[float]) -> np.ndarray:
    """A point of ``box``, float64 ``(d,)``: on each axis the ``usual`` value where it lies within,
    else the middle, or the low end where there is no high one."""
    low, high = box
    middle = np.where(np.isinf(high), low, (low + np.minimum(high, 1e300)) / 2)
    within = (low <= usual) & (usual < high)
    return np.where(within, usual, np.where(middle < high, middle, low))


def _without(piece: Box, box: Box) -> Iterator[Box]:
    """``piece`` less ``box``, in at most 2 d boxes apart from each other."""
    common = meet(piece, box)
    if common is None:
        yield piece
        return
    low, high = (side.copy() for side in piece)
    for axis in range(low.size):
        for start, end in ((low[axis], common[0][axis]), (common[1][axis], high[axis])):
            if start < end:
                part = low.copy(), high.copy()
                part[0][axis], part[1][axis] = start, end
                yield part
        low[axis], high[axis] = common[0][axis], common[1][axis]


__all__ = ["Box", "corner_near", "left_over", "meet"]
