"""Other packages with evocity's own operators, for `search_power.py`.

All methods breed by the mixture of a new recipe: the same operators, weights and parameters, each
birth with one operator. Each package selects parents and survivors, and handles the guard, as its
documents advise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from _power_methods import POPULATION, Case, Method, Told, bench, by_recipe, seed_deap

from evocity.genome import Genome
from evocity.operators import Operator
from evocity.recipe.mixture import PLAN_OPERATORS, split_ranges
from evocity.search.breeding.birth_plans import founder_plan
from evocity.search.calibration.recipe_text import SEARCH_KEYS
from evocity.search.toolbox import deap_toolbox

#: The mixture of a new recipe, as a recipe in Python has it.
MIXTURE = {name: dict(entry) for name, entry in PLAN_OPERATORS.items()}
#: The section [search] of a new recipe.
SEARCH = {key: value for key, (value, _) in SEARCH_KEYS.items()}
#: Operators in a row of a chain, at most.
CHAIN = 4
#: The loss of a birth that failed.
_WORST = 1e12


@dataclass
class Mixture:
    """Draws the operator of each birth by weight, as evocity's search does; ``takes`` says which
    operators have the sources as further parents."""

    recipe: object
    sources: Sequence[Genome]
    names: list[str] = field(init=False)
    chances: np.ndarray = field(init=False)

    def __post_init__(self):
        weights = {name: entry.weight for name, entry in self.recipe.operators.items()}
        self.names = list(weights)
        self.chances = np.array(list(weights.values())) / sum(weights.values())

    def job(self, first: Genome, second: Genome, rng: np.random.Generator) -> tuple:
        """Make the job of one birth: operator, parents, generator."""
        operator = self.recipe.operator_drawn(rng.choice(self.names, p=self.chances), rng)
        parents = [first, second][: operator.parents[0]]
        if getattr(operator, "takes_founders", False):
            parents += self.sources
        return operator, parents, rng


def founders(place) -> list[tuple]:
    """Make the jobs of evocity's own founders: the sources, then fusions and mutants of them."""
    plans = [founder_plan(place.recipe, place.sources, slot) for slot in range(POPULATION)]
    return [(plan.operator, plan.genomes, plan.rng) for plan in plans]


def by_deap() -> Method:
    """DEAP's eaMuPlusLambda with selNSGA2, by the toolbox; the share of crossings is that of the
    mixture's weights. The toolbox gives births that break the guard huge losses, as DEAP's
    DeltaPenalty does."""

    def method(case: Case, count: int, told: Told) -> None:
        from deap import algorithms

        seed_deap(case.seed)
        recipe = case.recipe(0, operators=MIXTURE)
        weights = {name: entry.weight for name, entry in recipe.operators.items()}
        crossing = sum(w for name, w in weights.items() if recipe.operator(name).parents[0] > 1)
        share = crossing / sum(weights.values())
        with deap_toolbox(recipe, workers=2) as box:
            evaluate, spread = box.evaluate, box.map

            def mapped(function, individuals):
                found = spread(evaluate, individuals)
                names = case.measures
                kept = [{} if one.error else one.values for one in individuals]
                told(np.array([[v.get(name, np.nan) for name in names] for v in kept], float))
                return found

            box.register("map", mapped)
            generations = -(-count // POPULATION) - 1
            how = {"cxpb": share, "mutpb": 1 - share, "ngen": generations, "verbose": False}
            algorithms.eaMuPlusLambda(
                box.population(POPULATION), box, mu=POPULATION, lambda_=POPULATION, **how
            )

    return method


def by_pymoo(make: Callable[[dict], object]) -> Method:
    """An algorithm of pymoo on variables of its own kind, as its guide "Custom Variable Type" has
    them: a variable is a job, bred when it is evaluated. The guard is an inequality constraint."""

    def method(case: Case, count: int, told: Told) -> None:
        from pymoo.core.crossover import Crossover
        from pymoo.core.duplicate import ElementwiseDuplicateElimination
        from pymoo.core.mutation import Mutation
        from pymoo.core.problem import Problem
        from pymoo.core.sampling import Sampling
        from pymoo.optimize import minimize

        with bench(case, operators=MIXTURE) as place:
            mixture, numbers = Mixture(place.recipe, place.sources), iter(range(10**9))

            class Jobs(Problem):
                def __init__(self):
                    super().__init__(n_var=1, n_obj=len(case.goals), n_ieq_constr=1)

                def _evaluate(self, births, out, *args, **kwargs):
                    jobs = [one[0] for one in births]
                    found = place.bred([job.plan for job in jobs], told)
                    for job, (*_, genome) in zip(jobs, found, strict=True):
                        job.genome = genome
                    worst = [_WORST] * len(case.goals)
                    out["F"] = np.array([worst if f is None else list(f) for f, *_ in found])
                    out["G"] = np.array([[min(broken, _WORST)] for _, broken, _ in found])

            class Founders(Sampling):
                def _do(self, problem, n_samples, **kwargs):
                    jobs = [Job(plan) for plan in founders(place)[:n_samples]]
                    return np.array(jobs, object)[:, None]

            class OneOperator(Crossover):
                def __init__(self):
                    super().__init__(n_parents=2, n_offsprings=1, prob=1.0)

                def _do(self, problem, X, **kwargs):
                    children = np.empty((1, X.shape[1], 1), object)
                    for k in range(X.shape[1]):
                        first, second = (X[parent, k, 0] for parent in range(2))
                        rng = np.random.default_rng([case.seed, 1, next(numbers)])
                        pair = [
                            place.sources[0] if one.genome is None else one.genome
                            for one in (first, second)  # a birth that failed has no genome
                        ]
                        children[0, k, 0] = Job(mixture.job(*pair, rng))
                    return children

            class Same(ElementwiseDuplicateElimination):
                def is_equal(self, a, b):
                    return a.X[0] is b.X[0]

            how = {
                "pop_size": POPULATION,
                "sampling": Founders(),
                "crossover": OneOperator(),
                "mutation": Mutation(prob=0.0),
                "eliminate_duplicates": Same(),
            }
            minimize(Jobs(), make(how), ("n_eval", count), seed=case.seed)

    return method


class Job:
    """A birth that pymoo carries about: its plan, and its genome once it is bred."""

    def __init__(self, plan: tuple):
        self.plan, self.genome = plan, None


def _nsga2(how: dict):
    from pymoo.algorithms.moo.nsga2 import NSGA2

    return NSGA2(**how)


def _sms(how: dict):
    from pymoo.algorithms.moo.sms import SMSEMOA

    return SMSEMOA(**how)


def _age2(how: dict):
    from pymoo.algorithms.moo.age2 import AGEMOEA2

    return AGEMOEA2(**how)


# -- a chain of operators -------------------------------------------------------------------------


@dataclass(frozen=True)
class Chain:
    """Operators in a row, each with its own seed: the child of one is the first parent of the
    next. The other parents are the sources."""

    steps: tuple[tuple[Operator, int], ...]

    name = "chain"
    parents = (1, None)

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        child, *sources = parents
        for operator, seed in self.steps:
            others = [one for one in sources if one.digest != child.digest] or sources
            more = others[: operator.parents[0] - 1]
            if getattr(operator, "takes_founders", False):
                more = [*more, *sources]
            child = operator([child, *more], np.random.default_rng(seed))
        return child


def by_optuna_chain() -> Method:
    """Optuna's NSGA-II chooses a source, up to four operators in a row, their parameters that have
    a range, and their seeds. The guard is a constraint of the sampler."""

    def method(case: Case, count: int, told: Told) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        with bench(case, operators=MIXTURE) as place:
            recipe, sources = place.recipe, place.sources
            sampler = optuna.samplers.NSGAIISampler(population_size=POPULATION, seed=case.seed)
            study = optuna.create_study(directions=["minimize"] * len(case.goals), sampler=sampler)
            made = 0
            while made < count:
                trials = [study.ask() for _ in range(min(POPULATION, count - made))]
                jobs = [chain_job(recipe, sources, trial) for trial in trials]
                found = place.born(jobs, told)
                for trial, (losses, broken) in zip(trials, found, strict=True):
                    trial.set_constraint("guard", float(min(broken, _WORST)))
                    values = [_WORST] * len(case.goals) if losses is None else list(losses)
                    study.tell(trial, values)
                made += len(jobs)

    return method


def chain_job(recipe, sources: Sequence[Genome], trial) -> tuple:
    """Make the job of a ``trial``: which source, and which operators with which parameters."""
    first = trial.suggest_int("source", 0, len(sources) - 1)
    steps = []
    for step in range(CHAIN):
        name = trial.suggest_categorical(f"operator {step}", ["none", *recipe.operators])
        seed = trial.suggest_int(f"seed {step}", 0, 999)
        if name == "none":
            continue
        kind = type(recipe.operator(name))
        ranges = split_ranges(kind, recipe.parameters(name))[1]
        drawn = {
            key: (trial.suggest_int if one.whole else trial.suggest_float)(
                f"{name} {key} {step}", one.low, one.high
            )
            for key, one in ranges.items()
        }
        steps.append((recipe.operator(name, **drawn), seed))
    return Chain(tuple(steps)), [sources[first], *sources], np.random.default_rng(0)


#: Methods by name; the first is evocity with a new recipe.
PEERS: dict[str, Method] = {
    "new recipe": by_recipe(operators=MIXTURE, search=SEARCH),
    "DEAP NSGA-II, our operators": by_deap(),
    "pymoo NSGA-II, our operators": by_pymoo(_nsga2),
    "pymoo SMS-EMOA, our operators": by_pymoo(_sms),
    "pymoo AGE-MOEA-II, our operators": by_pymoo(_age2),
    "Optuna NSGA-II, chain of operators": by_optuna_chain(),
}
