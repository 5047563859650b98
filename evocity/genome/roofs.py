"""Roofs of source cities: their shapes, and whether heights measure to eaves or to ridges."""

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.errors import GenomeError
from evocity.genome.nucleotides import unpacked
from evocity.isometries import AFFINE

#: The number of shapes of roofs, as of `evocity.io.roof_shapes.SHAPES`.
ROOF_SHAPES = 5
#: The bit of a code whose heights measure to the ridge; the other bits hold 1 + the number of a
#: shape, or 0 without a shape.
RIDGE = 8
#: Most runs of a table; a map with more keeps the meaning of its heights, but no shapes.
MOST_RUNS = 1 << 20
# Bytes of a run in a file: four of its length, one of its code.
_BYTES = 5
# Pixels that are traced at once.
_BAND = 1 << 20


@dataclass(frozen=True, eq=False)
class RoofTable:
    """The roofs of a source city by pixel: runs of pixels with the same code, row by row.

    size : rows and columns of the city's map.
    lengths : int64 ``(n,)``, the pixels of each run; they fill the map.
    codes : uint8 ``(n,)``: 1 + the number of a shape in `evocity.io.roof_shapes.SHAPES`, or 0
        without a shape; plus `RIDGE` if heights measure to the ridge.

    Raises `GenomeError` for runs that do not fill the map, and for unknown codes.
    """

    size: tuple[int, int]
    lengths: np.ndarray
    codes: np.ndarray

    def __post_init__(self):
        faults = {
            "a size out of range": _is_size(self.size),
            "runs that do not fill the map": self.lengths.shape == self.codes.shape
            and 0 < self.lengths.size <= MOST_RUNS
            and self.lengths.min() > 0
            and self.lengths.sum() == self.size[0] * self.size[1],
            "unknown codes": self.codes.dtype == np.uint8
            and bool(((self.codes % RIDGE <= ROOF_SHAPES) & (self.codes < 2 * RIDGE)).all()),
        }
        for fault, right in faults.items():
            if not right:
                raise GenomeError(
                    f"a table of roofs with {fault}",
                    "runs of pixels that fill the map, with the codes of evocity.genome.RoofTable",
                    "encode the map again",
                )

    def __eq__(self, other) -> bool:
        return isinstance(other, RoofTable) and self.document == other.document

    def __hash__(self) -> int:
        return hash(self.document["runs"])

    def __repr__(self) -> str:
        return f"RoofTable({self.size[0]} × {self.size[1]} px, {len(self.codes)} runs)"

    @classmethod
    def of_raster(cls, raster: np.ndarray) -> "RoofTable | None":
        """Make the table of a ``raster`` of codes, uint8 ``(H, W)``; None if all codes are 0. A
        raster of more than `MOST_RUNS` runs keeps no shapes."""
        if not raster.any():
            return None
        flat = raster.ravel()
        starts = np.flatnonzero(np.concatenate([[True], flat[1:] != flat[:-1]]))
        if len(starts) > MOST_RUNS:
            plain = raster & np.uint8(RIDGE)
            many = np.count_nonzero(plain.ravel()[1:] != plain.ravel()[:-1]) >= MOST_RUNS
            return None if many else cls.of_raster(plain)
        lengths = np.diff(starts, append=flat.size)
        return cls((raster.shape[0], raster.shape[1]), lengths, flat[starts])

    @cached_property
    def document(self) -> dict[str, Any]:
        """The table as a JSON value: ``size``, and ``runs`` as zlib in Base64. The runs hold the
        lowest bytes of all lengths, the next bytes, and so on, and then all codes."""
        lengths = self.lengths.astype("<u4").view(np.uint8).reshape(-1, _BYTES - 1)
        content = zlib.compress(lengths.T.tobytes() + self.codes.tobytes(), 9)
        return {"size": list(self.size), "runs": base64.b64encode(content).decode()}

    @classmethod
    def of_document(cls, document: Any) -> "RoofTable":
        """Read a `document`. Raises `GenomeError`, ValueError, TypeError, LookupError or zlib.error
        for another."""
        size, stream = tuple(document["size"]), zlib.decompressobj()
        if not _is_size(size):
            raise ValueError("a size out of range")
        most = _BYTES * min(size[0] * size[1], MOST_RUNS)
        content = base64.b64decode(document["runs"], validate=True)
        plain = np.frombuffer(stream.decompress(content, most + 1), np.uint8)
        if plain.size > most or plain.size % _BYTES or not stream.eof or stream.unused_data:
            raise ValueError("runs that are too long or incomplete")
        parts = plain.reshape(_BYTES, -1)
        lengths = np.ascontiguousarray(parts[:-1].T).view("<u4").ravel().astype(np.int64)
        return cls((size[0], size[1]), lengths, parts[-1].copy())

    @cached_property
    def _ends(self) -> np.ndarray:
        return np.cumsum(self.lengths)

    def at(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the codes at pixels, uint8; 0 outside the map."""
        height, width = self.size
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        place = np.where(inside, row * width + column, 0)
        return np.where(inside, self.codes[np.searchsorted(self._ends, place, "right")], 0)


def _is_size(size: Any) -> bool:
    return (
        len(size) == 2
        and all(type(side) is int and 0 < side <= MAX_SIDE for side in size)
        and size[0] * size[1] <= MAX_PIXELS
    )


def read_roofs(documents: Any, cities: tuple[str, ...]) -> dict[str, RoofTable]:
    """Read the tables of source ``cities`` by name. Raises `GenomeError` for damaged tables, and
    for tables of other cities."""
    if not isinstance(documents, dict) or not set(documents) <= set(cities):
        raise _damaged_roofs("not a table for each of some source cities")
    tables = {}
    for name, document in documents.items():
        try:
            tables[name] = RoofTable.of_document(document)
        except GenomeError as error:
            raise _damaged_roofs(f"{name[:80]!r}: {error.found}") from None
        except (ValueError, TypeError, LookupError, AttributeError, zlib.error) as error:
            raise _damaged_roofs(f"{name[:80]!r}: {str(error)[:120]}") from None
    return tables


def _damaged_roofs(found: str) -> GenomeError:
    return GenomeError(
        f"the roofs of source cities (metadata evocity.roofs) are damaged: {found}",
        "for each city a size, and runs of pixels that fill this size, with codes of roofs",
        "write the genome again, or remove evocity.roofs from the file's metadata",
    )


def roof_codes(genome: Any) -> np.ndarray:
    """Return the code of the roof that each pixel of a ``genome`` shows, uint8 ``(H, W)``: that of
    its place in the source city. The function takes about 10 ms for 256 × 256 px."""
    p = genome.pavement
    codes = np.zeros((p.height, p.width), np.uint8)
    if not genome.roofs:
        return codes
    lifs = p.raster(np.arange(len(p), dtype=np.int32))
    (top, left), side = p.corners, np.broadcast_to(p.side, len(p))
    row, column = unpacked(genome.source)
    step = max(_BAND // p.width, 1)
    for begin in range(0, p.height, step):
        own = lifs[begin : begin + step]
        y, x = np.indices(own.shape)
        a, last = AFFINE[genome.turn[own]], side[own].astype(np.int64) - 1
        i, j = y + begin - top[own], x - left[own]
        down = row[own] + a[..., 0] * last + a[..., 2] * i + a[..., 4] * j
        along = column[own] + a[..., 1] * last + a[..., 3] * i + a[..., 5] * j
        parent, band = genome.parent[own], codes[begin : begin + step]
        for number, name in enumerate(genome.cities):
            if name in genome.roofs:
                here = parent == number
                band[here] = genome.roofs[name].at(down[here], along[here])
    return codes


def building_roofs(city: CityMap, genome: Any) -> np.ndarray | None:
    """Return the roof of each building of a decoded ``city``, in the order of `CityMap.buildings`,
    as the source cities of the ``genome`` give it. Most pixels of the building decide. None if no
    source city gives roofs.

    city : the map of the ``genome``, decoded at any zoom.

    Returns int8 ``(n, 2)``: the number of the shape in `evocity.io.roof_shapes.SHAPES`, or -1; and
    1 if the height measures to the ridge, 0 if it measures to the eaves.
    """
    if not genome.roofs:
        return None
    codes = roof_codes(genome)
    if city.metres_per_pixel == genome.metres_per_pixel:
        codes = city.of_whole(codes)
    else:
        pairs = zip(city.shape, codes.shape, strict=True)
        codes = codes[np.ix_(*(np.arange(now) * was // now for now, was in pairs))]
    return most_roofs(city, codes)


def most_roofs(city: CityMap, codes: np.ndarray) -> np.ndarray:
    """Return the roof of most pixels of each building of ``city``, as `building_roofs`, for
    ``codes`` ``(H, W)``; pixels with a code below 0 do not count."""
    labels, wide = city.buildings.labels, 2 * RIDGE
    known = (labels > 0) & (codes >= 0)
    pairs = (labels[known].astype(np.int64) - 1) * wide + codes[known]
    count = len(city.buildings)
    most = np.bincount(pairs, minlength=count * wide).reshape(count, wide).argmax(axis=1)
    return np.column_stack([most % RIDGE - 1, most // RIDGE]).astype(np.int8)


def joined_roofs(genomes: Sequence[Any]) -> Mapping[str, RoofTable]:
    """Join the tables of several ``genomes``; the first table of a city counts."""
    return {name: table for one in genomes[::-1] for name, table in one.roofs.items()}
