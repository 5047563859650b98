"""Which of several domain blocks lies in surroundings most like the range block's?

Topological collage (Marsault 2002 §3.3, 2005 §2.1): by content alone a wall along a street and a
wall in a courtyard may be one block. Among candidates of nearly equal collage error, the one
whose neighbourhood is closest keeps the links between a block and what stands around it.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity import isometries
from evocity.coding._kernels import box_means, grow_outlines

#: Outlines whose errors differ by no more than this share are alike: the rest is rounding.
_ALIKE = 1e-9
#: Nor are heights told apart below this share of the highest.
_UNSEEN = 1e-6


@dataclass(frozen=True, eq=False)
class Candidates:
    """Domain blocks that n range blocks may choose among.

    Those of range block i stand at ``starts[i] : starts[i + 1]`` of all other arrays, in the
    order of (D, y, x, iso). ``starts`` is int64 ``(n + 1,)``; a range block may have none.

    multiple (D/B, 1 or more), y, x (px, north-west pixel of the domain block), iso (0…7): whole
    numbers. sigma, beta (m): float64, for float32 would break true ties.
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
    """For each range block, the candidate whose neighbourhood is closest to the range block's.

    Ring k are the pixels around a block at distance k (the larger of rows and columns). The
    domain block's is brought to the range block's as the block itself is: shrunk by means of
    cells of multiple × multiple pixels, which continue the domain block's own; turned by the
    isometry with the whole square of side B + 2k; times σ, plus β. Outlines grow by one pixel at
    a time, from ring 1. A candidate whose squared differences, summed over all rings so far,
    exceed the least is dropped, until one is left.

    - A pixel is compared where both neighbourhoods have it on the map. What a candidate lacks
      of a ring is taken to be as far off, on average, as what it has of that ring: so the map's
      border by itself is neither gain nor loss.
    - A candidate that has nothing of a ring gives way to those that have something.
    - Growth ends after ``rings`` rings, or when no candidate has anything left to compare.
      Of those that are left, the first, of lowest (D, y, x, iso), is chosen.

    Parameters
    ----------
    heights : ``(H, W)``, metres: the map of the range blocks.
    block : B, side of the range blocks, px, 2 or more.
    corners : (y, x) of the range blocks' north-west pixels, ``(n,)`` each.
    candidates : what each range block may choose among.
    rings : rings to compare at most; with 0 the first candidate is chosen.
    domain_heights : the map of the domain blocks, metres, if it is another (asymmetric fusion:
        with multiple 1, σ 1 and β 0 they are range blocks of another city).

    Returns
    -------
    int64 ``(n,)`` : the chosen candidates' places in their arrays; −1 for a range block that
        has none.

    Computed in float64. Errors within a share of 1e-9 of the least, or within the square of a
    millionth of the highest roof a pixel, are ties: so true ties stay ties under any isometry.
    """
    top, left = (np.asarray(corner, np.int64) for corner in corners)
    heights = np.asarray(heights, np.float64)
    others = heights if domain_heights is None else np.asarray(domain_heights, np.float64)
    layers, layer_of = _shrunk(others, candidates.multiple)
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


def _shrunk(heights: np.ndarray, multiple: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means of all cells of m × m pixels, a layer ``(H, W)`` for each ``multiple`` m that
    occurs, by their north-west pixels; and which layer is whose: ``layer_of[m]``."""
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
    """Int64 ``(8, 2, 3)``: where isometry k takes pixel (i, j) from, inside a block and around
    it: row Σ turns[k, 0] · (1, i, j), column Σ turns[k, 1] · (1, i, j), counted from the block's
    north-west pixel."""
    sources = isometries.sources(block).astype(np.int64)
    origin, below, right = (np.stack(np.divmod(sources[:, t], block), 1) for t in (0, block, 1))
    return np.stack([origin, below - origin, right - origin], axis=2)
