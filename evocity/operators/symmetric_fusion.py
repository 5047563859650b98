"""Symmetric fusion: at every place one of the two lifs that pairing finds, or what is between."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.coding.decode import decode
from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.lambda_crossover import interpolated, lambda_field
from evocity.operators.pairing import modulated
from evocity.operators.parameters import check_parameters, repair_checks


@dataclass(frozen=True)
class SymmetricFusion(Drafting):
    """At each range block r choose, or interpolate, between two lifs paired by content
    (Marsault 2002 §4.3).

    r12 is the first parent's range block whose content is closest to the second's at r, r21
    the second's that is closest to the first's at r. Their lifs are the pair: one of the first
    parent that builds the second's plan, as in 2mod1, and one of the second that builds the
    first's, as in 1mod2.

    Parameters
    ----------
    share : λ, share of the first parent's lifs, 0…1. 0 gives 1mod2, 1 gives 2mod1; see
        `AsymmetricFusion`.
    choose : whether r takes one lifs of its pair or the other, in patches, with λ for their
        share of the map; else every lifs is λ·r12 + (1 − λ)·r21, as in `Interpolation`.
    grain : size of the patches, in range blocks, 1 or more; 1 chooses lifs by lifs.
    isometries, alike : how blocks are paired, as in `AsymmetricFusion`.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the decoded
        content of r12 or r21, or λ of the one and 1 − λ of the other.
    """

    share: float = 0.5
    choose: bool = True
    grain: int = 8
    isometries: bool = False
    alike: float = 0.01
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "symmetric_fusion"
    parents = (2, 2)

    def __post_init__(self):
        check_parameters(
            self,
            {
                "share": (lambda share: 0 <= share <= 1, "0…1"),
                "grain": (lambda size: 1 <= size <= MAX_SIDE, f"1…{MAX_SIDE} blocks"),
                "alike": (lambda rms: rms >= 0, "0 m or more"),
                **repair_checks(),
            },
        )

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        first, second = parents
        pavement = first.pavement
        maps = [decode(parent).city.heights for parent in parents]
        if self.choose:
            lambdas = lambda_field(pavement, self.share, 0.0, self.grain, rng)
        else:
            lambdas = np.full(len(pavement), self.share)
        how = {"isometries": self.isometries, "alike": self.alike}
        ours, our_mosaic = modulated(second, first, maps[::-1], **how, where=lambdas > 0)
        theirs, their_mosaic = modulated(first, second, maps, **how, where=lambdas < 1)
        child = interpolated(ours, theirs, lambdas, rng.random(lambdas.size))
        weight = pavement.raster(lambdas.astype(np.float32))
        made = {"share": self.share, "choose": self.choose, "grain": self.grain, **how}
        return Draft(
            child.replace(origin=first.origin, crs=first.crs),
            weight * our_mosaic + (1 - weight) * their_mosaic,
            made,
        )
