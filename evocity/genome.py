"""`Genome`: a city as an iterated function system, one gene (a lifs) a range block.

`NUCLEOTIDES` is the one table of what a gene holds; arrays, files and logs follow it.
"""

import hashlib
import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.citymap import MAX_PIXELS
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.files import whole_file
from evocity.pavement import Pavement

#: Versions of the genome file's schema that are read, raised by one with every change a reader
#: must know of. What needs nothing newer is written as 1; 2 has a column `CONDENSED`.
SCHEMA_VERSIONS = (1, 2)
#: The column of a genome file that holds what is kept, see `Condensation.column`.
CONDENSED = "condensation"

#: What reading a file that is no genome, or a damaged one, can end in.
_DAMAGE = (
    pa.ArrowException,
    OSError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
)


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
    "dx": _nucleotide(np.int16, "px", "a multiple of B, > B; 0 = no domain"),
    "dy": _nucleotide(np.int16, "px", "a multiple of B, > B; 0 = no domain"),
    "iso": _nucleotide(np.uint8, "", "0…7, see evocity.isometries"),
}
#: Carried along with each lifs: which source city it came from, and which lifs of it.
PROVENANCE: Mapping[str, Nucleotide] = {
    "parent": _nucleotide(np.uint8, "", "index into cities"),
    "source": _nucleotide(np.int32, "", "index of a lifs in that city's genome"),
}
FIELDS: Mapping[str, Nucleotide] = {**NUCLEOTIDES, **PROVENANCE}


@dataclass(frozen=True, eq=False)
class Genome:
    """A chromosome: one lifs (σ, β, x, y, Dx, Dy, iso) a range block of its pavement.

    ω_i shrinks its domain block to B × B by averaging, multiplies by σ, adds β, applies the
    isometry and writes range block i (Marsault 2002 §2.2). A lifs without a domain
    (``dx == dy == 0``; then σ = 0 and x = y = iso = 0) codes a flat block of height β.

    Parameters
    ----------
    pavement : where the range blocks lie.
    sigma … iso : one array ``(n,)`` each, types and bounds as in `NUCLEOTIDES`.
    parent, source : one array ``(n,)`` each, see `PROVENANCE`.
    metres_per_pixel : side of a pixel of the coded map, metres.
    cities : names of the source cities that ``parent`` points into; a name stands for one
        city, so give maps different names before breeding them.
    sigma_max : the bound on \\|σ\\|; ``inf`` for codes without one.
    attribution : what the sources' licences ask for.
    origin, crs : where the decoded map lies, as in `CityMap`; None if nowhere.
    made : how the genome came about (operator, its parameters, what it reached).
    condensation : what decoding keeps, of the pavement's size, or None. No nucleotide:
        operators hand it on as it is.

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

    def __post_init__(self):
        for name, nucleotide in FIELDS.items():
            array = _typed(name, getattr(self, name), nucleotide, len(self.pavement))
            object.__setattr__(self, name, array)
        object.__setattr__(self, "cities", tuple(self.cities))
        object.__setattr__(self, "made", dict(self.made))
        _check_description(self)
        _check_bounds(self)

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
            f"Genome({' × '.join(self.cities)}: {len(self)} lifs, B = {p.block}, "
            f"{p.height} × {p.width} px at {self.metres_per_pixel:g} m, "
            f"{np.count_nonzero(self.uniform)} uniform)"
        )

    def __eq__(self, other) -> bool:
        """Same pavement, pixel size, nucleotides and condensation, bit for bit; provenance is not
        compared."""
        return isinstance(other, Genome) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @property
    def uniform(self) -> np.ndarray:
        """Bool ``(n,)``: lifs that code a flat block and have no domain."""
        return self.dx == 0

    @cached_property
    def digest(self) -> str:
        """Hex digest of pavement, pixel size, nucleotides and condensation: equal for equal
        genomes."""
        p = self.pavement
        state = hashlib.blake2b(digest_size=16)
        state.update(repr((p.height, p.width, p.block, self.metres_per_pixel)).encode())
        for name in NUCLEOTIDES:
            state.update(np.ascontiguousarray(getattr(self, name)).tobytes())
        if self.condensation is not None:
            state.update(self.condensation.digest.encode())
        return state.hexdigest()

    def replace(self, **changes) -> "Genome":
        """A new genome with some fields changed, checked as at construction."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return Genome(**(fields | changes))

    # -- files ---------------------------------------------------------------------------

    def write(self, path: str | os.PathLike) -> None:
        """Write a Parquet file: one row a lifs, everything else in the schema's metadata.

        The file appears whole or not at all. DuckDB, polars and pandas read it as it is.
        Raises `GenomeError` if it cannot be written.
        """
        columns = {name: getattr(self, name) for name in FIELDS}
        if self.condensation is not None:
            columns[CONDENSED] = self.condensation.column(self.pavement)
        table = pa.table(columns)
        about = {"evocity.genome": json.dumps(self._described(), default=str)}
        try:
            with whole_file(path) as temporary:
                pq.write_table(table.replace_schema_metadata(about), temporary, compression="zstd")
        except OSError as error:
            raise GenomeError(
                f"{path} cannot be written: {error.strerror or error}",
                "a file name in a folder that exists, with room on the disk",
                "make the folder, or choose another place",
            ) from error

    def _described(self) -> dict:
        p = self.pavement
        return {
            "schema_version": 1 if self.condensation is None else 2,
            "height": p.height,
            "width": p.width,
            "block": p.block,
            "metres_per_pixel": self.metres_per_pixel,
            "cities": list(self.cities),
            "sigma_max": None if np.isinf(self.sigma_max) else self.sigma_max,
            "attribution": self.attribution,
            "origin": self.origin,
            "crs": self.crs,
            "made": _finite(self.made),
        }


def read_genome(path: str | os.PathLike) -> Genome:
    """Read a genome file written by `Genome.write`.

    Raises `GenomeError` if the file is missing, is no genome, has another schema version, or
    holds nucleotides out of bounds. Nothing in the file is executed.
    """
    path = Path(path)
    if not path.is_file():
        raise GenomeError(
            f"no genome file at {path}",
            "a Parquet file written by `evocity encode`",
            "check the name, or make one: evocity encode MAP -o GENOME.parquet",
        )
    try:
        with pq.ParquetFile(path) as file:
            metadata = file.schema_arrow.metadata or {}
            if b"evocity.genome" not in metadata:
                raise _another_table(path, metadata)
            about = dict(json.loads(metadata[b"evocity.genome"]))
            version = about.pop("schema_version")
            rows = file.metadata.num_rows
    except _DAMAGE:
        raise GenomeError(
            f"{path} is not a genome file, or is damaged",
            "a Parquet file written by `evocity encode`",
            "write it again: evocity encode MAP -o GENOME.parquet",
        ) from None
    if version not in SCHEMA_VERSIONS:
        raise GenomeError(
            f"{path} has genome schema version {version}",
            f"version {' or '.join(map(str, SCHEMA_VERSIONS))}",
            "read it with the release of evocity that wrote it, or encode the map again",
        )
    try:
        pavement = Pavement(*(_whole(about.pop(key)) for key in ("height", "width", "block")))
        if pavement.height * pavement.width > MAX_PIXELS or rows != len(pavement):
            raise ValueError(
                f"{rows} lifs for {pavement.height} × {pavement.width} px of B = {pavement.block}"
            )
        if about["sigma_max"] is None:
            about["sigma_max"] = float("inf")
        if about["origin"] is not None:
            about["origin"] = tuple(about["origin"])
        table = pq.read_table(path, columns=[*FIELDS, *[CONDENSED] * (version > 1)])
        if version > 1:
            about["condensation"] = Condensation.from_column(table.column(CONDENSED), pavement)
        arrays = {name: table.column(name).to_numpy() for name in FIELDS}
        return Genome(pavement, **arrays, **about)
    except GenomeError as error:
        raise GenomeError(f"{path}: {error.found}", error.expected, error.remedy) from None
    except _DAMAGE as error:
        raise GenomeError(
            f"{path} lacks a part of a genome, or holds one that does not fit ({error})",
            f"columns {', '.join(FIELDS)} and their description",
            "write it again: evocity encode MAP -o GENOME.parquet",
        ) from None


def _whole(value) -> int:
    if type(value) is not int:
        raise TypeError(f"{value!r} in place of a whole number")
    return value


def _another_table(path: Path, metadata: Mapping[bytes, bytes]) -> GenomeError:
    found, remedy = "Parquet, but no genome", "encode a map: evocity encode MAP -o GENOME.parquet"
    if b"geo" in metadata:
        found, remedy = "GeoParquet", "export GeoPackage or GeoJSON, which can be read as maps"
    elif b"evocity.run" in metadata:
        found = "a table of a run"
        remedy = "name the run's folder and one individual: evocity decode RUN --id N"
    return GenomeError(f"{path} is {found}", "a Parquet file written by `evocity encode`", remedy)


def _finite(value):
    """``value`` with infinity and NaN, which JSON has not, as text."""
    if isinstance(value, Mapping):
        return {str(key): _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def merged_cities(genomes: Iterable[Genome]) -> tuple[tuple[str, ...], list[np.ndarray], str]:
    """Common table of source cities for a child of ``genomes``.

    Returns the names (each once, in order of appearance), for each genome its ``parent``
    array re-pointed into them, and the attributions joined.
    """
    names: list[str] = []
    attributions: list[str] = []
    parents = []
    for genome in genomes:
        names.extend(city for city in genome.cities if city not in names)
        if len(names) > 256:
            raise GenomeError(
                f"{len(names)} source cities",
                "at most 256",
                "breed from genomes that share more of their cities",
            )
        lookup = np.array([names.index(city) for city in genome.cities], dtype=np.uint8)
        parents.append(lookup[genome.parent])
        for line in genome.attribution.split("; "):
            if line and line not in attributions:
                attributions.append(line)
    return tuple(names), parents, "; ".join(attributions)


def _typed(name: str, values, nucleotide: Nucleotide, count: int) -> np.ndarray:
    array = np.asarray(values)
    if array.shape != (count,):
        raise GenomeError(
            f"{name} of shape {array.shape}",
            f"({count},), one value a range block",
            "build the arrays from the genome's own pavement",
        )
    if nucleotide.dtype.kind in "iu" and array.dtype != nucleotide.dtype:
        limits = np.iinfo(nucleotide.dtype)
        if array.dtype.kind not in "iub" or (
            array.size and (array.min() < limits.min or array.max() > limits.max)
        ):
            raise GenomeError(
                f"{name} of type {array.dtype} with values beyond {nucleotide.dtype}",
                f"whole numbers {limits.min}…{limits.max}",
                "round to legal values first",
            )
    ours = array.base is None and not array.flags.writeable  # else somebody may still write
    if array.dtype != nucleotide.dtype or not ours or not array.flags.c_contiguous:
        array = np.array(array, dtype=nucleotide.dtype, order="C")
        array.setflags(write=False)
    return array


def _check_description(genome: Genome) -> None:
    def number(value) -> bool:
        return isinstance(value, int | float | np.number) and not isinstance(value, bool)

    pixel, origin = genome.metres_per_pixel, genome.origin
    faults = {
        f"metres_per_pixel = {pixel!r}": number(pixel) and 0 < pixel < math.inf,
        f"sigma_max = {genome.sigma_max!r}": number(genome.sigma_max) and genome.sigma_max > 0,
        "cities that are no names": 0 < len(genome.cities) <= 256
        and all(isinstance(city, str) for city in genome.cities),
        f"attribution = {genome.attribution!r}": isinstance(genome.attribution, str),
        f"crs = {genome.crs!r}": genome.crs is None or isinstance(genome.crs, str),
        f"origin = {origin!r}": origin is None
        or (len(origin) == 2 and all(number(one) and math.isfinite(one) for one in origin)),
        f"condensation = {genome.condensation!r}": genome.condensation is None
        or _fits(genome.condensation, genome.pavement),
    }
    found = [fault for fault, right in faults.items() if not right]
    if found:
        raise GenomeError(
            "; ".join(found),
            "a pixel size above 0 m, 1…256 names of cities, text, (x, y) or None, a Condensation "
            "of the map's size or None",
            "correct them, or encode the map again",
        )


def _fits(layer, pavement: Pavement) -> bool:
    return isinstance(layer, Condensation) and layer.shape == (pavement.height, pavement.width)


def _check_bounds(genome: Genome) -> None:
    p, b = genome.pavement, genome.pavement.block
    none = genome.dx == 0
    extent_x, extent_y = genome.dx.astype(np.int32), genome.dy.astype(np.int32)
    right, bottom = genome.x + extent_x, genome.y + extent_y
    with np.errstate(invalid="ignore"):
        faults = {
            f"σ beyond ±{genome.sigma_max:g}": ~(
                np.abs(genome.sigma) <= np.float32(genome.sigma_max)
            ),
            "β not finite": ~np.isfinite(genome.beta),
            "domain outside the map": (genome.x < 0)
            | (genome.y < 0)
            | (right > p.width)
            | (bottom > p.height),
            f"extent not a multiple of {b} above {b}": ~none
            & ((extent_x <= b) | (extent_y <= b) | (extent_x % b != 0) | (extent_y % b != 0)),
            "no domain, yet σ, x, y, dy or iso not 0": none
            & (
                (genome.sigma != 0)
                | (extent_y != 0)
                | (genome.iso != 0)
                | (right != 0)
                | (bottom != 0)
            ),
            "iso above 7": genome.iso > 7,
            "parent not among the cities": genome.parent >= len(genome.cities),
            "source below 0": genome.source < 0,
        }
    found = [f"{np.count_nonzero(bad)} lifs: {what}" for what, bad in faults.items() if bad.any()]
    if found:
        raise GenomeError(
            "; ".join(found),
            "nucleotides within the bounds of evocity.genome.NUCLEOTIDES",
            "round and clip before building a genome",
        )
