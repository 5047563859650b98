"""`Pavement`: squares that tile a map, the range blocks."""

from collections.abc import Iterable
from functools import cached_property, lru_cache

import numpy as np

from evocity.errors import GenomeError, check_number, keyword, spell
from evocity.pavement._kernels import (
    cut_squares,
    lay_squares,
    split_squares,
    spread,
    sum_squares,
    tile,
)


class Pavement:
    """Range blocks of a map: squares that tile the map without gaps and without overlap.

    In Jacquin's uniform partition, all range blocks have the same side B. In an adaptive partition,
    which Marsault proposes (2002 §6.1, 2005 §4.1-4.2), the range blocks are the leaves of a
    quadtree. Range blocks are numbered row by row, in the order of their corners (top, left). The
    list of sides, in the order of the block numbers, determines the places of all range blocks.

    Parameters
    ----------
    height, width : height and width of the map, px.
    block : side of all range blocks, or a list with one side for each range block; px, 2 or more.

    Attributes
    ----------
    corners : row (top) and column (left) of each range block's north-west pixel, two arrays of
        int32 ``(n,)``.
    side : side of each range block, px, int32 ``(n,)``.
    block : common side of all range blocks, px. If range blocks have different sides, reading
        ``block`` raises `GenomeError`.
    rows, columns : number of rows, and number of columns, that the range blocks form. If range
        blocks have different sides, reading ``rows`` or ``columns`` raises `GenomeError`.
    finest, coarsest : side of the smallest and of the largest range block, px.
    index : array of int32 ``(H, W)`` with the number of the range block at each pixel.
    levels : mapping from each side, in ascending order, to the numbers of the range blocks with
        this side.

    All arrays of a pavement are read-only. Two pavements (tilings by range blocks) are equal if
    their range blocks have equal places and sides.

    Raises
    ------
    GenomeError : ``block`` does not divide the map's height and width, or the listed sides do not
        tile the map.
    """

    def __init__(self, height: int, width: int, block: int | Iterable[int]):
        self.height, self.width = height, width
        self._block: int | None = None
        if isinstance(block, Iterable):
            self._lay(np.array(block))
        else:
            self._block = block
            _check_uniform(height, width, block)

    def _lay(self, side: np.ndarray) -> None:
        if side.ndim != 1 or side.size == 0 or side.dtype.kind not in "iu" or side.min() < 2:
            raise GenomeError(
                f"the sides of range blocks are {spell(side.tolist())}",
                "whole numbers of pixels, 2 or more, one per range block",
                "give the sides row by row from the north-west, as in Pavement.side",
            )
        side = side.astype(np.int32)
        top, left = np.empty((2, side.size), np.int32)
        index = np.empty((self.height, self.width), np.int32)
        count = tile(side, index, top, left)
        if count != side.size:
            where = (
                f"overlap or leave the map from number {count} on" if count >= 0 else "leave gaps"
            )
            raise GenomeError(
                f"the {side.size} range blocks on a map of {self.height} × {self.width} px {where}",
                "squares that tile the map, sorted by top, then left",
                "encode the map again",
            )
        self._fill(top, left, side, index)

    def _fill(self, top, left, side, index) -> None:
        """Fill the cached properties below."""
        if (side == side[0]).all():
            self._block = int(side[0])
        self.__dict__["side"] = _read_only(side)
        self.__dict__["corners"] = (_read_only(top), _read_only(left))
        self.__dict__["index"] = _read_only(index)

    @classmethod
    def _of_squares(cls, top, left, side, index: np.ndarray) -> "Pavement":
        """Make the pavement of squares that tile a map, int32 ``(n,)`` each, in the order of their
        corners; ``index``, int32 ``(H, W)``, is theirs. Nothing is checked or copied."""
        pavement = object.__new__(cls)
        pavement.height, pavement.width = index.shape
        pavement._block = None
        pavement._fill(top, left, side, index)
        return pavement

    def __repr__(self) -> str:
        sides = self.block if self.uniform else f"{self.finest}…{self.coarsest}, {len(self)} leaves"
        return f"Pavement({self.height}, {self.width}, {sides})"

    def __len__(self) -> int:
        """Number of range blocks."""
        return self.rows * self.columns if self.uniform else self.side.size

    def __eq__(self, other) -> bool:
        if self is other:
            return True
        if not isinstance(other, Pavement):
            return NotImplemented
        if (self.height, self.width, self._block) != (other.height, other.width, other._block):
            return False
        return self.uniform or np.array_equal(self.side, other.side)

    def __hash__(self) -> int:
        return hash((self.height, self.width, self._block, len(self)))

    def __reduce__(self):
        if self.uniform:
            return _uniform, (self.height, self.width, self._block)
        return Pavement, (self.height, self.width, self.side.astype(np.int16))

    @property
    def uniform(self) -> bool:
        """True if all range blocks have the same side."""
        return self._block is not None

    @property
    def ends(self) -> int | tuple[int, int]:
        """Common side of all range blocks; if the sides differ, the smallest and the largest
        side."""
        return self.block if self.uniform else (self.finest, self.coarsest)

    @property
    def block(self) -> int:
        if self._block is None:
            raise GenomeError(
                f"the {len(self)} range blocks have no common side: their sides are from "
                f"{self.finest} to {self.coarsest} px",
                "range blocks that all have the same side",
                "use Pavement.side or Pavement.finest, or encode the map with one side: "
                f"{keyword('block', 4)}",
            )
        return self._block

    @property
    def rows(self) -> int:
        return self.height // self.block

    @property
    def columns(self) -> int:
        return self.width // self.block

    @cached_property
    def side(self) -> np.ndarray:
        return _read_only(np.full(len(self), self.block, np.int32))

    @cached_property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        y, x = np.divmod(np.arange(len(self), dtype=np.int32), self.columns)
        return _read_only(y * self.block), _read_only(x * self.block)

    @cached_property
    def index(self) -> np.ndarray:
        return _read_only(self.raster(np.arange(len(self), dtype=np.int32)))

    @cached_property
    def levels(self) -> dict[int, np.ndarray]:
        if self.uniform:
            return {self.block: np.arange(len(self))}
        return {int(s): np.flatnonzero(self.side == s) for s in np.unique(self.side)}

    @property
    def finest(self) -> int:
        return self._block or int(self.side.min())

    @property
    def coarsest(self) -> int:
        return self._block or int(self.side.max())

    @property
    def area(self) -> np.ndarray:
        """Number of pixels of each range block, int64 ``(n,)``."""
        return self.side.astype(np.int64) ** 2

    def scaled(self, step: int, per: int) -> "Pavement":
        """Make a copy of the pavement with all sides multiplied by the fraction ``step / per``.
        Each side of the copy must be a whole number of pixels, 2 or more."""
        if self.uniform:
            block = self.block * step // per
            return Pavement(self.rows * block, self.columns * block, block)
        sides = (self.height * step // per, self.width * step // per)
        return Pavement(*sides, self.side * step // per)

    # -- pixels and range blocks -----------------------------------------------------------

    def blocks(self, raster: np.ndarray, side: int | None = None) -> np.ndarray:
        """Cut all range blocks with the side s out of a ``(H, W)`` raster, in the order of the
        attribute `levels`. The result is a copy with the shape ``(m, s, s)``, for m range blocks
        with the side s. For a uniform pavement, whose range blocks all have the same side, leave
        out the argument ``side``."""
        if self.uniform and side in (None, self._block):
            b = self.block
            cut = raster.reshape(self.rows, b, self.columns, b).swapaxes(1, 2)
            return np.ascontiguousarray(cut).reshape(len(self), b, b)
        side = self.block if side is None else side
        return self.squares(raster, self.levels[side], side)

    def squares(self, raster: np.ndarray, which: np.ndarray, side: int) -> np.ndarray:
        """Copy m range blocks with the side s from a ``(H, W)`` raster into an array ``(m, s, s)``.
        The argument ``which``, an array ``(m,)``, holds the numbers of the range blocks to copy."""
        blocks = np.empty((which.size, side, side), raster.dtype)
        cut_squares(raster, *self.corners, which, blocks)
        return blocks

    def raster(self, values: np.ndarray) -> np.ndarray:
        """Spread ``(n,)`` values, one for each range block, over a ``(H, W)`` raster. If all range
        blocks have the side B, the method accepts an array ``(n, B, B)``, too, with a value for
        each pixel of each block."""
        if not self.uniform and values.ndim == 1:
            raster = np.empty((self.height, self.width), values.dtype)
            spread(values, self.index.ravel(), raster.ravel())
            return raster
        b = self.block
        if values.ndim == 1:
            return values.reshape(self.rows, self.columns).repeat(b, 1).repeat(b, 0)
        tiles = values.reshape(self.rows, self.columns, b, b).swapaxes(1, 2)
        return np.ascontiguousarray(tiles).reshape(self.height, self.width)

    def sums(self, raster: np.ndarray) -> np.ndarray:
        """Sum a ``(H, W)`` raster over each range block: float64 ``(n,)``."""
        sums = np.empty(len(self))
        sum_squares(raster, *self.corners, self.side, sums)
        return sums

    def maxima(self, raster: np.ndarray) -> np.ndarray:
        """Find the largest value of a ``(H, W)`` raster in each range block: float64 ``(n,)``."""
        maxima = np.empty(len(self))
        for side, which in self.levels.items():
            maxima[which] = self.blocks(raster, side).max(axis=(1, 2))
        return maxima


def joined_squares(height: int, width: int, top, left, side) -> Pavement:
    """Make the pavement of squares that surely tile a map, int32 ``(n,)`` each, in the order of
    their corners. The pavement takes the arrays over."""
    index = np.empty((height, width), np.int32)
    lay_squares(top, left, side, index)
    return Pavement._of_squares(top, left, side, index)


def divided(pavement: Pavement, where: np.ndarray, least: int) -> tuple[Pavement | int, np.ndarray]:
    """Halve the range blocks with a true pixel of ``where``, bool ``(H, W)``, until their sides are
    at most ``least``.

    Returns the new pavement, and the number of the range block that each of its blocks is a part
    of, int32 ``(n,)``; instead of the pavement the side of a block that cannot be halved.
    """
    squares = np.empty((4, pavement.height * pavement.width // 4), np.int32)
    index = np.empty((pavement.height, pavement.width), np.int32)
    count = split_squares(
        where, pavement.index, *pavement.corners, pavement.side, least, squares, index
    )
    if count < 0:
        return -count, squares[0, :0]
    if count == len(pavement):
        return pavement, squares[0, :count]
    lifs, top, left, side = (row[:count].copy() for row in squares)
    return Pavement._of_squares(top, left, side, index), lifs


@lru_cache(maxsize=2)
def _uniform(height: int, width: int, block: int) -> Pavement:
    """Share one object, and its cached arrays, among genomes from other processes."""
    return Pavement(height, width, block)


def _check_uniform(height: int, width: int, block: int) -> None:
    remedy = f"use for example {keyword('block', 4)}"
    check_number("block", block, 2, np.inf, "a range block of at least 2 px", GenomeError, remedy)
    if height % block or width % block or min(height, width) < 1:
        fits = [
            f"{low} or {low + block}" if side % block else f"{side}"
            for side in (height, width)
            for low in [max(side // block, 1) * block]
        ]
        raise GenomeError(
            f"a map of {height} × {width} px cannot be cut into range blocks of {block} px",
            f"height and width in multiples of {block} px: height {fits[0]}, width {fits[1]}",
            "crop or read the map at this size, or choose another side of range blocks",
        )


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array
