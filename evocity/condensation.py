"""`Condensation`: what decoding keeps as it is: a river, a listed building, a site that must not
change.
"""

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
    """A layer C of heights and a mask: W(I) = ∪ ω_i(I), then C where its mask covers
    (condensation IFS: Marsault 2002 §6.2, 2005 §4.2). Immutable.

    Parameters
    ----------
    heights : array ``(H, W)``, metres; finite and not negative where the mask covers.
    mask : bool ``(H, W)``, true where C covers; one pixel at least.

    Attributes: ``heights``, float32, 0 where the mask does not cover; ``mask``. Both are
    read-only. Two layers are equal if they keep the same heights in the same pixels.

    Raises
    ------
    GenomeError : shapes or types differ from these, nothing is covered, or a height is NaN,
        infinite or negative.
    """

    def __init__(self, heights: np.ndarray, mask: np.ndarray):
        heights, mask = np.asarray(heights), np.asarray(mask)
        _check_arrays(heights, mask)
        with np.errstate(over="ignore"):  # what float32 cannot hold is told as infinite
            kept = np.where(mask, heights, 0).astype(np.float32) + np.float32(0)  # no −0
        wrong = ~(np.isfinite(kept) & (kept >= 0))
        if wrong.any():
            raise GenomeError(
                f"{np.count_nonzero(wrong)} condensed heights that are NaN, infinite or below 0",
                "finite heights above ground, metres",
                "leave these pixels out of the mask, or give them heights",
            )
        self.heights, self.mask = kept, mask.copy()
        for array in (self.heights, self.mask):
            array.setflags(write=False)

    @classmethod
    def cut(cls, city: CityMap, mask: np.ndarray) -> "Condensation":
        """The heights of ``city`` where the bool ``(H, W)`` ``mask`` covers."""
        return cls(city.heights, mask)

    @classmethod
    def from_raster(cls, raster: np.ndarray) -> "Condensation":
        """Of a ``(H, W)`` ``raster``, metres, NaN where nothing is kept; see `raster`."""
        return cls(raster, ~np.isnan(raster))

    @property
    def raster(self) -> np.ndarray:
        """Float32 ``(H, W)``: the heights kept, metres; NaN where nothing is."""
        return np.where(self.mask, self.heights, np.float32(np.nan))

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in pixels."""
        return self.mask.shape

    def __len__(self) -> int:
        """Number of pixels that are kept."""
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

    def __reduce__(self):  # a genome goes to a worker and back: packed, a quarter of it is little
        bits, kept = np.packbits(self.mask).tobytes(), self.heights[self.mask].tobytes()
        return _unpacked, (self.shape, bits, kept)

    def laid(self, heights: np.ndarray) -> np.ndarray:
        """A copy of ``(H, W)`` ``heights`` with C in its place."""
        return np.where(self.mask, self.heights, heights).astype(heights.dtype, copy=False)

    def over(self, other: "Condensation") -> "Condensation":
        """Both layers in one; where both cover, this one is kept."""
        if self.shape != other.shape:
            raise GenomeError(
                f"condensations of {_size(self.shape)} and {_size(other.shape)}",
                "layers of one size",
                "make both on the same map",
            )
        return Condensation(self.laid(other.heights), self.mask | other.mask)

    def resampled(self, height: int, width: int) -> "Condensation | None":
        """The layer at ``height`` × ``width`` px, each new pixel from the one its centre lies in;
        None where no such pixel is kept."""
        if (height, width) == self.shape:
            return self
        places = ((height, self.shape[0]), (width, self.shape[1]))
        rows, columns = (((np.arange(n) + 0.5) * old / n).astype(np.intp) for n, old in places)
        mask = self.mask[np.ix_(rows, columns)]
        return Condensation(self.heights[np.ix_(rows, columns)], mask) if mask.any() else None

    # -- files ---------------------------------------------------------------------------

    def column(self, pavement: Pavement) -> pa.Array:
        """The layer cut along a pavement: a list of the heights of each range block, row by row,
        NaN where nothing is kept; null for blocks without any pixel kept."""
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
        """`column` the other way round. ValueError for a column of another kind."""
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
            raise ValueError(f"{heights.size} condensed heights for {kept.size} pixels")
        raster = np.full(pavement.height * pavement.width, np.nan, np.float32)
        raster[kept] = heights
        return cls.from_raster(raster.reshape(pavement.height, pavement.width))


def merged(layers: Iterable[Condensation | None]) -> Condensation | None:
    """All ``layers`` in one, None if there is none; where several cover, the first is kept."""
    first, *others = dict.fromkeys(one for one in layers if one is not None) or [None]
    for other in others:
        first = first.over(other)
    return first


@lru_cache(maxsize=4)  # all genomes of a run have one layer: here it stands in memory once
def _unpacked(shape: tuple[int, int], bits: bytes, kept: bytes) -> Condensation:
    count = shape[0] * shape[1]
    mask = np.unpackbits(np.frombuffer(bits, np.uint8), count=count).astype(bool).reshape(shape)
    heights = np.zeros(shape, np.float32)
    heights[mask] = np.frombuffer(kept, np.float32)
    return Condensation(heights, mask)


def _by_blocks(pavement: Pavement) -> tuple[np.ndarray, np.ndarray]:
    """The flat pixels of a map range block by range block, row by row in each; and where each
    range block begins among them, ``(n + 1,)``."""
    starts = np.concatenate([[0], np.cumsum(pavement.area)])
    return np.argsort(pavement.index, axis=None, kind="stable"), starts


def _check_arrays(heights: np.ndarray, mask: np.ndarray) -> None:
    if mask.ndim != 2 or mask.shape != heights.shape or heights.dtype.kind not in "buif":
        raise GenomeError(
            f"condensed heights of {heights.dtype} {heights.shape}, a mask of shape {mask.shape}",
            "numbers and a mask of one shape, rows from north to south",
            "give a height in metres and a yes or no a pixel",
        )
    if mask.dtype != bool:
        raise GenomeError(
            f"a mask of type {mask.dtype}", "true and false", "compare first: mask > 0"
        )
    if not mask.any():
        raise GenomeError(
            "a mask that covers nothing", "one pixel or more", "leave the condensation out"
        )


def _size(shape: tuple[int, int]) -> str:
    return f"{shape[0]} × {shape[1]} px"


__all__ = ["Condensation", "merged"]
