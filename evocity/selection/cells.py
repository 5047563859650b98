"""A grid of cells over two or three measures, and how well it is filled (Mouret & Clune 2015)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from evocity.errors import RecipeError, spell
from evocity.section import Fault
from evocity.selection.fronts import Scale

#: The most cells of a grid, and the most along one axis.
MOST_CELLS, MOST_ALONG = 1_000_000, 1000
#: Parents whose values differ by less than this share of the larger one are alike.
_ALIKE = 0.01
# The measure that only children of several parents have; at most equal shares.
_SHARE = "smallest_share"


@dataclass(frozen=True)
class Grid:
    """Cells over the measures ``descriptors``; ``counts`` is the number of cells along each
    measure, and ``ranges`` is the lowest and highest value of each measure, in its unit.

    The cells are numbered along the last descriptor first, then along the descriptor before it, and
    so on. A value outside a range belongs to the cell at the nearer end of the range.

    >>> grid = Grid(("gsi", "alignment"), (4, 10), ((0.0, 1.0), (0.0, 1.0)))
    >>> grid.cells([[0.3, 0.55], [0.3, 7.0], [0.3, float("nan")]])
    array([15, 19, -1])
    """

    descriptors: tuple[str, ...]
    counts: tuple[int, ...]
    ranges: tuple[tuple[float, float], ...]

    def __len__(self) -> int:
        return math.prod(self.counts)

    def cells(self, values: np.ndarray) -> np.ndarray:
        """Find the cell of each row of ``(n, d)`` values, int64; -1 for a row with NaN."""
        values = np.asarray(values, np.float64).reshape(-1, len(self.counts))
        known = ~np.isnan(values).any(axis=1)
        places = tuple(
            np.searchsorted(self.edges(axis)[1:-1], np.where(known, column, 0), "right")
            for axis, column in enumerate(values.T)
        )
        return np.where(known, np.ravel_multi_index(places, self.counts), -1)

    def places(self, cells: np.ndarray) -> np.ndarray:
        """Convert the numbers of ``cells`` `(n,)` to positions along each descriptor, int ``(n,
        d)``; the lowest position is 0."""
        places = np.unravel_index(np.asarray(cells, np.int64), self.counts)
        return np.stack(places, axis=-1).astype(np.int64)

    def edges(self, axis: int) -> np.ndarray:
        """List the values that bound the cells along the descriptor with the number `axis`,
        ``(counts[axis] + 1,)``."""
        low, high = self.ranges[axis]
        # Halves, the same to the bit: the range of two huge values would overflow.
        return 2 * np.linspace(0.5 * low, 0.5 * high, self.counts[axis] + 1)


def ranges_around(
    descriptors: Sequence[str],
    parents: Sequence[Mapping[str, float]],
    limits: Mapping[str, tuple[float, float]],
) -> tuple[tuple[float, float], ...]:
    """Compute the default ranges of a grid: those of the ``parents`` (measure -> value each), half
    as wide again on either side, within the ``limits`` that measures declare. The range of
    `smallest_share` goes from 0 to an equal share of all parents.

    Raises `RecipeError` if the parents do not differ in a descriptor, or have no value of it.
    """
    faults, ranges = [], []
    for name in descriptors:
        if name == _SHARE and len(parents) > 1:  # each parent has only itself
            ranges.append((0.0, 1 / len(parents)))
            continue
        values = [one[name] for one in parents if math.isfinite(one.get(name, math.nan))]
        low, high = min(values, default=math.nan), max(values, default=math.nan)
        size = max(abs(low), abs(high))
        if not high - low > _ALIKE * size:
            listed = ", ".join(f"{value:.4g}" for value in values)
            faults.append(
                f"{name} is nearly or quite the same in the parents' codes ({listed})"
                if len(values) > 1
                else f"{name} has a value in {len(values)} of {len(parents)} parents' codes"
            )
            continue
        least, most = limits.get(name, (-math.inf, math.inf))
        wider = 0.5 * (high - low)
        ranges.append((max(low - wider, least), min(high + wider, most)))
    if faults:
        raise RecipeError(
            f"the grid of map_elites has no ranges: {'; '.join(faults)}",
            "descriptors in which two parents differ by at least 1 %, or ranges in the recipe",
            f"write ranges = [[low, high], …] under [search], with one range for each of "
            f"{', '.join(descriptors)}, or choose other descriptors",
        )
    return tuple(ranges)


@dataclass(frozen=True)
class Quality:
    """QD-score in units of the first generation, which its losses ``(n, 1)`` fix.

    A filled cell counts as much as its loss lies below the reference, in units of the first
    generation's range, and never below 0. The reference lies a tenth beyond the worst of the first
    generation. The score of a cell is its hypervolume for one goal.
    """

    first: np.ndarray

    @cached_property
    def _scale(self) -> Scale:
        return Scale(np.asarray(self.first, np.float64).reshape(-1, 1))

    def worth(self, losses: np.ndarray) -> np.ndarray:
        """Compute the score of each of ``losses`` (n,), float ``(n,)``."""
        losses = np.asarray(losses, np.float64).reshape(-1, 1)
        return np.maximum(0.0, (self._scale.reference - self._scale(losses))[:, 0])

    def summary(self, grid: Grid, losses: np.ndarray) -> dict[str, float]:
        """Compute ``coverage``, ``cells`` and ``qd_score`` from the ``losses`` (n,) in filled
        cells."""
        filled = len(losses)
        return {
            "coverage": filled / len(grid),
            "cells": float(filled),
            "qd_score": float(self.worth(losses).sum()) if filled else 0.0,
        }


def check_grid(
    descriptors: Sequence[str], counts: Sequence[int], ranges: Sequence[Sequence[float]] | None
) -> list[Fault]:
    """List the faults of a grid in a recipe."""
    faults = []
    for name in sorted({one for one in descriptors if list(descriptors).count(one) > 1}):
        faults.append(("search.descriptors", f"{spell(name)} twice", "each measure once"))
    if len(counts) != len(descriptors):
        allowed = f"{len(descriptors)} numbers of cells, one for each of the descriptors"
        faults.append(("search.grid", spell(list(counts)), allowed))
    elif math.prod(counts) > MOST_CELLS:
        found = f"{' × '.join(map(str, counts))}, {math.prod(counts)} cells"
        faults.append(("search.grid", found, f"{MOST_CELLS} cells or fewer in all"))
    if ranges is not None and len(ranges) != len(descriptors):
        allowed = f"{len(descriptors)} ranges [low, high], one for each of the descriptors"
        faults.append(("search.ranges", spell([list(one) for one in ranges]), allowed))
    for number, one in enumerate(ranges or ()):
        if len(one) != 2 or not all(low < high for low, high in pairwise(one)):
            found = spell(list(one))
            faults.append((f"search.ranges[{number}]", found, "[low, high], the lower first"))
    return faults
