"""The chromosome `Genome`, and the description that children inherit from genomes."""

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.genome.checks import check_bounds, check_description, typed_array
from evocity.genome.nucleotides import FIELDS, MOST_PARENTS, NEWER, NUCLEOTIDES
from evocity.genome.writer import write_genome
from evocity.html_display import Displayed
from evocity.pavement import Pavement


@dataclass(frozen=True, eq=False)
class Genome(Displayed):
    """Code of a map: a chromosome with one lifs (σ, β, x, y, Dx, Dy, iso) for each range block of
    its pavement.

    ω_i shrinks its domain block to the size of range block i by averaging, multiplies by σ, adds
    β, applies the isometry and writes range block i (Marsault 2002 §2.2). A lifs without a domain
    (``dx == dy == 0``; then σ = 0 and x = y = iso = 0) codes a flat block of height β.

    Parameters
    ----------
    pavement : places and sides of the range blocks.
    sigma … iso : arrays ``(n,)``, with the types and bounds in `NUCLEOTIDES`.
    parent, source, turn, other, part : arrays ``(n,)``, described in `PROVENANCE`. They give the
        place in a source city that each range block shows. If the last three are missing, every
        place lies unturned in one city.
    metres_per_pixel : side of a pixel of the coded map, metres.
    cities : names of the source cities; the array ``parent`` holds indices into these names. A name
        stands for one city, so give maps different names before breeding them.
    sigma_max : bound on \\|σ\\|; infinity for codes without a bound.
    attribution : text that the licences of the sources demand.
    origin, crs : place of the decoded map on Earth, as in `CityMap`; None without a place.
    made : description of the birth: the operator, its parameters and its results.
    condensation : heights that decoding keeps, on a grid of the pavement's size; None without.
        Operators pass it on unchanged.
    settle : whether `evocity.decode` makes roofs flat by default. It is False for codes made by
        hand and for codes of older releases; `evocity.encode` sets True.

    Raises
    ------
    GenomeError : nucleotides are out of bounds; the message counts and lists them.

    The constructor copies the arrays, converts them to their types and makes them read-only. So
    operators return new genomes.
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
        for name, default in NEWER.items():
            if getattr(self, name) is None:
                values = getattr(self, default) if isinstance(default, str) else default
                values = np.broadcast_to(values, len(self.pavement))
                object.__setattr__(self, name, values.astype(FIELDS[name].dtype))
        for name, nucleotide in FIELDS.items():
            array = typed_array(name, getattr(self, name), nucleotide, len(self.pavement))
            object.__setattr__(self, name, array)
        object.__setattr__(self, "cities", tuple(self.cities))
        object.__setattr__(self, "made", dict(self.made))
        check_description(self)
        check_bounds(self)

    def __setstate__(self, state: dict) -> None:
        self.__dict__.update(state)
        for name in FIELDS:  # arrays from another process are writeable
            state[name].setflags(write=False)

    def __len__(self) -> int:
        """Number of lifs."""
        return len(self.pavement)

    def __repr__(self) -> str:
        p = self.pavement
        return (
            f"Genome({' × '.join(self.cities)}: {len(self)} lifs, B = {sides_text(p)}, "
            f"{p.height} × {p.width} px at {self.metres_per_pixel:g} m, "
            f"{np.count_nonzero(self.uniform)} uniform)"
        )

    def __eq__(self, other) -> bool:
        """Compare pavement, pixel size, nucleotides, condensation and settling, bit for bit;
        provenance does not count."""
        return isinstance(other, Genome) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @property
    def uniform(self) -> np.ndarray:
        """Lifs that code a flat block and have no domain block, bool ``(n,)``."""
        return self.dx == 0

    @property
    def shares(self) -> np.ndarray:
        """Share of the map that comes from each source city, float64 ``(len(cities),)``. The shares
        add up to 1. A lifs between two cities counts for both, by its ``part``."""
        return self.shares_of(self.pavement.area.astype(float))

    def shares_of(self, pixels: np.ndarray) -> np.ndarray:
        """Compute the `shares` over some of the pixels. The argument ``pixels`` ``(n,)`` is the
        number of such pixels in each range block. All shares are 0 if there are no pixels."""
        count = len(self.cities)
        total = np.bincount(self.parent, self.part * pixels, count)
        total += np.bincount(self.other, (1 - self.part) * pixels, count)
        return total / max(total.sum(), 1.0)

    @cached_property
    def digest(self) -> str:
        """Hex digest of pavement, pixel size, nucleotides, condensation and ``settle``: equal for
        equal genomes."""
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
        """Return a new genome with some fields changed, checked as at construction."""
        if changes.keys() == {"made"} and type(self) is Genome:  # nothing to check or copy
            other = copy(self)
            object.__setattr__(other, "made", dict(changes["made"]))
            return other
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return Genome(**(fields | changes))

    def write(self, path: str | os.PathLike) -> None:
        """Write a Parquet file with one row for each lifs. The metadata of its schema hold
        everything else.

        The file is written whole or not at all. DuckDB, polars and pandas read it directly. Raises
        `GenomeError` if writing fails.
        """
        write_genome(self, path)


def sides_text(pavement: Pavement) -> str:
    """Describe the sides of range blocks: "4" or "2…16"."""
    return f"{pavement.block}" if pavement.uniform else f"{pavement.finest}…{pavement.coarsest}"


def merged_cities(genomes: Iterable[Genome]) -> tuple[tuple[str, ...], list[np.ndarray], str]:
    """Join the lists of source cities of ``genomes`` for their child.

    Returns three values. The first lists the names, each once, in order of appearance. The second
    gives, for each genome, the index of each of its cities among these names, uint8. The third is
    the joined attributions.
    """
    genomes = list(genomes)
    names = list(dict.fromkeys(city for genome in genomes for city in genome.cities))
    if len(names) > MOST_PARENTS:
        raise GenomeError(
            f"the genome has {len(names)} source cities",
            f"at most {MOST_PARENTS}",
            "choose parents that share more of their cities",
        )
    number = {name: index for index, name in enumerate(names)}
    places = [np.array([number[city] for city in genome.cities], np.uint8) for genome in genomes]
    return tuple(names), places, joined(genome.attribution for genome in genomes)


def descended(genomes: Sequence[Genome]) -> tuple[list[dict[str, np.ndarray]], dict]:
    """Collect the fields that a child of all ``genomes`` inherits besides its lifs, for
    `Genome.replace`.

    Returns, for each genome, its ``parent`` and ``other`` as indices into the child's cities.
    Returns also the child's cities, attribution and sigma_max. The value ``settle`` is true if any
    parent settles. The values ``origin`` and ``crs`` are those of the parents if all parents share
    them.
    """
    cities, numbers, attribution = merged_cities(genomes)
    places = {(genome.origin, genome.crs) for genome in genomes}
    origin, crs = places.pop() if len(places) == 1 else (None, None)
    pointers = [
        {"parent": number[genome.parent], "other": number[genome.other]}
        for number, genome in zip(numbers, genomes, strict=True)
    ]
    return pointers, {
        "cities": cities,
        "attribution": attribution,
        "sigma_max": max(genome.sigma_max for genome in genomes),
        "origin": origin,
        "crs": crs,
        "settle": any(genome.settle for genome in genomes),
    }


def joined(attributions: Iterable[str]) -> str:
    """Join attributions. Each of their lines, separated by "; ", appears once."""
    lines = (line for text in attributions for line in text.split("; ") if line)
    return "; ".join(dict.fromkeys(lines))
