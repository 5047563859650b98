"""`Shape`: what the products of some affine maps make of a primitive."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from evocity.errors import setting
from evocity.shapes._kernels import DEEPEST, farthest, played, walked
from evocity.shapes.checks import (
    colours_of,
    corners,
    in_space,
    maps_of,
    no_long_words,
    refused_growth,
    too_many,
)
from evocity.shapes.contraction import Contraction, contraction_of
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import after, determinants, moved, norms, solved
from evocity.shapes.primitives import Primitive, primitive_of

#: The most pieces that are drawn unless more are asked for.
MOST_PIECES = 10**7

# For a walk that fills no cells, and for one that writes down no pieces.
_NO_LENGTHS, _NO_COLOURS = np.zeros(0, np.int64), np.zeros((0, 0))
_NO_MAPS = {size: np.zeros((0, size, size + 1)) for size in (2, 3)}
_NO_GRID = np.zeros(0, np.uint8), np.zeros((0, 0)), np.zeros(0), 1.0, np.zeros(0), 0


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of a shape, in lexicographic order of their words.

    maps : float ``(n, m, m + 1)``, the product of each.
    lengths : int ``(n,)``, how many letters its word has.
    colours : float ``(n, 3)``, of 0…1; ``(n, 0)`` of shapes without colours.
    primitive : what each map is applied to.
    """

    maps: np.ndarray
    lengths: np.ndarray
    colours: np.ndarray
    primitive: Primitive

    def __len__(self) -> int:
        return len(self.maps)

    @property
    def points(self) -> np.ndarray:
        """Of each piece the primitive's points, ``(n, k, m)``."""
        return moved(self.maps, self.primitive.points)


@dataclass(frozen=True, eq=False)
class Shape:
    """An iterated function system: affine maps of the plane or of space, and the words of them that
    act.

    Parameters
    ----------
    maps : float ``(N, m, m + 1)``, m = 2 or 3: linear part, then translation; x right, y up.
    primitive : what is drawn at each place: "point", "segment", "square", "cube", "sphere",
        "cylinder", or a `Primitive`; unless told the box of the attractor.
    language : the words that act; all unless told. The first letter is the outermost map.
    colours : a colour of each map, ``(N, 3)`` of 0…1; None: without.
    mix : how much each letter of a word counts for its colour beside the one before, in 0…1.

    ``a | b`` has the pieces of both. ``a @ b`` has copies of b along a, whose language should be of
    one level: ``koch.level(2) @ fern``. ``a & b`` and ``a - b``, of shapes with the same maps, have
    the words of both, and of the first alone.

    Raises
    ------
    ShapeError : maps that are none, or do not contract (they are named); a language of other
        letters or without words of any length; colours outside 0…1. Of maps of which it could
        neither be proved nor refuted that they contract it warns.

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
                f"a language of {language.letters} letters for {len(maps)} maps",
                "a letter a map",
                "give another language, or rename its letters",
            )
        _set(self, maps=maps, language=language, colours=colours_of(self.colours, len(maps)))
        if not (isinstance(self.mix, int | float) and 0 < self.mix < 1):
            raise ShapeError(setting("mix", self.mix), "a number between 0 and 1", "correct it")
        _set(self, contraction=contraction_of(maps, language))
        refused_growth(self.contraction)
        primitive = self.primitive
        if primitive is not None:
            primitive = in_space(primitive_of(primitive), maps.shape[1])
            _set(self, primitive=primitive)

    @classmethod
    def from_frames(cls, frames: Sequence, **more: Any) -> "Shape":
        """Of frames ``(O, x, y)``, in space ``(O, x, y, z)``: the map of each takes the origin to O
        and the axes' unit vectors to x, y (and z). Source: the same paper, §3.1, fig. 4."""
        listed = [np.array(frame, np.float64) for frame in frames]
        if not listed or any(one.ndim != 2 or one.shape[0] != one.shape[1] + 1 for one in listed):
            raise ShapeError(
                "frames that are none",
                "an origin and as many axes as it has numbers",
                "correct them",
            )
        return cls(np.stack([np.column_stack([*one[1:], one[0]]) for one in listed]), **more)

    # -- what it is --------------------------------------------------------------------------

    @property
    def size(self) -> int:
        """2 in the plane, 3 in space."""
        return self.maps.shape[1]

    def __len__(self) -> int:
        return len(self.maps)

    @cached_property
    def box(self) -> np.ndarray:
        """Least and greatest coordinates ``(2, m)`` of the attractor, by up to a 100th too wide
        where maps turn; of a language without words of any length, what all
        words reach."""
        centre, radius = self._ball
        whole = np.stack([centre - radius, centre + radius])
        if not self.language.lasts:
            return whole
        table, _ = self._goes_on
        points, slack = self._points(table), radius / (1000 if self.size == 2 else 200)
        ends = [
            [farthest(self.maps, table, points, centre, radius, sign * axis, slack) + slack
             for axis in np.eye(self.size)]
            for sign in (-1.0, 1.0)
        ]  # fmt: skip
        rough = np.stack([-np.array(ends[0]), np.array(ends[1])])
        return self._tightened(rough, whole)

    def _tightened(self, rough: np.ndarray, whole: np.ndarray) -> np.ndarray:
        """The box of the boxes that all maps make of those of the states they lead to, and so on
        from ``whole``, within ``rough``: exact where boxes have their sides along the axes."""
        table, lasting = self._goes_on
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
    def _goes_on(self) -> tuple[np.ndarray, np.ndarray]:
        """The automaton without states from which words do not go on, and those that do."""
        lasting = self.language.lasting
        table = self.language.table
        return np.where(np.append(lasting, False)[table], table, -1), lasting

    @cached_property
    def _ball(self) -> tuple[np.ndarray, float]:
        """Centre and radius of a ball that holds the attractor of all words: of products of one
        length, of which each is smaller than 1, with what shorter ones add."""
        length = max(1, self.contraction.length)
        products, norm = self.maps, np.inf
        for _ in range(length - 1):
            if len(products) * len(self.maps) > 65536:
                break
            products = after(products[:, None], self.maps[None]).reshape(-1, *self.maps.shape[1:])
        norm = float(norms(products[:, :, : self.size]).max())
        centre = self._middle
        step = np.sqrt((((moved(products, centre[None])[:, 0]) - centre) ** 2).sum(axis=1)).max()
        if norm < 1:
            return centre, float(step / (1 - norm)) * 1.0000001 + 1e-300
        points = self.chaos(20000, np.random.default_rng(0))  # not proved: looked at
        reach = np.sqrt(((points - centre) ** 2).sum(axis=1)).max()
        return centre, float(reach) * 1.5 + 1e-300

    @cached_property
    def _middle(self) -> np.ndarray:
        """The mean of the maps' fixed points, of those that have one."""
        points = [self.fixed(letter) for letter in range(len(self))]
        return np.mean([one for one in points if one is not None] or [np.zeros(self.size)], axis=0)

    def fixed(self, letter: int) -> np.ndarray | None:
        """The fixed point ``(m,)`` of one map; None if it has none or many."""
        part = np.eye(self.size) - self.maps[letter, :, : self.size]
        if abs(float(determinants(part[None])[0])) < 1e-12:
            return None
        return solved(part, self.maps[letter, :, self.size])

    # -- its pieces --------------------------------------------------------------------------

    def pieces(
        self,
        depth: int | None = None,
        pixel: float | None = None,
        most: int = MOST_PIECES,
    ) -> Pieces:
        """All pieces, of words of one ``depth`` (0…63), or as fine as a ``pixel``, in units of the
        shape: each branch ends where its box is smaller on every side.

        Raises `ShapeError` for more than ``most`` pieces, before they are made, and for neither or
        both of ``depth`` and ``pixel``.
        """
        if (depth is None) == (pixel is None):
            raise ShapeError(
                "neither depth= nor pixel=" if depth is None else "both depth= and pixel=",
                "one of them",
                "say how deep, or how fine",
            )
        language = self.language
        automaton = language.table, language.accepting
        if pixel is not None:
            if not (np.isfinite(pixel) and pixel > 0):
                raise ShapeError(setting("pixel", pixel), "a number above 0", "correct it")
            if not language.lasts:
                raise no_long_words()
            automaton, depth, fine = self._goes_on, DEEPEST, float(pixel)
        elif isinstance(depth, bool) or not isinstance(depth, int) or not 0 <= depth <= DEEPEST:
            raise ShapeError(setting("depth", depth), f"a whole number, 0…{DEEPEST}", "correct it")
        else:
            fine, count = 0.0, language.count(depth)
            if count > most:
                raise too_many(count, most)
        primitive = self._drawn
        ends = corners(self.box)
        if self.primitive is not None:
            ends = np.vstack([ends, primitive.points])
        return Pieces(*self._walked(depth, fine, ends, automaton, most), primitive)

    def _walked(
        self, depth: int, fine: float, ends: np.ndarray, automaton: tuple, most: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Maps, lengths and colours of the pieces, see `walked`."""
        base = np.zeros((len(self), 0)) if self.colours is None else self.colours
        room = 4096
        while True:
            found = np.empty((room, self.size, self.size + 1))
            lengths, colours = np.empty(room, np.int64), np.empty((room, base.shape[1]))
            count = walked(
                self.maps, *automaton, ends, depth, fine, base, float(self.mix),
                found, lengths, colours, _NO_GRID, most,
            )  # fmt: skip
            if count > most:
                raise too_many(count, most, " or more")
            if count <= room:
                return found[:count], lengths[:count], colours[:count]
            room = count

    def laid(
        self, side: int, scale: float, offset: np.ndarray, most: int = 10**9
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bool and float arrays ``(side, …)``, the second of one axis more: which cells the pieces
        of cells' size fill, rows from the north, then columns (and layers), and their colours,
        later words over earlier ones. ``scale``: cells a unit; ``offset`` ``(m,)``: of the origin,
        in cells, y upwards. Raises `ShapeError` for more than ``most`` pieces."""
        base = np.zeros((len(self), 0)) if self.colours is None else self.colours
        marks = np.zeros(side**self.size, np.uint8)
        paint = np.zeros((marks.size, base.shape[1]))
        grid = marks, paint, self.box.mean(axis=0), float(scale), np.array(offset, float), side
        if not self.language.lasts:
            raise no_long_words()
        count = walked(
            self.maps, *self._goes_on, corners(self.box), DEEPEST, (1 + 1e-9) / scale, base,
            float(self.mix), _NO_MAPS[self.size], _NO_LENGTHS, _NO_COLOURS, grid, most,
        )  # fmt: skip
        if count > most:
            raise too_many(count, most, " or more")
        shape = (side,) * self.size
        return marks.reshape(shape).astype(bool), paint.reshape(*shape, -1)

    @property
    def _drawn(self) -> Primitive:
        if self.primitive is not None:
            return self.primitive
        low, high = self.box
        from_unit = np.column_stack([np.diag(high - low), low])
        whole = primitive_of("square" if self.size == 2 else "cube")
        return replace(whole, points=moved(from_unit, whole.points))

    def chaos(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """``count`` points ``(count, m)`` of the attractor by the chaos game, for comparison: maps
        drawn by their share of the area, the automaton run backwards, since the newest letter is
        the outermost. Raises `ShapeError` for a language without words of any length."""
        if not self.language.lasts:
            raise no_long_words()
        table, _ = self._goes_on
        shares = np.maximum(np.abs(determinants(self.maps[:, :, : self.size])), 0.0)
        shares = np.maximum(shares / max(shares.sum(), 1e-300), 0.01)
        edges, chances, begins = [], [], [0]
        for state in range(len(table)):
            into = np.argwhere(table == state)
            edges += into.tolist()
            weights = shares[into[:, 1]]
            chances += (np.cumsum(weights) / max(weights.sum(), 1e-300)).tolist()
            begins.append(len(edges))
        found, have = [], 0
        edges_of = np.array(edges, np.int64).reshape(-1, 2)
        latest = self._points(table)
        while have < count:
            draws = rng.random(max(1024, 2 * (count - have)))
            points = np.empty((len(draws), self.size))
            got = played(
                self.maps, np.array(begins), edges_of, np.array(chances), latest, draws, points
            )
            found.append(points[:got])
            have += got
        return np.vstack(found)[:count]

    def _points(self, table: np.ndarray) -> np.ndarray:
        """A point ``(S, m)`` of each state's attractor: by a long word, of first letters alone."""
        letter = (table >= 0).argmax(axis=1)
        to = table[np.arange(len(table)), letter]
        found = np.repeat(self._middle[None], len(table), axis=0)
        for _ in range(1000):
            moved_on = np.einsum("sij,sj->si", self.maps[letter, :, : self.size], found[to])
            found = moved_on + self.maps[letter, :, self.size]
        return found

    # -- what is made of some ----------------------------------------------------------------

    def level(self, length: int) -> "Shape":
        """The same with the words of one length alone."""
        return self.restricted(self.language & Language.level(len(self), length))

    def restricted(self, language: Language) -> "Shape":
        """The same maps with other words."""
        return replace(self, language=language)

    def moved(self, matrix: np.ndarray) -> "Shape":
        """The shape as an affine map ``(m, m + 1)`` takes it: each of its maps conjugated.
        Raises `ShapeError` if that has no inverse."""
        own = maps_of([matrix])[0]
        size = self.size
        if own.shape != (size, size + 1) or abs(determinants(own[None, :, :size])[0]) < 1e-12:
            raise ShapeError(
                "a map that cannot be undone", f"({size}, {size + 1}), invertible", "correct it"
            )
        back = solved(own[:, :size], np.column_stack([np.eye(size), -own[:, size]]))
        maps = after(after(own, self.maps), back)
        primitive = self.primitive
        if primitive is not None:
            primitive = replace(primitive, points=moved(own, primitive.points))
        return replace(self, maps=maps, primitive=primitive)

    def __or__(self, other: "Shape") -> "Shape":
        first, second = self._joined(other)
        return self._beside(other, first | second)

    def __matmul__(self, other: "Shape") -> "Shape":
        first, second = self._joined(other)
        return replace(self._beside(other, first @ second), primitive=other.primitive)

    def __and__(self, other: "Shape") -> "Shape":
        self._check_same(other)
        return self.restricted(self.language & other.language)

    def __sub__(self, other: "Shape") -> "Shape":
        self._check_same(other)
        return self.restricted(self.language - other.language)

    def _joined(self, other: "Shape") -> tuple[Language, Language]:
        if self.size != other.size:
            raise ShapeError(
                "a shape of the plane and one of space", "two of the same", "choose another"
            )
        count = len(self) + len(other)
        names = range(len(self), count)
        return self.language.renamed(count, range(len(self))), other.language.renamed(count, names)

    def _beside(self, other: "Shape", language: Language) -> "Shape":
        colours = None
        if self.colours is not None and other.colours is not None:
            colours = np.vstack([self.colours, other.colours])
        maps = np.concatenate([self.maps, other.maps])
        return Shape(maps, self.primitive, language, colours, self.mix)

    def _check_same(self, other: "Shape") -> None:
        if not np.array_equal(self.maps, other.maps):
            raise ShapeError("shapes of other maps", "the same maps", "use | or @ for those")

    # -- what is counted ---------------------------------------------------------------------

    def count(self, depth: int) -> int:
        """How many pieces it has at a ``depth``, exactly."""
        return self.language.count(depth)

    def words(self, depth: int) -> Iterator[tuple[int, ...]]:
        """The words of its pieces at a ``depth``, in their order."""
        return self.language.words(depth)


def _set(one: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(one, name, value)


__all__ = ["MOST_PIECES", "Pieces", "Shape"]
