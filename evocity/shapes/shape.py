"""`Shape`: an iterated function system of affine maps, a language and a primitive."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from evocity.errors import setting
from evocity.shapes._kernels import DEEPEST, farthest, played, walked
from evocity.shapes.checks import (
    check_range,
    check_same_space,
    colours_of,
    corners,
    finite_language_error,
    maps_of,
    piece_count_error,
    read_only,
)
from evocity.shapes.contraction import Contraction, check_contraction, contraction_of
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import apply_maps, compose_maps, determinants, norms, solve
from evocity.shapes.primitives import Primitive, in_space, primitive_of

#: The default of the most pieces to draw.
MOST_PIECES = 10**7

# Arguments of walks without cells, and without pieces.
_NO_LENGTHS, _NO_COLOURS = np.zeros(0, np.int64), np.zeros((0, 0))
_NO_MAPS = {size: np.zeros((0, size, size + 1)) for size in (2, 3)}
_NO_GRID = np.zeros(0, np.uint8), np.zeros((0, 0)), np.zeros(0), 1.0, np.zeros(0), 0


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of a shape, in lexicographic order of their words.

    maps : the product of the maps along the word of each piece, float ``(n, m, m + 1)``.
    lengths : the length of the word of each piece, int ``(n,)``.
    colours : RGB values of each piece, 0 to 1, float ``(n, 3)``; ``(n, 0)`` without colours.
    primitive : the drawing that the map of each piece transforms.
    """

    maps: np.ndarray
    lengths: np.ndarray
    colours: np.ndarray
    primitive: Primitive

    def __len__(self) -> int:
        return len(self.maps)

    @property
    def points(self) -> np.ndarray:
        """Array ``(n, k, m)`` of the primitive's points, transformed by the map of each piece."""
        return apply_maps(self.maps, self.primitive.points)


@dataclass(frozen=True, eq=False)
class Shape:
    """An iterated function system: affine maps of the plane or of space, with a language of words.

    A word is a sequence of maps that transform the primitive into a piece of the shape.

    Parameters
    ----------
    maps : the affine maps, float ``(N, m, m + 1)`` with m = 2 or 3. The last column of a map is its
        translation; x is to the right, y up.
    primitive : the drawing that each piece shows: "point", "segment", "square", "cube", "sphere",
        "cylinder", or a `Primitive`. The default primitive is the box around the attractor.
    language : the words whose pieces belong to the shape; by default all words. The first letter of
        a word names the map that is applied last.
    colours : red, green and blue of each map, ``(N, 3)`` of 0…1; None for no colours.
    mix : weight of a letter's colour, 0…1, relative to the colour of the letter before it.

    The shape ``a | b`` has the pieces of both shapes. The shape ``a @ b`` has copies of the shape b
    along the shape a; words of a should have equal lengths, as in ``koch.level(2) @ fern``. For
    shapes with the same maps, ``a & b`` has the common words, and ``a - b`` has the words that only
    ``a`` has.

    Raises
    ------
    ShapeError : one of: invalid maps; maps that do not contract; a language with wrong letters or
        finitely many words; colours outside 0…1. The constructor warns if it can neither prove nor
        refute that the maps contract.

    Source: Tosan, Excoffier, Rondet-Mignotte 2005, §2 and §3.2; Hutchinson 1981.
    """

    maps: np.ndarray
    primitive: str | Primitive | None = None
    language: Language | None = None
    colours: np.ndarray | None = None
    mix: float = 0.5
    contraction: Contraction = field(init=False)

    def __post_init__(self):
        maps = maps_of(self.maps)
        language = Language.every(len(maps)) if self.language is None else self.language
        if language.letters != len(maps):
            raise ShapeError(
                f"a language of {language.letters} letters does not fit {len(maps)} affine maps",
                "a language with one letter for each affine map",
                "give another language, or rename its letters with renamed()",
            )
        _set(self, maps=maps, language=language, colours=colours_of(self.colours, len(maps)))
        if not (isinstance(self.mix, int | float) and 0 < self.mix < 1):
            found = setting("mix", self.mix)
            raise ShapeError(found, "a number above 0 and below 1", "choose another mix")
        _set(self, contraction=contraction_of(maps, language))
        check_contraction(self.contraction)
        primitive = self.primitive
        if primitive is not None:
            primitive = in_space(primitive_of(primitive), maps.shape[1])
            _set(self, primitive=primitive)

    @classmethod
    def from_frames(cls, frames: Sequence, **more: Any) -> "Shape":
        """Make a shape from ``frames``: (O, x, y) in the plane or (O, x, y, z) in space. The map of
        a frame takes the origin to O, and the unit vectors of the axes to x, y and z.
        Source: Tosan, Excoffier, Rondet-Mignotte 2005, §3.1 and figure 4."""
        arrays = [np.array(frame, np.float64) for frame in frames]
        if not arrays or any(one.ndim != 2 or len(one) != one.shape[1] + 1 for one in arrays):
            raise ShapeError(
                "the frames of the shape are invalid",
                "an origin in each frame, and one axis for each coordinate of this origin",
                "correct the frames",
            )
        return cls(np.stack([np.column_stack([*one[1:], one[0]]) for one in arrays]), **more)

    @property
    def size(self) -> int:
        """Number of coordinates: 2 in the plane, 3 in space."""
        return self.maps.shape[1]

    def __len__(self) -> int:
        return len(self.maps)

    @cached_property
    def box(self) -> np.ndarray:
        """Least and greatest coordinates of the attractor, ``(2, m)``. If maps turn, the box may be
        wider by up to 1 %. With finitely many words, the box is of the attractor of all words."""
        centre, radius = self._ball
        whole = np.stack([centre - radius, centre + radius])
        if not self.language.lasts:
            return whole
        table, _ = self._endless_automaton
        points, slack = self._points(table), radius / (1000 if self.size == 2 else 200)
        ends = [
            [farthest(self.maps, table, points, centre, radius, sign * axis, slack) + slack
             for axis in np.eye(self.size)]
            for sign in (-1.0, 1.0)
        ]  # fmt: skip
        rough = np.stack([-np.array(ends[0]), np.array(ends[1])])
        return self._tighten(rough, whole)

    def _tighten(self, rough: np.ndarray, whole: np.ndarray) -> np.ndarray:
        """Iterate the box of the maps' images of their next states' boxes, from ``whole``, within
        ``rough``: exact where boxes have their sides along the axes."""
        table, lasting = self._endless_automaton
        states, letters = np.nonzero(table >= 0)
        to = table[states, letters]
        part, at = self.maps[letters, :, : self.size], self.maps[letters, :, self.size]
        low, high = (np.repeat(end[None], len(table), axis=0) for end in whole)
        for _ in range(200):
            middle, half = (low[to] + high[to]) / 2, (high[to] - low[to]) / 2
            middle = np.einsum("kij,kj->ki", part, middle) + at
            half = np.einsum("kij,kj->ki", np.abs(part), half)
            least, most = np.full(low.shape, np.inf), np.full(high.shape, -np.inf)
            np.minimum.at(least, states, middle - half)
            np.maximum.at(most, states, middle + half)
            least, most = np.maximum(low, least)[lasting], np.minimum(high, most)[lasting]
            moved_by = max((least - low[lasting]).max(), (high[lasting] - most).max())
            low[lasting], high[lasting] = least, most
            if moved_by < 1e-14 * np.abs(whole).max():
                break
        return np.stack([np.maximum(low[0], rough[0]), np.minimum(high[0], rough[1])])

    @property
    def _endless_automaton(self) -> tuple[np.ndarray, np.ndarray]:
        """The automaton's table without states from which words end, and the other states."""
        lasting = self.language.lasting
        table = self.language.table
        return np.where(np.append(lasting, False)[table], table, -1), lasting

    @cached_property
    def _ball(self) -> tuple[np.ndarray, float]:
        """Centre and radius of a ball about the attractor of all words, by contracting products of
        one length."""
        length = max(1, self.contraction.length)
        products, norm = self.maps, np.inf
        for _ in range(length - 1):
            if len(products) * len(self.maps) > 65536:
                break
            products = compose_maps(products[:, None], self.maps[None]).reshape(
                -1, *self.maps.shape[1:]
            )
        norm = float(norms(products[:, :, : self.size]).max())
        centre = self._middle
        step = np.sqrt(
            (((apply_maps(products, centre[None])[:, 0]) - centre) ** 2).sum(axis=1)
        ).max()
        if norm < 1:
            return centre, float(step / (1 - norm)) * 1.0000001 + 1e-300
        points = self.chaos(20000, np.random.default_rng(0))  # not proved: estimated
        reach = np.sqrt(((points - centre) ** 2).sum(axis=1)).max()
        return centre, float(reach) * 1.5 + 1e-300

    @cached_property
    def _middle(self) -> np.ndarray:
        points = [self.fixed(letter) for letter in range(len(self))]
        points = [point for point in points if point is not None]
        return np.mean(points or [np.zeros(self.size)], axis=0)

    def fixed(self, letter: int) -> np.ndarray | None:
        """Find the fixed point ``(m,)`` of one map; the argument ``letter`` is the number of this
        map. The result is None if the map has no fixed point, or more than one fixed point."""
        part = np.eye(self.size) - self.maps[letter, :, : self.size]
        if abs(float(determinants(part[None])[0])) < 1e-12:
            return None
        return solve(part, self.maps[letter, :, self.size])

    def pieces(
        self,
        depth: int | None = None,
        pixel: float | None = None,
        most: int = MOST_PIECES,
    ) -> Pieces:
        """List the pieces of all words of length ``depth`` (0…63), or all pieces smaller than
        ``pixel``, a length in units of the shape. Give either ``depth`` or ``pixel``, not both.

        If ``pixel`` is given, a word ends as soon as the box around its piece is smaller than
        ``pixel`` on every side. Raises `ShapeError` if there would be more pieces than the limit
        ``most``.
        """
        if (depth is None) == (pixel is None):
            raise ShapeError(
                "the parameters 'depth' and 'pixel' are both "
                f"{'missing' if depth is None else 'given'}",
                "exactly one of the parameters 'depth' and 'pixel'",
                "give either the parameter 'depth' or the parameter 'pixel'",
            )
        language = self.language
        automaton = language.table, language.accepting
        if pixel is not None:
            if not (np.isfinite(pixel) and pixel > 0):
                found = setting("pixel", pixel)
                raise ShapeError(found, "a number above 0", "choose another pixel")
            if not language.lasts:
                raise finite_language_error()
            automaton, depth, fine = self._endless_automaton, DEEPEST, float(pixel)
        else:
            check_range("depth", depth, 0, DEEPEST, whole=True)
            fine, count = 0.0, language.count(depth)
            if count > most:
                raise piece_count_error(count, most)
        primitive = self._visible_primitive
        ends = corners(self.box)
        if self.primitive is not None:
            ends = np.vstack([ends, primitive.points])
        base, mix = self._base, float(self.mix)
        return Pieces(*walk(self.maps, automaton, ends, depth, fine, base, mix, most), primitive)

    @property
    def _base(self) -> np.ndarray:
        """Colours of the maps, ``(N, 3)``, or ``(N, 0)``."""
        return np.zeros((len(self), 0)) if self.colours is None else self.colours

    def laid(
        self, side: int, scale: float, offset: np.ndarray, most: int = 10**9
    ) -> tuple[np.ndarray, np.ndarray]:
        """Fill the cells of a raster with pieces as small as a cell.

        side : number of cells along each axis.
        scale : number of cells per unit of the shape.
        offset : position of the shape's origin in the raster, in cells, with y upwards, ``(m,)``.

        The first returned array is bool and marks the filled cells: rows from the north, then
        columns, then layers. The second returned array holds the colours of the filled cells, as
        floats along an additional axis. Pieces of later words paint over pieces of earlier words.
        Raises `ShapeError` for more pieces than the limit ``most``.
        """
        base, marks = read_only(self._base), np.zeros(side**self.size, np.uint8)
        paint = np.zeros((marks.size, base.shape[1]))
        grid = marks, paint, self.box.mean(axis=0), float(scale), np.array(offset, float), side
        if not self.language.lasts:
            raise finite_language_error()
        count = walked(
            *map(read_only, (self.maps, *self._endless_automaton)), corners(self.box), DEEPEST,
            (1 + 1e-9) / scale, base, float(self.mix),
            _NO_MAPS[self.size], _NO_LENGTHS, _NO_COLOURS, grid, most,
        )  # fmt: skip
        if count > most:
            raise piece_count_error(count, most, " or more")
        shape = (side,) * self.size
        return marks.reshape(shape).astype(bool), paint.reshape(*shape, -1)

    @property
    def _visible_primitive(self) -> Primitive:
        if self.primitive is not None:
            return self.primitive
        low, high = self.box
        from_unit = np.column_stack([np.diag(high - low), low])
        whole = primitive_of("square" if self.size == 2 else "cube")
        return replace(whole, points=apply_maps(from_unit, whole.points))

    def chaos(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draw random points ``(count, m)`` of the attractor by the chaos game.

        The probability of a map is proportional to the area of its image. The method runs the
        language's automaton backwards, because the last drawn letter names the outermost map.
        Raises `ShapeError` if the language has finitely many words.
        """
        if not self.language.lasts:
            raise finite_language_error()
        table, _ = self._endless_automaton
        shares = np.maximum(np.abs(determinants(self.maps[:, :, : self.size])), 0.0)
        shares = np.maximum(shares / max(shares.sum(), 1e-300), 0.01)
        edges, chances, begins = [], [], [0]
        for state in range(len(table)):
            into = np.argwhere(table == state)
            edges += into.tolist()
            weights = shares[into[:, 1]]
            chances += (np.cumsum(weights) / max(weights.sum(), 1e-300)).tolist()
            begins.append(len(edges))
        parts, have = [], 0
        edges_of = np.array(edges, np.int64).reshape(-1, 2)
        latest = self._points(table)
        while have < count:
            draws = rng.random(max(1024, 2 * (count - have)))
            points = np.empty((len(draws), self.size))
            got = played(
                self.maps, np.array(begins), edges_of, np.array(chances), latest, draws, points
            )
            parts.append(points[:got])
            have += got
        return np.vstack(parts)[:count]

    def _points(self, table: np.ndarray) -> np.ndarray:
        """Find a point ``(S, m)`` of each state's attractor, by a long word of first letters."""
        letter = (table >= 0).argmax(axis=1)
        to = table[np.arange(len(table)), letter]
        points = np.repeat(self._middle[None], len(table), axis=0)
        for _ in range(1000):
            moved = np.einsum("sij,sj->si", self.maps[letter, :, : self.size], points[to])
            points = moved + self.maps[letter, :, self.size]
        return points

    def level(self, length: int) -> "Shape":
        """Return a shape with only those words of this shape that have a given ``length``."""
        return self.restricted(self.language & Language.level(len(self), length))

    def restricted(self, language: Language) -> "Shape":
        """Return a shape with the same maps and another ``language``."""
        return replace(self, language=language)

    def moved(self, matrix: np.ndarray) -> "Shape":
        """Transform the shape by an affine map, the ``matrix`` ``(m, m + 1)``. Raises `ShapeError`
        if the affine map has no inverse."""
        own = maps_of([matrix])[0]
        size = self.size
        if own.shape != (size, size + 1) or abs(determinants(own[None, :, :size])[0]) < 1e-12:
            raise ShapeError(
                "the affine map that moves the shape has no inverse",
                f"an invertible affine map, as a matrix of {size} rows and {size + 1} columns",
                "choose an affine map that does not flatten the shape",
            )
        back = solve(own[:, :size], np.column_stack([np.eye(size), -own[:, size]]))
        maps = compose_maps(compose_maps(own, self.maps), back)
        primitive = self.primitive
        if primitive is not None:
            primitive = replace(primitive, points=apply_maps(own, primitive.points))
        return replace(self, maps=maps, primitive=primitive)

    def __or__(self, other: "Shape") -> "Shape":
        first, second = self._widened_languages(other)
        return self._union(other, first | second)

    def __matmul__(self, other: "Shape") -> "Shape":
        first, second = self._widened_languages(other)
        return replace(self._union(other, first @ second), primitive=other.primitive)

    def __and__(self, other: "Shape") -> "Shape":
        return self._combined(other, Language.__and__)

    def __sub__(self, other: "Shape") -> "Shape":
        return self._combined(other, Language.__sub__)

    def _widened_languages(self, other: "Shape") -> tuple[Language, Language]:
        check_same_space(self, other)
        count = len(self) + len(other)
        names = range(len(self), count)
        return self.language.renamed(count, range(len(self))), other.language.renamed(count, names)

    def _union(self, other: "Shape", language: Language) -> "Shape":
        colours = None
        if self.colours is not None and other.colours is not None:
            colours = np.vstack([self.colours, other.colours])
        maps = np.concatenate([self.maps, other.maps])
        return Shape(maps, self.primitive, language, colours, self.mix)

    def _combined(self, other: "Shape", combine: Callable) -> "Shape":
        if not np.array_equal(self.maps, other.maps):
            raise ShapeError(
                "the two shapes have different affine maps",
                "two shapes with the same affine maps",
                "combine shapes of different maps with the operators | and @",
            )
        return self.restricted(combine(self.language, other.language))

    def count(self, depth: int) -> int:
        """Count the pieces of words of length ``depth``, exactly."""
        return self.language.count(depth)

    def words(self, depth: int) -> Iterator[tuple[int, ...]]:
        """Yield all words of length ``depth``, in the order of their pieces."""
        return self.language.words(depth)


def walk(
    maps: np.ndarray,
    automaton: tuple,
    ends: np.ndarray,
    depth: int,
    fine: float,
    base: np.ndarray,
    mix: float,
    most: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute products, lengths and colours of all pieces by `walked`, with room for as many.
    Raises `ShapeError` for more than ``most``."""
    room, size = 4096, maps.shape[1]
    while True:
        products = np.empty((room, size, size + 1))
        lengths, colours = np.empty(room, np.int64), np.empty((room, base.shape[1]))
        count = walked(
            *map(read_only, (maps, *automaton)), ends, depth, fine, read_only(base), mix,
            products, lengths, colours, _NO_GRID, most,
        )  # fmt: skip
        if count > most:
            raise piece_count_error(count, most, " or more")
        if count <= room:
            return products[:count], lengths[:count], colours[:count]
        room = count


def _set(shape: Shape, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(shape, name, value)
