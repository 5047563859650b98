"""Asymmetric and symmetric fusion: lifs of two parents, paired by the contents of range blocks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from evocity.genome import Genome, laid
from evocity.operators.crossover import Draft, Drafting, raw_heights
from evocity.operators.grid import common_grid, in_cells, side_checks
from evocity.operators.lambda_crossover import GRAIN, interpolate, lambda_field
from evocity.operators.pairing import mosaic, pair_cells, pieces_of
from evocity.operators.pairing.squares import pair_squares
from evocity.operators.parameters import MOST_METRES, SHARE, Check

#: Range blocks along a side of paired squares, by default.
_BLOCKS = 5
_ALIKE: Check = (lambda rms: rms >= 0, "0 m or more")


@dataclass(frozen=True)
class AsymmetricFusion(Drafting):
    """Rebuild the first parent's plan from squares of the second parent (Marsault 2002 §4.3, 2005
    §2.3). In the papers, the fusion of the first parent with blocks of the second parent is called
    1mod2; with swapped parents, it is called 2mod1.

    The operator pairs each square of range blocks of the first parent with the square of the second
    parent that has the most similar decoded heights and mean height. The square of the second
    parent should also continue the squares to the north and west, and should not repeat. In the
    child, each range block of a square gets the lifs of its partner in the second parent.

    The papers pair single range blocks, as the operator does with ``side`` = 0. A single block has
    a likeness almost everywhere, so the pairs of single blocks show the first parent again. Squares
    show buildings of the second parent in the plan of the first parent.

    In the papers, the domain block of a copied lifs stays at its old position. Every copied lifs
    reads the child's plan instead of the second city, so the children in the papers crumble. With
    collage repair, the child shows the intended map, which the pairs make of the second city. The
    results in the papers are better with range blocks of 8 px than with blocks of 4 px, because
    larger blocks show more of a city. By default, the squares grow with the range blocks.

    Every lifs keeps the values ``parent`` and ``source`` that it has in the second parent. The
    child's list of cities includes the cities of the first parent, although no lifs comes from
    them.

    Parameters
    ----------
    side : side of the squares, metres, rounded to range blocks; 0 pairs single range blocks by
        their contents only, as releases before 0.3 did. If ``side`` is None, a square has 5 × 5
        range blocks. With range blocks of several sides, cells of up to 8 m count as range blocks.
        A recipe without this key uses 0.
    isometries : whether squares are compared under all 8 isometries of the square. The operator
        combines the isometry that turns the partner with the isometry of each lifs.
    alike : tolerance in metres, 0 or more; all squares within this tolerance of the most similar
        square count as equally similar, and the square at the same place wins. The difference
        between two squares is the root mean square of the differences between their heights.
        Decoded maps are precise to 0.01 m. With ``side`` = 0, the surroundings of blocks decide
        between equally similar blocks (topological collage).
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. In
        the intended map, the decoded heights of each partner replace those of the first parent.
    """

    isometries: bool = False
    alike: float = 0.01
    side: float | None = None

    name = "asymmetric_fusion"
    parents = (2, 2)
    #: Recipes and logs of releases before squares have no key ``side``.
    older_values: ClassVar[Mapping[str, Any]] = {"side": 0.0}

    def _checks(self) -> dict[str, Check]:
        allowed = f"0…{MOST_METRES:g} m, or none for 5 range blocks"
        return {
            "side": (lambda side: side is None or 0 <= side <= MOST_METRES, allowed),
            "alike": _ALIKE,
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents)
        maps = [raw_heights(parent) for parent in parents]
        how = {"isometries": self.isometries, "alike": self.alike}
        if self.side == 0:
            index, iso = pair_cells(grid, parents[1], maps, **how)
        else:
            cell = grid.block * parents[0].metres_per_pixel
            count = _BLOCKS if self.side is None else round(self.side / cell)
            count = min(max(count, 1), grid.rows, grid.columns)
            how["side"] = count * cell
            index, iso = pair_squares(grid, maps, count, turned=self.isometries, alike=self.alike)
        intended = mosaic(grid, maps[1], index, iso)
        child = laid(parents, pieces_of(grid, 1, index, iso)).genome
        distance = np.sqrt(np.mean((intended - maps[0]) ** 2, dtype=np.float64))
        return Draft(child, intended, {**how, "distance": round(float(distance), 3)})


@dataclass(frozen=True)
class SymmetricFusion(Drafting):
    """Choose or mix two lifs of similar content for each range block (Marsault 2002 §4.3).

    For a range block r, the block r12 is the range block of the first parent whose content is most
    similar to the second parent's content at r. The block r21 is the range block of the second
    parent whose content is most similar to the first parent's content at r. Together, the blocks
    r12 imitate the second parent's plan, and the blocks r21 imitate the first parent's plan.

    Parameters
    ----------
    share : share λ of the first parent's lifs, 0…1. A share of 0 gives the fusion 1mod2, and 1
        gives 2mod1; see `AsymmetricFusion` with ``side`` = 0.
    choose : whether the operator chooses one of two lifs for each block, in patches, so that λ is
        the first parent's share of the map. If ``choose`` is false, every lifs mixes the lifs of
        the blocks r12 and r21 as λ·r12 + (1 − λ)·r21, as in `Interpolation`.
    grain_side : size of the patches of neighbouring lifs with similar weights, metres; by default
        64 m.
    grain : size of the patches, counted in range blocks of equal size; 1 chooses single lifs.
        Deprecated.
    isometries, alike : rules for pairing blocks, as in `AsymmetricFusion`.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map has the decoded heights of r12 or r21, or their mixture with the weights λ and
        1 − λ.
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
