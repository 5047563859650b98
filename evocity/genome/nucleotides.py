"""Nucleotides and provenance: the table of a gene's fields, which arrays, files and logs follow."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_SIDE


@dataclass(frozen=True)
class Nucleotide:
    """Description of a field of a lifs: its type, its unit, and its bounds in words."""

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
#: The most source cities of a genome, and parents of one birth: ``parent`` is a byte.
MOST_PARENTS = 256
#: The origin of each range block, as a place in a source city. The range block shows the square of
#: its own side whose north-west pixel is ``source``, under the isometry ``turn``. For a lifs
#: between two cities (interpolation) that is the origin of the larger share, ``part``; the city
#: ``other`` has the rest.
PROVENANCE: Mapping[str, Nucleotide] = {
    "parent": _nucleotide(np.uint8, "", "index into cities"),
    "source": _nucleotide(np.int32, "", "32768 · row + column of a pixel in that city"),
    "turn": _nucleotide(np.uint8, "", "0…7, see evocity.isometries"),
    "other": _nucleotide(np.uint8, "", "index into cities"),
    "part": _nucleotide(np.float32, "1", "0…1"),
}
#: The fields of provenance that releases before leaves lack, and their defaults there.
NEWER: Mapping[str, str | float] = {"turn": 0, "other": "parent", "part": 1.0}
#: The source city of bare ground: it has no map.
VOID = "void"

FIELDS: Mapping[str, Nucleotide] = {**NUCLEOTIDES, **PROVENANCE}
#: Place and extent of a lifs' domain block.
DOMAIN = ("x", "y", "dx", "dy")

_ROW = MAX_SIDE + 1


def packed(row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Pack the row and the column of pixels in a source city into int32 numbers, in the format
    of the field ``source`` in `PROVENANCE`."""
    return (np.asarray(row, np.int64) * _ROW + column).astype(np.int32)


def unpacked(source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unpack the numbers of the field ``source`` into rows and columns of pixels, int32."""
    return np.divmod(source, np.int32(_ROW))
