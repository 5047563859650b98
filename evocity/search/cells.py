"""A grid of cells over two or three measures, and how well it is filled (Mouret & Clune 2015)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from evocity.errors import RecipeError, shown
from evocity.search.fronts import Scale

#: So many cells a grid may have, and so many along one axis.
MOST_CELLS, MOST_ALONG = 1_000_000, 1000
#: Parents that differ by less than this share of the larger value are alike.
_ALIKE = 0.01


@dataclass(frozen=True)
class Grid:
    """Cells over the measures ``descriptors``: ``counts`` tells how many along each, ``ranges`` the
    (lowest, highest) value of each, in its unit.

    Cells are numbered with the last descriptor running fastest. Values beyond a range belong to the
    cell at its end.

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
        """The cell of each row of ``(n, d)`` values, int64; -1 of one that lacks a value (NaN)."""
        values = np.asarray(values, np.float64).reshape(-1, len(self.counts))
        known = ~np.isnan(values).any(axis=1)
        places = tuple(
            np.searchsorted(self.edges(axis)[1:-1], np.where(known, column, 0), "right")
            for axis, column in enumerate(values.T)
        )
        return np.where(known, np.ravel_multi_index(places, self.counts), -1)

    def places(self, cells: np.ndarray) -> np.ndarray:
        """Where ``cells`` (n,) lie along each descriptor, int ``(n, d)``, 0 the lowest."""
        found = np.unravel_index(np.asarray(cells, np.int64), self.counts)
        return np.stack(found, axis=-1).astype(np.int64)

    def edges(self, axis: int) -> np.ndarray:
        """Values between which the cells along a descriptor lie, ``(counts[axis] + 1,)``."""
        low, high = self.ranges[axis]
        # Halves, the same to the bit: the range of two huge values would overflow.
        return 2 * np.linspace(0.5 * low, 0.5 * high, self.counts[axis] + 1)


def ranges_around(
    descriptors: Sequence[str],
    parents: Sequence[Mapping[str, float]],
    limits: Mapping[str, tuple[float, float]],
) -> tuple[tuple[float, float], ...]:
    """Ranges of a grid that none are given for: what the ``parents`` have (measure -> value each),
    half as far again on either side, within the ``limits`` that measures declare.

    Raises `RecipeError` where the parents do not differ in a descriptor, or have no value of it.
    """
    faults, ranges = [], []
    for name in descriptors:
        values = [one[name] for one in parents if math.isfinite(one.get(name, math.nan))]
        low, high = min(values, default=math.nan), max(values, default=math.nan)
        size = max(abs(low), abs(high))
        if not high - low > _ALIKE * size:
            told = ", ".join(f"{value:.4g}" for value in values)
            faults.append(
                f"{name} is nearly or quite the same in the parents' codes ({told})"
                if len(values) > 1
                else f"{name} has a value in {len(values)} of {len(parents)} parents' codes"
            )
            continue
        least, most = limits.get(name, (-math.inf, math.inf))
        wider = 0.5 * (high - low)
        ranges.append((max(low - wider, least), min(high + wider, most)))
    if faults:
        raise RecipeError(
            f"no ranges for the grid of map_elites: {'; '.join(faults)}",
            "descriptors in which two parents differ by a hundredth or more, or ranges",
            f"write under [search] ranges = [[low, high], …], one for each of "
            f"{', '.join(descriptors)}, or choose other descriptors",
        )
    return tuple(ranges)


@dataclass(frozen=True)
class Quality:
    """QD-score in units of the first generation: fixed by its losses ``(n, 1)``.

    Each filled cell counts by how far its loss lies below the reference, a tenth beyond the worst
    of the first generation, in units of that generation's range; never below 0. That is the cell's
    own hypervolume of one goal.
    """

    first: np.ndarray

    @cached_property
    def _scale(self) -> Scale:
        return Scale(np.asarray(self.first, np.float64).reshape(-1, 1))

    def worth(self, losses: np.ndarray) -> np.ndarray:
        """Of each of ``losses`` (n,), float ``(n,)``."""
        losses = np.asarray(losses, np.float64).reshape(-1, 1)
        return np.maximum(0.0, (self._scale.reference - self._scale(losses))[:, 0])

    def summary(self, grid: Grid, losses: np.ndarray) -> dict[str, float]:
        """``coverage``, the share of cells that are filled, ``cells``, how many, and ``qd_score``,
        of the ``losses`` (n,) in filled cells."""
        filled = len(losses)
        return {
            "coverage": filled / len(grid),
            "cells": float(filled),
            "qd_score": float(self.worth(losses).sum()) if filled else 0.0,
        }


def check_grid(
    descriptors: Sequence[str], counts: Sequence[int], ranges: Sequence[Sequence[float]] | None
) -> list[tuple[str, str, str]]:
    """Faults (key, found, allowed) of a grid as a recipe has it."""
    faults = []
    for name in sorted({one for one in descriptors if list(descriptors).count(one) > 1}):
        faults.append(("search.descriptors", f"{shown(name)} twice", "each measure once"))
    if len(counts) != len(descriptors):
        allowed = f"{len(descriptors)} numbers of cells, one for each of the descriptors"
        faults.append(("search.grid", shown(list(counts)), allowed))
    elif math.prod(counts) > MOST_CELLS:
        found = f"{' × '.join(map(str, counts))}, {math.prod(counts)} cells"
        faults.append(("search.grid", found, f"{MOST_CELLS} cells or fewer in all"))
    if ranges is not None and len(ranges) != len(descriptors):
        allowed = f"{len(descriptors)} ranges [low, high], one for each of the descriptors"
        faults.append(("search.ranges", shown([list(one) for one in ranges]), allowed))
    for number, one in enumerate(ranges or ()):
        if len(one) != 2 or not all(low < high for low, high in pairwise(one)):
            found = shown(list(one))
            faults.append((f"search.ranges[{number}]", found, "[low, high], the lower first"))
    return faults
