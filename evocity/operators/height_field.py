"""Height field: street blocks rise and fall by whole storeys, as a field of factors tells."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import STOREY
from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.fields import DIGITS, MOST_SIDE, field_weights
from evocity.operators.height_scaling import MOST_FACTOR
from evocity.operators.heights import Heights, height_checks
from evocity.operators.parameters import Check, at_fault

#: Factors that are drawn lie within these.
_DRAWN = 0.625, 1.6


@dataclass(frozen=True)
class HeightField(Drafting):
    """Raise and lower street blocks by whole storeys, as a field of factors tells.

    The field has ``side`` × ``side`` factors, smooth in between (by their logarithms). The
    buildings of a street block change by the whole number of storeys that brings them nearest to
    their height times the field's mean over the block; those that half a storey is too much for
    stay. Factors of 1 give the parent. Buildings keep their footprints and their roofs' shape,
    and locked ones stay, as in `HeightScaling`. With ``values`` told nothing is drawn, so that an
    optimiser can look for the best field (`evocity refine --way heights`).

    Parameters
    ----------
    side : factors along each side of the field, 1…64.
    values : the factors, 0.1…10, row by row from the north-west; None draws them within
        0.625…1.6, evenly by their logarithm. Four digits count.
    storey, highest : as in `HeightScaling`.
    repair, reach, domains : as in `Drafting`.

    ``made`` tells the ``values``, how many street blocks were ``scaled``, and what `HeightScaling`
    tells of buildings and floor space.

    Source: ours.
    """

    side: int = 4
    values: Sequence[float] | None = None
    storey: float = STOREY
    highest: float = 50.0

    clears: ClassVar[bool] = True
    name = "height_field"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        least, most = 1 / MOST_FACTOR, MOST_FACTOR
        return {
            "side": (lambda side: 1 <= side <= MOST_SIDE, f"1…{MOST_SIDE}"),
            "values": (
                lambda values: values is None or all(least <= one <= most for one in values),
                f"numbers of {least:g}…{most:g}, or none",
            ),
            **height_checks(),
        }

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless there are as many ``values`` as the field has."""
        wanted = self.side**2
        if self.values is not None and len(self.values) != wanted:
            told = f"{len(self.values)} numbers", f"{wanted}, {self.side} × {self.side}"
            raise at_fault(self.name, {"values": told})

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        (parent,) = parents
        self.check_count(1)
        values = self.values
        if values is None:
            values = np.exp(rng.uniform(*np.log(_DRAWN), self.side**2))
        values = np.round(np.asarray(values, float), DIGITS)
        heights = Heights(parent, self.storey, self.highest)
        groups = heights.groups("quarters", self.name)
        of = np.zeros(int(heights.labels.max(initial=0)) + 1, np.int64)
        for number, group in enumerate(groups, 1):
            of[group] = number
        numbers = np.arange(1, len(groups) + 1)
        weights = field_weights(of[heights.labels], numbers, self.side)
        scaled = 0
        for group, factor in zip(groups, np.exp((weights * np.log(values)).sum(1)), strict=True):
            scaled += heights.scale(group, float(factor), at_least_one=False)
        return heights.draft({"side": self.side, "values": values.tolist(), "scaled": scaled})


__all__ = ["HeightField"]
