"""`Kind`: what every kind of chromosome must be able to do."""

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
    """What a genome stands for: its map, or why it has none.

    city : the map that is measured, None without one.
    problem : in words, why there is none.
    form : what measures of other things than maps see, by the names of these: "shape", "curve",
        "site".
    """

    city: CityMap | None
    problem: str | None = None
    form: Mapping[str, Any] = field(default_factory=dict)

    def of(self, subject: str) -> Any:
        """What a measure of a ``subject`` sees: the map, or a form."""
        return self.city if subject == "city" else self.form[subject]


@dataclass(frozen=True)
class Window:
    """The square that every genome of a run is laid in, as ``[map]`` tells it."""

    pixels: int
    metres_per_pixel: float

    def __str__(self) -> str:
        return f"{self.pixels} × {self.pixels} px of {self.metres_per_pixel:g} m"


class Kind(Protocol):
    """A kind of chromosome. ``header`` is the run's `evocity.store.Header` throughout; ``locked``
    what is condensed in every genome of the run, or None."""

    name: str
    #: Operators that breed the first population, of two sources and of one: the first of each that
    #: a recipe has, else the last.
    first: tuple[tuple[str, ...], tuple[str, ...]]
    #: The mixture of a recipe without ``[operators]``: name -> weight and parameters.
    usual: Mapping[str, Mapping[str, Any]]
    #: What its measures may be of: "city", "shape", "curve", "site".
    subjects: tuple[str, ...]
    #: What its operators may breed: "fabric", "shape", "curve"; of several, one a birth.
    factors: tuple[str, ...]
    #: Those of its columns that only tell whose stones are where: `genome` does without them, and
    #: what it gives expresses the same.
    stones: tuple[str, ...]
    #: What its parents are, as keys of ``[[parents]]``; individuals of runs besides.
    sources: tuple[str, ...]

    def fields(self, header) -> list[tuple[str, pa.DataType]]:
        """Its columns among the births', in order."""

    def columns(self, genomes: Sequence[Any], header) -> dict[str, pa.Array]:
        """These columns of ``genomes``, null for those that are None."""

    def genome(self, row: Mapping[str, pa.Scalar], header, locked, made: Mapping) -> Any:
        """The genome in one row of the births. Raises what damage ends in: ValueError,
        TypeError, LookupError, `EvocityError`."""

    def adopt(self, genome: Any, header, locked, made: Mapping | None = None) -> Any:
        """The same genome told in the run's terms; its own ``made`` unless another is given."""

    def faults(self, child: Any, header) -> dict[str, str]:
        """What of a ``child``, of any type, does not suit the run: what was found -> what was
        expected in its place; nothing for one that does."""

    def prepare(self, city: CityMap, how: Mapping[str, Any], locked) -> Any:
        """The genome of a source city, made as the recipe's ``[genome]`` tells; ``how`` are its
        keys."""

    def begun(self, parent: Any, folder: Path, window: Window, name: str) -> Any:
        """The genome of a ``parent`` that is no map, as the recipe in a ``folder`` tells it. Raises
        `EvocityError`."""

    def called(self, genome: Any, name: str) -> Any:
        """A founder's ``genome``, of a city called ``name``."""

    def completed(self, genome: Any, city: CityMap, recipe: Any) -> Any:
        """A source's ``genome`` with what the ``recipe`` adds to it."""

    def read(self, path: Path) -> Any:
        """The genome in a file. Raises `EvocityError`."""

    def unsuited(self, genome: Any, window: Window) -> tuple[str, str] | None:
        """What a genome that was bred before has in place of the ``window``, and what it is to
        have; None if that suits."""

    def bred(self, operator: Any, parents: Sequence[Any], rng: np.random.Generator) -> Any:
        """The child that an ``operator`` makes of ``parents``, in one factor of them."""

    def fabric(self, genome: Any) -> Genome | None:
        """What of a genome is fabric; None if nothing is."""

    def founder(self, genome: Any, name: str, settle: bool) -> Any:
        """A ``genome`` that was bred before as the founder of a run: all it has is its own, of a
        city called ``name``; ``settle`` as the run's header tells. What was locked is not any more:
        the run locks its own."""

    def express(self, genome: Any) -> Expressed:
        """The map that is measured."""


def lists(rows: Sequence[np.ndarray | None], dtype: np.dtype, size: int | None = None) -> pa.Array:
    """A column of lists, null for None; of ``size`` values each, if that is given."""
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
