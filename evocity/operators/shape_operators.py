"""Operators of shapes: perturbation and exchange of maps, metamorphosis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.kinds import ShapeForm
from evocity.operators.form_common import STEP, Forming, draw_mask
from evocity.operators.parameters import SHARE, Check


@dataclass(frozen=True, kw_only=True)
class MapPerturbation(Forming):
    """Change some maps of a shape a little.

    Parameters
    ----------
    step : standard deviation of the change of each number of a map, as a share of the window's
        side.
    share : share of the maps that change; at least one map changes.
    """

    name = "map_perturbation"
    of = "shape"
    parents = (1, 1)

    step: float = 0.05
    share: float = 0.4

    def _checks(self) -> dict[str, Check]:
        return {"step": STEP, "share": SHARE}

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        maps = parents[0].maps
        changed = draw_mask(len(maps), self.share, rng)
        maps = maps + self.step * rng.standard_normal(maps.shape) * changed[:, None, None]
        return parents[0].replace(maps=maps), {"maps": np.flatnonzero(changed).tolist()}


@dataclass(frozen=True, kw_only=True)
class MapExchange(Forming):
    """Replace some maps of the first shape. Each is replaced by the map of the second shape with
    the same number.

    Parameters
    ----------
    share : share of the maps that come from the second shape.
    """

    name = "map_exchange"
    of = "shape"
    parents = (2, 2)

    share: float = 0.5

    def _checks(self) -> dict[str, Check]:
        return {"share": SHARE}

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        first, second = (parent.maps for parent in parents)
        count = min(len(first), len(second))
        taken = draw_mask(count, self.share, rng)
        maps = first.copy()
        maps[:count][taken] = second[:count][taken]
        return parents[0].replace(maps=maps), {"maps": np.flatnonzero(taken).tolist()}


@dataclass(frozen=True, kw_only=True)
class ShapeMetamorphosis(Forming):
    """Make a shape between the first shape and the second. Parts that are connected in both stay
    connected. If the numbers of maps differ, the child's ``made`` lists the pairs. See
    `evocity.shapes.metamorphosis`.

    Parameters
    ----------
    far : largest distance of the child from the first shape, 0…1, as a share of the way. The
        distance is drawn evenly up to there.
    """

    name = "shape_metamorphosis"
    of = "shape"
    parents = (2, 2)

    far: float = 1.0

    def _checks(self) -> dict[str, Check]:
        return {"far": SHARE}

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        from evocity.shapes import metamorphosis

        t = self.far * float(rng.random())
        path = metamorphosis(*(parent.shape for parent in parents))
        made = {"t": t}
        if len(parents[0].maps) != len(parents[1].maps):
            made["pairs"] = [list(pair) for pair in path.pairs]
        return parents[0].replace(maps=path(t).maps), made
