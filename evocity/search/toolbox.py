"""DEAP's algorithms on city genomes: a toolbox whose individuals are cities.

Children are bred where they are evaluated: in the workers, each with its deadline.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError, OperatorError, RecipeError, shown
from evocity.fitness.shipping import shipped
from evocity.genome import Genome
from evocity.search.beginning import Crew, pool_of, sides_of
from evocity.search.borrowed import deap
from evocity.search.breeding import founder, generator
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluation import Engine
from evocity.search.preparation import prepare
from evocity.search.recipe import Recipe

#: Losses of an individual that breaks a constraint are beyond that, those of one that failed
#: `FAILED`: worse than all others.
BROKEN, FAILED = 1e30, 1e40
# The births of DEAP's algorithms have no generation: theirs are numbered in one.
_BIRTHS = 1


class City:
    """An individual of DEAP's algorithms: a genome, bred when it is asked for, with a ``fitness``.

    ``values`` maps measures to raw values once it is evaluated, ``violation`` tells how far it
    breaks the constraints, 0 if it keeps them; ``error`` why breeding or evaluation failed, or
    None; ``operator`` what bred it, None for a source.
    """

    def __init__(self, fitness: Any, breed: Callable[["City"], None], operator, parents, rng):
        self.fitness, self._breed = fitness, breed
        self.operator = None if operator is None else operator.name
        self.plan = operator, tuple(parents), rng
        self.values: dict[str, float] = {}
        self.violation = 0.0
        self.error: str | None = None
        self._genome = parents[0] if operator is None else None

    @property
    def bred(self) -> bool:
        """Whether its genome is there."""
        return self._genome is not None

    @property
    def genome(self) -> Genome:
        """Raises `OperatorError` if its breeding failed."""
        if self._genome is None and self.error is None:
            self._breed(self)
        if self._genome is None:
            raise OperatorError(self.error, "an individual that was bred", "breed from another")
        return self._genome

    @genome.setter
    def genome(self, genome: Genome | None) -> None:
        self._genome = genome

    @property
    def parents(self) -> tuple[Genome, ...]:
        """What it was bred from; a source is its own parent."""
        return self.plan[1]

    @property
    def city(self) -> CityMap:
        """Its map."""
        from evocity.coding import decode

        return decode(self.genome).city

    def __deepcopy__(self, memo: dict) -> "City":
        """Clones share the genome, which nobody changes, and have a fitness of their own."""
        other = object.__new__(City)
        other.__dict__ |= self.__dict__ | {"values": dict(self.values)}
        other.fitness = type(self.fitness)(self.fitness.values if self.fitness.valid else ())
        return other

    def __eq__(self, other: object) -> bool:
        return isinstance(other, City) and (self is other or self.genome == other.genome)

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        told = self.error or (f"{self.genome}" if self.bred else "not bred yet")
        return f"City({told})"


class Toolbox(deap.Toolbox):
    """DEAP's toolbox, with ``individual``, ``population``, ``clone``, ``mate``, ``mutate``,
    ``evaluate``, ``map`` and ``select`` registered; made by `deap_toolbox`. `close` it, or use it
    in a ``with``: it has workers."""

    def __init__(self, recipe: Recipe, workers: int | None, tell: Callable[[str], None]):
        super().__init__()
        self.recipe = recipe
        self._crew = Crew.asked(recipe, workers)
        measured = [*recipe.measures, *recipe.recorded]
        self._shipped = shipped(measured) if not self._crew.here else ()
        compile_once(sides_of(recipe, None), needed(recipe), tell)
        self.prepared = prepare(recipe, tell)
        self._sources = [source.genome for source in self.prepared.sources]
        self._tell, self._pool = tell, None
        self._fitness = deap.losses_kind(len(self.prepared.aims.names), _wrong_values)
        self._founded, self._births = count(), count()
        self._crossing, self._changing = (
            {
                name: entry.weight
                for name, entry in recipe.operators.items()
                if entry.weight > 0 and (recipe.operator(name).parents[0] > 1) is crossing
            }
            for crossing in (True, False)
        )
        self.register("individual", self._individual)
        self.register("population", self._population)
        self.register("mate", self._mate)
        self.register("mutate", self._mutate)
        self.register("evaluate", self._evaluate)
        self.register("select", deap.select_nsga2)
        self._own = self.evaluate
        self.register("map", self._map)

    def __enter__(self) -> "Toolbox":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the workers; they start again when they are needed."""
        if self._pool is not None:
            self._pool.close()
            self._pool = None

    # -- what is registered --------------------------------------------------------------

    def _individual(self) -> City:
        """The next founder: the sources first, then fusions and mutants of them."""
        return self._founder(next(self._founded))

    def _population(self, n: int | None = None) -> list[City]:
        """``n`` founders, the recipe's population unless told: the sources first."""
        size = self.recipe.run.population if n is None else n
        return [self._founder(slot) for slot in range(size)]

    def _mate(self, one: City, other: City) -> tuple[City, City]:
        """Two children of two parents, by an operator of the recipe that crosses, drawn by weight:
        the streets, or whatever else is the first parent's, are of each in turn."""
        _refuse_strangers(one, other)
        return self._child(self._crossing, one, other), self._child(self._crossing, other, one)

    def _mutate(self, one: City) -> tuple[City]:
        """A child of one parent, by an operator of the recipe that needs no other."""
        _refuse_strangers(one)
        return (self._child(self._changing, one),)

    def _evaluate(self, one: City) -> tuple[float, ...]:
        """Losses of the recipe's goals, lower is better; its ``values`` are told besides."""
        return self._losses([one])[0]

    def _map(self, function: Callable, *iterables: Iterable) -> list:
        """As Python's, but of `evaluate`, whose individuals the workers share."""
        if function is not self._own:
            return list(map(function, *iterables))
        (individuals,) = iterables
        return self._losses(list(individuals))

    # -- breeding and evaluation ---------------------------------------------------------

    def _founder(self, slot: int) -> City:
        plan = founder(self.recipe, self._sources, slot)
        return self._new(plan.operator, plan.genomes, plan.rng)

    def _child(self, weights: dict[str, float], *parents: City) -> City:
        if not weights:
            kind = "two parents" if len(parents) > 1 else "one parent"
            raise OperatorError(
                f"[operators] of {', '.join(self.recipe.operators)}",
                f"one for {kind}",
                "add one to the recipe, or give the probability 0 to what needs it",
            )
        rng = generator(self.recipe.run.seed, _BIRTHS, next(self._births))
        names = list(weights)
        chances = np.array([weights[name] for name in names])
        name = names[rng.choice(len(names), p=chances / chances.sum())]
        operator = self.recipe.operator_drawn(name, rng)
        living = [one for one in parents if self._alive(one)]
        if len(living) < len(parents):  # nothing comes of one that failed
            return self.clone(living[0] if living else parents[0])
        genomes = [one.genome for one in living]
        if getattr(operator, "takes_founders", False):
            genomes += self._sources
        return self._new(operator, genomes, rng)

    def _alive(self, one: City) -> bool:
        try:
            return one.genome is not None
        except OperatorError:
            return False

    def _new(self, operator, genomes: Sequence[Genome], rng: np.random.Generator) -> City:
        return City(self._fitness(), self._breed, operator, genomes, rng)

    def _breed(self, one: City) -> None:
        (outcome,) = self._workers.run("breed", [one.plan])
        one.genome, one.error = outcome.genome, outcome.error

    def _losses(self, individuals: list[City]) -> list[tuple[float, ...]]:
        _refuse_strangers(*individuals)
        fresh = [one for one in individuals if not one.bred and one.error is None]
        known = [one for one in individuals if one.bred]
        outcomes = self._workers.run("born", [one.plan for one in fresh])
        for one, outcome in zip(fresh, outcomes, strict=True):
            one.genome = outcome.genome
        outcomes += self._workers.run("evaluate", [(one.genome, one.parents) for one in known])
        aims = self.prepared.aims
        found = {}
        for one, outcome in zip([*fresh, *known], outcomes, strict=True):
            one.values = dict(outcome.values)
            if outcome.status != "ok":
                one.error = outcome.error or outcome.status
                continue
            one.error, one.violation = None, aims.violation(one.values)
            found[id(one)] = (
                (BROKEN * (1 + min(one.violation, 1e6)),) * len(aims.names)
                if one.violation
                else aims.losses(one.values)
            )
        return [found.get(id(one), (FAILED,) * len(aims.names)) for one in individuals]

    @property
    def _workers(self) -> Engine:
        if self._pool is None:
            args = self.prepared, self._crew, self._shipped, self._tell, self._tell
            self._pool = pool_of(*args)
        return self._pool


def deap_toolbox(
    recipe: Recipe,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Toolbox:
    """A ``deap.base.Toolbox`` for the cities, operators and measures of a ``recipe``: any algorithm
    of DEAP's own runs on it.

    >>> from deap import algorithms, tools  # doctest: +SKIP
    >>> with evocity.deap_toolbox(evocity.read_recipe("demo")) as toolbox:  # doctest: +SKIP
    ...     population, log = algorithms.eaMuPlusLambda(
    ...         toolbox.population(n=24), toolbox, 24, 24, cxpb=0.6, mutpb=0.4, ngen=10
    ...     )
    ...     best = tools.selBest(population, 1)[0].city

    Fitnesses are losses, lower is better: one for each goal. Whoever breaks a constraint has losses
    beyond `BROKEN`, whoever failed `FAILED`. ``workers`` evaluate, in place of the recipe's number;
    0 works in this process. What our operators draw comes from the recipe's seed; DEAP draws from
    Python's ``random``, which the caller seeds.

    Raises what `Search.prepare` raises, and `RecipeError` for a recipe with islands.
    """
    if not isinstance(recipe, Recipe):
        raise OperatorError(
            f"a toolbox for {shown(recipe)}",
            "a Recipe",
            "read one first: evocity.read_recipe(path)",
        )
    if recipe.islands:
        raise RecipeError(
            f"a recipe with {len(recipe.islands)} islands for DEAP's algorithms",
            "a recipe of one population",
            "leave [[islands]] out; DEAP's own migRing moves individuals between lists of them",
        )
    return Toolbox(recipe, workers, progress or (lambda text: None))


def _refuse_strangers(*individuals: object) -> None:
    for one in individuals:
        if not isinstance(one, City):
            raise OperatorError(
                f"an individual that is {shown(one)}",
                "one that toolbox.individual, population, mate or mutate made",
                "register functions that return individuals of this toolbox",
            )


def _wrong_values(values: object, goals: int) -> EvocityError:
    return OperatorError(
        f"fitness values {shown(values)}",
        f"{goals} finite number{'s' if goals > 1 else ''}, one for each goal of the recipe",
        "return such a tuple from the function registered as evaluate",
    )


__all__ = ["BROKEN", "FAILED", "City", "Toolbox", "deap_toolbox"]
