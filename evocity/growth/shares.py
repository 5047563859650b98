"""Shares of the originals over a fabric: constants, ramps, painted arrays, functions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from evocity.errors import OperatorError, spell, text_setting

Share = float | Sequence[float] | np.ndarray | Callable[[float, float], float | Sequence[float]]


@dataclass(frozen=True, eq=False)
class Shares:
    """The shares of ``count`` originals at each pixel: a ``share`` as in `grow`, over a rectangle
    of ``shape`` (height, width) px, with the first original's north-west pixel at its ``corner``.
    Only the ratio of several numbers counts. Raises `OperatorError` for an illegal share."""

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
                "growth: a share is given for a single genome",
                "at least two genomes if the parameter 'share' is given",
                "leave the parameter 'share' out, or name a second genome",
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
            raise self._fault(spell(self.share))
        object.__setattr__(self, "share", share / share.sum(0))

    @property
    def label(self) -> str | list:
        """The share as ``made`` notes it: constants, or a word for all else."""
        if self.share is None or callable(self.share):
            return "a ramp" if self.share is None else "a function"
        return self.share.tolist() if self.share.ndim == 1 else "an array"

    def owners(self, middles: np.ndarray, chances: np.ndarray) -> np.ndarray:
        """Choose the original of each group, int64 ``(n,)``, by ``chances`` ``(n,)``, draws from 0
        to below 1; ``middles`` are float ``(n, 2)``, pixels from the first original's corner."""
        if self.count == 1:
            return np.zeros(len(middles), np.int64)
        parts = np.array([self.at(y, x) for y, x in middles + self.corner])
        ends = parts.cumsum(axis=1)[:, :-1]
        return (chances[:, None] >= ends).sum(axis=1)

    def at(self, y: float, x: float) -> np.ndarray:
        """Compute shares, float ``(count,)`` of sum 1, at a pixel of the rectangle or beyond."""
        share, (height, width) = self.share, self.shape
        if share is None:
            along = min(max(x / width, 0.0), 1.0) * (self.count - 1)
            return np.maximum(0.0, 1 - abs(np.arange(self.count) - along))
        if callable(share):
            return self._check_parts(share(float(y), float(x)), y, x)
        if share.ndim == 1:
            return share
        _, tall, wide = share.shape
        i = min(max(int(y * tall // height), 0), tall - 1)
        return share[:, i, min(max(int(x * wide // width), 0), wide - 1)]

    def _check_parts(self, value, y: float, x: float) -> np.ndarray:
        """Convert a function's value at a pixel to shares, or raise `OperatorError`."""
        try:
            parts = np.asarray(value, float)
        except (TypeError, ValueError):
            parts = np.empty(0)
        if parts.ndim == 0 and self.count == 2:
            parts = np.array([1 - parts, parts])
        if not (parts.shape == (self.count,) and (parts >= 0).all() and 0 < parts.sum() < np.inf):
            raise self._fault(f"{spell(value)} at row {y:g}, column {x:g}")
        return parts / parts.sum()

    def _fault(self, found: str) -> OperatorError:
        several = f"{self.count} numbers of 0 or more, at least one above 0"
        single = "a number from 0 to 1 for the second genome, or " if self.count == 2 else ""
        return OperatorError(
            f"growth: {text_setting('share', found)} is not a share of the genomes",
            f"{single}{several}; or an array of such numbers, or a function of row and column",
            "give another share, or leave 'share' out to use a ramp from west to east",
        )
