"""Polynomial deformation of shapes: an operation on the maps, in the space of monomials.

An affine map acts linearly on the monomials of a point up to a power. So the lifted maps are an
iterated function system of matrices, and a polynomial of the point is a projection of its
attractor. Source: Tosan, Excoffier, Rondet-Mignotte 2005, §3.2, after Zair and Tosan 1996.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from evocity.shapes._kernels import DEEPEST
from evocity.shapes.checks import array_like, check_range, piece_count_error
from evocity.shapes.languages import ShapeError
from evocity.shapes.rendering import Frame, inked
from evocity.shapes.shape import MOST_PIECES, Shape

#: The greatest power of a deformation: more monomials would fold a shape many times.
MOST_POWER = 3
#: Points along an axis at which the stretch of a deformation is measured.
_GRID = 33


def monomials(size: int, power: int) -> np.ndarray:
    """List the exponents of all monomials of ``size`` coordinates up to a ``power``, int ``(K,
    size)``: 1, then x, y, then x², xy, y², and so on."""
    listed = [
        [letters.count(axis) for axis in range(size)]
        for degree in range(power + 1)
        for letters in combinations_with_replacement(range(size), degree)
    ]
    return np.array(listed, np.int64)


@dataclass(frozen=True, eq=False)
class Deformation:
    """A shape under a polynomial of its coordinates; `deform` makes it.

    shape : the shape before the deformation.
    power : the greatest degree of the polynomial's monomials, 1 to `MOST_POWER`.
    coefficients : numbers of each coordinate's polynomial, ``(m, K)``, in the order of
        `monomials`.
    """

    shape: Shape
    power: int
    coefficients: np.ndarray

    @cached_property
    def lifted(self) -> np.ndarray:
        """The maps on the space of monomials, ``(N, K, K)``: the monomials of a map's image are the
        map's matrix times the monomials of the point."""
        size = self.shape.size
        exponents = monomials(size, self.power)
        place = {tuple(one): k for k, one in enumerate(exponents.tolist())}
        lifted = np.zeros((len(self.shape), len(place), len(place)))
        for number, one in enumerate(self.shape.maps):
            for row, powers in enumerate(exponents.tolist()):
                product = {(0,) * size: 1.0}
                for axis, times in enumerate(powers):
                    for _ in range(times):
                        product = _times_affine(product, one[axis])
                for monomial, factor in product.items():
                    lifted[number, row, place[monomial]] += factor
        return lifted

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Deform ``points`` ``(…, m)``."""
        points = np.asarray(points, np.float64)
        powers = monomials(self.shape.size, self.power)
        values = np.prod(points[..., None, :] ** powers, axis=-1)
        return np.einsum("ik,...k->...i", self.coefficients, values)

    def points(self, depth: int, most: int = MOST_PIECES) -> np.ndarray:
        """Compute the deformed primitive of each piece of a ``depth``, ``(n, k, m)``, by products
        of the lifted maps. Raises `ShapeError` for more than ``most`` pieces."""
        check_range("depth", depth, 0, DEEPEST, whole=True)
        count = self.shape.count(depth)
        if count > most:
            raise piece_count_error(count, most)
        size = self.shape.size
        start = self.shape._visible_primitive.points
        powers = monomials(size, self.power)
        values = np.prod(start[:, None, :] ** powers, axis=-1)
        rows = self.coefficients[None]
        words = np.array(list(self.shape.words(depth)), np.int64).reshape(count, depth)
        rows = np.broadcast_to(rows, (count, *self.coefficients.shape))
        for letter in range(depth):
            rows = np.einsum("nik,nkl->nil", rows, self.lifted[words[:, letter]])
        return np.einsum("nik,pk->npi", rows, values)

    @cached_property
    def box(self) -> np.ndarray:
        """Least and greatest coordinates of the deformed attractor, ``(2, m)``, to a thousandth of
        the extent."""
        low, high = self.shape.box
        middles = self(self._middles((high - low).max() / 1000))
        return np.stack([middles.min(axis=0), middles.max(axis=0)])

    def picture(self, side: int = 512, most: int = MOST_PIECES) -> Image.Image:
        """Draw the deformed attractor in ``side`` × ``side`` px, with the shape's colours; later
        words cover earlier words. Raises `ShapeError` for a shape in space, or too many pieces."""
        if self.shape.size != 2:
            raise ShapeError(
                "the deformed shape is not two-dimensional, so it has no picture",
                "a two-dimensional shape",
                "compute its points instead: deformation.points(depth)",
            )
        frame = Frame.of(self.box, side)
        pieces = self.shape.pieces(pixel=1 / frame.scale / self._stretch, most=most)
        middles = self(self._middles_of(pieces))
        return inked(frame, middles, pieces.colours)

    def _middles(self, pixel: float) -> np.ndarray:
        return self._middles_of(self.shape.pieces(pixel=pixel))

    def _middles_of(self, pieces) -> np.ndarray:
        size = self.shape.size
        middle = self.shape.box.mean(axis=0)
        return pieces.maps[:, :, :size] @ middle + pieces.maps[:, :, size]

    @cached_property
    def _stretch(self) -> float:
        """How much longer a short way in the shape's box becomes, at most; at least 1."""
        low, high = self.shape.box
        axes = [np.linspace(a, b, _GRID) for a, b in zip(low, high, strict=True)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        step = 1e-6 * float((high - low).max())
        slopes = [
            np.linalg.norm(self(points + step * axis) - self(points - step * axis), axis=-1)
            for axis in np.eye(len(low))
        ]
        return max(1.0, float(np.sum(slopes, axis=0).max()) / (2 * step))


def deform(shape: Shape, coefficients: ArrayLike) -> Deformation:
    """Deform a ``shape`` by a polynomial of its coordinates.

    coefficients : numbers ``(m, K)``, a row for each coordinate of the deformed point. In the
        plane, the columns are the factors of 1, x, y, x², xy, y², x³, x²y, xy², y³; with K = 3, 6
        or 10, the power is 1, 2 or 3. In space, K is 4, 10 or 20. For powers above 3, raises
        `ShapeError`.

    With a power of 1, the deformed shape is `Shape.moved` of the same matrix.
    """
    size = shape.size
    known = {len(monomials(size, power)): power for power in range(1, MOST_POWER + 1)}
    try:
        array = np.array(coefficients, np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.ndim == 2 and len(array) == size and array.shape[1] > max(known):
        power = next(
            (p for p in range(MOST_POWER + 1, 40) if len(monomials(size, p)) >= array.shape[1]), 40
        )
        raise ShapeError(
            f"a deformation with {array.shape[1]} coefficients for each coordinate has the power "
            f"{power}",
            f"a power of at most {MOST_POWER}, so at most {max(known)} coefficients",
            "leave out the coefficients of higher powers",
        )
    allowed = " or ".join(f"({size}, {count})" for count in known)
    array = array_like(
        coefficients,
        "coefficients",
        allowed,
        lambda s: len(s) == 2 and s[0] == size and s[1] in known,
    )
    return Deformation(shape, known[array.shape[1]], array)


def _times_affine(product: dict, row: np.ndarray) -> dict:
    """Multiply a polynomial, exponents -> factor, by an affine form, a ``row`` of a map."""
    result: dict[tuple[int, ...], float] = {}
    for powers, factor in product.items():
        for axis, slope in enumerate(row.tolist()):
            raised = list(powers)
            if axis < len(powers):
                raised[axis] += 1
            key = tuple(raised)
            result[key] = result.get(key, 0.0) + factor * slope
    return result
