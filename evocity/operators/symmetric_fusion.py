"""Symmetric fusion: at every place one of the two lifs that pairing finds, or what is between."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome, laid
from evocity.operators.crossing import Draft, Drafting, raw_heights
from evocity.operators.grid import common_grid, in_cells, side_checks
from evocity.operators.lambda_crossover import GRAIN, interpolated, lambda_field
from evocity.operators.pairing import mosaic_of, paired_pieces, pairing
from evocity.operators.parameters import Check


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
    grain_side : size of the patches, metres; None for 64.
    grain : the same in range blocks, of uniform pavements; 1 chooses lifs by lifs. Deprecated.
    isometries, alike : how blocks are paired, as in `AsymmetricFusion`.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the decoded
        content of r12 or r21, or λ of the one and 1 − λ of the other.
    """

    share: float = 0.5
    choose: bool = True
    grain_side: float | None = None
    isometries: bool = False
    alike: float = 0.01
    grain: int | None = None

    name = "symmetric_fusion"
    parents = (2, 2)

    def _checks(self) -> dict[str, Check]:
        return {
            "share": (lambda share: 0 <= share <= 1, "0…1"),
            **side_checks(self, "grain"),
            "alike": (lambda rms: rms >= 0, "0 m or more"),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        first, second = parents
        grid = common_grid(self.name, parents)
        maps = [raw_heights(parent) for parent in parents]
        if self.choose:
            grain = in_cells(self.name, "grain", self.grain_side, self.grain, GRAIN, grid, parents)
            lambdas = lambda_field(grid, self.share, 0.0, grain, rng)
        else:
            lambdas = np.full(len(grid), self.share)
        how = {"isometries": self.isometries, "alike": self.alike}
        ours = pairing(grid, first, maps[::-1], **how, where=lambdas > 0)
        theirs = pairing(grid, second, maps, **how, where=lambdas < 1)
        weight = grid.raster(lambdas.astype(np.float32))
        mosaics = [mosaic_of(grid, maps[0], *ours), mosaic_of(grid, maps[1], *theirs)]
        made = {"share": self.share, "choose": self.choose, **how}
        if self.choose:
            one = lambdas >= 0.5
            index, iso = (np.where(one, *both) for both in zip(ours, theirs, strict=True))
            child = laid(parents, paired_pieces(grid, np.where(one, 0, 1), index, iso)).genome
            made["grain_side"] = grain * grid.block * first.metres_per_pixel
        else:
            both = [
                laid(parents, paired_pieces(grid, whose, *one)).genome
                for whose, one in ((0, ours), (1, theirs))
            ]
            child = interpolated(self.name, both, grid, lambdas, rng)
        return Draft(child, weight * mosaics[0] + (1 - weight) * mosaics[1], made)
