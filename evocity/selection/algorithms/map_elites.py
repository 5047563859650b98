"""MAP-Elites (Mouret & Clune 2015): the best of each cell of a grid over measures lives."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from evocity.section import Fault, Finite, Section
from evocity.selection.algorithms.algorithm import (
    Algorithm,
    First,
    Living,
    Look,
    Rng,
    one_goal_faults,
)
from evocity.selection.cells import MOST_ALONG, Grid, Quality, check_grid, ranges_around
from evocity.selection.individual import Individual


class MapElitesKeys(Section):
    """``descriptors``: the measures that span the grid; ``grid``: how many cells along each, by
    default 20 along each of two and 10 along each of three; ``ranges``: the lowest and the highest
    value of each, None for those around the parents, see `evocity.selection.cells.ranges_around`.
    """

    descriptors: list[str] = Field(["gsi", "alignment"], min_length=2, max_length=3)
    grid: list[Annotated[int, Field(ge=1, le=MOST_ALONG)]] = Field([20, 20], min_length=2)
    ranges: list[list[Finite]] | None = None

    @model_validator(mode="before")
    @classmethod
    def _fill_grid(cls, keys: Any) -> Any:
        names = keys.get("descriptors") if isinstance(keys, dict) else None
        if isinstance(names, list) and len(names) == 3 and "grid" not in keys:
            return {**keys, "grid": [10, 10, 10]}
        return keys

    def disagreements(self) -> list[Fault]:
        return check_grid(self.descriptors, self.grid, self.ranges)


class MapElites(Algorithm):
    """The best individual of each cell lives, one for every cell that any birth fell into.

    Within a cell the individual is better that breaks the constraints less, then the one with the
    lesser loss, then the older one. A cell is filled if its holder keeps all constraints. Parents
    are drawn evenly among the holders of filled cells, as long as there are enough of them. A birth
    without a value of a descriptor does not enter. ``size`` does not bound the living.
    """

    name = "map_elites"
    marks = ("cell",)
    figures = ("coverage", "cells", "qd_score")
    Keys = MapElitesKeys

    def __init__(self, size: int, keys: Section | None = None):
        super().__init__(size, keys)
        self._grid: Grid | None = None
        self._quality: Quality | None = None

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        return one_goal_faults(cls.name, goals)

    @classmethod
    def described(cls, keys: Section) -> tuple[str, ...]:
        return tuple(keys.descriptors)

    def begin(self, first: First) -> None:
        ranges = self.keys.ranges
        if ranges is None:
            ranges = ranges_around(self.keys.descriptors, first.sources, first.limits)
        self._grid = Grid(
            tuple(self.keys.descriptors),
            tuple(self.keys.grid),
            tuple((float(low), float(high)) for low, high in ranges),
        )
        self._quality = Quality(first.losses) if len(first.losses) else None

    def survivors(self, candidates: Living, look: Look, rng: Rng) -> list[Individual]:
        holders: dict[float, Individual] = {}
        for one in self.judged(candidates):
            holders.setdefault(one.marks["cell"], one)
        return self.judged(list(holders.values()))

    def judged(self, living: Living) -> list[Individual]:
        if not living:  # if all births failed, `begin` was never called
            return []
        names = self.keys.descriptors
        values = [[one.values.get(name, np.nan) for name in names] for one in living]
        cells = self._grid.cells(np.array(values, np.float64)).tolist()
        levels = sorted({one.violation for one in living} | {0.0})
        placed = [
            replace(one, rank=levels.index(one.violation), marks={"cell": float(cell)})
            for one, cell in zip(living, cells, strict=True)
            if cell >= 0
        ]
        return sorted(placed, key=lambda one: (one.violation, one.losses, one.id))

    def parents(self, living: Living, count: int, rng: Rng) -> list[int]:
        kept = [place for place, one in enumerate(living) if not one.violation]
        broken = [place for place, one in enumerate(living) if one.violation]
        order = [*rng.permutation(kept), *rng.permutation(broken)]
        return [int(order[turn % len(order)]) for turn in range(count)]

    def migrants(self, living: Living, count: int, rng: Rng) -> list[Individual]:
        """Draw evenly among the holders of filled cells, or among all if no cell is filled."""
        holders = [one for one in living if not one.violation] or living
        return [holders[place] for place in rng.permutation(len(holders))[:count]]

    def summary(self, living: Living) -> dict[str, float]:
        losses = np.array([one.losses[0] for one in living if not one.violation])
        return self._quality.summary(self._grid, losses)
