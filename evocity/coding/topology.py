"""Topological collage: choice among domain blocks by their surroundings (Marsault 2002 §3.3, 2005
§2.1).

By content, a wall along a street and a wall in a courtyard may be equal. Among candidates of nearly
equal collage error, the closest neighbourhood keeps the links between a block and its surroundings.
"""

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
    """Candidate domain blocks of n range blocks.

    The candidates of range block i have the indices ``starts[i] : starts[i + 1]`` in all other
    arrays. Their order is (D, y, x, iso). The array ``starts`` is int64 ``(n + 1,)``. A range block
    may have no candidates.

    Four arrays hold whole numbers: ``multiple`` (D/B, 1 or more), ``y`` and ``x`` (px, north-west
    pixel of the domain block), ``iso`` (0…7). The arrays ``sigma`` and ``beta`` (m) are float64,
    because float32 would break true ties.
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
    """Choose for each range block the candidate whose surroundings resemble the block's
    surroundings most.

    Ring k is the set of pixels at distance k around a block (the larger of row and column
    distance). The ring of a domain block is made comparable in the same way as the block. It is
    averaged over ``multiple`` × ``multiple`` pixels, and turned by the isometry with the whole
    square of side B + 2k. Then it is multiplied by σ, and β is added. The comparison begins with
    ring 1 and adds ring after ring. A candidate drops out if its squared differences over all rings
    so far exceed the least. The comparison ends when one candidate is left.

    - A pixel counts if both neighbourhoods have it on the map. A missing pixel of a ring counts as
      the average of the ring's other pixels. So the map's border brings neither gain nor loss.
    - A candidate without pixels in a ring loses to candidates with pixels in it.
    - The comparison also ends after ``rings`` rings, or when no candidate has pixels left. Then
      the first of the remaining candidates, with the lowest (D, y, x, iso), wins.

    Parameters
    ----------
    heights : map of the range blocks, ``(H, W)``, metres.
    block : side B of the range blocks, px, 2 or more.
    corners : (y, x) of the north-west pixels of the range blocks, ``(n,)`` each.
    candidates : candidates of each range block.
    rings : largest number of rings; 0 takes the first candidate.
    domain_heights : map of the domain blocks, metres, if it is another map. Asymmetric fusion uses
        it: with ``multiple`` 1, σ 1 and β 0 these blocks are range blocks of another city.

    Returns
    -------
    int64 ``(n,)`` : indices of the chosen candidates in their arrays; −1 for a range block without
    candidates.

    The function computes in float64. Two errors are a tie if they differ by at most 1e-9 of the
    least. They are also a tie if they differ per pixel by at most (highest roof / 1 000 000)². So
    true ties stay ties under any isometry.
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
    sources = isometries.sources(block).astype(np.int64)
    origin, below, right = (np.stack(np.divmod(sources[:, t], block), 1) for t in (0, block, 1))
    return np.stack([origin, below - origin, right - origin], axis=2)
