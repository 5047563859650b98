"""Topological collage: choice among domain blocks by their surroundings (Marsault 2002 §3.3, 2005
§2.1), which tell a wall along a street from a wall in a courtyard."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity import isometries
from evocity.coding._kernels import box_means, grow_outlines

#: Errors of outlines within this share are equal up to rounding.
_ALIKE = 1e-9
#: Heights within this share of the highest roof are equal too.
_UNSEEN = 1e-6


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate domain blocks for each of n range blocks.

    The slice ``starts[i] : starts[i + 1]`` of the arrays `multiple`, `y`, `x`, `iso`, `sigma` and
        `beta` holds the candidates of range block i. The candidates of a range block are sorted by
        the side D of the domain block, then by `y`, `x` and `iso`. The array ``starts`` has the
        type int64 and the
    shape ``(n + 1,)``. A range block may have no candidates.

    The arrays ``multiple`` (side of the domain block / side of the range block, 1 or more), ``y``,
    ``x`` and ``iso`` (0…7) hold whole numbers. The north-west pixel of the domain block is at row
    ``y`` and column ``x``. The arrays ``sigma`` and ``beta`` (m) are float64, because rounding to
    float32 would hide which candidates tie.
    """

    starts: np.ndarray
    multiple: np.ndarray
    y: np.ndarray
    x: np.ndarray
    iso: np.ndarray
    sigma: np.ndarray
    beta: np.ndarray


def closest_neighbourhood(
    heights: np.ndarray,
    block: int,
    corners: tuple[np.ndarray, np.ndarray],
    candidates: Candidates,
    *,
    rings: int = 16,
    domain_heights: np.ndarray | None = None,
) -> np.ndarray:
    """Choose for each range block the candidate with the most similar surroundings.

    Ring k is the set of pixels at distance k around a block. The distance of a pixel from a block
    is the larger of its distances in rows and in columns. The ring of a domain block is transformed
    like the block itself. Before the isometry, the ring of a domain block is averaged over
    ``multiple`` × ``multiple`` pixels. After averaging, the isometry turns the whole square of side
    B + 2k that ring k encloses, with B the side of the block. Finally, the heights of the domain
    block's ring are multiplied by σ, and β is added.

    The comparison begins with ring 1, and adds one ring in each step. After each ring, a candidate
    drops out if its sum of squared differences exceeds the least sum of all candidates, and does
    not tie with that sum. The comparison ends when only one candidate is left, when no candidate
    has pixels left, or after ``rings`` rings. Among the remaining candidates of a range block, the
    first wins: the candidate with the lowest side D, row y, column x and isometry, in this order.

    - A pixel of a ring counts only if it lies on the map both around the range block and around the
      domain block. A missing pixel of a ring counts as the mean of the ring's other pixels. The
      border of the map has no influence on the choice of a candidate.
    - A candidate without pixels in a ring loses to candidates with pixels in that ring.

    Parameters
    ----------
    heights : map of the range blocks, ``(H, W)``, metres.
    block : side B of the range blocks, px, 2 or more.
    corners : (y, x) of the north-west pixels of the range blocks, ``(n,)`` each.
    candidates : candidate domain blocks of each range block.
    rings : largest number of rings to compare; with 0, the first candidate wins.
    domain_heights : map of the domain blocks, metres; None means the map ``heights``. Asymmetric
        fusion passes the map of another city as ``domain_heights``. Candidates with ``multiple`` =
        1, σ = 1 and β = 0 are range blocks of the map ``domain_heights``.

    Returns
    -------
    int64 ``(n,)`` : index of the chosen candidate of each range block; −1 for a range block without
    candidates.

    The function computes in float64. Two sums of squared differences are a tie if they differ by at
    most 1e-9 of the least sum. Two sums of squared differences are also a tie if they differ per
    pixel by at most (highest roof / 1 000 000)². Candidates with equal surroundings tie under any
    isometry.
    """
    top, left = (np.asarray(corner, np.int64) for corner in corners)
    heights = np.asarray(heights, np.float64)
    others = heights if domain_heights is None else np.asarray(domain_heights, np.float64)
    layers, layer_of = _shrink(others, candidates.multiple)
    highest = max(np.abs(heights).max(initial=0), np.abs(others).max(initial=0))
    rings = min(rings, max(heights.shape))  # no outline reaches farther on the map
    chosen = np.empty(len(top), np.int64)
    grow_outlines(
        heights, layers, layer_of, top, left, block,
        candidates.starts, candidates.multiple, candidates.y, candidates.x, candidates.iso,
        candidates.sigma, candidates.beta,
        _turns(block), rings, _ALIKE, (_UNSEEN * highest) ** 2, chosen,
    )  # fmt: skip
    return chosen


def _shrink(heights: np.ndarray, multiple: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute means of all cells of m × m pixels by their north-west pixels, a layer ``(H, W)`` for
    each ``multiple`` m; and the layer of m, ``layer_of[m]``."""
    occurring = np.unique(multiple)
    layer_of = np.zeros(occurring.max(initial=0) + 1, np.int64)
    if occurring.tolist() == [1]:
        return heights[None], layer_of
    layers = np.zeros((len(occurring), *heights.shape))
    for k, m in enumerate(occurring.tolist()):
        box_means(heights, m, m, layers[k])
        layer_of[m] = k
    return layers, layer_of


@cache
def _turns(block: int) -> np.ndarray:
    """Tabulate the source of pixel (i, j) under isometry k, in a block and around it: row
    Σ turns[k, 0] · (1, i, j), column Σ turns[k, 1] · (1, i, j), from the block's north-west pixel;
    int64 ``(8, 2, 3)``."""
    a = isometries.AFFINE
    return np.stack([a[:, :2] * (block - 1), a[:, 2:4], a[:, 4:]], axis=2)
