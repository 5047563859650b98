"""The one table of what a gene holds; arrays, files and logs follow it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_SIDE


@dataclass(frozen=True)
class Nucleotide:
    """One field of a lifs: its type, its unit, its bounds in words."""

    dtype: np.dtype
    unit: str
    bounds: str


def _nucleotide(dtype, unit, bounds) -> Nucleotide:
    return Nucleotide(np.dtype(dtype), unit, bounds)


NUCLEOTIDES: Mapping[str, Nucleotide] = {
    "sigma": _nucleotide(np.float32, "1", "|σ| ≤ sigma_max"),
    "beta": _nucleotide(np.float32, "m", "finite"),
    "x": _nucleotide(np.int16, "px", "domain block inside the map"),
    "y": _nucleotide(np.int16, "px", "domain block inside the map"),
    "dx": _nucleotide(np.int16, "px", "a multiple of the range block's side, above it; 0 = none"),
    "dy": _nucleotide(np.int16, "px", "a multiple of the range block's side, above it; 0 = none"),
    "iso": _nucleotide(np.uint8, "", "0…7, see evocity.isometries"),
}
#: Source cities of a genome, and parents of one birth: ``parent`` counts them in a byte.
MOST_PARENTS = 256
#: Carried along with each lifs: the stone its range block is, as a place in a source city. The
#: range block shows the square of its own side whose north-west pixel is ``source``, under the
#: isometry ``turn``. Of a lifs between two (interpolation) that is the stone of the larger share,
#: ``part``; the rest is of the city ``other``.
PROVENANCE: Mapping[str, Nucleotide] = {
    "parent": _nucleotide(np.uint8, "", "index into cities"),
    "source": _nucleotide(np.int32, "", "32768 · row + column of a pixel in that city"),
    "turn": _nucleotide(np.uint8, "", "0…7, see evocity.isometries"),
    "other": _nucleotide(np.uint8, "", "index into cities"),
    "part": _nucleotide(np.float32, "1", "0…1"),
}
#: What of it releases before leaves did not know, and what stands there for them.
NEWER: Mapping[str, str | float] = {"turn": 0, "other": "parent", "part": 1.0}
#: The city of stones that are bare ground: it has no map.
VOID = "void"

FIELDS: Mapping[str, Nucleotide] = {**NUCLEOTIDES, **PROVENANCE}
#: Where the domain block of a lifs lies, and how large it is.
DOMAIN = ("x", "y", "dx", "dy")

_ROW = MAX_SIDE + 1


def packed(row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Places in a source city, px, as `PROVENANCE`'s ``source`` holds them, int32."""
    return (np.asarray(row, np.int64) * _ROW + column).astype(np.int32)


def unpacked(source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(row, column), int32, of the pixels that ``source`` stands for."""
    return np.divmod(source, np.int32(_ROW))
