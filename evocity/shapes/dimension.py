"""Dimensions of shapes: exact ones by their ratios and languages, and by counting boxes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from evocity.shapes.drawing import line_mask, mask_of
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import norms, radii
from evocity.shapes.shape import Shape

#: By so much, relative, a map may differ from a similarity.
SIMILAR = 1e-9


def ratios_of(shape: Shape) -> np.ndarray:
    """How much each map shrinks ``(N,)``. Raises `ShapeError` where one is no similarity."""
    parts = shape.maps[:, :, : shape.size]
    ratios = norms(parts)
    squares = np.einsum("kji,kjl->kil", parts, parts)
    off = np.abs(squares - (ratios**2)[:, None, None] * np.eye(shape.size)).max(axis=(1, 2))
    wrong = np.flatnonzero(off > SIMILAR * np.maximum(ratios**2, 1e-300))
    if len(wrong):
        raise ShapeError(
            f"map {wrong[0]}, which shrinks by other amounts in other directions",
            "similarities, of which the dimension is known",
            "count boxes instead: boxes_of",
        )
    return ratios


def dimension_of(shape: Shape) -> float:
    """The similarity dimension: the s at which the automaton's matrix of the sums of rˢ has a
    spectral radius of 1; of all words Σ rˢ = 1. It is the attractor's own where its pieces do not
    overlap (the open set condition). 0 for a shape of single points.

    Raises `ShapeError` unless all maps are similarities, and for a language without words of any
    length.

    Source: Moran 1946; Mauldin & Williams 1988.
    """
    ratios, language = ratios_of(shape), shape.language.minimal
    if not language.lasts:
        raise ShapeError(
            "a language without words of any length", "one whose words go on", "change it"
        )
    kept = np.flatnonzero(language.lasting)
    at = np.full(len(language.table) + 1, -1)
    at[kept] = np.arange(len(kept))
    rows, letters = np.nonzero(at[language.table[kept]] >= 0)
    columns = at[language.table[kept][rows, letters]]

    def radius(s: float) -> float:
        matrix = np.zeros((len(kept), len(kept)))
        np.add.at(matrix, (rows, columns), ratios[letters] ** s)
        return float(radii(matrix[None])[0])

    if radius(0.0) <= 1 + 1e-12:
        return 0.0
    high = 1.0
    while radius(high) > 1:
        high *= 2
    return float(brentq(lambda s: radius(s) - 1, 0.0, high, xtol=1e-15, rtol=1e-15))


@dataclass(frozen=True)
class Boxes:
    """How many boxes a mask fills, ``counts`` of ``sides`` px, and the ``dimension`` that their
    slope tells."""

    dimension: float
    sides: tuple[int, ...]
    counts: tuple[int, ...]


def boxes_of(mask: np.ndarray, base: int = 2) -> Boxes:
    """The box dimension of a ``mask``, bool of 2 or 3 axes: boxes of ``base``ʲ px, from four px or
    ``base`` to a quarter of the shortest axis, the least count over offsets of the grid, and the
    slope of their logarithms.

    Raises `ShapeError` for a mask with nothing in it, or too small for three sides.
    """
    mask = np.asarray(mask, bool)
    sides = []
    side = base**2 if base == 2 else base
    while side <= min(mask.shape) // 4:
        sides.append(side)
        side *= base
    if not mask.any() or len(sides) < 3:
        raise ShapeError(
            f"a mask of {' × '.join(map(str, mask.shape))} with {np.count_nonzero(mask)} cells",
            f"some cells, and {4 * base ** (4 if base == 2 else 3)} or more along each axis",
            "draw it larger",
        )
    parts = 4 if base == 2 else base  # of a box, which offsets of the grid are multiples of
    fine, counts, side = mask, [], 1
    for wide in sides:
        fine, side = _blocks(fine, wide // parts // side, 0), wide // parts
        grids = np.ndindex(*[parts] * mask.ndim)
        counts.append(min(int(_blocks(fine, parts, *at).sum()) for at in grids))
    slope = (
        np.polynomial.polynomial.Polynomial.fit(np.log(sides), np.log(counts), 1).convert().coef[1]
    )
    return Boxes(float(-slope), tuple(sides), tuple(counts))


def box_dimension(shape: Shape, side: int | None = None) -> Boxes:
    """The box dimension of a shape, of a mask of it of at most ``side`` px (4096, in space 256),
    with boxes that grow as its maps do: by the whole number that all of them shrink by, else by 2.
    """
    base = _base_of(shape)
    most = side or (4096 if shape.size == 2 else 256)
    whole = base
    while whole * base <= most:
        whole *= base
    return boxes_of(mask_of(shape, whole), base)


def line_dimension(line: ArrayLike, side: int = 1024) -> Boxes:
    """The box dimension of a line ``(n, 2)`` in a raster of ``side`` px: how rough it is at the
    scales that its points reach; 1 for a smooth one. Raises `ShapeError` as `line_of`."""
    return boxes_of(line_mask(line, side))


def _base_of(shape: Shape) -> int:
    shrinks = 1 / np.maximum(norms(shape.maps[:, :, : shape.size]), 1e-300)
    base = round(float(shrinks[0]))
    return base if 2 <= base <= 8 and np.abs(shrinks - base).max() < 1e-9 else 2


def _blocks(mask: np.ndarray, side: int, *offsets: int) -> np.ndarray:
    """Whether each block of ``side`` cells along every axis holds something; the first blocks are
    by ``offsets`` cells shorter."""
    for axis in range(mask.ndim):
        offset = offsets[axis] if len(offsets) > 1 else 0
        starts = np.arange(-offset, mask.shape[axis], side)
        mask = np.logical_or.reduceat(mask, np.maximum(starts, 0), axis=axis)
    return mask


__all__ = ["Boxes", "box_dimension", "boxes_of", "dimension_of", "line_dimension", "ratios_of"]
