"""Aims of a logged run: its goals and constraints, and by them the losses of its births.

Nothing of the run is executed, no measure is loaded.
"""

import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of, known_of, words_of
from evocity.errors import EvocityError, RunError
from evocity.fitness import Aims, Constraint, Measure, Objective, Wanted
from evocity.search.record.commands import StandingOrders
from evocity.store import Birth, Header, RunLog

#: What a damaged provenance raises where it is read.
DAMAGE = (LookupError, TypeError, AttributeError, ValueError)
_HEAVIEST = 1e9  # weight that a recipe may give
_MOST = sys.float_info.max


def aims_of_run(run: RunLog) -> Aims:
    """Read the goals and constraints of a ``run`` from its provenance, with the weights in force.
    Its measures have only names and cannot be called. Raises `RunError` for a damaged goal."""
    try:
        noted = {one["name"]: one for one in run.provenance["fitness"]}
        aims = Aims(tuple(_wanted_of(noted[name]) for name in run.header.measures))
        aims = aims.reweighted(StandingOrders.of(run.events(), len(run.generations)).weights)
        if not aims.names:
            raise ValueError("only constraints")
    except (*DAMAGE, ArithmeticError, EvocityError) as error:
        own = isinstance(error, EvocityError)
        reason = str(error).splitlines()[0] if own else f"{type(error).__name__}: {error}"
        raise damaged_provenance(run, f"lacks a measure's goal ({reason})") from error
    return aims


@contextmanager
def provenance_read(run: RunLog) -> Iterator[None]:
    """Raise errors of reading a damaged provenance as `RunError`."""
    try:
        yield
    except DAMAGE as error:
        raise damaged_provenance(run, f"lacks a part ({error!r})") from None


def damaged_provenance(run: RunLog, lack: str) -> RunError:
    """Return the error for a provenance with this ``lack``."""
    return RunError(
        f"{run.path}: provenance.json {lack}",
        "a file provenance.json as `evocity run` writes it",
        "restore the file from a backup",
    )


def _wanted_of(noted: dict) -> Wanted:
    measure = uncallable_measure(noted["name"])
    goal, low, high = (noted.get(key) for key in ("goal", "min", "max"))
    total = noted.get("objective")
    if goal is None and (low, high) == (None, None):
        raise ValueError(f"no goal for {noted['name']}")
    weight = float(noted.get("weight", 1.0))
    if not 0 < weight <= _HEAVIEST:
        raise ValueError(f"a weight of {weight} for {noted['name']}")
    return Wanted(
        measure,
        None if goal is None else Objective(measure, goal, noted.get("target")),
        None if (low, high) == (None, None) else Constraint(measure, low, high),
        weight,
        None if total is None else str(total),
    )


def uncallable_measure(name: str) -> Measure:
    """Return a measure that has a ``name`` and cannot be called."""
    return Measure(name, _refuse_call, None, "", (-math.inf, math.inf), "", "", 0)


def _refuse_call(city) -> float:
    raise NotImplementedError("a measure of which only the name is known")


def measured_births(run: RunLog, bounds: Collection[str], recorded: Sequence[str] = ()) -> pa.Table:
    """Read the generation, id and values of all births with status ``ok``, by id. Only ``bounds``
    and ``recorded`` measures may lack values; births without a value of a goal are left out."""
    values = [f"fitness.{name}" for name in run.header.measures]
    others = [f"fitness.{name}" for name in recorded if name not in run.header.measures]
    births = run.births(columns=["generation", "id", "status", "feasible", *values, *others])
    ok = column_of(words_of(births["status"]) == "ok")
    births = births.filter(ok).replace_schema_metadata(None)
    goals = [name for name in values if name.removeprefix("fitness.") not in bounds]
    complete = array_of(births["feasible"])
    if goals:
        complete = complete | np.logical_and.reduce([known_of(births[name]) for name in goals])
    births = births.filter(column_of(complete)).drop_columns(["feasible"])
    births = births.sort_by("id").combine_chunks()
    columns = [array_of(births[name]) for name in goals]
    known = all(np.isfinite(column.astype(np.float64)).all() for column in columns)
    if not known or len(np.unique(array_of(births["id"]))) < len(births):
        raise RunError(
            f"{run.path}: the log of births is damaged: an id occurs twice, or a number is missing",
            "births as `evocity run` writes them, with one id and finite numbers for each birth",
            "restore the folder from a backup",
        )
    return births


def judge_births(births: pa.Table, aims: Aims) -> tuple[np.ndarray, np.ndarray]:
    """Return the losses ``(n, goals)`` of ``births``, and bool ``(n,)``: which keep all
    constraints."""
    names = [wanted.measure.name for wanted in aims.wanted]
    values = {name: array_of(births[f"fitness.{name}"]).astype(np.float64) for name in names}
    return losses_of(aims, values), violations_of(aims, values) == 0


def losses_of(aims: Aims, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Compute `Aims.losses` of many births, the same to the bit: from measure -> ``(n,)`` values,
    NaN for none, the losses ``(n, goals)``."""
    goals: dict[str, np.ndarray] = {}
    with np.errstate(all="ignore"):
        for one in aims.wanted:
            if one.objective is None:
                continue
            value, name = values[one.measure.name], one.total or one.measure.name
            loss = _finite(one.weight * _finite(_loss(one.objective, value)))
            goals[name] = goals.get(name, 0.0) + loss  # in the order of their sum
        columns = [_finite(goals[name]) for name in aims.names]
    return np.column_stack(columns) if columns else np.empty((0, 0))


def _loss(objective: Objective, values: np.ndarray) -> np.ndarray:
    if objective.goal in ("max", "min"):
        return -values if objective.goal == "max" else values
    return np.abs(values - objective.target)


def violations_of(aims: Aims, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Compute `Aims.violation` of many births, the same to the bit: ``(n,)``, 0 if all constraints
    are kept."""
    total = np.zeros(len(next(iter(values.values()), ())))
    lacking = np.zeros(len(total), bool)
    with np.errstate(all="ignore"):
        for one in aims.wanted:
            if one.objective is not None:
                lacking |= np.isnan(values[one.measure.name])
            if one.constraint is not None:
                total = total + _violation(one.constraint, values[one.measure.name])
        return np.where(lacking, _MOST, _finite(total))


def _violation(bounds: Constraint, values: np.ndarray) -> np.ndarray:
    low, high = bounds.low, bounds.high
    beyond = np.zeros(len(values))
    if low is not None:
        beyond = np.maximum(beyond, low - values)
    if high is not None:
        beyond = np.maximum(beyond, values - high)
    size = abs(high if low is None else low) if None in (low, high) else high - low
    return np.where(np.isnan(values), _MOST, _finite(beyond / (size or 1.0)))


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isnan(values), _MOST, np.clip(values, -_MOST, _MOST))


@dataclass(frozen=True)
class Digest:
    """The digest of a genome, in place of the genome."""

    digest: str


def births_without_genomes(run: RunLog, generation: int) -> list[Birth]:
    """Read the births of a ``generation``: status, values and digests, without parents, errors and
    genomes."""
    return births_of_table(run.births(generation, columns_but_genomes(run.header)), run.header)


def iterate_generations(run: RunLog) -> Iterator[list[Birth]]:
    """Read `births_without_genomes` of all generations of a ``run``, in order. The log is read
    once: to find each generation among hundreds in a file takes longer than to read the file."""
    births = run.births(columns=columns_but_genomes(run.header))
    return (births_of_table(table, run.header) for table in split_generations(births))


def split_generations(rows: pa.Table) -> Iterator[pa.Table]:
    """Split ``rows`` of births, or of the membership, into those of each generation, in order."""
    rows = rows.combine_chunks()
    born = array_of(rows["generation"])
    ends = np.searchsorted(born, np.arange(born.max(initial=-1) + 2)).tolist()
    return (rows.slice(start, end - start) for start, end in pairwise(ends))


def columns_but_genomes(header: Header) -> list[str]:
    """Return the columns that `births_of_table` reads."""
    names = ["generation", "id", "operator", "status", "genome"]
    names += [f"fitness.{name}" for name in header.columns]
    return names + (["island"] if header.islands else [])


def births_of_table(births: pa.Table, header: Header) -> list[Birth]:
    """Convert a table of births, as `births_without_genomes` does."""
    names = [(name, f"fitness.{name}") for name in header.columns]
    return [
        Birth(
            row["generation"],
            row["id"],
            (),
            row["operator"],
            row["status"],
            None,
            0.0,
            {name: row[column] for name, column in names if row[column] is not None},
            None if row["genome"] is None else Digest(row["genome"]),
            island=row.get("island"),
        )
        for row in births.select(columns_but_genomes(header)).to_pylist()
    ]
