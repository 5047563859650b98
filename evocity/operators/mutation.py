"""Mutation of the seven nucleotides of a lifs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import BUILT_ABOVE, MAX_SIDE
from evocity.coding.decode import CollageMap, decode
from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.parameters import check_parameters, repair_checks

_RATES = ("sigma", "beta", "x", "y", "dx", "dy", "iso")


@dataclass(frozen=True)
class Mutation(Drafting):
    """Alter any nucleotide, each at a rate of its own (Marsault 2002 §4.1).

    Lifs mutate in square groups that share one draw, so that a change is as large as a
    building and not as small as a block.

    Parameters
    ----------
    sigma, beta, x, y, dx, dy, iso : rate of each nucleotide, 0…1: share of the groups in
        which it changes. Lifs without a domain change in β alone; bare ground stays.
    group : side of a group, in range blocks; 1 mutates lifs by lifs.
    sigma_step : standard deviation of the change of σ; the result is cut at ±sigma_max.
    beta_step : standard deviation of the change of β, metres.
    move : largest change of a domain's x or y, px.
    stretch : largest change of an extent, in blocks.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is one step of
        the mutated code on the parent's decoded map, so that what did not mutate stays.
    """

    sigma: float = 0.02
    beta: float = 0.02
    x: float = 0.02
    y: float = 0.02
    dx: float = 0.01
    dy: float = 0.01
    iso: float = 0.01
    group: int = 4
    sigma_step: float = 0.2
    beta_step: float = 3.0
    move: int = 16
    stretch: int = 1
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "mutation"
    parents = (1, 1)

    def __post_init__(self):
        check_parameters(
            self,
            {
                **dict.fromkeys(_RATES, (lambda rate: 0 <= rate <= 1, "0…1")),
                "group": (lambda side: 1 <= side <= MAX_SIDE, f"1…{MAX_SIDE} blocks"),
                "sigma_step": (lambda step: 0 <= step <= 1000, "0…1000"),
                "beta_step": (lambda step: 0 <= step <= 1000, "0…1000 m"),
                "move": (lambda step: 0 <= step <= MAX_SIDE, f"0…{MAX_SIDE} px"),
                "stretch": (lambda step: 0 <= step <= MAX_SIDE, f"0…{MAX_SIDE} blocks"),
                **repair_checks(),
            },
        )

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        (parent,) = parents
        child, changed = self._mutated(parent, rng)
        intended = np.maximum(CollageMap(child)(decode(parent).attractor), 0)
        return Draft(child, intended, {"mutated": int(changed)})

    def _mutated(self, parent: Genome, rng: np.random.Generator) -> tuple[Genome, int]:
        pavement, block = parent.pavement, parent.pavement.block
        group = self._groups(pavement, rng)
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
            "dx": rng.integers(-self.stretch, self.stretch, count, endpoint=True) * block,
            "dy": rng.integers(-self.stretch, self.stretch, count, endpoint=True) * block,
            "iso": rng.integers(1, 8, count),
        }
        for name, step in steps.items():
            hit = (rng.random(count) < getattr(self, name))[group] & able[name]
            columns[name][hit] += step[group][hit]
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

    def _groups(self, pavement, rng) -> np.ndarray:
        """Index of each lifs' group, ``(n,)``; the grid of groups is laid at a random offset."""
        down, along = rng.integers(0, self.group, 2)
        row = (np.arange(pavement.rows) + down) // self.group
        column = (np.arange(pavement.columns) + along) // self.group
        return (row[:, None] * (column[-1] + 1) + column).ravel()
