"""Old births of a run scored by the new measures of another recipe, and its log written anew by it.

Nobody is bred again, and who lived in a generation stays who lived. What is wanted now judges them
all: ranks, marks, hypervolume and the best of every generation are those that the living of then
have by the new goals, in units of the first generation by the new goals.
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
from evocity.fitness import Aims
from evocity.search.archipelago import Archipelago
from evocity.search.evaluation import Engine
from evocity.search.evaluator import UNRECORDED, Outcome, unrecorded
from evocity.search.island import Island
from evocity.search.judging import births_without_genomes, without_genomes
from evocity.search.preparation import Prepared
from evocity.store import Birth, Header, Run, RunWriter
from evocity.store.schema import told_short

#: Births whose genomes are read at a time, or up to twice as many.
_AT_ONCE = 256
#: Seconds between two words of how far it is.
_BETWEEN = 5.0


def write_anew(
    run: Run,
    prepared: Prepared,
    writer: RunWriter,
    about: Mapping,
    engine_of: Callable[[Prepared], Engine],
    tell: Callable[[str], None],
) -> dict:
    """Write the log of a ``run`` anew by the header and the goals of what is ``prepared``, beside
    the old one; see `evocity.store.anew`. Births that are ok are scored by the measures that they
    have no column of, each measure by itself: one that fails leaves the birth as it is, without its
    value. ``about``: what the numbers depend on; ``engine_of`` makes what evaluates; ``tell`` is
    told how far it is.

    Returns what is noted of it: the new ``measures``, how many ``births`` were scored, and how many
    of them have no value (``lacking``, by the measure).

    Raises `RunError`, and leaves the run as it is, if nobody of the first generation, or nobody who
    lives, has a value of all that is sought, on any island.
    """
    header, population = prepared.header, Archipelago(prepared)
    new = [name for name in header.columns if name not in run.header.columns]
    anew, history = writer.anew(run, header, about), run.history()
    done, last, lacking = anew.run.generations, len(run.generations) - 1, Counter()
    known: dict[int, Birth] = {}
    total = 0
    with closing(_outcomes(run, prepared, new, len(done), engine_of, tell)) as outcomes:
        for generation in run.generations:
            found: Mapping[int, Outcome] = {}
            if generation in done:
                births = births_without_genomes(anew.run, generation)
            else:
                found = next(outcomes) if new else found
                table = _scored(run.births(generation), found, new, header, prepared.aims)
                births = without_genomes(table, header)
            if generation == 0:
                population.begin_with(births)
                judged = [len(one.population.first_losses) > 0 for one in population.islands]
                _refuse_unjudged(run, prepared, writer, generation, judged, found)
            alive = [birth for birth in births if birth.ok]
            total += len(alive)
            lacking.update(name for one in alive for name in new if name not in one.values)
            living = _living(run, generation, known | {one.id: one for one in alive})
            known = {one.id: one for births in living.values() for one in births}
            population.restore(living)
            if generation not in done:
                told = _summary(history[generation], population)
                anew.write(generation, table, population.members, told)
    if last >= 0:
        judged = [_judged(island) for island in population.islands]
        _refuse_unjudged(run, prepared, writer, last, judged)
    lacks = {name: lacking[name] for name in new if lacking[name]}
    return {"measures": new, "births": total if new else 0, "lacking": lacks}


def in_words(scored: Mapping) -> str:
    """What `write_anew` noted, for people; "" where no measure was new."""
    if not scored["measures"]:
        return ""
    text = f"{scored['births']} births were scored by {', '.join(scored['measures'])}"
    for name, number in scored["lacking"].items():
        text += f"; {number} of them have no value of {name}"
    return text


def _outcomes(
    run: Run,
    prepared: Prepared,
    new: Sequence[str],
    start: int,
    engine_of: Callable[[Prepared], Engine],
    tell: Callable[[str], None],
) -> Iterator[dict[int, Outcome]]:
    """Of each generation from ``start`` on, in order, what was found of its births by id."""
    states = run.births(columns=["generation", "status"])
    asked = pc.and_(pc.equal(states["status"], "ok"), pc.greater_equal(states["generation"], start))
    left = pc.sum(asked).as_py() or 0
    if not left:
        yield from ({} for _ in run.generations[start:])
        return
    # recorded measures do not end each other, and none of them makes a birth fail
    header = replace(prepared.header, measures=(), recorded=tuple(new))
    wanted = [one for one in prepared.recipe.entries for one in one.measures if one.name in new]
    parents = any("parents" in one.takes for one in wanted)
    with closing(engine_of(replace(prepared, header=header))) as engine:
        scoring = _Scoring(run, start, parents, _progress(left, new, tell))
        yield from scoring.outcomes(engine)


class _Scoring:
    """The births of a ``run`` from the generation ``start`` on, given to an engine as there is
    room, with the genomes of their ``parents`` if they are asked for."""

    def __init__(self, run: Run, start: int, parents: bool, progress: Callable[[int], None]):
        self._run, self._parents, self._progress = run, parents, progress
        self._generations, self._next = run.generations[start:], start
        self._given: dict[int, tuple[int, int]] = {}  # generation and id, by the job
        self._left: dict[int, int] = {}  # births that have no outcome yet, by the generation
        self._found: dict[int, dict[int, Outcome]] = {}

    def outcomes(self, engine: Engine) -> Iterator[dict[int, Outcome]]:
        for done, (job, outcome) in enumerate(engine.stream("evaluate", self._jobs()), 1):
            generation, identifier = self._given.pop(job)
            self._found[generation][identifier] = outcome
            self._left[generation] -= 1
            self._progress(done)
            yield from self._whole()
        yield from self._whole()

    def _whole(self) -> Iterator[dict[int, Outcome]]:
        while self._left.get(self._next) == 0:
            del self._left[self._next]
            yield self._found.pop(self._next)
            self._next += 1

    def _jobs(self) -> Iterator[tuple]:
        numbers = count()
        for ids in self._blocks():
            yield from self._jobs_of(ids, numbers)

    def _jobs_of(self, ids: Sequence[int], numbers: Iterator[int]) -> Iterator[tuple]:
        """Those of one block, whose genomes are gone before the next are read."""
        births = self._run.individuals(ids)
        parents = self._run.parents(births) if self._parents else [()] * len(births)
        for birth, own in zip(births, parents, strict=True):
            self._given[next(numbers)] = birth.generation, birth.id
            yield birth.genome, own

    def _blocks(self) -> Iterator[list[int]]:
        """The ids of those that are scored, of some generations at a time, or parts of a large
        one."""
        waiting: list[int] = []
        for generation in self._generations:
            rows = self._run.births(generation, ["id", "status", "genome"]).to_pylist()
            ids = [one["id"] for one in rows if one["status"] == "ok" and one["genome"]]
            self._left[generation], self._found[generation] = len(ids), {}
            waiting += ids
            if parts := len(waiting) // _AT_ONCE:
                most = math.ceil(len(waiting) / parts)
                yield from (waiting[at : at + most] for at in range(0, len(waiting), most))
                waiting = []
        yield waiting


def _progress(total: int, new: Sequence[str], tell: Callable[[str], None]) -> Callable[[int], None]:
    began = time.monotonic()
    told = -math.inf

    def progress(done: int) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told < _BETWEEN and done < total:
            return
        told = now
        left = timedelta(seconds=round((now - began) / done * (total - done)))
        tell(f"scoring births by {', '.join(new)}: {done} of {total}, {left} left")

    return progress


def _scored(
    births: pa.Table, found: Mapping[int, Outcome], new: Sequence[str], header: Header, aims: Aims
) -> pa.Table:
    """The ``births`` with what was ``found``: columns of the ``new`` measures, why one has no
    value, and which keep the constraints now."""
    ids = births["id"].to_pylist()
    for name in new:
        values = [found[one].values.get(name) if one in found else None for one in ids]
        births = births.append_column(f"fitness.{name}", pa.array(values, pa.float64()))
    pairs = zip(ids, births["error"].to_pylist(), strict=True)
    errors = [_told(error, found.get(one), new) for one, error in pairs]
    births = _replaced(births, "error", pa.array(errors, pa.string()))
    judged = without_genomes(births, header)
    feasible = [one.ok and not aims.violation(one.values) for one in judged]
    return _replaced(births, "feasible", pa.array(feasible, pa.bool_()))


def _replaced(births: pa.Table, name: str, column: pa.Array) -> pa.Table:
    return births.set_column(births.column_names.index(name), name, column)


def _told(error: str | None, outcome: Outcome | None, new: Sequence[str]) -> str | None:
    """An ``error`` of before, with why a birth has no value of a measure."""
    if outcome is None or outcome.error is None:
        return error
    reason = outcome.error.removeprefix(UNRECORDED)
    if outcome.status != "ok":
        reason = f"{', '.join(new)}: {outcome.status}, {reason}"
    before = [] if error is None else [error.removeprefix(UNRECORDED)]
    return told_short(unrecorded([*before, reason]))


def _living(run: Run, generation: int, known: Mapping[int, Birth]) -> dict[str | None, list[Birth]]:
    """Who lived in a ``generation``, by the island, of those that are ``known``."""
    living: dict[str | None, list[Birth]] = {}
    for row in run.members(generation).to_pylist():
        if row["id"] not in known:
            raise RunError(
                f"{run.path}: individual {row['id']} lives in generation {generation}, and was "
                "neither born in it nor alive before",
                "a run folder as `evocity run` writes it",
                "bring the folder back from a copy",
            )
        living.setdefault(row.get("island"), []).append(known[row["id"]])
    return living


def _summary(before: Mapping, population: Archipelago) -> dict:
    """The summary of a generation, as it was ``before`` but for what is judged."""
    kept = ("births", "failures", "evaluations_per_second")
    told = {key: before[key] for key in kept if key in before}
    volume = population.hypervolume
    if not math.isnan(volume):  # as `observers.Log` writes it
        told["hypervolume"] = volume if math.isfinite(volume) else None
    told["best"] = population.best
    others = {"algorithm": population.summary, "islands": population.summaries}
    return told | {key: value for key, value in others.items() if value}


def _judged(island: Island) -> bool:
    """Whether anybody who lives there has a value of all that is sought."""
    return any(island.aims.complete(one.values) for one in island.population.living)


def _refuse_unjudged(
    run: Run,
    prepared: Prepared,
    writer: RunWriter,
    generation: int,
    judged: Sequence[bool],
    found: Mapping[int, Outcome] | None = None,
) -> None:
    """Raise `RunError` unless of each island somebody is ``judged`` of a ``generation``, of which
    these outcomes were ``found``."""
    if all(judged):
        return
    writer.drop_anew()
    reasons = (one.error for one in (found or {}).values() if one.error)
    reason = next((f" ({one.removeprefix(UNRECORDED)})" for one in reasons), "")
    islands = [one.name for one in prepared.recipe.islands]
    where = f" on {islands[list(judged).index(False)]}" if islands else ""
    raise RunError(
        f"{run.path} cannot be judged by {prepared.recipe.file or 'this recipe'}: nobody of "
        f"generation {generation}{where} has a value of all that is sought{reason}",
        "a value of each goal among the births of the first generation, with which all are "
        "compared, and among the living",
        "correct the measure; or have it recorded for now: [run] record = [...]",
    )


__all__ = ["in_words", "write_anew"]
