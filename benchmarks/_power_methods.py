"""The methods that `search_power.py` compares: each breeds so many births of one case, and tells
what they were measured to be."""

import contextlib
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import evocity
from evocity.operators import make
from evocity.operators.crossover import Draft, Drafting, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.lambda_crossover import interpolate
from evocity.search import Observer
from evocity.search.preparation.preparation import prepare
from evocity.search.preparation.startup import Crew, start_engine
from evocity.search.toolbox import deap_toolbox

POPULATION = 48


class Over(BaseException):
    """The minutes are over; no observer keeps it to itself."""


@dataclass
class Case:
    """A pair of cities, ``goals`` and bounds of the ``guard`` (measure -> min or max), a seed."""

    pair: tuple[str, str]
    goals: tuple[str, ...]
    guard: Mapping[str, Mapping[str, float]]
    seed: int

    @property
    def measures(self) -> list[str]:
        return [*self.goals, *self.guard]

    def recipe(self, generations: int, guarded: bool = True, **sections) -> evocity.Recipe:
        """The default recipe of the case; without the guard its measures are recorded."""
        bounds = [{"name": name, **bound} for name, bound in self.guard.items()]
        run = {"seed": self.seed, "population": POPULATION, "generations": generations}
        if not guarded:
            run["record"] = list(self.guard)
        return evocity.Recipe(
            parents=list(self.pair),
            fitness=[*self.goals, *(bounds if guarded else [])],
            run=run,
            evaluation={"timeout": 60.0, "max_failures": 1.0},
            **sections,
        )


#: Tells the values of births as they come, ``(n, measures)``, NaN for what failed.
Told = Callable[[np.ndarray], None]
#: A method: a case, how many births, whom to tell.
Method = Callable[[Case, int, Told], None]


class _Births(Observer):
    def __init__(self, case: Case, told: Told):
        self._measures, self._told = case.measures, told

    def generation(self, generation, births, members):
        kept = [born.values if born.ok else {} for born in births]
        rows = [[values.get(name, np.nan) for name in self._measures] for values in kept]
        self._told(np.array(rows, float))


def by_recipe(guarded: bool = True, **sections) -> Method:
    """evocity's own search, with other ``sections`` than the default recipe's."""

    def method(case: Case, count: int, told: Told) -> None:
        recipe = case.recipe(-(-count // POPULATION) - 1, guarded, **sections)
        with evocity.Search(recipe, workers=2, observers=[_Births(case, told)]) as search:
            for _ in search:
                pass

    return method


#: The default mixture, as a recipe in Python has it.
MIXTURE = {
    name: entry.model_dump(exclude_none=True)
    for name, entry in evocity.Recipe.model_fields["operators"]
    .get_default(call_default_factory=True)
    .items()
}


def without(*names: str) -> Method:
    """evocity's own search without some of its operators."""
    return by_recipe(operators={key: one for key, one in MIXTURE.items() if key not in names})


#: What the default mixture had besides, until 2026-11-24.
REFILL = {"quarter_refill": {"weight": 3, "street_blocks": {"from": 2, "to": 8}}}


def founders_alone(*names: str) -> Method:
    """evocity's own search, some of whose operators breed its first generation alone: their weight
    is next to nothing, so that no later birth draws them."""
    seldom = {name: {**one, "weight": 1e-9} for name, one in MIXTURE.items() if name in names}
    return by_recipe(operators=MIXTURE | seldom)


def halfway(value):
    """The middle of a range, whole where its ends are; anything else as it is."""
    if not isinstance(value, dict):
        return value
    middle = (value["from"] + value["to"]) / 2
    return round(middle) if isinstance(value["from"], int) else middle


def fixed(*names: str) -> Method:
    """evocity's own search with the middles of the ranges that births draw from, and without the
    operators of these ``names``."""
    middle = {
        name: {key: one if key == "weight" else halfway(one) for key, one in entry.items()}
        for name, entry in MIXTURE.items()
        if name not in names
    }
    return by_recipe(operators=middle)


def unrepaired() -> Method:
    return by_recipe(operators={name: {**one, "repair": "none"} for name, one in MIXTURE.items()})


# -- without selection, and by others -------------------------------------------------------------


@contextlib.contextmanager
def bench(case: Case, **sections) -> Iterator["Bench"]:
    """Parents of a case, and workers that breed and evaluate its births; ``sections`` of its recipe
    other than the default's."""
    recipe = case.recipe(0, **sections)
    prepared = prepare(recipe)
    pool = start_engine(prepared, Crew(2), (), lambda text: None, lambda text: None)
    try:
        yield Bench(case, recipe, [one.genome for one in prepared.sources], prepared, pool)
    finally:
        pool.close()


@dataclass
class Bench:
    case: Case
    recipe: evocity.Recipe
    sources: list
    prepared: object
    pool: object

    def born(self, jobs: Sequence[tuple], told: Told) -> list[tuple[tuple[float, ...], float]]:
        """Losses and violation of each of the ``jobs``, (operator, parents, generator)."""
        return [found[:2] for found in self.bred(jobs, told)]

    def bred(self, jobs: Sequence[tuple], told: Told) -> list[tuple]:
        """Losses, violation and genome of each of the ``jobs``; None for what failed."""
        outcomes = self.pool.run("born", list(jobs))
        names, aims = self.case.measures, self.prepared.aims
        kept = [one.values if one.status == "ok" else {} for one in outcomes]
        told(np.array([[values.get(name, np.nan) for name in names] for values in kept], float))
        return [
            (aims.losses(values), aims.violation(values), one.genome)
            if values
            else (None, np.inf, None)
            for one, values in zip(outcomes, kept, strict=True)
        ]


def at_random(draw: Callable) -> Method:
    """The parents, then children of theirs alone, by the operator that ``draw`` makes."""

    def method(case: Case, count: int, told: Told) -> None:
        with bench(case) as place:
            sources, made = place.sources, 0
            while made < count:
                jobs = []
                for number in range(made, min(made + POPULATION, count)):
                    rng = np.random.default_rng([case.seed, number])
                    if number < len(sources):
                        jobs.append((None, [sources[number]], rng))
                        continue
                    operator = draw(place.recipe, rng)
                    order = sources if rng.random() < 0.5 else sources[::-1]
                    jobs.append((operator, order, rng))
                place.born(jobs, told)
                made += len(jobs)

    return method


def pavement(recipe, rng):
    return make("pavement_fusion", fill=float(rng.uniform(0.1, 0.9)))


def quarters(recipe, rng):
    return recipe.operator_drawn("quarter_fusion", rng)


def seed_deap(seed: int) -> None:
    """Seed the module ``random``, which DEAP's algorithms draw from."""
    random.seed(seed)


def textbook(repair: bool) -> Method:
    """DEAP's eaMuPlusLambda and selNSGA2, with uniform crossover of lifs and Gaussian mutation."""

    def method(case: Case, count: int, told: Told) -> None:
        from deap import algorithms

        rates = dict.fromkeys(("dx", "dy", "iso"), 0.0)
        own = {} if repair else {"repair": "none"}
        operators = {
            "direct_fusion": {"weight": 1, **own},
            "mutation": {"weight": 1, "group_side": 4.0, **rates, **own},
        }
        seed_deap(case.seed)
        with deap_toolbox(case.recipe(0, operators=operators), workers=2) as box:
            evaluate, share = box.evaluate, box.map

            def mapped(function, individuals):
                found = share(evaluate, individuals)
                names = case.measures
                kept = [{} if one.error else one.values for one in individuals]
                told(np.array([[v.get(name, np.nan) for name in names] for v in kept], float))
                return found

            box.register("map", mapped)
            first = [box.individual() for _ in case.pair]
            while len(first) < POPULATION:
                first += box.mate(*first[: len(case.pair)])
            generations = -(-count // POPULATION) - 1
            how = {"cxpb": 0.6, "mutpb": 0.4, "ngen": generations, "verbose": False}
            algorithms.eaMuPlusLambda(
                first[:POPULATION], box, mu=POPULATION, lambda_=POPULATION, **how
            )

    return method


@dataclass(frozen=True)
class Choice(Drafting):
    """Of which of two parents each part of the map is, as a ``mask`` of side × side squares tells;
    repaired as evocity's operators are."""

    mask: tuple[bool, ...] = ()

    name = "choice"
    parents = (2, 2)

    def _draft(self, parents, rng) -> Draft:
        grid = common_grid(self.name, parents)
        side = round(len(self.mask) ** 0.5)
        mask = np.array(self.mask, float).reshape(side, side)
        rows = np.arange(grid.rows) * side // grid.rows
        columns = np.arange(grid.columns) * side // grid.columns
        lambdas = mask[np.ix_(rows, columns)].ravel()
        child = interpolate(self.name, parents, grid, lambdas, rng)
        weight = grid.raster(lambdas.astype(np.float32))
        first, second = (raw_heights(parent) for parent in parents)
        return Draft(child, weight * first + (1 - weight) * second, {})


def by_pymoo(side: int = 16) -> Method:
    """pymoo's NSGA-II on a choice of parent in side × side squares."""

    def method(case: Case, count: int, told: Told) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem
        from pymoo.operators.crossover.pntx import TwoPointCrossover
        from pymoo.operators.mutation.bitflip import BitflipMutation
        from pymoo.operators.sampling.rnd import BinaryRandomSampling
        from pymoo.optimize import minimize

        with bench(case) as place:

            class Fields(Problem):
                def __init__(self):
                    super().__init__(
                        n_var=side**2, n_obj=len(case.goals), n_ieq_constr=1, xl=0, xu=1, vtype=bool
                    )

                def _evaluate(self, fields, out, *args, **kwargs):
                    jobs = [
                        (
                            Choice(mask=tuple(map(bool, one))),
                            place.sources,
                            np.random.default_rng(0),
                        )
                        for one in fields
                    ]
                    found = place.born(jobs, told)
                    worst = [1e12] * len(case.goals)
                    out["F"] = np.array([worst if f is None else list(f) for f, _ in found])
                    out["G"] = np.array([[min(broken, 1e12)] for _, broken in found])

            algorithm = NSGA2(
                pop_size=POPULATION,
                sampling=BinaryRandomSampling(),
                crossover=TwoPointCrossover(),
                mutation=BitflipMutation(),
                eliminate_duplicates=True,
            )
            minimize(Fields(), algorithm, ("n_eval", count), seed=case.seed)

    return method


def by_optuna(side: int = 6, fine: int = 32) -> Method:
    """Optuna's NSGA-II on a λ-field of side × side numbers, thresholded to a choice."""

    def method(case: Case, count: int, told: Told) -> None:
        import optuna
        from scipy.ndimage import zoom

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        with bench(case) as place:
            sampler = optuna.samplers.NSGAIISampler(
                population_size=POPULATION,
                seed=case.seed,
            )
            study = optuna.create_study(directions=["minimize"] * len(case.goals), sampler=sampler)
            names = [f"v{k}" for k in range(side**2)]
            made = 0
            while made < count:
                trials = [study.ask() for _ in range(min(POPULATION, count - made))]
                jobs = []
                for trial in trials:
                    field = np.array([trial.suggest_float(name, 0, 1) for name in names])
                    smooth = zoom(field.reshape(side, side), fine / side, order=1)
                    mask = tuple((smooth > 0.5).ravel().tolist())
                    jobs.append((Choice(mask=mask), place.sources, np.random.default_rng(0)))
                found = place.born(jobs, told)
                for trial, (losses, broken) in zip(trials, found, strict=True):
                    trial.set_constraint("guard", float(min(broken, 1e12)))
                    study.tell(trial, [1e12] * len(case.goals) if losses is None else list(losses))
                made += len(jobs)

    return method


#: What is compared, by name; the first is the default.
METHODS: dict[str, Method] = {
    "default": by_recipe(),
    "random pavement fusion": at_random(pavement),
    "random quarter fusion": at_random(quarters),
    "textbook DEAP": textbook(repair=False),
    "textbook DEAP, repaired": textbook(repair=True),
    "pymoo NSGA-II, 16 x 16 choice": by_pymoo(),
    "Optuna NSGA-II, 6 x 6 field": by_optuna(),
}
ABLATIONS: dict[str, Method] = {
    "with quarter_refill": by_recipe(operators=MIXTURE | REFILL),
    "without repair": unrepaired(),
    **{f"without {name}": without(name) for name in MIXTURE},
    "quarters for founders alone": founders_alone("quarter_fusion"),
    "without the guard": by_recipe(guarded=False),
    "NSGA-II's survival": by_recipe(search={"algorithm": "nsga2"}),
    "distinct = 0": by_recipe(search={"distinct": 0}),
    "adaptation": by_recipe(search={"adapt": True}),
    "fixed parameters": fixed(),
}
#: Those that do not look at goals: bred once for all.
BLIND = ("random pavement fusion", "random quarter fusion")
