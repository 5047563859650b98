"""`Condensation`: heights that decoding keeps: a river, a listed building, a protected site."""

from collections.abc import Iterable
from functools import cached_property, lru_cache
from hashlib import blake2b

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of, column_of
from evocity.errors import GenomeError
from evocity.pavement import Pavement


class Condensation:
    """Heights C of the masked pixels of a map; decoding never changes these heights.

    Each decoding step computes W(I) = ∪ ω_i(I) from heights I and lifs ω_i, and then writes the
    fixed heights C into the result (condensation IFS: Marsault 2002 §6.2, 2005 §4.2). A
    condensation is immutable.

    Parameters
    ----------
    heights : array ``(H, W)`` of heights, metres. Heights within the mask are finite and not
        negative.
    mask : array of bool ``(H, W)``, true in the pixels whose heights are fixed. The mask has at
        least one true pixel.

    The attributes ``heights`` (float32, 0 outside the mask) and ``mask`` are read-only. Two
    condensations are equal if they fix the same heights in the same pixels.

    Raises
    ------
    GenomeError : one of: an array of a wrong shape or type; a mask without a true pixel; a height
        that is NaN, infinite or negative.
    """

    def __init__(self, heights: np.ndarray, mask: np.ndarray):
        heights, mask = np.asarray(heights), np.asarray(mask)
        _check_arrays(heights, mask)
        with np.errstate(over="ignore"):  # heights beyond float32 become infinite
            kept = np.where(mask, heights, 0).astype(np.float32) + np.float32(0)  # no −0
        wrong = ~(np.isfinite(kept) & (kept >= 0))
        if wrong.any():
            raise GenomeError(
                f"{np.count_nonzero(wrong)} fixed heights are NaN, infinite or below 0",
                "finite heights above ground, in metres",
                "remove these pixels from the mask, or set their heights",
            )
        self.heights, self.mask = kept, mask.copy()
        for array in (self.heights, self.mask):
            array.setflags(write=False)

    @classmethod
    def cut(cls, city: CityMap, mask: np.ndarray) -> "Condensation":
        """Make a condensation that fixes the heights of ``city`` where ``mask``, bool ``(H, W)``,
        is true."""
        return cls(city.heights, mask)

    @classmethod
    def from_raster(cls, raster: np.ndarray) -> "Condensation":
        """Make a condensation from a ``raster`` ``(H, W)`` of fixed heights in metres, with NaN in
        all other pixels."""
        return cls(raster, ~np.isnan(raster))

    @property
    def raster(self) -> np.ndarray:
        """Fixed heights as an array of float32 ``(H, W)``, metres; NaN outside the mask."""
        return np.where(self.mask, self.heights, np.float32(np.nan))

    @property
    def shape(self) -> tuple[int, int]:
        """Size ``(H, W)`` of the map in pixels."""
        return self.mask.shape

    def __len__(self) -> int:
        """Number of kept pixels."""
        return int(np.count_nonzero(self.mask))

    def __repr__(self) -> str:
        return f"Condensation({len(self)} of {self.shape[0]} × {self.shape[1]} px)"

    @cached_property
    def digest(self) -> str:
        """Hex digest of mask and heights: equal for equal layers."""
        state = blake2b(repr(self.shape).encode(), digest_size=16)
        state.update(np.packbits(self.mask).tobytes())
        state.update(self.heights.tobytes())
        return state.hexdigest()

    def __eq__(self, other) -> bool:
        return self is other or (isinstance(other, Condensation) and self.digest == other.digest)

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self):  # packed, for genomes that workers receive and return
        bits, kept = np.packbits(self.mask).tobytes(), self.heights[self.mask].tobytes()
        return _unpack, (self.shape, bits, kept)

    def laid(self, heights: np.ndarray) -> np.ndarray:
        """Return a copy of the array ``heights``, ``(H, W)``, with the fixed heights in the masked
        pixels."""
        return np.where(self.mask, self.heights, heights).astype(heights.dtype, copy=False)

    def over(self, other: "Condensation") -> "Condensation":
        """Combine this condensation with the condensation ``other``. Where the masks of both
        condensations are true, the result has the heights of this condensation."""
        if self.shape != other.shape:
            raise GenomeError(
                f"two condensations differ in size, {_size(self.shape)} and "
                f"{_size(other.shape)}, and cannot be joined",
                "condensations that all have the same size",
                "make both condensations from the same map",
            )
        return Condensation(self.laid(other.heights), self.mask | other.mask)

    def resampled(self, height: int, width: int) -> "Condensation | None":
        """Resample the condensation to ``height`` × ``width`` px. Each new pixel takes the height
        of the old pixel at the centre of the new pixel. Return None if the resampled mask has no
        true pixel."""
        if (height, width) == self.shape:
            return self
        places = ((height, self.shape[0]), (width, self.shape[1]))
        rows, columns = (((np.arange(n) + 0.5) * old / n).astype(np.intp) for n, old in places)
        mask = self.mask[np.ix_(rows, columns)]
        return Condensation(self.heights[np.ix_(rows, columns)], mask) if mask.any() else None

    # -- files ---------------------------------------------------------------------------

    def column(self, pavement: Pavement) -> pa.Array:
        """Return an Arrow column that lists the fixed heights of each range block.

        Each entry of the column lists the heights in one range block, row by row, with NaN outside
        the mask. A range block without fixed heights has the entry null in the column.
        """
        order, starts = _by_blocks(pavement)
        heights = self.raster.ravel()[order]
        free = np.add.reduceat(self.mask.ravel()[order], starts[:-1], dtype=np.int64) == 0
        if pavement.uniform:
            return pa.FixedSizeListArray.from_arrays(
                column_of(heights), pavement.block**2, mask=column_of(free)
            )
        return pa.ListArray.from_arrays(
            column_of(starts.astype(np.int32)), column_of(heights), mask=column_of(free)
        )

    @classmethod
    def from_column(cls, column: pa.ChunkedArray, pavement: Pavement) -> "Condensation":
        """Make a condensation from an Arrow column that the method `column` returned. Raises
        ValueError if the type or the length of the column is wrong."""
        kind = pa.list_(pa.float32(), pavement.block**2 if pavement.uniform else -1)
        if column.type != kind or len(column) != len(pavement):
            raise ValueError(f"a condensation of {len(column)} × {column.type}")
        array = column.combine_chunks()
        array = array.combine_chunks() if isinstance(array, pa.ChunkedArray) else array
        taken = array_of(array.is_valid())
        order, starts = _by_blocks(pavement)
        kept = order[np.repeat(taken, np.diff(starts))]
        heights = array_of(array.flatten())
        if heights.size != kept.size:
            raise ValueError(f"{heights.size} fixed heights for {kept.size} pixels")
        raster = np.full(pavement.height * pavement.width, np.nan, np.float32)
        raster[kept] = heights
        return cls.from_raster(raster.reshape(pavement.height, pavement.width))


def merged(layers: Iterable[Condensation | None]) -> Condensation | None:
    """Join several condensations; return None if all ``layers`` are None. If the masks of several
    condensations contain a pixel, the first of these condensations determines the pixel's
    height."""
    first, *others = dict.fromkeys(layer for layer in layers if layer is not None) or [None]
    for other in others:
        first = first.over(other)
    return first


@lru_cache(maxsize=4)  # all genomes of a run share a layer in memory
def _unpack(shape: tuple[int, int], bits: bytes, kept: bytes) -> Condensation:
    count = shape[0] * shape[1]
    mask = np.unpackbits(np.frombuffer(bits, np.uint8), count=count).astype(bool).reshape(shape)
    heights = np.zeros(shape, np.float32)
    heights[mask] = np.frombuffer(kept, np.float32)
    return Condensation(heights, mask)


def _by_blocks(pavement: Pavement) -> tuple[np.ndarray, np.ndarray]:
    """Order the flat pixels of a map by range blocks, row by row in each; and return the start of
    each range block among them, ``(n + 1,)``."""
    starts = np.concatenate([[0], np.cumsum(pavement.area)])
    return np.argsort(pavement.index, axis=None, kind="stable"), starts


def _check_arrays(heights: np.ndarray, mask: np.ndarray) -> None:
    if mask.ndim != 2 or mask.shape != heights.shape or heights.dtype.kind not in "buif":
        raise GenomeError(
            f"fixed heights of type {heights.dtype} and shape {heights.shape} do not fit a "
            "mask "
            f"of shape {mask.shape}",
            "an array of numbers and a mask of the same shape, with rows from north to south",
            "pass one height in metres and one boolean for each pixel",
        )
    if mask.dtype != bool:
        raise GenomeError(
            f"the mask of the fixed heights has the type {mask.dtype}",
            "a mask of booleans",
            "compare the mask with a number to get booleans: mask > 0",
        )
    if not mask.any():
        raise GenomeError(
            "the mask of the fixed heights marks no pixel",
            "a mask that is True for at least one pixel",
            "set the mask to True for at least one pixel, or leave out the condensation",
        )


def _size(shape: tuple[int, int]) -> str:
    return f"{shape[0]} × {shape[1]} px"


__all__ = ["Condensation", "merged"]
