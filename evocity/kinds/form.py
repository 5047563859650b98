"""`Form`: the base class of chromosomes other than fabrics, and their files."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from hashlib import blake2b
from typing import ClassVar, Self

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import column_of
from evocity.errors import GenomeError
from evocity.genome.writer import FORM_KEY, write_described

#: Of a file: the metadata key of a form's description, the version, and the description's keys.
ABOUT, VERSION = FORM_KEY, 1
DESCRIBED = ("pixels", "metres_per_pixel", "name", "attribution", "origin", "crs")
#: The height of shapes and curves on their maps, metres: as high as a house, to be visible.
WALL = 9.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Form:
    """A chromosome in a square window of ``pixels`` of ``metres_per_pixel``.

    name : name of the form.
    attribution : credit lines that the licences of its sources require.
    origin : (x, y) of the window's north-west corner in the reference system ``crs``; None for a
        window without a place on Earth.
    made : provenance of the form.

    A form is immutable. Caches of computed values are not sent to other processes.
    """

    #: The name of its kind in `evocity.kinds.KINDS`.
    kind: ClassVar[str]

    pixels: int
    metres_per_pixel: float
    name: str = ""
    attribution: str = ""
    origin: tuple[float, float] | None = None
    crs: str | None = None
    made: Mapping = field(default_factory=dict)

    def __eq__(self, other: object) -> bool:
        """Compare kind, window and arrays, bit for bit; names and provenance do not count, as of
        genomes."""
        return isinstance(other, Form) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self):
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return partial(type(self), **values), ()

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Its content as one-dimensional arrays, by the names of columns."""
        raise NotImplementedError

    @cached_property
    def digest(self) -> str:
        """Hex digest of the window and the arrays, bit for bit."""
        state = blake2b(
            repr((self.kind, self.pixels, self.metres_per_pixel)).encode(), digest_size=16
        )
        for name, array in self.arrays.items():
            state.update(f"{name} {array.dtype.str} {array.size} ".encode())
            state.update(np.ascontiguousarray(array).tobytes())
        return state.hexdigest()

    @property
    def side(self) -> float:
        """Side of the window, metres."""
        return self.pixels * self.metres_per_pixel

    def replace(self, **changes) -> Self:
        """Return a copy with ``changes``."""
        return replace(self, **changes)

    @cached_property
    def problem(self) -> str | None:
        """Why it is not a valid individual, in words; None for a valid one."""
        return None

    @cached_property
    def city(self) -> CityMap:
        """Its map. Raises `GenomeError` if it is not a valid individual."""
        if self.problem is not None:
            raise GenomeError(
                self.problem, "a form that fits in its window", "choose another individual"
            )
        return CityMap(
            self._heights(),
            self.metres_per_pixel,
            name=self.name,
            attribution=self.attribution,
            origin=self.origin,
            crs=self.crs,
        )

    def _heights(self) -> np.ndarray:
        raise NotImplementedError

    def _file_content(self) -> tuple[dict[str, np.ndarray], dict]:
        about = {name: getattr(self, name) for name in DESCRIBED}
        return self.arrays, about | {"version": VERSION, "kind": self.kind, "made": dict(self.made)}

    def write(self, path: str | os.PathLike) -> None:
        """Write a Parquet file for `evocity.kinds.read_form`. Raises `GenomeError` if it cannot be
        written."""
        arrays, about = self._file_content()
        columns = {
            name: pa.ListArray.from_arrays(pa.array([0, array.size], pa.int32()), column_of(array))
            for name, array in arrays.items()
        }
        write_described(pa.table(columns), ABOUT.decode(), about, path)
