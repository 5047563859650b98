"""What a run tells of its births: raw values, losses and constraints, by what it noted it wanted.

Nothing of the run is executed, no measure is loaded.
"""

import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of, known_of, words_of
from evocity.errors import EvocityError, RunError
from evocity.fitness import Aims, Constraint, Measure, Objective, Wanted
from evocity.search.commands import Standing
from evocity.store import Birth, Header, Run

_HEAVIEST = 1e9  # weight that a recipe may give
_MOST = sys.float_info.max


def aims_of_run(run: Run) -> Aims:
    """What the run wants, as ``provenance.json`` records it, by the weights it has now.

    The measures in it have names alone and cannot be called: those of a stranger's run may not
    be here. Raises `RunError` if a measure's goal is not told, or cannot be.
    """
    try:
        noted = {one["name"]: one for one in run.provenance["fitness"]}
        aims = Aims(tuple(_wanted(noted[name]) for name in run.header.measures))
        aims = aims.reweighted(Standing.of(run.events(), len(run.generations)).weights)
        if not aims.names:
            raise ValueError("constraints alone")
    except (LookupError, TypeError, AttributeError, ValueError, ArithmeticError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise _unknown(run, reason) from error
    except EvocityError as error:
        raise _unknown(run, str(error).splitlines()[0]) from error
    return aims


def _unknown(run: Run, reason: str) -> RunError:
    return RunError(
        f"{run.path}: provenance.json does not tell what was wanted of each measure ({reason})",
        "a provenance as `evocity run` writes it",
        "bring the file back from a copy",
    )


def _wanted(noted: dict) -> Wanted:
    measure = named_alone(noted["name"])
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


def named_alone(name: str) -> Measure:
    """A measure that has a ``name`` and cannot be called."""
    return Measure(name, _uncalled, None, "", (-math.inf, math.inf), "", "", 0)


def _uncalled(city) -> float:
    raise NotImplementedError("a measure known by its name alone")


def measured(run: Run, bounds: Collection[str], recorded: Sequence[str] = ()) -> pa.Table:
    """Generation, id and values of all births with status ``ok``, by id; of measures that are
    ``bounds`` alone, and of those ``recorded``, there may be none. Left out are births of before a
    measure was wanted that have no value of it: they are not judged."""
    values = [f"fitness.{name}" for name in run.header.measures]
    others = [f"fitness.{name}" for name in recorded if name not in run.header.measures]
    births = run.births(columns=["generation", "id", "status", "feasible", *values, *others])
    ok = column_of(words_of(births["status"]) == "ok")
    births = births.filter(ok).replace_schema_metadata(None)
    sought = [name for name in values if name.removeprefix("fitness.") not in bounds]
    complete = array_of(births["feasible"])
    if sought:
        complete = complete | np.logical_and.reduce([known_of(births[name]) for name in sought])
    births = births.filter(column_of(complete)).drop_columns(["feasible"])
    births = births.sort_by("id").combine_chunks()
    columns = [array_of(births[name]) for name in sought]
    known = all(np.isfinite(column.astype(np.float64)).all() for column in columns)
    if not known or len(np.unique(array_of(births["id"]))) < len(births):
        raise RunError(
            f"{run.path}: the births are damaged: one stands there twice, or is without a number",
            "births as `evocity run` writes them, a finite number for each measure of those alive",
            "bring the file back from a copy",
        )
    return births


def judged(births: pa.Table, aims: Aims) -> tuple[np.ndarray, np.ndarray]:
    """Losses ``(n, goals)`` of ``births``, and bool ``(n,)``: which keep all constraints."""
    names = [wanted.measure.name for wanted in aims.wanted]
    values = {name: array_of(births[f"fitness.{name}"]).astype(np.float64) for name in names}
    return losses_of(aims, values), broken_by(aims, values) == 0


def losses_of(aims: Aims, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """`Aims.losses` of many births, the same to the bit: measure -> ``(n,)`` values, NaN for none,
    become losses ``(n, goals)``."""
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


def broken_by(aims: Aims, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """`Aims.violation` of many births, the same to the bit: ``(n,)``, 0 where all constraints are
    kept."""
    found = np.zeros(len(next(iter(values.values()), ())))
    lacking = np.zeros(len(found), bool)
    with np.errstate(all="ignore"):
        for one in aims.wanted:
            if one.objective is not None:
                lacking |= np.isnan(values[one.measure.name])
            if one.constraint is not None:
                found = found + _violation(one.constraint, values[one.measure.name])
        return np.where(lacking, _MOST, _finite(found))


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
    """In place of a genome that is not needed."""

    digest: str


def births_without_genomes(run: Run, generation: int) -> list[Birth]:
    """The births of a ``generation``: how they ended and what they were measured to be, without
    parents and errors; for genomes stand their digests alone."""
    return without_genomes(run.births(generation, columns_without(run.header)), run.header)


def every_generation(run: Run) -> Iterator[list[Birth]]:
    """`births_without_genomes` of all of a ``run``, one generation after the other. The log is read
    once: to look for each generation among hundreds of a file takes longer than to read it."""
    births = run.births(columns=columns_without(run.header))
    return (without_genomes(one, run.header) for one in by_generation(births))


def by_generation(rows: pa.Table) -> Iterator[pa.Table]:
    """Of all ``rows`` of births, or of the membership, those of each generation, in order."""
    rows = rows.combine_chunks()
    born = array_of(rows["generation"])
    ends = np.searchsorted(born, np.arange(born.max(initial=-1) + 2)).tolist()
    return (rows.slice(start, end - start) for start, end in pairwise(ends))


def columns_without(header: Header) -> list[str]:
    """The columns that `without_genomes` reads."""
    names = ["generation", "id", "operator", "status", "genome"]
    names += [f"fitness.{name}" for name in header.columns]
    return names + (["island"] if header.islands else [])


def without_genomes(births: pa.Table, header: Header) -> list[Birth]:
    """As `births_without_genomes`, of a table."""
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
        for row in births.select(columns_without(header)).to_pylist()
    ]
