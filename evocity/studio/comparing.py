"""Births put in order by how they differ: likeness to one, or those that differ most first."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from evocity.analysis.asked import check_count
from evocity.analysis.spread import farthest_first
from evocity.errors import RunError
from evocity.studio.asked import Body
from evocity.studio.picks import Id
from evocity.studio.watched import Moment

#: Births of which maps or genomes are compared, or each with all others, at most.
MOST_COMPARED = 400
_AT_A_TIME = 64


class Compare(Body):
    """What is asked for: how far ``ids`` are from ``to``, or, where that is None, in which order
    each differs most from all before it; ``by`` what `evocity.analysis.likeness` calls so."""

    by: Literal["looks", "scores", "kin"]
    ids: Annotated[list[Id], Field(min_length=1, max_length=200_000)]
    to: Id | None = None


def compared(moment: Moment, asked: Compare) -> bytes:
    """Float32 of each of the ``ids``: how far it is, 0 for what is the same; or its place, 1
    upwards. NaN of those that cannot be compared, because they failed, or the log leaves their
    genome out. Raises `EvocityError` for more than `MOST_COMPARED` where each takes long,
    `RunError` for what is no birth, and where ``to`` itself cannot be compared."""
    ids = np.array(list(dict.fromkeys(asked.ids)), np.int64)
    if asked.to is None or asked.by != "scores":
        check_count("births that are compared", len(ids), MOST_COMPARED)
    told = moment.run.told
    every = ids if asked.to is None else np.append(ids, asked.to)
    known = told.ok[told.rows(every)]
    if asked.by != "scores":
        known &= np.isin(every, _read(moment, every[known].tolist()))
    if asked.to is not None and not known[-1]:
        raise RunError(
            f"birth {asked.to} failed, or the log leaves its genome out",
            "one that others can be compared with",
            "choose another",
        )
    found = np.full(len(ids), np.nan, np.float32)
    kept = known[: len(ids)]
    if asked.to is not None:
        found[kept] = moment.likeness.from_one(asked.to, ids[kept], asked.by)
    else:
        matrix = moment.likeness.matrix(ids[kept], asked.by)
        places = farthest_first(matrix, len(matrix))
        ranks = np.empty(len(matrix), np.float32)
        ranks[places] = np.arange(1, len(matrix) + 1)
        found[kept] = ranks
    return found.astype("<f4").tobytes()


def _read(moment: Moment, ids: list[int]) -> list[int]:
    """Those of ``ids`` whose genome is in the log and stands for a map, which is kept."""
    found = []
    for start in range(0, len(ids), _AT_A_TIME):
        some = ids[start : start + _AT_A_TIME]
        for birth in moment.run.individuals(some, rebred=False):
            city = None if birth.genome is None else moment.run.told.expressed(birth).city
            if city is not None:
                moment.likeness.note(birth.id, city)
                found.append(birth.id)
    return found


__all__ = ["MOST_COMPARED", "Compare", "compared"]
