"""`refine`: one individual of a run made better by an optimiser; the run stays as it is."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pyarrow.compute as pc

from evocity.citymap import CityMap
from evocity.coding.fit import fit_attractor
from evocity.coding.optimising import WITHOUT_GRADIENTS
from evocity.errors import EvocityError, RunError, keyword, shown
from evocity.genome import VOID, Genome
from evocity.search.beginning import Crew, pool_of, sides_of
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluation import Here
from evocity.search.evaluator import Outcome
from evocity.search.founding import alive
from evocity.search.judging import judged, measured
from evocity.search.opening import open_run
from evocity.search.preparation import Prepared
from evocity.search.refinement.climbing import Climbed, climb, rounded
from evocity.search.refinement.score import Score
from evocity.search.refinement.tuning import Tuning, of_field, of_heights, of_parameters
from evocity.search.replaying import plan_of
from evocity.search.rereading import read_again
from evocity.search.resuming import standing_of
from evocity.store import Birth, Run

#: What may be tuned of an individual.
WAYS = ("lambda_field", "heights", "parameters", "fit")
#: The most values along each side of a field, and the most evaluations.
MOST_SIDE, MOST_BUDGET = 16, 1_000_000
# So many others offer their fabric in a round unless they are named.
_OTHERS = 2


@dataclass(frozen=True)
class Refined:
    """A ``genome`` and its ``values``, measure -> raw number, beside those ``before``; the
    ``score`` of both, lower is better: each goal's loss over its range in the run's first
    generation, summed. ``violation``: how far it breaks the constraints, 0 if it keeps them.
    ``evaluations``: children that were measured, of which ``failures`` failed, the first with
    ``error``; ``bred``: children that were bred, of which equal ones are measured once;
    ``others``: those whose fabric was offered, by id.

    ``better``: whether anything better was found; else the genome is the individual's own.
    """

    genome: Genome
    values: Mapping[str, float]
    before: Mapping[str, float]
    score: float
    score_before: float
    evaluations: int
    failures: int = 0
    error: str | None = None
    others: tuple[int, ...] = ()
    better: bool = False
    violation: float = 0.0
    bred: int = 0

    @property
    def city(self) -> CityMap:
        """Its map."""
        from evocity.coding import decode

        return decode(self.genome).city


def refine(
    run: str | os.PathLike | Run,
    id: int,
    *,
    way: str = "lambda_field",
    budget: int = 200,
    algorithm: str = "sbplx",
    side: int = 4,
    rounds: int = 4,
    others: Sequence[int] | None = None,
    seed: int = 0,
    tune: Sequence[str] = (),
    towards: CityMap | None = None,
    accept_changes: bool = False,
    trust: bool = False,
    progress: Callable[[int, float], None] | None = None,
    told: Callable[[str], None] | None = None,
) -> Refined:
    """The individual ``id`` of a ``run`` made better, by the run's own goals and constraints.

    Parameters
    ----------
    run : a run's folder, or what `evocity.open_run` gives; finished or going on. It is only read.
    id : an individual that was bred and measured.
    way : what is tuned.
        "lambda_field": which street blocks get the fabric of ``others``, see
        `evocity.operators.LambdaField`; ``side`` × ``side`` numbers for each of these. The budget
        is spent in ``rounds``, each from the best of the round before.
        "heights": the heights of street blocks, see `evocity.operators.HeightField`, by ``side`` ×
        ``side`` factors.
        "parameters": the numbers among the parameters of the operator that it was bred by, its
        making replayed with the same draws; ``tune`` names those to be tuned, all unless told.
        "fit": σ and β of all lifs, until its map is closest to that of ``towards``, see
        `evocity.coding.fit.fit_attractor`; the goals are told, and do not count.
    budget : evaluations at most, 1…1000000; equal children are measured once.
    algorithm : NLopt's "sbplx", "cobyla" or "bobyqa"; "fit" has its own.
    side : 1…16; 4 to 8 suits.
    rounds : 1…1000.
    others : ids whose fabric is offered; unless told, in each round two of those who live in the
        last generation, drawn by ``seed``.
    accept_changes : go on though the recipe, a map or a measure has changed since.
    trust : execute the measures of a run that was not begun on this machine.
    progress : called with (evaluations, the best score).
    told : told in a few words what is prepared.

    Returns
    -------
    Refined : its genome has ``refined`` in its ``made``.

    Raises
    ------
    RunError : the run has no such individual, or it failed, or what it was made of has changed.
    OperatorError : nothing can be tuned so.
    EvocityError : a way, an algorithm or a number that is none.

    Failed children are counted, and worse than all others. What else a measure of one's own
    raises in this process, Ctrl-C too, is raised here.
    """
    _check(way, budget, algorithm, side, rounds, towards)
    say = told or (lambda text: None)
    run = run if isinstance(run, Run) else open_run(run)
    say("reading the run")
    (birth,) = alive(run, [id])
    prepared = _with_void(read_again(run, None, accept_changes, trust)[0])
    compile_once(sides_of(prepared.recipe, prepared), needed(prepared.recipe), say)
    pool = pool_of(prepared, Crew(0), (), say, say)
    score = score_of(run, prepared)
    if way == "fit":
        return _fitted(birth, towards, budget, score, pool, progress)

    def climb_by(genome, values, tuning: Tuning, most: int, done: int = 0) -> Climbed:
        return climb(
            genome,
            values,
            tuning,
            score,
            lambda *job: pool.run("breed", [job])[0],
            lambda child, _: pool.run("evaluate", [(child, own)])[0],
            most,
            algorithm,
            None if progress is None else lambda count, best: progress(done + count, best),
        )

    recipe, own = prepared.recipe, (birth.genome,)
    if way != "parameters" and any("parents" in one.takes for one in recipe.measures):
        (again,) = pool.run("evaluate", [(birth.genome, own)])  # as its children are
        if again.status == "ok":
            birth = replace(birth, values=again.values)
    chosen: dict[int, None] = {}
    if way == "lambda_field":
        offered = _Others(run, birth, others, seed)

        def field(genome: Genome) -> Tuning:
            births = offered.next()
            chosen.update(dict.fromkeys(one.id for one in births))
            genomes = [one.genome for one in births]
            return of_field(genome, genomes, side, partial(recipe.operator, "lambda_field"))

        climbed = _in_rounds(birth, field, climb_by, budget, rounds)
    elif way == "heights":
        tuning = of_heights(birth.genome, side, partial(recipe.operator, "height_field"))
        climbed = climb_by(birth.genome, birth.values, tuning, budget)
    else:
        plan = plan_of(run, prepared, birth.id)
        local = recipe.at(birth.id % recipe.run.population)
        tuning, own = of_parameters(plan, local.parameters(plan.name), tune), plan.genomes
        climbed = climb_by(birth.genome, birth.values, tuning, budget)
    before = score(birth.values)
    noted = {
        "way": way,
        "id": id,
        "others": list(chosen),
        "algorithm": algorithm,
        "evaluations": climbed.evaluations,
        "score_before": rounded(before[1]),
        "score": rounded(climbed.score[1]),
    }
    made = {**climbed.genome.made, "refined": noted}
    return Refined(
        climbed.genome.replace(made=made),
        dict(climbed.values),
        dict(birth.values),
        climbed.score[1],
        before[1],
        climbed.evaluations,
        climbed.failures,
        climbed.error,
        tuple(chosen),
        climbed.better,
        climbed.score[0],
        climbed.bred,
    )


def _with_void(prepared: Prepared) -> Prepared:
    """The same, where bare ground may be laid that no city has: what is bred leaves the run."""
    cities = prepared.header.cities
    if VOID in cities:
        return prepared
    return replace(prepared, header=replace(prepared.header, cities=(*cities, VOID)))


def score_of(run: Run, prepared: Prepared) -> Score:
    """The score that a ``run``'s individuals are refined by, with the weights it has now."""
    aims = prepared.aims.reweighted(standing_of(run, len(run.generations)).weights)
    births = measured(run, aims.bounds)
    first = births.filter(pc.equal(births["generation"], 0))
    if not len(first):
        raise RunError(
            f"{run.path}: no birth of the first generation was measured",
            "first births, whose ranges are the goals' units",
            "choose another run",
        )
    return Score.of(aims, judged(first, aims)[0])


def _check(way: str, budget: int, algorithm: str, side: int, rounds: int, towards) -> None:
    for key, value, known in (("way", way, WAYS), ("algorithm", algorithm, WITHOUT_GRADIENTS)):
        if value not in known:
            allowed = ", ".join(map(shown, known))
            raise EvocityError(keyword(key, value), f"one of {allowed}", "choose one of these")
    numbers = (("budget", budget, MOST_BUDGET), ("side", side, MOST_SIDE), ("rounds", rounds, 1000))
    for key, value, most in numbers:
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
            raise EvocityError(keyword(key, value), f"a whole number, 1…{most}", "correct it")
    if (towards is None) == (way == "fit"):
        found = "no map to fit to" if towards is None else f"a map to fit to, with way = {way!r}"
        raise EvocityError(found, "a map with way = 'fit', and none else", "correct one of them")


class _Others:
    """Whose fabric is offered to an individual: those of ``ids`` in each round, or two drawn from
    all others who live."""

    def __init__(self, run: Run, birth: Birth, ids: Sequence[int] | None, seed: int):
        self._fixed, self._rng = ids is not None, np.random.default_rng(seed)
        if ids is None:
            ids = run.members(run.generations[-1]).column("id").to_pylist()
        found = alive(run, [one for one in dict.fromkeys(ids) if one != birth.id])
        self._all = [one for one in found if one.genome.digest != birth.genome.digest]
        if not self._all:
            raise RunError(
                f"{run.path}: nobody but individual {birth.id} to take fabric from",
                "one other individual or more",
                "name others, or choose another way, such as heights",
            )

    def next(self) -> list[Birth]:
        if self._fixed:
            return self._all
        drawn = self._rng.permutation(len(self._all))[:_OTHERS]
        return [self._all[at] for at in drawn.tolist()]


def _in_rounds(
    birth: Birth,
    field: Callable[[Genome], Tuning],
    climb_by: Callable[..., Climbed],
    budget: int,
    rounds: int,
) -> Climbed:
    """The best of several climbs, each from the best of the one before; what a round leaves of the
    budget, the last have."""
    each, done, failures, bred, error = -(-budget // rounds), 0, 0, 0, None
    genome, values, better = birth.genome, birth.values, False
    for number in range(rounds):
        if done >= budget:
            break
        most = budget - done if number == rounds - 1 else min(each, budget - done)
        found = climb_by(genome, values, field(genome), most, done)
        genome, values = found.genome, found.values
        done, failures = done + found.evaluations, failures + found.failures
        bred, error, better = bred + found.bred, error or found.error, better or found.better
    totals = {"evaluations": done, "failures": failures, "error": error, "bred": bred}
    return replace(found, better=better, **totals)


def _fitted(
    birth: Birth,
    towards: CityMap,
    budget: int,
    score,
    pool: Here,
    tell,
) -> Refined:
    before = score(birth.values)
    tried = 0

    def counted(done: int, _: int) -> None:
        nonlocal tried
        tried = done
        if tell is not None:
            tell(done, before[1])

    fitted = fit_attractor(birth.genome, towards, evaluations=budget, progress=counted)
    if fitted is birth.genome:
        outcome = Outcome("ok", values=birth.values)
    else:
        (outcome,) = pool.run("evaluate", [(fitted, (birth.genome,))])
    noted = {"way": "fit", "id": birth.id, "evaluations": tried}
    measured_ = outcome.status == "ok"
    after = score(outcome.values) if measured_ else (np.inf, np.nan)
    return Refined(
        fitted.replace(made={**fitted.made, "refined": noted}),
        dict(outcome.values),
        dict(birth.values),
        after[1],
        before[1],
        tried,
        0 if measured_ else 1,
        outcome.error,
        (),
        fitted is not birth.genome,
        after[0],
        tried,
    )


__all__ = ["MOST_SIDE", "WAYS", "Refined", "refine", "score_of"]
