"""`Kind`: what every kind of chromosome must be able to do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pyarrow as pa

from evocity.citymap import CityMap
from evocity.columns import column_of


@dataclass(frozen=True, eq=False)
class Expressed:
    """What a genome stands for: its map, or why it has none.

    city : the map that is measured, None without one.
    problem : in words, why there is none.
    """

    city: CityMap | None
    problem: str | None = None


class Kind(Protocol):
    """A kind of chromosome. ``header`` is the run's `evocity.store.Header` throughout; ``locked``
    what is condensed in every genome of the run, or None."""

    name: str
    #: Operators that breed the first population, of two sources and of one: the first of each that
    #: a recipe has, else the last.
    first: tuple[tuple[str, ...], tuple[str, ...]]

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
