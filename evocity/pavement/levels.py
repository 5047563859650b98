"""Partitions of several sides: legal sides for a map, common refinements of partitions."""

from collections.abc import Sequence

import numpy as np

from evocity.errors import GenomeError, setting
from evocity.pavement._kernels import touching
from evocity.pavement.pavement import Pavement

#: The default sides of leaves, px: from the finest to the root.
USUAL = (2, 16)


def halved_sides(finest: int, root: int) -> tuple[int, ...]:
    """List the sides of quadtree leaves in px, from ``root`` down to ``finest``; each side is half
    of the previous side.

    Raises `GenomeError` if repeated halving of ``root`` does not give ``finest``, or if ``finest``
    is below 2.
    """
    sides = [root]
    while sides[-1] > finest and sides[-1] % 2 == 0:
        sides.append(sides[-1] // 2)
    if finest < 2 or sides[-1] != finest:
        raise GenomeError(
            f"range blocks cannot have sides from {finest} to {root} px",
            "a finest side of 2 px or more, and a largest side that is 2, 4, 8… times the finest "
            "side",
            f"use for example 2-16, or {finest}-{4 * max(finest, 2)}",
        )
    return tuple(sides)


def read_sides(text: str) -> int | tuple[int, int]:
    """Read the side of range blocks in px, for example "4", or the smallest and the largest side of
    range blocks, for example "2-16". Raises `GenomeError` for a text that is neither a number nor a
    pair of numbers with a hyphen."""
    parts = text.strip().split("-")
    if len(parts) <= 2 and all(part.strip().isascii() and part.strip().isdigit() for part in parts):
        sides = tuple(int(part) for part in parts)
        if len(sides) == 1:
            return sides[0]
        halved_sides(*sides)
        return sides
    raise GenomeError(
        setting("block", text),
        "one side of range blocks, or the finest and the largest of leaves, px",
        "write for example 4, or 2-16",
    )


def fitting_sides(height: int, width: int) -> tuple[int, int]:
    """Choose the smallest and the largest side of range blocks for a map of ``height`` × ``width``
    px. The finest side of range blocks is 2 px. The largest side is 16 px, or less if 16 does not
    divide both the height and the width. Raises `GenomeError` if the height or the width is odd."""
    finest, root = USUAL
    while root > finest and (height % root or width % root):
        root //= 2
    if height % root or width % root:
        near = [
            f"{side}" if side % 2 == 0 else f"{side - 1} or {side + 1}" for side in (height, width)
        ]
        raise GenomeError(
            f"a map of {height} × {width} px cannot have range blocks of {finest} px and more",
            f"an even height and an even width: height {near[0]}, width {near[1]}",
            "crop or read the map at this size, or encode the map with one side of range blocks "
            "that divides its height and width",
        )
    return finest, root


def common_refinement(pavements: Sequence[Pavement]) -> Pavement:
    """Find the coarsest pavement (division of a map into range blocks) that refines all
    ``pavements``.

    Raises `GenomeError` if two range blocks overlap and neither contains the other.
    """
    common = pavements[0]
    for other in pavements[1:]:
        common = _refine(common, other)
    return common


def touched(where: np.ndarray, top: np.ndarray, left: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Select the squares that contain a true pixel of a mask.

    where : the mask, bool ``(H, W)``.
    top, left, side : north-west corner and side of each square, px.

    Returns bool ``(n,)``.
    """
    mask = np.empty(side.size, bool)
    touching(where, top, left, side, mask)
    return mask


def quartered(pavements: Sequence[Pavement]) -> bool:
    """Check whether all range blocks come from one grid by repeated division into four squares. If
    the blocks come from one grid, any two blocks are disjoint or nested, and a `common_refinement`
    exists."""
    root = max(p.coarsest for p in pavements)
    return all(
        root % side == 0
        and (times := root // side) & (times - 1) == 0
        and not any((corner[which] % side).any() for corner in p.corners)
        for p in pavements
        for side, which in p.levels.items()
    )


def _refine(first: Pavement, second: Pavement) -> Pavement:
    if first == second:
        return first
    if (first.height, first.width) == (second.height, second.width):
        (inner, _), (other, same) = _nesting(first, second), _nesting(second, first)
        top, left, side = (
            np.concatenate([column(first)[inner], column(second)[other & ~same]])
            for column in (lambda p: p.corners[0], lambda p: p.corners[1], lambda p: p.side)
        )
        if int((side.astype(np.int64) ** 2).sum()) == first.height * first.width:
            return Pavement(first.height, first.width, side[np.lexsort((left, top))])
    raise GenomeError(
        " and ".join(
            f"range blocks of {p.finest}…{p.coarsest} px on {p.height} × {p.width} px"
            for p in (first, second)
        ),
        "partitions of one map whose sides halve, 4 and 2, not 6 and 4",
        "encode both maps with the same sides",
    )


def _nesting(inner: Pavement, outer: Pavement) -> tuple[np.ndarray, np.ndarray]:
    """Tell which range blocks of ``inner`` lie in a single one of ``outer``, and which of them are
    that range block: bool ``(n,)`` each."""
    top, left = inner.corners
    bottom, right = top + inner.side - 1, left + inner.side - 1
    holder = outer.index[top, left]
    within = (holder == outer.index[bottom, right]) & (holder == outer.index[top, right])
    corners = (outer.corners[0][holder] == top) & (outer.corners[1][holder] == left)
    return within, corners & (outer.side[holder] == inner.side)
