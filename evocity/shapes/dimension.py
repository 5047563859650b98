"""Dimensions of shapes: exact, by ratios and languages, and by counting boxes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from evocity.shapes.checks import finite_language_error
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import norms, radii
from evocity.shapes.rendering import line_mask, mask_of
from evocity.shapes.shape import Shape

#: The greatest relative difference of a map from a similarity.
SIMILAR = 1e-9


def ratios_of(shape: Shape) -> np.ndarray:
    """Compute the ratio of each map ``(N,)``. Raises `ShapeError` for maps other than
    similarities."""
    parts = shape.maps[:, :, : shape.size]
    ratios = norms(parts)
    squares = np.einsum("kji,kjl->kil", parts, parts)
    off = np.abs(squares - (ratios**2)[:, None, None] * np.eye(shape.size)).max(axis=(1, 2))
    wrong = np.flatnonzero(off > SIMILAR * np.maximum(ratios**2, 1e-300))
    if len(wrong):
        raise ShapeError(
            f"the affine map {wrong[0]} does not shrink equally in all directions",
            "affine maps that are similarities, because the formula needs similarities",
            "count boxes instead: box_dimension(shape)",
        )
    return ratios


def dimension_of(shape: Shape) -> float:
    """Compute the similarity dimension s of a ``shape``.

    For a shape with all words, the dimension s solves Σ rˢ = 1 over the ratios r of the shape's
    maps. For a restricted language, the dimension s gives the automaton's matrix the spectral
    radius 1; the entries of the matrix are sums of rˢ over the ratios r. The similarity dimension
    equals the dimension of the attractor if pieces do not overlap (the open set condition). A shape
    of single points has the dimension 0.

    Raises `ShapeError` if a map is not a similarity, or if the language has finitely many words.

    Source: Moran 1946; Mauldin & Williams 1988.
    """
    ratios, language = ratios_of(shape), shape.language.minimal
    if not language.lasts:
        raise finite_language_error("choose another language")
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
    """Box counts of a mask.

    dimension : the box dimension, from the slope of the logarithms of ``counts`` against ``sides``.
    sides : the sides of the boxes, px.
    counts : the number of boxes of each side that contain a filled cell.
    """

    dimension: float
    sides: tuple[int, ...]
    counts: tuple[int, ...]


def boxes_of(mask: np.ndarray, base: int = 2) -> Boxes:
    """Compute the box dimension of a ``mask``, bool with 2 or 3 axes.

    The sides of boxes are powers of ``base``, px. The side of the largest box is at most a quarter
    of the mask's shortest axis. Each count is the least count among several offsets of the grid of
    boxes.

    Raises `ShapeError` if the mask is empty, or too small for three sizes of boxes.
    """
    mask = np.asarray(mask, bool)
    sides = []
    side = base**2 if base == 2 else base
    while side <= min(mask.shape) // 4:
        sides.append(side)
        side *= base
    if not mask.any() or len(sides) < 3:
        raise ShapeError(
            f"the mask has {' × '.join(map(str, mask.shape))} cells, and {np.count_nonzero(mask)} "
            "cells are filled",
            f"a mask with filled cells, at least {4 * base ** (4 if base == 2 else 3)} cells long "
            "on each axis",
            "draw a mask with more cells",
        )
    parts = 4 if base == 2 else base  # of a box; offsets of the grid are multiples of a part
    fine, counts, side = mask, [], 1
    for wide in sides:
        fine, side = _blocks(fine, wide // parts // side, 0), wide // parts
        grids = np.ndindex(*[parts] * mask.ndim)
        counts.append(min(int(_blocks(fine, parts, *at).sum()) for at in grids))
    slope = np.polynomial.Polynomial.fit(np.log(sides), np.log(counts), 1).convert().coef[1]
    return Boxes(float(-slope), tuple(sides), tuple(counts))


def box_dimension(shape: Shape, side: int | None = None) -> Boxes:
    """Compute the box dimension of a ``shape`` from a mask of at most ``side`` px along each axis.
    The default side is 4096 px in the plane and 256 px in space. The sides of boxes are powers of
    2, or of the whole number by which all maps shrink."""
    base = _base_of(shape)
    most = side or (4096 if shape.size == 2 else 256)
    whole = base
    while whole * base <= most:
        whole *= base
    return boxes_of(mask_of(shape, whole), base)


def line_dimension(line: ArrayLike, side: int = 1024) -> Boxes:
    """Compute the box dimension of a ``line`` ``(n, 2)`` in a raster of ``side`` × ``side`` px. The
    dimension measures how rough the line is; a smooth line has the dimension 1. Raises `ShapeError`
    if the line is not a polyline of the plane."""
    return boxes_of(line_mask(line, side))


def _base_of(shape: Shape) -> int:
    shrinks = 1 / np.maximum(norms(shape.maps[:, :, : shape.size]), 1e-300)
    base = round(float(shrinks[0]))
    return base if 2 <= base <= 8 and np.abs(shrinks - base).max() < 1e-9 else 2


def _blocks(mask: np.ndarray, side: int, *offsets: int) -> np.ndarray:
    """Tell whether each block of ``side`` cells along every axis has a filled cell; the first
    blocks are shorter by ``offsets`` cells."""
    for axis in range(mask.ndim):
        offset = offsets[axis] if len(offsets) > 1 else 0
        starts = np.arange(-offset, mask.shape[axis], side)
        mask = np.logical_or.reduceat(mask, np.maximum(starts, 0), axis=axis)
    return mask
