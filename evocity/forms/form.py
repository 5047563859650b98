"""`Form`: what all chromosomes that are no fabric have in common."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from hashlib import blake2b
from typing import ClassVar, Self

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import column_of
from evocity.errors import GenomeError
from evocity.genome.files import write_described

#: Of a file: where in the metadata what describes a form stands, in which version, and its keys.
ABOUT, VERSION = b"evocity.form", 1
TOLD = ("pixels", "metres_per_pixel", "name", "attribution", "origin", "crs")
#: What is laid where a shape or a curve is, metres: as high as a house, so that it is seen.
WALL = 9.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Form:
    """A chromosome in a square window of ``pixels`` of ``metres_per_pixel``.

    name : what it is called. attribution : what its sources' licences ask for. origin : (x, y) of
    the window's north-west corner in ``crs``, None for a window that lies nowhere. made : how it
    came about. Immutable; what is computed of it is kept, and does not travel to another process.
    """

    #: The kind that it is of, see `evocity.kinds`.
    kind: ClassVar[str]

    pixels: int
    metres_per_pixel: float
    name: str = ""
    attribution: str = ""
    origin: tuple[float, float] | None = None
    crs: str | None = None
    made: Mapping = field(default_factory=dict)

    def __eq__(self, other: object) -> bool:
        """Of the same kind, in the same window, with the same arrays, bit for bit; names and
        provenance are not compared, as of genomes."""
        return isinstance(other, Form) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self):
        return _again, (type(self), {one.name: getattr(self, one.name) for one in fields(self)})

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """What it is, as arrays of one axis each, by the names of columns."""
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
        """Of the window, metres."""
        return self.pixels * self.metres_per_pixel

    def replace(self, **changes) -> Self:
        """The same with ``changes``."""
        return replace(self, **changes)

    @cached_property
    def problem(self) -> str | None:
        """Why it is no individual, in words; None if it is one."""
        return None

    @cached_property
    def city(self) -> CityMap:
        """It laid in its window, as a map. Raises `GenomeError` if it is no individual."""
        if self.problem is not None:
            raise GenomeError(
                self.problem, "a form that can be laid in its window", "choose another individual"
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

    def _described(self) -> tuple[dict[str, np.ndarray], dict]:
        """What a file of it has: arrays, and what describes them."""
        about = {name: getattr(self, name) for name in TOLD}
        return self.arrays, about | {"version": VERSION, "kind": self.kind, "made": dict(self.made)}

    def write(self, path: str | os.PathLike) -> None:
        """Write a Parquet file, which `evocity.forms.read_form` reads. Raises `GenomeError` if it
        cannot be written."""
        arrays, about = self._described()
        columns = {
            name: pa.ListArray.from_arrays(pa.array([0, one.size], pa.int32()), column_of(one))
            for name, one in arrays.items()
        }
        write_described(pa.table(columns), ABOUT.decode(), about, path)


def _again(kind: type[Form], told: dict) -> Form:
    return kind(**told)


__all__ = ["ABOUT", "TOLD", "VERSION", "WALL", "Form"]
