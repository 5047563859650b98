"""Rescoring: the old births of a run measured by another recipe, and its log rewritten.

Nobody is bred again, and each generation keeps its members. The new goals judge them all: ranks,
marks, hypervolume and best of every generation are recomputed, in units of the first generation by
the new goals.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from datetime import timedelta
from itertools import count

import pyarrow as pa
import pyarrow.compute as pc

from evocity.errors import RunError
from evocity.evaluation import Engine
from evocity.evaluation.evaluator import UNRECORDED, Outcome, unrecorded
from evocity.fitness import Aims
from evocity.search.breeding.archipelago import Archipelago
from evocity.search.preparation.preparation import Prepared
from evocity.search.record.aims import births_of_table, births_without_genomes
from evocity.store import Birth, Header, RunLog, RunWriter
from evocity.store.schema import shortened_error

#: Births whose genomes are in memory at a time, or up to twice as many.
_AT_ONCE = 256
#: Seconds between two reports of progress.
_BETWEEN = 5.0


def rescore_run(
    run: RunLog,
    prepared: Prepared,
    writer: RunWriter,
    about: Mapping,
    start: Callable[[Prepared], Engine],
    tell: Callable[[str], None],
) -> dict:
    """Rewrite the log of a ``run`` by the header and the goals of ``prepared``, beside the old log;
    see `evocity.store.rewrite`. Births that are ok are scored by new measures; a measure that fails
    leaves no value. ``about``: what the numbers depend on; ``start`` returns what evaluates.

    Returns what provenance notes of it: the new ``measures``, how many ``births`` were scored, and
    how many of them lack a value (``lacking``, by the measure). Raises `RunError`, and leaves the
    run as it is, if on an island nobody of the first generation, or of the living, has values of
    all goals.
    """
    header, population = prepared.header, Archipelago(prepared)
    new = [name for name in header.columns if name not in run.header.columns]
    rewritten, history = writer.rewrite(run, header, about), run.history()
    done, last, lacking = rewritten.run.generations, len(run.generations) - 1, Counter()
    known: dict[int, Birth] = {}
    total = 0
    with closing(_outcomes(run, prepared, new, len(done), start, tell)) as stream:
        for generation in run.generations:
            outcomes: Mapping[int, Outcome] = {}
            if generation in done:
                births = births_without_genomes(rewritten.run, generation)
            else:
                outcomes = next(stream) if new else outcomes
                table = _add_columns(run.births(generation), outcomes, new, header, prepared.aims)
                births = births_of_table(table, header)
            if generation == 0:
                population.begin_with(births)
                judged = [len(island.population.first_losses) > 0 for island in population.islands]
                _refuse_unjudged(run, prepared, writer, generation, judged, outcomes)
            alive = [birth for birth in births if birth.ok]
            total += len(alive)
            lacking.update(name for birth in alive for name in new if name not in birth.values)
            living = _members(run, generation, known | {birth.id: birth for birth in alive})
            known = {birth.id: birth for births in living.values() for birth in births}
            population.restore(living)
            if generation not in done:
                summary = _summary(history[generation], population)
                rewritten.write(generation, table, population.members, summary)
    if last >= 0:
        judged = [
            any(island.aims.complete(one.values) for one in island.population.living)
            for island in population.islands
        ]
        _refuse_unjudged(run, prepared, writer, last, judged)
    lacks = {name: lacking[name] for name in new if lacking[name]}
    return {"measures": new, "births": total if new else 0, "lacking": lacks}


def describe_rescoring(scored: Mapping) -> str:
    """Describe what `rescore_run` returned; "" if no measure was new."""
    if not scored["measures"]:
        return ""
    text = f"{scored['births']} births were scored by {', '.join(scored['measures'])}"
    for name, number in scored["lacking"].items():
        text += f"; {number} of them have no value of {name}"
    return text


def _outcomes(
    run: RunLog,
    prepared: Prepared,
    new: Sequence[str],
    first: int,
    start: Callable[[Prepared], Engine],
    tell: Callable[[str], None],
) -> Iterator[dict[int, Outcome]]:
    states = run.births(columns=["generation", "status"])
    counted = pc.and_(
        pc.equal(states["status"], "ok"), pc.greater_equal(states["generation"], first)
    )
    left = pc.sum(counted).as_py() or 0
    if not left:
        yield from ({} for _ in run.generations[first:])
        return
    # recorded measures do not end each other, and none of them makes a birth fail
    header = replace(prepared.header, measures=(), recorded=tuple(new))
    measures = [one for entry in prepared.recipe.entries for one in entry.measures]
    parents = any("parents" in one.takes for one in measures if one.name in new)
    with closing(start(replace(prepared, header=header))) as engine:
        scoring = _Scoring(run, first, parents, _progress(left, new, tell))
        yield from scoring.outcomes(engine)


class _Scoring:
    """Passes the births of a ``run`` from a ``first`` generation on to an engine, as there is room,
    with the genomes of their ``parents`` if a measure takes them."""

    def __init__(self, run: RunLog, first: int, parents: bool, progress: Callable[[int], None]):
        self._run, self._parents, self._progress = run, parents, progress
        self._generations, self._next = run.generations[first:], first
        self._given: dict[int, tuple[int, int]] = {}  # generation and id, by the job
        self._left: dict[int, int] = {}  # births that have no outcome yet, by the generation
        self._outcomes: dict[int, dict[int, Outcome]] = {}

    def outcomes(self, engine: Engine) -> Iterator[dict[int, Outcome]]:
        """Id -> outcome of each generation, in order."""
        for done, (job, outcome) in enumerate(engine.stream("evaluate", self._jobs()), 1):
            generation, identifier = self._given.pop(job)
            self._outcomes[generation][identifier] = outcome
            self._left[generation] -= 1
            self._progress(done)
            yield from self._whole()
        yield from self._whole()

    def _whole(self) -> Iterator[dict[int, Outcome]]:
        while self._left.get(self._next) == 0:
            del self._left[self._next]
            yield self._outcomes.pop(self._next)
            self._next += 1

    def _jobs(self) -> Iterator[tuple]:
        numbers = count()
        for ids in self._blocks():
            yield from self._jobs_of(ids, numbers)

    def _jobs_of(self, ids: Sequence[int], numbers: Iterator[int]) -> Iterator[tuple]:
        """The jobs of one block, whose genomes are dropped before the next are read."""
        births = self._run.individuals(ids)
        parents = self._run.parents(births) if self._parents else [()] * len(births)
        for birth, own in zip(births, parents, strict=True):
            self._given[next(numbers)] = birth.generation, birth.id
            yield birth.genome, own

    def _blocks(self) -> Iterator[list[int]]:
        """Ids of births to be scored: of some generations at a time, or parts of a large one."""
        waiting: list[int] = []
        for generation in self._generations:
            rows = self._run.births(generation, ["id", "status", "genome"]).to_pylist()
            ids = [row["id"] for row in rows if row["status"] == "ok" and row["genome"]]
            self._left[generation], self._outcomes[generation] = len(ids), {}
            waiting += ids
            if parts := len(waiting) // _AT_ONCE:
                most = math.ceil(len(waiting) / parts)
                yield from (waiting[at : at + most] for at in range(0, len(waiting), most))
                waiting = []
        yield waiting


def _progress(total: int, new: Sequence[str], tell: Callable[[str], None]) -> Callable[[int], None]:
    began = time.monotonic()
    last = -math.inf

    def progress(done: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last < _BETWEEN and done < total:
            return
        last = now
        left = timedelta(seconds=round((now - began) / done * (total - done)))
        tell(f"scoring births by {', '.join(new)}: {done} of {total}, {left} left")

    return progress


def _add_columns(
    births: pa.Table,
    outcomes: Mapping[int, Outcome],
    new: Sequence[str],
    header: Header,
    aims: Aims,
) -> pa.Table:
    """Add values of the ``new`` measures; renew errors, and which births keep the constraints."""
    ids = births["id"].to_pylist()
    for name in new:
        values = [outcomes[k].values.get(name) if k in outcomes else None for k in ids]
        births = births.append_column(f"fitness.{name}", pa.array(values, pa.float64()))
    pairs = zip(ids, births["error"].to_pylist(), strict=True)
    errors = [_error(error, outcomes.get(identifier), new) for identifier, error in pairs]
    births = _replace_column(births, "error", pa.array(errors, pa.string()))
    rows = births_of_table(births, header)
    feasible = [birth.ok and not aims.violation(birth.values) for birth in rows]
    return _replace_column(births, "feasible", pa.array(feasible, pa.bool_()))


def _replace_column(births: pa.Table, name: str, column: pa.Array) -> pa.Table:
    return births.set_column(births.column_names.index(name), name, column)


def _error(error: str | None, outcome: Outcome | None, new: Sequence[str]) -> str | None:
    if outcome is None or outcome.error is None:
        return error
    reason = outcome.error.removeprefix(UNRECORDED)
    if outcome.status != "ok":
        reason = f"{', '.join(new)}: {outcome.status}, {reason}"
    before = [] if error is None else [error.removeprefix(UNRECORDED)]
    return shortened_error(unrecorded([*before, reason]))


def _members(
    run: RunLog, generation: int, known: Mapping[int, Birth]
) -> dict[str | None, list[Birth]]:
    living: dict[str | None, list[Birth]] = {}
    for row in run.members(generation).to_pylist():
        if row["id"] not in known:
            raise RunError(
                f"{run.path}: individual {row['id']} lives in generation {generation}, but was "
                "neither born in this generation nor alive in the generation before",
                "a run folder as `evocity run` writes it",
                "restore the folder from a backup",
            )
        living.setdefault(row.get("island"), []).append(known[row["id"]])
    return living


def _summary(before: Mapping, population: Archipelago) -> dict:
    """The summary of a generation: as ``before``, with new figures by the new goals."""
    kept = ("births", "failures", "evaluations_per_second")
    summary = {key: before[key] for key in kept if key in before}
    volume = population.hypervolume
    if not math.isnan(volume):  # as `observers.Log` writes it
        summary["hypervolume"] = volume if math.isfinite(volume) else None
    summary["best"] = population.best
    others = {"algorithm": population.summary, "islands": population.summaries}
    return summary | {key: value for key, value in others.items() if value}


def _refuse_unjudged(
    run: RunLog,
    prepared: Prepared,
    writer: RunWriter,
    generation: int,
    judged: Sequence[bool],
    outcomes: Mapping[int, Outcome] | None = None,
) -> None:
    """Raise `RunError` unless each island has somebody ``judged`` in a ``generation``."""
    if all(judged):
        return
    writer.drop_rewrites()
    reasons = (outcome.error for outcome in (outcomes or {}).values() if outcome.error)
    reason = next((f" ({error.removeprefix(UNRECORDED)})" for error in reasons), "")
    islands = [island.name for island in prepared.recipe.islands]
    where = f" on {islands[list(judged).index(False)]}" if islands else ""
    raise RunError(
        f"{prepared.recipe.file or 'this recipe'} cannot score {run.path}: no individual of "
        f"generation {generation}{where} has a value of each goal{reason}",
        "at least one birth of the first generation, and one living individual, with a value of "
        "each goal",
        "correct the measure that has no value, or record this measure without a goal: [run] "
        "record = [...]",
    )
