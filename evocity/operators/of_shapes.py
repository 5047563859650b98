"""Operators of shapes: maps moved, exchanged, and one shape on its way to another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.forms import ShapeForm
from evocity.operators.forming import Forming, chosen, step_checks
from evocity.operators.parameters import Check


@dataclass(frozen=True, kw_only=True)
class MapPerturbation(Forming):
    """Some maps of a shape changed a little.

    Parameters
    ----------
    step : standard deviation of what is added to each number of a map, in sides of the window.
    share : of the maps that change, one at least.
    """

    name: ClassVar[str] = "map_perturbation"
    of: ClassVar[str] = "shape"
    parents: ClassVar[tuple[int, int | None]] = (1, 1)

    step: float = 0.05
    share: float = 0.4

    def _checks(self) -> dict[str, Check]:
        return step_checks()

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        maps = parents[0].maps
        changed = chosen(len(maps), self.share, rng)
        moved = maps + self.step * rng.standard_normal(maps.shape) * changed[:, None, None]
        return parents[0].replace(maps=moved), {"maps": np.flatnonzero(changed).tolist()}


@dataclass(frozen=True, kw_only=True)
class MapExchange(Forming):
    """Each map of the first shape, or the one at its place of the second where that has one.

    Parameters
    ----------
    share : of the maps that are the second's.
    """

    name: ClassVar[str] = "map_exchange"
    of: ClassVar[str] = "shape"
    parents: ClassVar[tuple[int, int | None]] = (2, 2)

    share: float = 0.5

    def _checks(self) -> dict[str, Check]:
        return {"share": step_checks()["share"]}

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        first, second = (one.maps for one in parents)
        count = min(len(first), len(second))
        taken = chosen(count, self.share, rng)
        maps = first.copy()
        maps[:count][taken] = second[:count][taken]
        return parents[0].replace(maps=maps), {"maps": np.flatnonzero(taken).tolist()}


@dataclass(frozen=True, kw_only=True)
class ShapeMetamorphosis(Forming):
    """A shape on the way from the first to the second, see `evocity.shapes.metamorphosis`: what
    hangs together in both hangs together in between. Of shapes with other numbers of maps ``made``
    tells the pairs.

    Parameters
    ----------
    far : how far on the way at most, 0…1; drawn evenly up to there.
    """

    name: ClassVar[str] = "shape_metamorphosis"
    of: ClassVar[str] = "shape"
    parents: ClassVar[tuple[int, int | None]] = (2, 2)

    far: float = 1.0

    def _checks(self) -> dict[str, Check]:
        return {"far": (lambda far: 0 <= far <= 1, "0…1")}

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        from evocity.shapes import metamorphosis

        t = self.far * float(rng.random())
        way = metamorphosis(*(one.shape for one in parents))
        made = {"t": t}
        if len(parents[0].maps) != len(parents[1].maps):
            made["pairs"] = [list(pair) for pair in way.pairs]
        return parents[0].replace(maps=way(t).maps), made


__all__ = ["MapExchange", "MapPerturbation", "ShapeMetamorphosis"]
