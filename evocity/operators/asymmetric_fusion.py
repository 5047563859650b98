"""Asymmetric fusion: one city in the stones of another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome, laid
from evocity.operators.crossing import Draft, Drafting, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.pairing import mosaic_of, paired_pieces, pairing
from evocity.operators.parameters import Check


@dataclass(frozen=True)
class AsymmetricFusion(Drafting):
    """1mod2, the first parent modulated by the second (Marsault 2002 §4.3, 2005 §2.3).

    Each range block r1 of the first parent's decoded map is paired with the range block r2 of
    the second's whose content is closest, ties by topological collage, and r1 is given the lifs
    of r2. Parents in the other order give 2mod1. The papers' results are better with B = 8 than
    with 4: larger blocks show more of the city they are from.

    Without repair a lifs reads its domain block where that lay in the second city, in what is
    now the first's plan: hence the papers' crumbling. With it the child is the mosaic that
    pairing means: the plan of the first city in stones of the second.

    Every lifs' ``parent`` and ``source`` are those of r2; the first parent is named among the
    child's cities, but none of the lifs is from it.

    Parameters
    ----------
    isometries : pair under the 8 isometries of the square; that which brings r2 to r1 is
        composed into the lifs.
    alike : contents whose root mean square distance to r1's exceeds the least by no more are
        tied, metres. Decoded maps are good to 0.01 m. More gives the surroundings more to say.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the decoded
        content of r2 at r1.
    """

    isometries: bool = False
    alike: float = 0.01

    name = "asymmetric_fusion"
    parents = (2, 2)

    def _checks(self) -> dict[str, Check]:
        return {"alike": (lambda rms: rms >= 0, "0 m or more")}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents)
        maps = [raw_heights(parent) for parent in parents]
        index, iso = pairing(grid, parents[1], maps, isometries=self.isometries, alike=self.alike)
        mosaic = mosaic_of(grid, maps[1], index, iso)
        child = laid(parents, paired_pieces(grid, 1, index, iso)).genome
        distance = np.sqrt(np.mean((mosaic - maps[0]) ** 2, dtype=np.float64))
        made = {
            "isometries": self.isometries,
            "alike": self.alike,
            "distance": round(float(distance), 3),
        }
        return Draft(child, mosaic, made)
