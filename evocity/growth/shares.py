"""Which original is laid where: a painted share, or a ramp."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from evocity.errors import OperatorError, set_to, shown

Share = float | Sequence[float] | np.ndarray | Callable[[float, float], float | Sequence[float]]


@dataclass(frozen=True, eq=False)
class Shares:
    """The shares of ``count`` originals at each pixel.

    share : None for a ramp from west to east, from the first original to the last; a number, the
        share of the second of two, or one number an original; an array ``(h, w)`` of the
        second's or ``(count, h, w)`` of all, laid over the rectangle, whose edges go on beyond
        it; or a function of (row, column) that returns a number, or one an original. Several
        are taken by their ratio.
    shape : (height, width) of the rectangle that the ramp or the array lies over, px.
    corner : (row, column) of the first original's north-west pixel in that rectangle.

    Raises `OperatorError` for a share that is none.
    """

    count: int
    share: Share | None
    shape: tuple[int, int]
    corner: tuple[int, int]

    def __post_init__(self):
        share = self.share
        if share is None or callable(share):
            return
        if self.count == 1:
            raise OperatorError(
                "growth: a share, and one genome alone",
                "two genomes or more with a share",
                "leave share out, or name the other genome too",
            )
        try:
            share = np.asarray(share, float)
        except (TypeError, ValueError):
            share = np.empty(0)
        if share.ndim in (0, 2) and self.count == 2 and share.size:
            share = np.stack([1 - share, share])
        good = share.ndim in (1, 3) and len(share) == self.count and share.size
        # NaN is not 0 or more
        if not (
            good and (share >= 0).all() and np.isfinite(share).all() and (share.sum(0) > 0).all()
        ):
            raise self._fault(shown(self.share))
        object.__setattr__(self, "share", share / share.sum(0))

    @property
    def told(self) -> str | list:
        """What is written of it: numbers as they are."""
        if self.share is None or callable(self.share):
            return "a ramp" if self.share is None else "a function"
        return self.share.tolist() if self.share.ndim == 1 else "an array"

    def owners(self, middles: np.ndarray, chances: np.ndarray) -> np.ndarray:
        """Int64 ``(n,)``, whose group is laid: ``middles`` float ``(n, 2)``, pixels from the first
        original's corner; ``chances`` ``(n,)``, numbers from 0 to below 1, by which it is drawn."""
        if self.count == 1:
            return np.zeros(len(middles), np.int64)
        parts = np.array([self.at(y, x) for y, x in middles + self.corner])
        ends = parts.cumsum(axis=1)[:, :-1]
        return (chances[:, None] >= ends).sum(axis=1)

    def at(self, y: float, x: float) -> np.ndarray:
        """Float ``(count,)`` shares at a pixel of the rectangle or beyond; their sum is 1."""
        share, (height, width) = self.share, self.shape
        if share is None:
            along = min(max(x / width, 0.0), 1.0) * (self.count - 1)
            return np.maximum(0.0, 1 - abs(np.arange(self.count) - along))
        if callable(share):
            return self._told(share(float(y), float(x)), y, x)
        if share.ndim == 1:
            return share
        _, tall, wide = share.shape
        i = min(max(int(y * tall // height), 0), tall - 1)
        return share[:, i, min(max(int(x * wide // width), 0), wide - 1)]

    def _told(self, told, y: float, x: float) -> np.ndarray:
        """What a function said of a pixel."""
        try:
            parts = np.asarray(told, float)
        except (TypeError, ValueError):
            parts = np.empty(0)
        if parts.ndim == 0 and self.count == 2:
            parts = np.array([1 - parts, parts])
        if not (parts.shape == (self.count,) and (parts >= 0).all() and 0 < parts.sum() < np.inf):
            raise self._fault(f"{shown(told)} at row {y:g}, column {x:g}")
        return parts / parts.sum()

    def _fault(self, found: str) -> OperatorError:
        several = f"{self.count} numbers of 0 or more, not all of them 0"
        one = "a number from 0 to 1, the share of the second, or " if self.count == 2 else ""
        return OperatorError(
            f"growth: {set_to('share', found)}",
            f"{one}{several}; or an array of such, or a function of row and column",
            "paint another share, or leave it out for a ramp from west to east",
        )
