"""One number for a city, from all that is wanted of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evocity.fitness import Aims
from evocity.search.judging import named_alone


@dataclass(frozen=True)
class Score:
    """The sum of an individual's losses, each over its range among a run's first births, and
    ``weights`` times; lower is better. Whoever breaks a constraint comes after all who do not.

    lows, ranges : of each goal the least loss and the range of the first births.
    """

    aims: Aims
    lows: Sequence[float]
    ranges: Sequence[float]
    weights: Sequence[float]

    @classmethod
    def of(cls, aims: Aims, first: np.ndarray, weights: Sequence[float] | None = None) -> "Score":
        """By the losses of the ``first`` births ``(n, goals)``, n ≥ 1; goals that have one value
        among them count as they are."""
        lows, highs = first.min(axis=0), first.max(axis=0)
        ranges = np.where(highs > lows, highs - lows, 1.0)
        told = np.ones(len(lows)) if weights is None else np.asarray(weights, float)
        return cls(
            _by_name(aims), tuple(lows.tolist()), tuple(ranges.tolist()), tuple(told.tolist())
        )

    def __call__(self, values: Mapping[str, float]) -> tuple[float, float]:
        """How far the raw ``values`` break the constraints, 0 if they keep them, and the sum."""
        losses = self.aims.losses(values)
        parts = zip(losses, self.lows, self.ranges, self.weights, strict=True)
        total = sum(weight * (loss - low) / unit for loss, low, unit, weight in parts)
        return self.aims.violation(values), float(total)


def _by_name(aims: Aims) -> Aims:
    """The same of measures that cannot be called: those of one's own are no other process's."""
    found = []
    for one in aims.wanted:
        measure = named_alone(one.measure.name)
        parts = {
            key: replace(part, measure=measure)
            for key, part in (("objective", one.objective), ("constraint", one.constraint))
            if part is not None
        }
        found.append(replace(one, measure=measure, **parts))
    return Aims(tuple(found))


__all__ = ["Score"]
