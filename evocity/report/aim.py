"""What a run wanted of a measure, in words and signs."""

import math
import sys
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Aim:
    """A measure of the run and what was wanted of it: max, min, like, a target, bounds (for a
    constraint alone), or unknown; what it counted in if it was part of a sum; and what it tells,
    if it is known here."""

    name: str
    unit: str
    goal: str
    target: float | None = None
    low: float | None = None
    high: float | None = None
    total: str | None = None
    meaning: str = ""

    @property
    def wanted(self) -> str:
        """The goal in words."""
        words = {
            "max": "more is better",
            "min": "less is better",
            "like": "as in one city",
            "bounds": "",
            "none": "recorded",
        }
        parts = [words.get(self.goal, "as its file declares")]
        if self.target is not None:
            parts = [f"{self.target:.4g} {self.unit}".rstrip() + " is wanted"]
        parts.append(self.bounds)
        if self.total is not None:
            parts.append(f"part of {self.total}")
        return ", ".join(part for part in parts if part)

    @property
    def bounds(self) -> str:
        """The bounds in words; nothing if there are none."""
        told = ("at least", self.low), ("at most", self.high)
        return ", ".join(f"{w} {b:.4g} {self.unit}".rstrip() for w, b in told if b is not None)

    @property
    def sign(self) -> str:
        """The goal as a sign: ↑ more, ↓ less, →0.35 a target, ≥ and ≤ bounds; nothing if it is
        unknown."""
        if self.target is not None:
            return f"→{self.target:.4g}"
        if self.goal == "bounds":
            bounds = ("≥", self.low), ("≤", self.high)
            return " ".join(f"{sign}{b:.4g}" for sign, b in bounds if b is not None)
        return {"max": "↑", "min": "↓"}.get(self.goal, "")

    @property
    def _bounds(self) -> tuple[float, float]:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high

    def within(self, values: np.ndarray) -> np.ndarray:
        """Bool: which ``values`` keep the bounds."""
        low, high = self._bounds
        return (low <= values) & (values <= high) | ((low, high) == (-math.inf, math.inf))

    def loss(self, value: float) -> float:
        """Lower is better, in the order of `evocity.fitness.Wanted`; that one needs the measure
        itself, which a stranger's run may not have."""
        if self.goal == "bounds":
            low, high = self._bounds
            if math.isnan(value):
                return sys.float_info.max
            return min(max(low - value, value - high, 0.0), sys.float_info.max)
        if self.target is not None:
            return min(abs(float(value) - self.target), sys.float_info.max)
        return value if self.goal == "min" else -value  # of an unknown goal: an order, no more


__all__ = ["Aim"]
