"""Births of a run bred and measured once more: whether they are the same, bit for bit."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import groupby

from evocity.errors import RunError, keyword
from evocity.fitness.shipping import shipped
from evocity.search.beginning import Crew, pool_of, sides_of
from evocity.search.births import LOST, Born, bred, coming
from evocity.search.breeding import Plan
from evocity.search.compiling import compile_once, needed
from evocity.search.differing import differences
from evocity.search.evaluation import Engine
from evocity.search.opening import open_run
from evocity.search.preparation import Prepared
from evocity.search.replaying import plans_of
from evocity.search.rereading import read_again
from evocity.search.revising import columns_of
from evocity.store import Birth, Run


@dataclass(frozen=True)
class Replayed:
    """One birth, recomputed.

    same : whether all is the same, bit for bit; None where that cannot be told.
    differs : column of the births -> what the log tells (``then``) and what was found (``now``):
        ``parents``, ``operator``, ``status``, ``genome`` (its digest), ``fitness.NAME``.
    reason : why it cannot be told.
    """

    id: int
    same: bool | None
    differs: Mapping[str, Mapping] = field(default_factory=dict)
    reason: str | None = None


def replay(
    run: Run | str | os.PathLike,
    ids: Sequence[int] | None = None,
    trust: bool = False,
    accept_changes: bool = False,
    workers: int = 0,
    progress: Callable[[int], None] = lambda done: None,
) -> list[Replayed]:
    """Recompute births of a ``run`` from its log: who bred them, by which operator, the child, and
    its measures; and compare each with what the log tells. In the order of ``ids``.

    The run stays as it is, and may be going on. What it brings of measures is executed.

    ids : of the births; None for all.
    trust, accept_changes : as `evocity.Search.resume` has them.
    workers : processes, which have the recipe's deadline and memory; 0 does it in this process,
        without either. Then a birth that ended by a timeout, by memory or because its worker died
        is bred, if the log has its genome, and not measured.
    progress : told how many births are done.

    Raises `RunError` as `evocity.Search.resume` does, and for ids that are none of the run's.
    """
    run = run if isinstance(run, Run) else open_run(run)
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 0:
        raise RunError(f"workers={workers!r}", "a whole number, 0 or more", "correct it")
    known = run.births(columns=["id"])["id"].to_pylist()
    ids = known if ids is None else list(ids)
    run.individuals(_strange(ids, set(known)), rebred=False)  # refused before anything is executed
    prepared, _ = read_again(run, None, accept_changes, trust)
    found: dict[int, Replayed] = {}
    size = run.header.population
    for era, own in groupby(sorted(set(ids)), lambda one: _era(run, one // size)):
        then = prepared if era is None else _prepared_then(run, era, accept_changes, trust)
        for one in _replayed(run, then, list(own), workers):
            found[one.id] = one
            progress(len(found))
    return [found[one] for one in ids]


def _strange(ids: Sequence[int], known: set[int]) -> list[int]:
    """Those of the ``ids`` that are none."""
    return [one for one in ids if isinstance(one, bool) or one not in known]


def _replayed(run: Run, prepared: Prepared, ids: list[int], workers: int) -> Iterator[Replayed]:
    """Births that one recipe bred."""
    recipe, size = prepared.recipe, run.header.population
    compile_once(sides_of(recipe, prepared), needed(recipe), lambda text: None)
    crew = Crew(workers)
    sent = () if crew.here else shipped([*recipe.measures, *recipe.recorded])
    ignored: Callable[[str], None] = lambda text: None  # noqa: E731
    with closing(pool_of(prepared, crew, sent, ignored, ignored)) as engine:
        for _, group in groupby(plans_of(run, prepared, ids), lambda plan: plan.id // size):
            plans = {plan.id: plan for plan in group}
            births = run.individuals(list(plans), rebred=False)
            if crew.here:
                lost = {birth.id for birth in births if birth.status in LOST}
                yield from (_bred_alone(b, plans.pop(b.id), engine) for b in births if b.id in lost)
            then = {birth.id: birth for birth in births}
            for one in coming(engine, iter(plans.values())):
                yield _compared(then[one.plan.id], one, prepared)


def _compared(then: Birth, now: Born, prepared: Prepared) -> Replayed:
    """Measures of a later recipe, by which ``then`` was scored again, are left out."""
    columns = prepared.header.columns
    own = {name: value for name, value in then.values.items() if name in columns}
    found = differences(replace(then, values=own), now.birth(then.generation, prepared.aims))
    return Replayed(then.id, not found, found)


def _bred_alone(then: Birth, plan: Plan, engine: Engine) -> Replayed:
    """One that ended as only a worker process can end: it is not measured here."""
    reason = f"it ended by {then.status}: it is measured again by worker processes alone"
    hint = f"; ask for some: {keyword('workers', 1)}"
    if then.digest is None or hasattr(plan.operator, "bred_within"):
        made = replace(then, operator=plan.name, parents=tuple(plan.parents))
    else:
        (one,) = bred(engine, [plan])
        made = replace(
            then, operator=plan.name, parents=tuple(plan.parents), genome=one.bred.genome
        )
    found = differences(then, made)
    return Replayed(then.id, False if found else None, found, None if found else reason + hint)


# -- recipes of before ------------------------------------------------------------------------


def _era(run: Run, generation: int) -> int | None:
    """Which of the run's earlier recipes bred a ``generation``, from 1; None for its present
    one."""
    for number, note in enumerate(run.provenance["recipe"].get("before", ()), 1):
        if generation < note["generations"]:
            return number
    return None


def _prepared_then(run: Run, number: int, accept_changes: bool, trust: bool) -> Prepared:
    """What the ``run`` was prepared with when it went by its earlier recipe of this ``number``."""
    then = open_run(run.path)
    notes = run.provenance["recipe"]["before"][number - 1 :]
    note = notes[0]
    then.provenance = {**run.provenance, "recipe": run.provenance["recipe"] | note}
    measures = next((one["measures"] for one in notes if "measures" in one), None)
    if measures is not None:  # the run had others then
        then.provenance |= {"recorded": [], **measures}
        then.header = replace(run.header, **columns_of(then.provenance))
    then.recipe_text = run.earlier_recipe(number)
    if then.recipe_text is None:
        raise RunError(
            f"{run.path / note['file']} is not there",
            "the recipe that the births were bred by",
            "bring the file back from a copy",
        )
    asked = {"run.generations": max(1, len(run.generations) - 1)}
    return read_again(then, asked, accept_changes, trust)[0]


__all__ = ["Replayed", "replay"]
