"""`Genome`: a city as an iterated function system, one gene (a lifs) a range block."""

import hashlib
import os
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from evocity.condensation import Condensation
from evocity.displayed import Displayed
from evocity.genome.checks import check_bounds, check_description, typed
from evocity.genome.files import write_genome
from evocity.genome.nucleotides import FIELDS, NEWER, NUCLEOTIDES
from evocity.pavement import Pavement


@dataclass(frozen=True, eq=False)
class Genome(Displayed):
    """A chromosome: one lifs (σ, β, x, y, Dx, Dy, iso) a range block of its pavement.

    ω_i shrinks its domain block to the size of range block i by averaging, multiplies by σ, adds
    β, applies the isometry and writes range block i (Marsault 2002 §2.2). A lifs without a domain
    (``dx == dy == 0``; then σ = 0 and x = y = iso = 0) codes a flat block of height β.

    Parameters
    ----------
    pavement : where the range blocks lie.
    sigma … iso : one array ``(n,)`` each, types and bounds as in `NUCLEOTIDES`.
    parent, source, turn, other, part : one array ``(n,)`` each, see `PROVENANCE`: whose stone each
        range block is. The last three left out, no stone is turned, and each is of one city.
    metres_per_pixel : side of a pixel of the coded map, metres.
    cities : names of the source cities that ``parent`` points into; a name stands for one
        city, so give maps different names before breeding them.
    sigma_max : the bound on \\|σ\\|; ``inf`` for codes without one.
    attribution : what the sources' licences ask for.
    origin, crs : where the decoded map lies, as in `CityMap`; None if nowhere.
    made : how the genome came about (operator, its parameters, what it reached).
    condensation : what decoding keeps, of the pavement's size, or None. No nucleotide:
        operators hand it on as it is.
    settle : whether `evocity.decode` settles roofs unless told otherwise. False for a code
        made by hand and for those of older releases; `evocity.encode` makes it True.

    Raises
    ------
    GenomeError : a nucleotide is out of its bounds; the message counts and names them.

    Arrays are copied to their types and made read-only: operators return new genomes.
    """

    pavement: Pavement
    sigma: np.ndarray
    beta: np.ndarray
    x: np.ndarray
    y: np.ndarray
    dx: np.ndarray
    dy: np.ndarray
    iso: np.ndarray
    parent: np.ndarray
    source: np.ndarray
    metres_per_pixel: float
    cities: tuple[str, ...]
    sigma_max: float = 0.9
    attribution: str = ""
    origin: tuple[float, float] | None = None
    crs: str | None = None
    made: Mapping = field(default_factory=dict)
    condensation: Condensation | None = None
    turn: np.ndarray | None = None
    other: np.ndarray | None = None
    part: np.ndarray | None = None
    settle: bool = False

    def __post_init__(self):
        for name, usual in NEWER.items():
            if getattr(self, name) is None:
                values = getattr(self, usual) if isinstance(usual, str) else usual
                values = np.broadcast_to(values, len(self.pavement))
                object.__setattr__(self, name, values.astype(FIELDS[name].dtype))
        for name, nucleotide in FIELDS.items():
            array = typed(name, getattr(self, name), nucleotide, len(self.pavement))
            object.__setattr__(self, name, array)
        object.__setattr__(self, "cities", tuple(self.cities))
        object.__setattr__(self, "made", dict(self.made))
        check_description(self)
        check_bounds(self)

    def __setstate__(self, state: dict) -> None:
        self.__dict__.update(state)
        for name in FIELDS:  # what comes from another process is writeable
            state[name].setflags(write=False)

    def __len__(self) -> int:
        """Number of lifs."""
        return len(self.pavement)

    def __repr__(self) -> str:
        p = self.pavement
        return (
            f"Genome({' × '.join(self.cities)}: {len(self)} lifs, B = {_sides(p)}, "
            f"{p.height} × {p.width} px at {self.metres_per_pixel:g} m, "
            f"{np.count_nonzero(self.uniform)} uniform)"
        )

    def __eq__(self, other) -> bool:
        """Same pavement, pixel size, nucleotides, condensation and settling, bit for bit;
        provenance is not compared."""
        return isinstance(other, Genome) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @property
    def uniform(self) -> np.ndarray:
        """Bool ``(n,)``: lifs that code a flat block and have no domain."""
        return self.dx == 0

    @property
    def shares(self) -> np.ndarray:
        """Float64 ``(len(cities),)``: the share of the map that is each source city's stone; they
        sum to 1. A lifs between two counts for both, by its ``part``."""
        return self.shares_of(self.pavement.area.astype(float))

    def shares_of(self, pixels: np.ndarray) -> np.ndarray:
        """`shares` of so many ``pixels`` ``(n,)`` of each range block; 0 where they are none."""
        count = len(self.cities)
        found = np.bincount(self.parent, self.part * pixels, count)
        found += np.bincount(self.other, (1 - self.part) * pixels, count)
        return found / max(found.sum(), 1.0)

    @cached_property
    def digest(self) -> str:
        """Hex digest of pavement, pixel size, nucleotides, condensation and whether roofs are
        settled: equal for equal genomes."""
        p = self.pavement
        state = hashlib.blake2b(digest_size=16)
        block = p.block if p.uniform else "leaves"
        state.update(repr((p.height, p.width, block, self.metres_per_pixel)).encode())
        if not p.uniform:
            state.update(p.side.tobytes())
        if self.settle:
            state.update(b"settled")
        for name in NUCLEOTIDES:
            state.update(np.ascontiguousarray(getattr(self, name)).tobytes())
        if self.condensation is not None:
            state.update(self.condensation.digest.encode())
        return state.hexdigest()

    def replace(self, **changes: Any) -> "Genome":
        """A new genome with some fields changed, checked as at construction."""
        if changes.keys() == {"made"} and type(self) is Genome:  # nothing to check, or to copy
            other = copy(self)
            object.__setattr__(other, "made", dict(changes["made"]))
            return other
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return Genome(**(fields | changes))

    def write(self, path: str | os.PathLike) -> None:
        """Write a Parquet file: one row a lifs, everything else in the schema's metadata.

        The file appears whole or not at all. DuckDB, polars and pandas read it as it is.
        Raises `GenomeError` if it cannot be written.
        """
        write_genome(self, path)


def _sides(pavement: Pavement) -> str:
    return f"{pavement.block}" if pavement.uniform else f"{pavement.finest}…{pavement.coarsest}"
