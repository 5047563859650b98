"""Replay: births of a run bred and measured a second time, and compared bit for bit."""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import groupby

from evocity.errors import RunError, check_number, keyword
from evocity.evaluation import Engine
from evocity.search.breeding.birth_plans import BirthPlan
from evocity.search.breeding.births import LOST, Offspring, breed_plans, stream_offspring
from evocity.search.preparation.preparation import Prepared
from evocity.search.preparation.startup import Crew, compile_and_start
from evocity.search.preparation.trust import Permission
from evocity.search.record.complete_run import CompleteRun, differences
from evocity.search.resume.logged_plans import plans_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.search.resume.recipe_changes import columns_of
from evocity.store import Birth, RunLog


@dataclass(frozen=True)
class Replayed:
    """One birth, recomputed.

    same : whether all is the same, bit for bit; None if that cannot be decided.
    differs : column of the births -> value in the log (``then``) and new value (``now``):
        ``parents``, ``operator``, ``status``, ``genome`` (its digest), ``fitness.NAME``.
    reason : why it cannot be decided.
    """

    id: int
    same: bool | None
    differs: Mapping[str, Mapping] = field(default_factory=dict)
    reason: str | None = None


def replay(
    run: RunLog | str | os.PathLike,
    ids: Sequence[int] | None = None,
    trust: bool = False,
    accept_changes: bool = False,
    workers: int = 0,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Replayed]:
    """Repeat births of a run, and compare the parents, operator, child and measures of each birth
    with the log. Return one result for each of the ``ids``, in the same order.

    The run may be in progress; replaying births does not change the run. Replaying executes the
    measure files in the run folder.

    ids : ids of the births to repeat; None repeats all births.
    trust, accept_changes : permissions to execute measures and to accept changes, as in
        `evocity.Search.resume`.
    workers : number of worker processes, which obey the recipe's deadline and memory limit. With
        ``workers=0``, the calling process repeats the births, without limits of time and memory.
        Births that exceeded a limit, or whose worker died, are not measured; they are bred only if
        the log has their genome.
    progress : function that is called with the number of finished births.

    Raises `RunError` if one of the ``ids`` is not a birth of the run; see `evocity.Search.resume`
    for further causes.
    """
    run = run if isinstance(run, RunLog) else CompleteRun(run)
    expected = "a whole number of processes, 0 or more"
    remedy = "pass 0 to use this process, or a number of worker processes"
    check_number("workers", workers, 0, math.inf, expected, RunError, remedy, whole=True)
    known = run.births(columns=["id"])["id"].to_pylist()
    ids = known if ids is None else list(ids)
    known = set(known)
    unknown = [one for one in ids if isinstance(one, bool) or one not in known]
    run.individuals(unknown, rebred=False)  # refused before anything is executed
    permission = Permission(trust, accept_changes)
    prepared, _ = read_preparation(run, None, permission)
    done: dict[int, Replayed] = {}
    size = run.header.population
    for number, group in groupby(sorted(set(ids)), lambda one: _recipe_number(run, one // size)):
        then = prepared if number is None else _earlier_preparation(run, number, permission)
        for replayed in _replay_ids(run, then, list(group), workers):
            done[replayed.id] = replayed
            progress(len(done))
    return [done[identifier] for identifier in ids]


def _replay_ids(
    run: RunLog, prepared: Prepared, ids: list[int], workers: int
) -> Iterator[Replayed]:
    crew, size = Crew(workers), run.header.population
    with closing(compile_and_start(prepared, crew, lambda text: None)) as engine:
        for _, group in groupby(plans_of(run, prepared, ids), lambda plan: plan.id // size):
            plans = {plan.id: plan for plan in group}
            births = {birth.id: birth for birth in run.individuals(list(plans), rebred=False)}
            if crew.in_process:
                for birth in births.values():
                    if birth.status in LOST:
                        yield _breed_only(birth, plans.pop(birth.id), engine)
            for child in stream_offspring(engine, iter(plans.values())):
                yield _compare(births[child.plan.id], child, prepared)


def _compare(then: Birth, child: Offspring, prepared: Prepared) -> Replayed:
    """Measures of a later recipe, which scored ``then`` again, are left out."""
    columns = prepared.header.columns
    own = {name: value for name, value in then.values.items() if name in columns}
    now = child.birth(then.generation, prepared.aims)
    found = differences(replace(then, values=own), now)
    return Replayed(then.id, not found, found)


def _breed_only(then: Birth, plan: BirthPlan, engine: Engine) -> Replayed:
    """A birth that ended as only worker processes can end is not measured in this process."""
    reason = f"it ended by {then.status}: only worker processes can measure it again"
    hint = f"; ask for some: {keyword('workers', 1)}"
    now = replace(then, operator=plan.name, parents=tuple(plan.parents))
    if then.digest is not None and not hasattr(plan.operator, "bred_within"):
        (child,) = breed_plans(engine, [plan])
        now = replace(now, genome=child.breeding.genome)
    found = differences(then, now)
    return Replayed(then.id, False if found else None, found, None if found else reason + hint)


# -- earlier recipes --------------------------------------------------------------------------


def _recipe_number(run: RunLog, generation: int) -> int | None:
    """The number of the earlier recipe that bred a ``generation``; None for the present one."""
    notes = enumerate(run.provenance["recipe"].get("before", ()), 1)
    return next((number for number, note in notes if generation < note["generations"]), None)


def _earlier_preparation(run: RunLog, number: int, permission: Permission) -> Prepared:
    then = CompleteRun(run.path)
    notes = run.provenance["recipe"]["before"][number - 1 :]
    then.provenance = {**run.provenance, "recipe": run.provenance["recipe"] | notes[0]}
    measures = next((note["measures"] for note in notes if "measures" in note), None)
    if measures is not None:  # the run had others then
        then.provenance |= {"recorded": [], **measures}
        then.header = replace(run.header, **columns_of(then.provenance))
    then.recipe_text = run.earlier_recipe(number)
    if then.recipe_text is None:
        raise RunError(
            f"the recipe {run.path / notes[0]['file']} is missing",
            "the file of the recipe that bred these births",
            "restore the file from a backup",
        )
    overrides = {"run.generations": max(1, len(run.generations) - 1)}
    return read_preparation(then, overrides, permission)[0]
