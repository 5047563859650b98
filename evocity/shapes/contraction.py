"""Contraction of affine maps: bounds of their joint spectral radius."""

import warnings
from dataclasses import dataclass

import numpy as np

from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import norms, radii

#: The most products of one length.
MOST_PRODUCTS = 4096


@dataclass(frozen=True)
class Contraction:
    """Bounds of the joint spectral radius of maps, computed from products of several maps;
    ``length`` is the number of maps in a product.

    The joint spectral radius lies between ``lower`` and ``upper``. If the joint spectral radius is
    below 1, long products of maps contract to points. The attribute ``word`` lists the maps whose
    product gives the bound ``lower``.
    """

    lower: float
    upper: float
    length: int
    word: tuple[int, ...]

    @property
    def proved(self) -> bool:
        """Whether all long products of the maps contract."""
        return self.upper < 1

    @property
    def refuted(self) -> bool:
        """Whether some products of the maps never contract."""
        return self.lower >= 1


def contraction_of(maps: np.ndarray, language: Language) -> Contraction:
    """Bound the joint spectral radius of ``maps`` ``(N, m, m + 1)`` in the words of a ``language``,
    by products of growing length, until a bound decides it or there are more than `MOST_PRODUCTS`.

    The upper bound is the largest spectral norm of products of length k, to the power 1 / k. The
    lower bound is the largest spectral radius of products that lead from a state back to it, and
    can be repeated. Source: ../shared/SHAPES.md §0.
    """
    size = maps.shape[1]
    parts = maps[:, :, :size]
    kept = np.flatnonzero(language.lasting)
    table = np.where(np.append(language.lasting, False)[language.table], language.table, -1)
    products = np.broadcast_to(np.eye(size), (len(kept), size, size))
    starts, ends = kept, kept
    words = np.zeros((len(kept), 0), np.int64)
    lower, upper, word = 0.0, np.inf, ()
    while True:
        way, letter = np.nonzero(table[ends] >= 0)
        length = words.shape[1] + 1
        if length > 1 and len(way) > MOST_PRODUCTS:
            return Contraction(lower, upper, length - 1, word)
        products = np.einsum("kij,kjl->kil", products[way], parts[letter])
        words = np.column_stack([words[way], letter])
        starts, ends = starts[way], table[ends[way], letter]
        if not len(way):
            return Contraction(0.0, 0.0, length, ())
        upper = min(upper, float(norms(products).max()) ** (1 / length))
        round_trips = np.flatnonzero(starts == ends)
        if len(round_trips):
            own = radii(products[round_trips])
            best = int(own.argmax())
            if own[best] ** (1 / length) > lower:
                lower = float(own[best]) ** (1 / length)
                word = tuple(words[round_trips[best]].tolist())
        if upper < 1 or lower >= 1 or length == 64:
            return Contraction(lower, upper, length, word)


def check_contraction(bounds: Contraction) -> None:
    """Raise `ShapeError`, which names them, for maps that do not contract; warn if it is
    unknown."""
    if bounds.refuted:
        named, count = " ".join(map(str, bounds.word)), len(bounds.word)
        which = f"map {named}" if count == 1 else f"the product of maps {named}"
        raise ShapeError(
            f"{which} does not contract: its spectral radius is {bounds.lower**count:.4g}",
            "affine maps with a spectral radius below 1, so that their products contract",
            "shrink these maps, or exclude this product from the language of the shape",
        )
    if not bounds.proved:
        warnings.warn(
            f"maps that may not contract: their joint spectral radius lies between "
            f"{bounds.lower:.4g} and {bounds.upper:.4g}",
            stacklevel=4,
        )
