"""Mutation of the seven nucleotides of a lifs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import BUILT_ABOVE, MAX_SIDE
from evocity.coding.collage_map import CollageMap
from evocity.coding.decoding_cache import decoded
from evocity.genome import NUCLEOTIDES, Genome
from evocity.operators.crossover import Draft, Drafting
from evocity.operators.grid import common_grid, in_cells, side_checks
from evocity.operators.parameters import SHARE, Check

_RATES = tuple(NUCLEOTIDES)


@dataclass(frozen=True)
class Mutation(Drafting):
    """Change nucleotides, each at its own rate (Marsault 2002 §4.1).

    Lifs mutate in square groups that share a random draw, so that a change is as large as a
    building.

    Parameters
    ----------
    sigma, beta, x, y, dx, dy, iso : rate of each nucleotide, 0…1: the share of the groups in which
        this nucleotide changes. In a lifs without a domain block, only β changes; lifs of bare
        ground do not change.
    group_side : side of a square group of lifs, metres; by default 32 m. A lifs belongs to the
        group that contains the middle of its range block.
    group : side of a square group of lifs, counted in range blocks of equal size; 1 mutates single
        lifs. Deprecated.
    sigma_step : standard deviation of the change of σ; the new σ is limited to ±sigma_max.
    beta_step : standard deviation of the change of β, metres.
    move : largest change of a domain block's ``x`` or ``y``, px.
    stretch : largest change of a domain block's extent, as a multiple of the range block's side.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the parent's decoded map after one iteration of the mutated code, so range
        blocks without a mutation stay unchanged.
    """

    sigma: float = 0.02
    beta: float = 0.02
    x: float = 0.02
    y: float = 0.02
    dx: float = 0.01
    dy: float = 0.01
    iso: float = 0.01
    group_side: float | None = None
    sigma_step: float = 0.2
    beta_step: float = 3.0
    move: int = 16
    stretch: int = 1
    group: int | None = None

    keeps_streets: ClassVar[bool] = True
    name = "mutation"
    takes_turns: ClassVar[bool] = True
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return {
            **dict.fromkeys(_RATES, SHARE),
            **side_checks(self, "group"),
            "sigma_step": (lambda step: 0 <= step <= 1000, "0…1000"),
            "beta_step": (lambda step: 0 <= step <= 1000, "0…1000 m"),
            "move": (lambda step: 0 <= step <= MAX_SIDE, f"0…{MAX_SIDE} px"),
            "stretch": (lambda step: 0 <= step <= MAX_SIDE, f"0…{MAX_SIDE} range blocks"),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        (parent,) = parents
        child, changed = self._mutate(parent, rng)
        intended = np.maximum(CollageMap(child)(decoded(parent).attractor), 0)
        rates = {name: getattr(self, name) for name in _RATES}
        return Draft(child, intended, {"mutated": int(changed), "rates": rates})

    def _mutate(self, parent: Genome, rng: np.random.Generator) -> tuple[Genome, int]:
        pavement, block = parent.pavement, parent.pavement.side
        group = self._groups(parent, rng)
        count = int(group.max()) + 1
        columns = {name: getattr(parent, name).astype(float) for name in _RATES}
        domain = ~parent.uniform
        able = dict.fromkeys(_RATES, domain)
        able["beta"] = domain | (parent.beta > BUILT_ABOVE)
        steps = {
            "sigma": rng.normal(0, self.sigma_step, count),
            "beta": rng.normal(0, self.beta_step, count),
            "x": rng.integers(-self.move, self.move, count, endpoint=True),
            "y": rng.integers(-self.move, self.move, count, endpoint=True),
            "dx": rng.integers(-self.stretch, self.stretch, count, endpoint=True),
            "dy": rng.integers(-self.stretch, self.stretch, count, endpoint=True),
            "iso": rng.integers(1, 8, count),
        }
        for name, step in steps.items():
            hit = (rng.random(count) < getattr(self, name))[group] & able[name]
            unit = block[hit] if name in ("dx", "dy") else 1
            columns[name][hit] += step[group][hit] * unit
        columns["iso"] %= 8
        columns["sigma"] = np.clip(columns["sigma"], -parent.sigma_max, parent.sigma_max)
        columns["beta"] = np.where(domain, columns["beta"], np.maximum(columns["beta"], 0))
        for extent, corner, side in (("dx", "x", pavement.width), ("dy", "y", pavement.height)):
            legal = np.clip(columns[extent], 2 * block, side // block * block)
            columns[extent] = np.where(domain, legal, 0)
            columns[corner] = np.clip(columns[corner], 0, side - columns[extent])
        columns = {
            name: values.astype(getattr(parent, name).dtype) for name, values in columns.items()
        }
        different = [columns[name] != getattr(parent, name) for name in _RATES]
        return parent.replace(**columns), np.logical_or.reduce(different).sum()

    def _groups(self, parent: Genome, rng) -> np.ndarray:
        """Number each lifs' group, ``(n,)``; the grid of groups has a random offset."""
        grid = common_grid(self.name, [parent])
        side = in_cells(self, "group", 32.0, grid, [parent])
        down, along = rng.integers(0, side, 2)
        top, left = parent.pavement.corners
        half, cell = parent.pavement.side // 2, grid.block
        row = ((top + half) // cell + down) // side
        column = ((left + half) // cell + along) // side
        return row * (grid.columns // side + 2) + column
