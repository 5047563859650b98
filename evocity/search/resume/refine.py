"""`refine`: an optimiser improves one individual of a run; the run stays as it is."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pyarrow.compute as pc

from evocity.citymap import CityMap
from evocity.coding.fit import fit_attractor
from evocity.coding.optimiser import WITHOUT_GRADIENTS
from evocity.errors import EvocityError, RunError, check_number, check_word
from evocity.evaluation import Here
from evocity.evaluation.evaluator import Outcome
from evocity.genome import VOID, Genome
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.birth_plans import founder_indices
from evocity.search.breeding.refinement.climb import Breed, ClimbResult, Score, climb, round_score
from evocity.search.breeding.refinement.variables import (
    Tuning,
    height_tuning,
    level_tuning,
    parameter_tuning,
)
from evocity.search.preparation.founders import require_alive
from evocity.search.preparation.preparation import Prepared
from evocity.search.preparation.startup import Crew, compile_and_start
from evocity.search.preparation.trust import Permission
from evocity.search.record.aims import judge_births, measured_births
from evocity.search.record.complete_run import CompleteRun
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.search.resume.resume import orders_of
from evocity.store import Birth, RunLog

#: The ways of refinement.
WAYS = ("lambda_field", "heights", "parameters", "fit")
#: The most values along each side of a field, and the most evaluations.
MOST_SIDE, MOST_BUDGET = 16, 1_000_000
# Evaluations of a round of Subplex, which needs few; and rounds of the budget of other algorithms.
_A_ROUND, _ROUNDS = 10, 4
# So many rounds in a row without a new child are the last.
_IDLE = 10
#: Steps by which a variant is bred, and how many are tried at most: some fail.
_STEPS, _TRIES = 3, 12


@dataclass(frozen=True)
class Refined:
    """The result of `refine`.

    genome, values : of the best child, measure -> raw number; of the individual itself unless
        ``better``.
    before, score_before : values and score of the individual.
    score : each goal's loss over its range in the run's first generation, summed; lower is better.
    violation : how far it breaks the constraints, 0 if it keeps them.
    evaluations, failures, error : children that were measured, those of them that failed, and the
        error of the first. bred : children that were bred; equal ones are measured once.
    others : ids of the individuals whose fabric was offered.
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
        """The map of its genome."""
        from evocity.coding import decode

        return decode(self.genome).city


def refine(
    run: str | os.PathLike | RunLog,
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
    """Improve the individual ``id`` of a run by the goals and constraints of the run.

    Parameters
    ----------
    run : folder of a run, or the object that `evocity.open_run` returned. The run may be finished
        or in progress, and the refinement does not change the run.
    id : id of an individual that the run has bred and measured.
    way : name of the refinement: "lambda_field", "heights", "parameters" or "fit". With
        ``way="lambda_field"``, the refinement tunes which street blocks take the fabric of other
        individuals (`evocity.operators.LambdaField`). With ``way="lambda_field"``, the refinement
        works in rounds, and tunes a field of ``side`` × ``side`` values for each of the other
        individuals, from coarse to fine. Each round of the refinement starts at the best result of
        the previous round. With ``way="heights"``, the refinement tunes ``side`` × ``side`` factors
        of the heights of street blocks (`evocity.operators.HeightField`). With
        ``way="parameters"``, the refinement tunes numeric parameters of the operator that bred the
        individual; the operator's random draws do not change. With ``way="fit"``, the refinement
        tunes σ and β of all lifs until the decoded map is closest to the map ``towards``
        (`evocity.coding.fit.fit_attractor`). With ``way="fit"``, the refinement ignores the goals
        of the run.
    budget : largest number of evaluations, 1…1000000. If several children have equal genomes, the
        refinement measures only the first of these children.
    algorithm : one of NLopt's algorithms "sbplx", "cobyla" and "bobyqa"; the refinement with
        ``way="fit"`` ignores this name.
    side : number of values along each side of a field, 1…16; 4 to 8 is a good choice.
    rounds : number of rounds of the refinement, 1…1000. By default, "sbplx" makes one round for
        each ten evaluations, and the other algorithms make four rounds in all.
    others : ids of the other individuals whose fabric the refinement tries in each round. By
        default, each round uses two other individuals: one drawn at random from the last generation
        by ``seed``, and a variant of the refined individual. In three steps, the run's operators
        breed a variant of the refined individual; the variant is not measured.
    tune : names of the parameters to tune with ``way="parameters"``; by default all parameters.
    accept_changes : whether to continue although the recipe, a map or a measure has changed since
        the run.
    trust : whether to execute the measures of a run that started on another machine.
    progress : function that is called with the number of evaluations and the best score so far.
    told : function that receives a short text at each step of the preparation.

    Returns
    -------
    Refined : result of the refinement, with the refined genome. In the result's genome, the
        attribute ``made`` describes the refinement under the key ``refined``.

    Raises
    ------
    RunError : error if the run has no individual with this id, if the individual failed, or if the
        inputs of the run have changed.
    OperatorError : error if the individual has nothing that the refinement can tune.
    EvocityError : the argument ``way`` or ``algorithm`` is unknown, or a number is out of range.

    A failed child uses up one evaluation, and ranks below all children that succeeded. An exception
    in your own measure, or Ctrl-C, ends the refinement, unless evocity counts the exception as a
    failed child.
    """
    _refuse_arguments(way, budget, algorithm, side, rounds, towards)
    say = told or (lambda text: None)
    run = run if isinstance(run, RunLog) else CompleteRun(run)
    say("reading the run")
    (birth,) = require_alive(run, [id])
    permission = Permission(trust, accept_changes)
    prepared = _with_void(read_preparation(run, None, permission)[0])
    engine = compile_and_start(prepared, Crew(0), say)
    score = score_of(run, prepared)

    def breed(*job) -> Outcome:
        return engine.run("breed", [job])[0]

    def climb_by(genome, values, tuning: Tuning, most: int, done: int = 0) -> ClimbResult:
        return climb(
            genome,
            values,
            tuning,
            score,
            breed,
            lambda child, _: engine.run("evaluate", [(child, parents)])[0],
            most,
            algorithm,
            None if progress is None else lambda count, best: progress(done + count, best),
        )

    recipe, parents = prepared.recipe, (birth.genome,)
    if way not in ("parameters", "fit") and any("parents" in one.takes for one in recipe.measures):
        (outcome,) = engine.run("evaluate", [(birth.genome, parents)])  # as its children are
        if outcome.status == "ok":
            birth = replace(birth, values=outcome.values)
    offered: Mapping[int, None] = {}
    local = recipe.at(birth.id % recipe.generation_size)
    if way == "fit":
        climbed = _fit_to_map(birth, towards, budget, score, engine, progress)
    elif way == "lambda_field":
        sources = [one.genome for one in prepared.sources]
        donors = Donors(run, birth, others, local, sources, breed, seed)
        offered, make = donors.offered_ids, partial(recipe.operator, "lambda_field")
        order = np.random.default_rng([seed, 1])

        def field(genome: Genome) -> Tuning | None:
            genomes = donors.offer(genome)
            return level_tuning(genome, genomes, side, make, order) if genomes else None

        each = _A_ROUND if algorithm == "sbplx" else -(-budget // _ROUNDS)
        each = each if rounds is None else -(-budget // rounds)
        start = ClimbResult(birth.genome, birth.values, score(birth.values), 0, 0, None, False)
        climbed = _climb_in_rounds(start, field, climb_by, budget, each)
    elif way == "heights":
        tuning = height_tuning(birth.genome, side, partial(recipe.operator, "height_field"))
        climbed = climb_by(birth.genome, birth.values, tuning, budget)
    else:
        plan = plan_of(run, prepared, birth.id)
        tuning = parameter_tuning(plan, local.parameters(plan.name), tune)
        parents = plan.genomes
        climbed = climb_by(birth.genome, birth.values, tuning, budget)
    before = score(birth.values)
    noted = {
        "way": way,
        "id": id,
        "others": list(offered),
        "algorithm": algorithm,
        "evaluations": climbed.evaluations,
        "score_before": round_score(before[1]),
        "score": round_score(climbed.score[1]),
    }
    if way == "fit":
        noted = {key: noted[key] for key in ("way", "id", "evaluations")}
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
        tuple(offered),
        climbed.better,
        climbed.score[0],
        climbed.bred,
    )


class Donors:
    """Offers genomes in each round: all named ``ids``, or else one individual of the last
    generation and a variant of the best so far, which the ``recipe``'s own operators breed in a few
    steps. ``sources`` are further parents of operators that take from anywhere."""

    def __init__(
        self,
        run: RunLog,
        birth: Birth,
        ids: Sequence[int] | None,
        recipe: Recipe,
        sources: Sequence[Genome],
        breed: Breed,
        seed: int,
    ):
        self._named = ids is not None
        if ids is None:
            ids = run.members(run.generations[-1]).column("id").to_pylist()
        others = require_alive(run, [other for other in dict.fromkeys(ids) if other != birth.id])
        self._others = [other for other in others if other.genome.digest != birth.genome.digest]
        if self._named and not self._others:
            raise RunError(
                f"{run.path}: all other individuals have the same genome as individual {birth.id}",
                "at least one individual with a different genome",
                "name other individuals, or name no individual to take genomes from the last "
                "generation",
            )
        self._breed, self._sources = breed, sources
        self._recipe, self._rng = recipe, np.random.default_rng(seed)
        self.offered_ids: dict[int, None] = {}

    def offer(self, genome: Genome) -> list[Genome]:
        """Return genomes other than ``genome``; none if nobody else lives and nothing can be bred.
        ``offered_ids`` has the ids of all so far."""
        chosen, variants = self._others, []
        if not self._named:
            chosen = [self._others[k] for k in self._rng.permutation(len(self._others))[:1]]
            variants = [self._variant(genome)]
        self.offered_ids.update(dict.fromkeys(other.id for other in chosen))
        offered = [*(other.genome for other in chosen), *variants]
        return [other for other in offered if other.digest != genome.digest]

    def _variant(self, genome: Genome) -> Genome:
        entries = self._recipe.operators
        names = [name for name, entry in entries.items() if entry.weight > 0]
        chances = np.array([entries[name].weight for name in names])
        steps = 0
        for _ in range(_TRIES):
            name = names[self._rng.choice(len(names), p=chances / chances.sum())]
            operator = self._recipe.operator_drawn(name, self._rng)
            further = self._rng.permutation(len(self._others))[: operator.parents[0] - 1]
            parents = [genome, *(self._others[k].genome for k in further)]
            parents += [self._sources[k] for k in founder_indices(operator, len(self._sources))]
            child = self._breed(operator, parents, self._rng).genome
            if child is not None:
                genome, steps = child, steps + 1
            if steps == _STEPS:
                break
        return genome


def _with_void(prepared: Prepared) -> Prepared:
    """Allow open ground that no city has: the child leaves the run."""
    cities = prepared.header.cities
    if VOID in cities:
        return prepared
    return replace(prepared, header=replace(prepared.header, cities=(*cities, VOID)))


def score_of(run: RunLog, prepared: Prepared) -> Score:
    """Return the score by which a ``run``'s individuals are refined, with the weights in force."""
    aims = prepared.aims.reweighted(orders_of(run, len(run.generations)).weights)
    births = measured_births(run, aims.bounds)
    first = births.filter(pc.equal(births["generation"], 0))
    if not len(first):
        raise RunError(
            f"{run.path}: no birth of the first generation was measured",
            "measured births in the first generation, because their values scale the goals",
            "choose another run",
        )
    return Score.of(aims, judge_births(first, aims)[0])


def _refuse_arguments(way: str, budget: int, algorithm: str, side: int, rounds, towards) -> None:
    check_word("way", way, WAYS)
    check_word("algorithm", algorithm, WITHOUT_GRADIENTS)
    numbers = [("budget", budget, MOST_BUDGET), ("side", side, MOST_SIDE)]
    numbers += [] if rounds is None else [("rounds", rounds, 1000)]
    for key, value, most in numbers:
        check_number(key, value, 1, most, f"a whole number from 1 to {most}", whole=True)
    if (towards is None) == (way == "fit"):
        found = "no map to fit to" if towards is None else f"a map to fit to, with way = {way!r}"
        allowed = "a map to fit to if the way is 'fit', and no map with another way"
        raise EvocityError(found, allowed, "correct the way, or the map")


def _climb_in_rounds(
    start: ClimbResult,
    field: Callable[[Genome], Tuning | None],
    climb_by: Callable[..., ClimbResult],
    budget: int,
    each: int,
) -> ClimbResult:
    """The best of several climbs; one that finds no new children leaves its rest to the next."""
    best, idle = start, 0
    while best.evaluations < budget and idle < _IDLE:
        tuning = field(best.genome)
        if tuning is None:
            break
        most = min(each, budget - best.evaluations)
        climbed = climb_by(best.genome, best.values, tuning, most, best.evaluations)
        idle = 0 if climbed.evaluations else idle + 1
        best = replace(
            climbed,
            evaluations=best.evaluations + climbed.evaluations,
            failures=best.failures + climbed.failures,
            error=best.error or climbed.error,
            better=best.better or climbed.better,
            bred=best.bred + climbed.bred,
        )
    return best


def _fit_to_map(
    birth: Birth, towards: CityMap, budget: int, score: Score, engine: Here, progress
) -> ClimbResult:
    before = score(birth.values)
    tried = 0

    def count(done: int, _: int) -> None:
        nonlocal tried
        tried = done
        if progress is not None:
            progress(done, before[1])

    fitted = fit_attractor(birth.genome, towards, evaluations=budget, progress=count)
    outcome = Outcome("ok", values=birth.values)
    if fitted is not birth.genome:
        (outcome,) = engine.run("evaluate", [(fitted, (birth.genome,))])
    failed, better = outcome.status != "ok", fitted is not birth.genome
    after = (np.inf, np.nan) if failed else score(outcome.values)
    error = outcome.error
    return ClimbResult(fitted, outcome.values, after, tried, int(failed), error, better, tried)
