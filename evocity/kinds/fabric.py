"""The kind of fabrics: a city as an iterated function system, a `Genome`."""

from collections.abc import Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.errors import EvocityError, spell
from evocity.genome import (
    FIELDS,
    NEWER,
    PROVENANCE,
    Genome,
    RoofTable,
    packed,
    read_genome,
    roof_codes,
    unpacked,
)
from evocity.kinds.kind import Expressed, Kind, Window, lists
from evocity.pavement import Pavement

#: The column of the range blocks' sides, px, in the order of `Pavement.side`.
SIDE = "side"
#: Columns of logs without leaves: lists of one length, no turns, lifs for places.
_OLDER = [name for name in FIELDS if name not in NEWER]


class Fabric(Kind):
    """The kind of `Genome`. A birth has a list for each field of nucleotides, and a list of the
    sides of the range blocks. Runs of older releases, whose header has a ``block``, keep their
    format."""

    name = "fabric"
    first_operators = (
        ("quarter_fusion", "plan_fusion", "pavement_fusion"),
        ("quarter_refill", "plan_fusion", "mutation"),
    )
    default_operators: ClassVar = {
        "quarter_fusion": {"weight": 2, "fill": {"from": 0.05, "to": 0.6}},
        "height_scaling": {"weight": 2},
        "relocation": {"weight": 1.5},
        "region_fusion": {"weight": 1.5, "cut": 0.0},
    }
    subjects = ("city",)
    factors = ("fabric",)
    sources = ("map",)
    ancestry_columns = tuple(PROVENANCE)

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        if header.block is not None:
            count = len(Pavement(header.height, header.width, header.block))
            return [(name, pa.list_(_type(name), count)) for name in _OLDER]
        return [*((name, pa.list_(_type(name))) for name in FIELDS), (SIDE, pa.list_(pa.int16()))]

    def columns(self, genomes: Sequence[Genome | None], header) -> dict[str, pa.Array]:
        def column(of, dtype: np.dtype, size=None) -> pa.Array:
            return lists(
                [None if genome is None else of(genome) for genome in genomes], dtype, size
            )

        getters = {name: attrgetter(name) for name in FIELDS}
        if header.block is None:
            columns = {name: column(of, FIELDS[name].dtype) for name, of in getters.items()}
            return columns | {SIDE: column(attrgetter("pavement.side"), np.dtype(np.int16))}
        count = len(Pavement(header.height, header.width, header.block))
        getters["source"] = lambda genome: _lifs(genome.source, header)
        return {name: column(getters[name], FIELDS[name].dtype, count) for name in _OLDER}

    def genome(self, row, header, locked: Condensation | None, made: Mapping) -> Genome:
        older = header.block is not None
        names = [name for name in (_OLDER if older else FIELDS) if name in row]
        arrays = {name: array_of(row[name].values) for name in names}
        sides = header.block if older else array_of(row[SIDE].values)
        pavement = Pavement(header.height, header.width, sides)
        if "source" not in arrays:
            arrays |= _own_ancestry(pavement)
        elif older:
            line, place = np.divmod(arrays["source"].astype(np.int64), pavement.columns)
            arrays["source"] = packed(line * header.block, place * header.block)
        return Genome(
            pavement,
            **arrays,
            metres_per_pixel=header.metres_per_pixel,
            made=made,
            **_common(header, locked),
        )

    def adopt(
        self, genome: Genome, header, locked: Condensation | None, made: Mapping | None = None
    ) -> Genome:
        made = genome.made if made is None else made
        common = _common(header, locked)
        if all(getattr(genome, key) == value for key, value in common.items()):
            return genome.replace(made=made)
        lookup = np.array([header.cities.index(city) for city in genome.cities], dtype=np.uint8)
        pointers = {"parent": lookup[genome.parent], "other": lookup[genome.other]}
        return genome.replace(**pointers, **common, made=made)

    def faults(self, child, header) -> dict[str, str]:
        if not isinstance(child, Genome):
            return {f"a child that is {spell(child)}": "a Genome"}
        faults = {}
        size = child.pavement.height, child.pavement.width
        if size != (header.height, header.width):
            found = f"a child of {size[0]} × {size[1]} px"
            faults[found] = f"{header.height} × {header.width} px, as the run"
        elif header.block is not None and child.pavement != Pavement(*size, header.block):
            found = f"range blocks of {child.pavement.finest}…{child.pavement.coarsest} px"
            faults[found] = f"range blocks of {header.block} px, as the run"
        if child.metres_per_pixel != header.metres_per_pixel:
            found = f"pixels of {child.metres_per_pixel!r} m"
            faults[found] = f"pixels of {header.metres_per_pixel!r} m"
        steep = np.abs(child.sigma) > np.float32(header.sigma_max)
        if steep.any():
            found = f"|σ| up to {np.abs(child.sigma).max():.4g} in {np.count_nonzero(steep)} lifs"
            faults[found] = f"|σ| ≤ {header.sigma_max:g}, the run's genome.sigma_max"
        strange = [city for city in child.cities if city not in header.cities]
        if strange:
            found = f"cities {', '.join(map(spell, strange))}"
            faults[found] = f"cities of the run: {', '.join(header.cities)}"
        return faults

    def prepare(self, city: CityMap, how: Mapping, locked: Condensation | None) -> Genome:
        from evocity.coding.encode import encode

        return encode(city, condensation=locked, **how).genome

    def rename(self, genome: Genome, name: str) -> Genome:
        tables = genome.roofs.values() if len(genome.cities) == 1 else ()
        return genome.replace(cities=(name,), roofs=dict(zip((name,), tables, strict=False)))

    def read(self, path: Path) -> Genome:
        return read_genome(path)

    def window_mismatch(self, genome: Genome, window: Window) -> tuple[str, str] | None:
        pavement, pixel = genome.pavement, genome.metres_per_pixel
        size = pavement.height, pavement.width
        if (*size, pixel) == (window.pixels, window.pixels, window.metres_per_pixel):
            return None
        return f"{size[0]} × {size[1]} px of {pixel:g} m", str(window)

    def fabric(self, genome: Genome) -> Genome:
        return genome

    def founder(self, genome: Genome, name: str, settle: bool | str) -> Genome:
        roofs = RoofTable.of_raster(roof_codes(genome))
        return genome.replace(
            cities=(name,),
            roofs={} if roofs is None else {name: roofs},
            **_own_ancestry(genome.pavement),
            **dict.fromkeys(("turn", "other", "part")),
            condensation=None,
            settle=settle,
            made={"operator": "source", "bred": dict(genome.made)},
        )

    def express(self, genome: Genome) -> Expressed:
        from evocity.coding.decoding_cache import decoded  # reading a run does not need it

        try:
            decoding = decoded(genome)
        except EvocityError as error:
            return Expressed(None, f"{error.found} (expected: {error.expected})")
        if not decoding.converged:
            return Expressed(None, f"decoding did not converge: still {decoding.change:.3g} m")
        return Expressed(decoding.city)


def _common(header, locked: Condensation | None) -> dict:
    names = ("cities", "sigma_max", "attribution", "origin", "crs", "settle")
    return {name: getattr(header, name) for name in names} | {"condensation": locked}


def _own_ancestry(pavement: Pavement) -> dict[str, np.ndarray]:
    """Return the ancestry of a code of a single city, the first: each lifs comes from its own
    place."""
    return {"parent": np.zeros(len(pavement), np.uint8), "source": packed(*pavement.corners)}


def _type(name: str) -> pa.DataType:
    return pa.from_numpy_dtype(FIELDS[name].dtype)


def _lifs(source: np.ndarray, header) -> np.ndarray:
    """Convert the places ``source`` to numbers of lifs, as in older releases."""
    row, column = unpacked(source)
    return row // header.block * (header.width // header.block) + column // header.block
