"""Partitions of many sides: which sides a map allows, and what two partitions have in common."""

from collections.abc import Sequence

import numpy as np

from evocity.errors import GenomeError, setting
from evocity.pavement._kernels import touching
from evocity.pavement.pavement import Pavement

#: The sides of the leaves unless the user asks for others, px: from the finest to the root.
USUAL = (2, 16)


def halved_sides(finest: int, root: int) -> tuple[int, ...]:
    """The sides from ``root`` down to ``finest``, each half of the one before, px.

    Raises `GenomeError` if halving the root does not come to the finest, or that is below 2.
    """
    sides = [root]
    while sides[-1] > finest and sides[-1] % 2 == 0:
        sides.append(sides[-1] // 2)
    if finest < 2 or sides[-1] != finest:
        raise GenomeError(
            f"leaves from {finest} to {root} px",
            "sides that come from the largest by halving it, 2 px or more: 2-16, 4-32, 3-12",
            f"use for example 2-16, or {finest}-{4 * max(finest, 2)}",
        )
    return tuple(sides)


def read_sides(text: str) -> int | tuple[int, int]:
    """One side of range blocks, or the finest and the largest of leaves, as users write them: "4"
    or "2-16", px. Raises `GenomeError` for anything else."""
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
    """(finest, root) of the usual leaves, 2…16 px, on a map of ``height`` × ``width`` px; a
    smaller root where 16 does not divide both. Raises `GenomeError` for odd sides."""
    finest, root = USUAL
    while root > finest and (height % root or width % root):
        root //= 2
    if height % root or width % root:
        near = [
            f"{side}" if side % 2 == 0 else f"{side - 1} or {side + 1}" for side in (height, width)
        ]
        raise GenomeError(
            f"a map of {height} × {width} px for leaves of {finest} px and more",
            f"even sides: height {near[0]}, width {near[1]}",
            "crop or read the map at such a size, or encode it with one side that divides both",
        )
    return finest, root


def common_refinement(pavements: Sequence[Pavement]) -> Pavement:
    """The coarsest pavement of which every range block lies in one of each of ``pavements``.

    Raises `GenomeError` where two range blocks lap over each other, and neither holds the other:
    such partitions cannot be refined to each other.
    """
    common = pavements[0]
    for other in pavements[1:]:
        common = _refined(common, other)
    return common


def touched(where: np.ndarray, top: np.ndarray, left: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Bool ``(n,)``: which squares (``top``, ``left``, ``side``; px) hold a true pixel of
    ``where``, bool ``(H, W)``."""
    found = np.empty(side.size, bool)
    touching(where, top, left, side, found)
    return found


def quartered(pavements: Sequence[Pavement]) -> bool:
    """Whether all range blocks are squares of one grid, cut in four again and again. Then any two
    are apart, or one holds the other, and there is a `common_refinement`."""
    root = max(p.coarsest for p in pavements)
    return all(
        root % side == 0
        and (times := root // side) & (times - 1) == 0
        and not any((corner[which] % side).any() for corner in p.corners)
        for p in pavements
        for side, which in p.levels.items()
    )


def _refined(one: Pavement, other: Pavement) -> Pavement:
    if one == other:
        return one
    if (one.height, one.width) == (other.height, other.width):
        kept = [_within(a, b) for a, b in ((one, other), (other, one))]
        top, left, side = (
            np.concatenate([column(one)[kept[0]], column(other)[kept[1] & ~_same(other, one)]])
            for column in (lambda p: p.corners[0], lambda p: p.corners[1], lambda p: p.side)
        )
        if int((side.astype(np.int64) ** 2).sum()) == one.height * one.width:
            return Pavement(one.height, one.width, side[np.lexsort((left, top))])
    raise GenomeError(
        f"range blocks of {one.finest}…{one.coarsest} px on {one.height} × {one.width} px and of "
        f"{other.finest}…{other.coarsest} px on {other.height} × {other.width} px",
        "partitions of one map of which one divides the other wherever they meet: sides that "
        "halve, 4 and 2, not 6 and 4",
        "encode both maps with the same sides",
    )


def _within(one: Pavement, other: Pavement) -> np.ndarray:
    """Bool ``(n,)``: which range blocks of ``one`` lie in a single one of ``other``."""
    top, left = one.corners
    bottom, right = top + one.side - 1, left + one.side - 1
    holder = other.index[top, left]
    return (holder == other.index[bottom, right]) & (holder == other.index[top, right])


def _same(one: Pavement, other: Pavement) -> np.ndarray:
    """Bool ``(n,)``: which range blocks of ``one`` are range blocks of ``other``."""
    top, left = one.corners
    holder = other.index[top, left]
    places = zip(other.corners, one.corners, strict=True)
    same = other.side[holder] == one.side
    for theirs, ours in places:
        same &= theirs[holder] == ours
    return same
