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
from evocity.errors import GenomeError, plain_text
from evocity.genome.checks import (
    SETTLING,
    check_bounds,
    check_description,
    owned_array,
    typed_array,
)
from evocity.genome.nucleotides import FIELDS, MOST_PARENTS, NEWER, NUCLEOTIDES
from evocity.genome.roofs import RoofTable, joined_roofs
from evocity.genome.writer import write_genome
from evocity.html_display import Displayed
from evocity.pavement import Pavement


@dataclass(frozen=True, eq=False)
class Genome(Displayed):
    """Code of a map: a chromosome that has one lifs for each range block of the map. The fields of
    a lifs are σ, β, x, y, dx, dy and iso.

    For range block i, the function ω_i averages a domain block to the size of the range block, and
    multiplies the heights by σ. After the multiplication by σ, the function ω_i adds β, applies an
    isometry and writes range block i (Marsault 2002 §2.2). A lifs without a domain block codes a
    flat range block of height β. A lifs without a domain block has the value 0 in its fields σ, x,
    y, dx, dy and iso.

    Parameters
    ----------
    pavement : tiling of the map by range blocks, with the place and the side of each block.
    sigma, beta, x, y, dx, dy, iso : arrays ``(n,)`` of nucleotides, with one entry for each lifs;
        `NUCLEOTIDES` lists the bounds of the entries.
    parent, source, turn, other, part : arrays ``(n,)`` of provenance, with one entry for each lifs;
        `PROVENANCE` describes each array. Five arrays of provenance say from which source city, and
        from which place in this city, each range block comes. Without the arrays ``turn``,
        ``other`` and ``part``, each range block shows a single city, without an isometry.
    metres_per_pixel : length of a pixel's side in the coded map, metres.
    cities : names of the source cities; the array ``parent`` holds indices into these names.
        Breeding identifies cities by their names, so give different maps different names before you
        breed them.
    sigma_max : upper bound on the absolute value of σ in each lifs; infinity for codes without a
        bound.
    attribution : text that the licences of the sources demand.
    origin, crs : coordinates and reference system of the decoded map, as in `CityMap`; None if they
        are unknown.
    made : description of how the genome was bred: the operator, its parameters and its results.
    condensation : fixed heights, which decoding does not change; None if no heights are fixed.
        Operators copy the condensation to the child unchanged.
    settle : whether `evocity.decode` makes roofs flat by default: True, False or ``"roofs"``, as in
        `evocity.decode`. The function `evocity.encode` sets this field to True. The field
        ``settle`` is False for codes made by hand and for codes of older releases.
    roofs : the `RoofTable` of each source city whose source gives shapes of roofs, or heights of
        ridges, by the name of the city. Only scenes use these tables. The field ``roofs`` does not
        count in comparisons and in the `digest`.

    Raises
    ------
    GenomeError : nucleotides are out of bounds; the message counts and lists these nucleotides.

    The constructor copies the arrays, converts the types of the copies, and makes the copies
    read-only. Operators never change a genome, but return new genomes.
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
    settle: bool | str = False
    roofs: Mapping[str, RoofTable] = field(default_factory=dict)

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
        roofs = {name: self.roofs[name] for name in self.cities if name in self.roofs}
        object.__setattr__(self, "roofs", roofs)
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
            f"Genome({plain_text(' × '.join(self.cities))}: {len(self)} lifs, B = {sides_text(p)}, "
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
        """Mask of the lifs that code a flat block without a domain block, bool ``(n,)``."""
        return self.dx == 0

    @property
    def shares(self) -> np.ndarray:
        """Share of the map that comes from each source city, float64 ``(len(cities),)``. The shares
        add up to 1. If a lifs interpolates two cities, each city counts by its weight in the field
        ``part``."""
        return self.shares_of(self.pavement.area.astype(float))

    def shares_of(self, pixels: np.ndarray) -> np.ndarray:
        """Compute the share of each source city in a part of the map; the attribute `shares` covers
        the whole map. The argument `pixels`, an array ``(n,)``, counts the pixels of each range
        block within the part of the map. All shares are 0 if the part of the map contains no
        pixel."""
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
            state.update(b"settled" if self.settle is True else str(self.settle).encode())
        for name in NUCLEOTIDES:
            state.update(np.ascontiguousarray(getattr(self, name)).tobytes())
        if self.condensation is not None:
            state.update(self.condensation.digest.encode())
        return state.hexdigest()

    def replace(self, **changes: Any) -> "Genome":
        """Return a copy of the genome with some fields changed; the constructor checks the new
        values of these fields."""
        if changes.keys() == {"made"} and type(self) is Genome:  # nothing to check or copy
            other = copy(self)
            object.__setattr__(other, "made", dict(changes["made"]))
            return other
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return Genome(**(fields | changes))

    def write(self, path: str | os.PathLike) -> None:
        """Write a Parquet file with one row for each lifs. The metadata of the file's schema hold
        the fields that have a single value for the whole genome.

        If writing fails, no partial file remains. DuckDB, polars and pandas read the Parquet file
        directly. Raises `GenomeError` if writing fails.
        """
        write_genome(self, path)


def derived(genome: Genome, **changes: Any) -> Genome:
    """Return a copy of ``genome`` with some fields changed, as `Genome.replace` does, but without a
    check of their bounds: for the steps of an operator, whose child `checked` checks once. The copy
    takes over new arrays. Changes of ``cities`` and ``roofs`` need `Genome.replace`."""
    other = object.__new__(Genome)
    fields, known = other.__dict__, genome.__dict__
    for name in _FIELD_NAMES:
        fields[name] = changes[name] if name in changes else known[name]
    count = len(fields["pavement"])
    for name in changes.keys() & FIELDS.keys():
        fields[name] = owned_array(name, fields[name], FIELDS[name], count)
    return other


_FIELD_NAMES = tuple(Genome.__dataclass_fields__)


def checked(genome: Genome) -> Genome:
    """Return ``genome``. Raises `GenomeError` if a nucleotide is out of bounds."""
    check_description(genome)
    check_bounds(genome)
    return genome


def sides_text(pavement: Pavement) -> str:
    """Describe the sides of range blocks: "4" or "2…16"."""
    return f"{pavement.block}" if pavement.uniform else f"{pavement.finest}…{pavement.coarsest}"


def merged_cities(genomes: Iterable[Genome]) -> tuple[tuple[str, ...], list[np.ndarray], str]:
    """Merge the source cities of several ``genomes`` into a list for a child of these genomes.

    The first result lists the names of the cities, each name once, in order of appearance. The
    second result holds a uint8 array for each genome: the indices of the genome's cities in the
    first result. The third result is the joined attribution of all genomes.
    """
    genomes = list(genomes)
    names = list(dict.fromkeys(city for genome in genomes for city in genome.cities))
    if len(names) > MOST_PARENTS:
        raise GenomeError(
            f"the genome has {len(names)} source cities",
            f"at most {MOST_PARENTS} source cities",
            "choose parents with fewer different source cities",
        )
    number = {name: index for index, name in enumerate(names)}
    places = [np.array([number[city] for city in genome.cities], np.uint8) for genome in genomes]
    return tuple(names), places, joined(genome.attribution for genome in genomes)


def descended(genomes: Sequence[Genome]) -> tuple[list[dict[str, np.ndarray]], dict]:
    """Collect the fields that a child inherits from several ``genomes``, apart from its lifs. The
    fields are arguments of `Genome.replace`.

    The first result holds the fields ``parent`` and ``other`` of each genome, converted to indices
    into the child's cities. The second result maps the names of the child's remaining fields to the
    values of these fields. The field ``settle`` has the last value in `SETTLING` that a genome
    has. The fields ``origin`` and ``crs`` have values only if all genomes agree on them.
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
        "settle": max((genome.settle for genome in genomes), key=SETTLING.index),
        "roofs": joined_roofs(genomes),
    }


def joined(attributions: Iterable[str]) -> str:
    """Join attributions with semicolons; a line that several attributions contain appears only
    once."""
    lines = (line for text in attributions for line in text.split("; ") if line)
    return "; ".join(dict.fromkeys(lines))
