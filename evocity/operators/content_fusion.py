"""Asymmetric and symmetric fusion: lifs of two parents, paired by the contents of range blocks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome, laid
from evocity.operators.crossover import Draft, Drafting, raw_heights
from evocity.operators.grid import common_grid, in_cells, side_checks
from evocity.operators.lambda_crossover import GRAIN, interpolate, lambda_field
from evocity.operators.pairing import mosaic, pair_cells, pieces_of
from evocity.operators.parameters import SHARE, Check

_ALIKE: Check = (lambda rms: rms >= 0, "0 m or more")


@dataclass(frozen=True)
class AsymmetricFusion(Drafting):
    """Rebuild the first parent's map from range blocks of the second, 1mod2 (Marsault 2002 §4.3,
    2005 §2.3).

    Each range block r1 of the first parent's decoded map is paired with a range block r2 of the
    second parent. The block r2 has the closest content; topological collage decides ties. The child
    has the lifs of r2 at r1. Parents in the other order give 2mod1. The papers' results are better
    with B = 8 than with B = 4, because larger blocks show more of their own city.

    Without repair, the lifs of r2 keeps the place of its domain block. At this place, the child has
    the first parent's plan instead of the second city. This explains the crumbling in the papers.
    With repair, the child is the mosaic that the pairing intends: the plan of the first city, in
    range blocks of the second.

    The values ``parent`` and ``source`` of every lifs are those of r2. The child's cities include
    those of the first parent, but no lifs comes from it.

    Parameters
    ----------
    isometries : whether blocks are paired under the 8 isometries of the square. The isometry that
        turns r2 to r1 is then combined with the lifs' own isometry.
    alike : largest difference between tied contents, metres (root mean square distance to r1).
        Decoded maps are precise to 0.01 m. With a larger value, the surroundings count more.
    repair, reach, domains : as in `PavementFusion`. The intended map has the decoded content of r2
        at r1.
    """

    isometries: bool = False
    alike: float = 0.01

    name = "asymmetric_fusion"
    parents = (2, 2)

    def _checks(self) -> dict[str, Check]:
        return {"alike": _ALIKE}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents)
        maps = [raw_heights(parent) for parent in parents]
        how = {"isometries": self.isometries, "alike": self.alike}
        index, iso = pair_cells(grid, parents[1], maps, **how)
        intended = mosaic(grid, maps[1], index, iso)
        child = laid(parents, pieces_of(grid, 1, index, iso)).genome
        distance = np.sqrt(np.mean((intended - maps[0]) ** 2, dtype=np.float64))
        return Draft(child, intended, {**how, "distance": round(float(distance), 3)})


@dataclass(frozen=True)
class SymmetricFusion(Drafting):
    """Choose or mix, at each range block r, two lifs that are paired by content (Marsault 2002
    §4.3).

    The block r12 is the range block of the first parent whose content is closest to the second
    parent's at r. The block r21 is the range block of the second parent whose content is closest to
    the first parent's at r. The lifs of r12 and r21 are the pair. All r12 build the second parent's
    plan, as in 2mod1. All r21 build the first parent's plan, as in 1mod2.

    Parameters
    ----------
    share : λ, the share of the first parent's lifs, 0…1. 0 gives 1mod2, and 1 gives 2mod1; see
        `AsymmetricFusion`.
    choose : whether r takes one of the two lifs, in patches; λ is then the first parent's share of
        the map. Otherwise every lifs is λ·r12 + (1 − λ)·r21, as in `Interpolation`.
    grain_side : size of the patches, metres; None for 64.
    grain : the same size in range blocks, for uniform pavements; 1 chooses single lifs. Deprecated.
    isometries, alike : rules for pairing blocks, as in `AsymmetricFusion`.
    repair, reach, domains : as in `PavementFusion`. The intended map has the decoded content of r12
        or r21, or their mixture by λ and 1 − λ.
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
        return {"share": SHARE, **side_checks(self, "grain"), "alike": _ALIKE}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        first, second = parents
        grid = common_grid(self.name, parents)
        maps = [raw_heights(parent) for parent in parents]
        if self.choose:
            grain = in_cells(self, "grain", GRAIN, grid, parents)
            lambdas = lambda_field(grid, self.share, 0.0, grain, rng)
        else:
            lambdas = np.full(len(grid), self.share)
        how = {"isometries": self.isometries, "alike": self.alike}
        ours = pair_cells(grid, first, maps[::-1], **how, where=lambdas > 0)
        theirs = pair_cells(grid, second, maps, **how, where=lambdas < 1)
        weight = grid.raster(lambdas.astype(np.float32))
        mosaics = [mosaic(grid, maps[0], *ours), mosaic(grid, maps[1], *theirs)]
        made = {"share": self.share, "choose": self.choose, **how}
        if self.choose:
            larger = lambdas >= 0.5
            index, iso = (np.where(larger, *both) for both in zip(ours, theirs, strict=True))
            child = laid(parents, pieces_of(grid, np.where(larger, 0, 1), index, iso)).genome
            made["grain_side"] = grain * grid.block * first.metres_per_pixel
        else:
            both = [
                laid(parents, pieces_of(grid, number, *pairs)).genome
                for number, pairs in ((0, ours), (1, theirs))
            ]
            child = interpolate(self.name, both, grid, lambdas, rng)
        return Draft(child, weight * mosaics[0] + (1 - weight) * mosaics[1], made)
