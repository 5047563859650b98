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
from evocity.search.refinement.offering import Offers
from evocity.search.refinement.score import Score
from evocity.search.refinement.tuning import Tuning, of_heights, of_levels, of_parameters
from evocity.search.replaying import plan_of
from evocity.search.rereading import read_again
from evocity.search.resuming import standing_of
from evocity.store import Birth, Run

#: What may be tuned of an individual.
WAYS = ("lambda_field", "heights", "parameters", "fit")
#: The most values along each side of a field, and the most evaluations.
MOST_SIDE, MOST_BUDGET = 16, 1_000_000
# Of Subplex, which gets somewhere in few, a round has so many evaluations; of others the budget has
# so many rounds.
_A_ROUND, _ROUNDS = 10, 4
# Rounds without a child to be measured, one after another, after which there are no more.
_IDLE = 10


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
    rounds: int | None = None,
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
        `evocity.operators.LambdaField`; a field of ``side`` × ``side`` for each of these, tuned
        from coarse to fine. The budget is spent in ``rounds``, each from the best of the round
        before.
        "heights": the heights of street blocks, see `evocity.operators.HeightField`, by ``side`` ×
        ``side`` factors.
        "parameters": the numbers among the parameters of the operator that it was bred by, its
        making replayed with the same draws; ``tune`` names those to be tuned, all unless told.
        "fit": σ and β of all lifs, until its map is closest to that of ``towards``, see
        `evocity.coding.fit.fit_attractor`; the goals are told, and do not count.
    budget : evaluations at most, 1…1000000; equal children are measured once.
    algorithm : NLopt's "sbplx", "cobyla" or "bobyqa"; "fit" has its own.
    side : 1…16; 4 to 8 suits.
    rounds : 1…1000; unless told, of "sbplx" one for each ten evaluations, else four.
    others : ids whose fabric is offered in each round. Unless told, that of one of those who live
        in the last generation, drawn by ``seed``, and of a variant of the individual, which the
        run's own operators breed from it in three steps and nobody measures.
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

    def breed(*job) -> Outcome:
        return pool.run("breed", [job])[0]

    def climb_by(genome, values, tuning: Tuning, most: int, done: int = 0) -> Climbed:
        return climb(
            genome,
            values,
            tuning,
            score,
            breed,
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
    chosen: Mapping[int, None] = {}
    local = recipe.at(birth.id % recipe.run.population)
    if way == "lambda_field":
        sources = [one.genome for one in prepared.sources]
        offers = Offers(run, birth, others, local, sources, breed, seed)
        chosen, make = offers.taken, partial(recipe.operator, "lambda_field")
        order = np.random.default_rng([seed, 1])

        def field(genome: Genome) -> Tuning | None:
            offered = offers.next(genome)
            return of_levels(genome, offered, side, make, order) if offered else None

        each = _A_ROUND if algorithm == "sbplx" else -(-budget // _ROUNDS)
        each = each if rounds is None else -(-budget // rounds)
        start = Climbed(birth.genome, birth.values, score(birth.values), 0, 0, None, False)
        climbed = _in_rounds(start, field, climb_by, budget, each)
    elif way == "heights":
        tuning = of_heights(birth.genome, side, partial(recipe.operator, "height_field"))
        climbed = climb_by(birth.genome, birth.values, tuning, budget)
    else:
        plan = plan_of(run, prepared, birth.id)
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


def _check(way: str, budget: int, algorithm: str, side: int, rounds, towards) -> None:
    for key, value, known in (("way", way, WAYS), ("algorithm", algorithm, WITHOUT_GRADIENTS)):
        if value not in known:
            allowed = ", ".join(map(shown, known))
            raise EvocityError(keyword(key, value), f"one of {allowed}", "choose one of these")
    numbers = [("budget", budget, MOST_BUDGET), ("side", side, MOST_SIDE)]
    numbers += [] if rounds is None else [("rounds", rounds, 1000)]
    for key, value, most in numbers:
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
            raise EvocityError(keyword(key, value), f"a whole number, 1…{most}", "correct it")
    if (towards is None) == (way == "fit"):
        found = "no map to fit to" if towards is None else f"a map to fit to, with way = {way!r}"
        raise EvocityError(found, "a map with way = 'fit', and none else", "correct one of them")


def _in_rounds(
    start: Climbed,
    field: Callable[[Genome], Tuning | None],
    climb_by: Callable[..., Climbed],
    budget: int,
    each: int,
) -> Climbed:
    """The best of several climbs of ``each`` so many evaluations, each from the best of the one
    before. A round that finds no more children to measure leaves its rest to further ones; so many
    that find none in a row are the last."""
    best, idle = start, 0
    while best.evaluations < budget and idle < _IDLE:
        tuning = field(best.genome)
        if tuning is None:
            break
        most = min(each, budget - best.evaluations)
        found = climb_by(best.genome, best.values, tuning, most, best.evaluations)
        idle = 0 if found.evaluations else idle + 1
        best = replace(
            found,
            evaluations=best.evaluations + found.evaluations,
            failures=best.failures + found.failures,
            error=best.error or found.error,
            better=best.better or found.better,
            bred=best.bred + found.bred,
        )
    return best


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
