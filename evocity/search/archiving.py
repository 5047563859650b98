"""The archive of a run: of all births ever, those that no other dominates.

A population has a fixed size and forgets what it has no room for. The log does not:
this reads it, columns alone. Nothing of the run is executed, no measure is loaded.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from evocity.errors import EvocityError, RunError
from evocity.fitness import Aims, Constraint, Measure, Objective, Wanted
from evocity.search.commands import Standing
from evocity.search.fronts import Hypervolume, crowding_of, not_dominated, ranks_of
from evocity.store import Run

_ROWS = 20_000  # births that are compared with the archive at a time
_HEAVIEST = 1e9  # weight that a recipe may give

# Points up to which the exact hypervolume of so many objectives takes a second or two.
_MOST_POINTS = {5: 10_000, 6: 1_000, 7: 250, 8: 120}
_MOST_POINTS_OF_MORE = 40


@dataclass(frozen=True)
class Archive:
    """The births of a run that no other ever dominated; made by `archive`.

    Attributes
    ----------
    births : Arrow table by id: ``generation``, ``id``, ``fitness.<name>`` of each measure,
        ``crowding`` (distance within the archive: the higher, the further from the others) and
        ``alive`` (it, or one equal in all goals, lives in the last generation).
    hypervolume : of the archive, in units of the first population's ranges as in the run's
        history; None where so many births of so many goals would take minutes.
    hypervolume_alive : of those of the last generation that break no constraint.
    """

    births: pa.Table
    hypervolume: float | None
    hypervolume_alive: float

    def __len__(self) -> int:
        return len(self.births)


def archive(run: Run, last: int | None = None) -> Archive:
    """Of all births of ``run`` those that no other dominates, by the run's goals; up to the
    generation ``last``, the last whole one unless it is given. While the run goes on, nothing born
    after that generation counts.

    What counts are births with status ``ok`` that keep all constraints; of those equal in all
    goals the earliest alone. Goals, targets, weights and bounds are those that
    ``provenance.json`` records.

    Raises `RunError` if the run has no whole generation yet, is damaged, or does not tell what
    it wanted.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> evocity.archive(run).births.to_pandas()  # doctest: +SKIP
    """
    aims = aims_of_run(run)
    # a run may go on meanwhile: the generation is settled before anything of it is read
    last = len(run.generations) - 1 if last is None else last
    births = _measured(run, aims.bounds)
    births = births.filter(pc.less_equal(births["generation"], last))
    living = pc.is_in(births["id"], value_set=run.members(last)["id"]).to_numpy()
    first = pc.equal(births["generation"], pc.min(births["generation"])).to_numpy()
    chosen = np.empty(0, np.intp)
    front = np.empty((0, len(aims.names)))
    units, alive = [front], [front]
    for start in range(0, len(births), _ROWS):
        losses, kept = _judged(births.slice(start, _ROWS), aims)
        here = slice(start, start + _ROWS)
        units.append(losses[first[here]])
        alive.append(losses[living[here] & kept])
        front = np.vstack([front, losses[kept]])
        chosen = np.concatenate([chosen, start + np.flatnonzero(kept)])
        among = not_dominated(front)
        front, chosen = front[among], chosen[among]
    alive = np.vstack(alive)
    lives = set(map(tuple, alive.tolist()))
    crowding = crowding_of(front, ranks_of(front))
    table = births.take(pa.array(chosen)).drop_columns(["status"])
    table = table.append_column("crowding", pa.array(crowding, pa.float64()))
    found = [row in lives for row in map(tuple, front.tolist())]
    table = table.append_column("alive", pa.array(found, pa.bool_()))
    if not len(births):
        return Archive(table, 0.0, 0.0)
    volume = Hypervolume(np.vstack(units))
    most = _MOST_POINTS.get(len(aims.names), _MOST_POINTS_OF_MORE)
    small = len(aims.names) < 5 or len(front) <= most
    return Archive(
        table,
        (volume(front) if len(front) else 0.0) if small else None,
        volume(alive) if len(alive) else 0.0,
    )


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
    measure = Measure(noted["name"], _uncalled, None, "", (-math.inf, math.inf), "", "", 0)
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


def _uncalled(city) -> float:
    raise NotImplementedError("a measure known by its name alone")


def _measured(run: Run, bounds: Collection[str]) -> pa.Table:
    """Generation, id and values of all births with status ``ok``, by id; of measures that are
    ``bounds`` alone there may be none."""
    values = [f"fitness.{name}" for name in run.header.measures]
    births = run.births(columns=["generation", "id", "status", *values])
    births = births.filter(pc.equal(births["status"], "ok")).replace_schema_metadata(None)
    births = births.sort_by("id").combine_chunks()
    sought = [name for name in values if name.removeprefix("fitness.") not in bounds]
    columns = [births[name].to_numpy(zero_copy_only=False) for name in sought]
    known = all(np.isfinite(column.astype(np.float64)).all() for column in columns)
    if not known or len(pc.unique(births["id"])) < len(births):
        raise RunError(
            f"{run.path}: the births are damaged: one stands there twice, or is without a number",
            "births as `evocity run` writes them, a finite number for each measure of those alive",
            "bring the file back from a copy",
        )
    return births


def _judged(births: pa.Table, aims: Aims) -> tuple[np.ndarray, np.ndarray]:
    """Losses ``(n, goals)`` of ``births``, and bool ``(n,)``: which keep all constraints."""
    names = [wanted.measure.name for wanted in aims.wanted]
    columns = [births[f"fitness.{name}"].to_numpy().astype(np.float64).tolist() for name in names]
    every = [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
    losses = np.array([aims.losses(values) for values in every]).reshape(-1, len(aims.names))
    kept = np.array([aims.violation(values) == 0 for values in every], bool)
    return losses, kept
