"""The order of births by how they differ: by likeness to one birth, or the most different first."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from evocity.analysis.arguments import check_count
from evocity.analysis.clusters import farthest_first
from evocity.errors import RunError
from evocity.studio.request_fields import Body, Id
from evocity.studio.run_watcher import Moment

#: Births whose maps or genomes are compared, or that are compared with all others; at most.
MOST_COMPARED = 400
_BATCH = 64


class Comparison(Body):
    """A request for the distances of ``ids`` from ``to``. Without ``to``: for the order in which
    each birth differs most from all before it. ``by``: a measure of `evocity.analysis.likeness`."""

    by: Literal["looks", "scores", "kin"]
    ids: Annotated[list[Id], Field(min_length=1, max_length=200_000)]
    to: Id | None = None


def compare_births(moment: Moment, request: Comparison) -> bytes:
    """Return a float32 for each of the ``ids``: its distance, 0 for equal births; or its place, 1
    upwards. NaN for births that failed or whose genome is not in the log. Raises `EvocityError`
    for more than `MOST_COMPARED` births where each takes long. Raises `RunError` for an unknown id
    and for a ``to`` that cannot be compared."""
    ids = np.array(list(dict.fromkeys(request.ids)), np.int64)
    if request.to is None or request.by != "scores":
        check_count("births to compare", len(ids), MOST_COMPARED)
    births = moment.run.columns
    every = ids if request.to is None else np.append(ids, request.to)
    known = births.ok[births.rows(every)]
    if request.by != "scores":
        known &= np.isin(every, _note_maps(moment, every[known].tolist()))
    if request.to is not None and not known[-1]:
        raise RunError(
            f"birth {request.to} failed, or its genome is not in the log",
            "a birth with a genome in the log",
            "choose another birth",
        )
    values = np.full(len(ids), np.nan, np.float32)
    kept = known[: len(ids)]
    if request.to is not None:
        values[kept] = moment.likeness.from_one(request.to, ids[kept], request.by)
    else:
        matrix = moment.likeness.matrix(ids[kept], request.by)
        ranks = np.empty(len(matrix), np.float32)
        ranks[farthest_first(matrix, len(matrix))] = np.arange(1, len(matrix) + 1)
        values[kept] = ranks
    return values.astype("<f4").tobytes()


def _note_maps(moment: Moment, ids: list[int]) -> list[int]:
    """Note the maps of births for the comparison; return the ``ids`` that have a map."""
    mapped = []
    for start in range(0, len(ids), _BATCH):
        for birth in moment.run.individuals(ids[start : start + _BATCH], rebred=False):
            city = None if birth.genome is None else moment.run.columns.expressed(birth).city
            if city is not None:
                moment.likeness.note(birth.id, city)
                mapped.append(birth.id)
    return mapped
