"""MAP-Elites (Mouret & Clune 2015): of each cell of a grid over measures the best lives."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from evocity.search.algorithms.algorithm import Algorithm, First, Look
from evocity.search.cells import MOST_ALONG, Grid, Quality, check_grid, ranges_around
from evocity.search.individual import Individual
from evocity.search.values import Finite, Section


class MapElitesKeys(Section):
    """``descriptors``: the measures that the grid lies over; ``grid``: how many cells along each,
    20 of two and 10 of three unless told; ``ranges``: lowest and highest value of each, None to
    take them from the parents, see `evocity.search.cells.ranges_around`."""

    descriptors: list[str] = Field(["gsi", "alignment"], min_length=2, max_length=3)
    grid: list[Annotated[int, Field(ge=1, le=MOST_ALONG)]] = Field([20, 20], min_length=2)
    ranges: list[list[Finite]] | None = None

    @model_validator(mode="before")
    @classmethod
    def _of_three(cls, told: Any) -> Any:
        names = told.get("descriptors") if isinstance(told, dict) else None
        if isinstance(names, list) and len(names) == 3 and "grid" not in told:
            return {**told, "grid": [10, 10, 10]}
        return told

    def disagreements(self) -> list[tuple[str, str, str]]:
        return check_grid(self.descriptors, self.grid, self.ranges)


class MapElites(Algorithm):
    """Whoever is the best of its cell lives, as many as there are cells that anybody fell into.

    Within a cell whoever breaks the constraints less is better, then who has the lesser loss, then
    who was born first. A cell is filled if its holder keeps all constraints. Parents are drawn
    evenly among the holders of filled cells, as long as there are enough of them. A birth that
    lacks a value of a descriptor does not enter. ``size`` does not bound who lives.
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
    def faults(
        cls, keys: Section, goals: int, population: int, parents: int = 2
    ) -> list[tuple[str, str, str]]:
        if goals == 1:
            return []
        allowed = 'one; measures that have the same objective = "a name" are summed to one'
        return [("search.algorithm", f"{cls.name!r} with {goals} goals", allowed)]

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

    def survivors(
        self, candidates: Sequence[Individual], look: Look, rng: np.random.Generator
    ) -> list[Individual]:
        holders: dict[float, Individual] = {}
        for one in self.judged(candidates):
            holders.setdefault(one.marks["cell"], one)
        return self.judged(list(holders.values()))

    def judged(self, living: Sequence[Individual]) -> list[Individual]:
        if not living:  # so it may be before it began: all births failed
            return []
        names = self.keys.descriptors
        values = [[one.values.get(name, np.nan) for name in names] for one in living]
        cells = self._grid.cells(np.array(values, np.float64)).tolist()
        levels = sorted({one.violation for one in living} | {0.0})
        found = [
            replace(one, rank=levels.index(one.violation), marks={"cell": float(cell)})
            for one, cell in zip(living, cells, strict=True)
            if cell >= 0
        ]
        return sorted(found, key=lambda one: (one.violation, one.losses, one.id))

    def parents(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[int]:
        kept = [place for place, one in enumerate(living) if not one.violation]
        broken = [place for place, one in enumerate(living) if one.violation]
        order = [*rng.permutation(kept), *rng.permutation(broken)]
        return [int(order[turn % len(order)]) for turn in range(count)]

    def migrants(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[Individual]:
        """Drawn evenly among the holders of filled cells; of the others where none is."""
        holders = [one for one in living if not one.violation] or living
        return [holders[place] for place in rng.permutation(len(holders))[:count]]

    def summary(self, living: Sequence[Individual]) -> dict[str, float]:
        losses = np.array([one.losses[0] for one in living if not one.violation])
        return self._quality.summary(self._grid, losses)
