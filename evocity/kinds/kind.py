"""`Kind`: the protocol of every kind of chromosome; and the results of its methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import column_of
from evocity.genome import Genome


@dataclass(frozen=True, eq=False)
class Expressed:
    """The expression of a genome: its map, or the reason that it has none.

    city : the map for measures, or None.
    problem : the reason, in words, that there is no map.
    form : the subjects of measures other than maps, by name: "shape", "curve", "site".
    """

    city: CityMap | None
    problem: str | None = None
    form: Mapping[str, Any] = field(default_factory=dict)

    def of(self, subject: str) -> Any:
        """Return the map or form that a measure of a ``subject`` takes."""
        return self.city if subject == "city" else self.form[subject]


@dataclass(frozen=True)
class Window:
    """The square window of every genome of a run, from ``[map]``."""

    pixels: int
    metres_per_pixel: float

    def __str__(self) -> str:
        return f"{self.pixels} × {self.pixels} px of {self.metres_per_pixel:g} m"


class Kind(Protocol):
    """A kind of chromosome. In all methods ``header`` is the run's `evocity.store.Header`, and
    ``locked`` the condensation of every genome of the run, or None."""

    name: str
    #: Operators that breed the first population, from two sources and from one: the first of each
    #: tuple that a recipe has, else the last.
    first_operators: tuple[tuple[str, ...], tuple[str, ...]]
    #: The mixture of a recipe without ``[operators]``: name -> weight and parameters.
    default_operators: Mapping[str, Mapping[str, Any]]
    #: Subjects of its measures: "city", "shape", "curve", "site".
    subjects: tuple[str, ...]
    #: Factors that its operators may breed: "fabric", "shape", "curve"; a birth changes one.
    factors: tuple[str, ...]
    #: Columns that only describe ancestry: `genome` works without them, and its genome expresses
    #: the same map.
    ancestry_columns: tuple[str, ...]
    #: Keys of ``[[parents]]`` for its parents, besides individuals of runs.
    sources: tuple[str, ...]

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        """List its columns of the births, in order."""

    def columns(self, genomes: Sequence[Any], header) -> dict[str, pa.Array]:
        """Make these columns of ``genomes``, with null for None."""

    def genome(self, row: Mapping[str, pa.Scalar], header, locked, made: Mapping) -> Any:
        """Make the genome of a row of the births. Raises ValueError, TypeError, LookupError or
        `EvocityError` for damaged rows."""

    def adopt(self, genome: Any, header, locked, made: Mapping | None = None) -> Any:
        """Convert a genome to the run's window, cities and lock; keep its ``made`` unless given."""

    def faults(self, child: Any, header) -> dict[str, str]:
        """List what of a ``child``, of any type, does not suit the run: problem -> expectation;
        empty for a suitable child."""

    def prepare(self, city: CityMap, how: Mapping[str, Any], locked) -> Any:
        """Make the genome of a source city; ``how``: the keys of the recipe's ``[genome]``."""
        raise NotImplementedError(f"a parent of a {self.name} is not a map")

    def make_parent(self, parent: Any, folder: Path, window: Window, name: str) -> Any:
        """Make the genome of a ``parent`` other than a map, of a recipe in a ``folder``. Raises
        `EvocityError`."""
        raise NotImplementedError(f"a parent of a {self.name} is a map")

    def rename(self, genome: Any, name: str) -> Any:
        """Rename the city of a founder's ``genome``."""

    def complete(self, genome: Any, city: CityMap, recipe: Any) -> Any:
        """Add the recipe's own parts to a source's ``genome``; by default none."""
        return genome

    def read(self, path: Path) -> Any:
        """Read the genome in a file. Raises `EvocityError`."""

    def window_mismatch(self, genome: Any, window: Window) -> tuple[str, str] | None:
        """Describe the window of an earlier genome and the expected ``window``; None if they are
        equal."""

    def breed(self, operator: Any, parents: Sequence[Any], rng: np.random.Generator) -> Any:
        """Breed a child of ``parents`` by an ``operator``, in one factor."""
        return operator(parents, rng)

    def fabric(self, genome: Any) -> Genome | None:
        """Return the fabric of a genome; None without a fabric."""
        return None

    def founder(self, genome: Any, name: str, settle: bool | str) -> Any:
        """Make an earlier ``genome`` the founder of a run: it becomes a single city called
        ``name``, without its former lock; ``settle`` as in the run's header."""

    def express(self, genome: Any) -> Expressed:
        """Express a genome as a map."""


def lists(rows: Sequence[np.ndarray | None], dtype: np.dtype, size: int | None = None) -> pa.Array:
    """Make a column of lists, null for None; of ``size`` values each, if given."""
    absent = column_of(np.array([row is None for row in rows], bool))
    if size is not None:
        values = np.zeros((len(rows), size), dtype)
        for line, row in zip(values, rows, strict=True):
            if row is not None:
                line[:] = row
        return pa.FixedSizeListArray.from_arrays(column_of(values.ravel()), size, mask=absent)
    counts = [0 if row is None else len(row) for row in rows]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    given = [row for row in rows if row is not None]
    values = np.concatenate(given).astype(dtype) if given else np.zeros(0, dtype)
    return pa.ListArray.from_arrays(column_of(starts), column_of(values), mask=absent)
