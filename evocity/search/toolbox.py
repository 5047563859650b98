"""DEAP's algorithms on city genomes: a toolbox whose individuals are cities.

The workers breed and evaluate the children, each under its deadline.
"""

import contextlib
from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError, OperatorError, RecipeError, plain_text, spell
from evocity.evaluation import Engine
from evocity.evaluation.compilation import compile_once, kernel_parts
from evocity.genome import Genome
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.birth_plans import birth_generator, founder_plan
from evocity.search.preparation.preparation import prepare
from evocity.search.preparation.startup import Crew, block_sides, start_engine
from evocity.selection.backends import deap

#: The least loss of an individual that breaks a constraint, and that of one that failed.
BROKEN, FAILED = 1e30, 1e40
# The generation of all births of DEAP's algorithms, for their generators.
_BIRTHS = 1


class City:
    """An individual of DEAP's algorithms: a genome, bred at first use, with a ``fitness``.

    values : measure -> raw value, once it is evaluated.
    violation : how far it breaks the constraints, 0 if it keeps them.
    error : why breeding or evaluation failed, or None.
    operator : the name of what bred it, None for a source.
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
        """Whether it has a genome yet."""
        return self._genome is not None

    @property
    def genome(self) -> Genome:
        """Its genome. Raises `OperatorError` if its breeding failed."""
        if self._genome is None and self.error is None:
            self._breed(self)
        if self._genome is None:
            raise OperatorError(
                self.error, "an individual whose breeding succeeded", "choose another parent"
            )
        return self._genome

    @genome.setter
    def genome(self, genome: Genome | None) -> None:
        self._genome = genome

    @property
    def parents(self) -> tuple[Genome, ...]:
        """The genomes it was bred from; a source is its own parent."""
        return self.plan[1]

    @property
    def city(self) -> CityMap:
        """The map of its genome."""
        from evocity.coding import decode

        return decode(self.genome).city

    def __deepcopy__(self, memo: dict) -> "City":
        """Clones share the genome, which never changes, and have their own fitness."""
        other = object.__new__(City)
        other.__dict__ |= self.__dict__ | {"values": dict(self.values)}
        other.fitness = type(self.fitness)(self.fitness.values if self.fitness.valid else ())
        return other

    def __eq__(self, other: object) -> bool:
        return isinstance(other, City) and (self is other or self.genome == other.genome)

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        text = self.error or (f"{self.genome}" if self.bred else "not bred yet")
        return f"City({plain_text(text)})"


class Toolbox(deap.Toolbox):
    """DEAP's toolbox, with ``individual``, ``population``, ``clone``, ``mate``, ``mutate``,
    ``evaluate``, ``map`` and ``select`` registered; made by `deap_toolbox`. It has workers: `close`
    it, or use it in a ``with``."""

    def __init__(self, recipe: Recipe, workers: int | None, tell: Callable[[str], None]):
        super().__init__()
        self.recipe = recipe
        self._crew = Crew.choose(recipe, workers)
        self._shipment = self._crew.ship(recipe)
        compile_once(block_sides(recipe, None), kernel_parts(recipe), tell)
        self.prepared = prepare(recipe, tell)
        self._sources = [source.genome for source in self.prepared.sources]
        self._tell, self._pool = tell, None
        self._fitness = deap.losses_kind(len(self.prepared.aims.names), _wrong_values)
        self._slots, self._births = count(), count()
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
        self._evaluates = self.evaluate
        self.register("map", self._map)

    def __enter__(self) -> "Toolbox":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the workers; the next evaluation starts them again."""
        if self._pool is not None:
            self._pool.close()
            self._pool = None

    # -- what is registered --------------------------------------------------------------

    def _individual(self) -> City:
        """Return the next founder: the sources first, then fusions and mutants of them."""
        return self._founder(next(self._slots))

    def _population(self, n: int | None = None) -> list[City]:
        """Return ``n`` founders, by default the recipe's population: the sources first."""
        size = self.recipe.run.population if n is None else n
        return [self._founder(slot) for slot in range(size)]

    def _mate(self, one: City, other: City) -> tuple[City, City]:
        """Return two children of two parents, by crossing operators of the recipe, drawn by weight.
        Each parent is the first of one child, which takes its streets."""
        _refuse_others(one, other)
        return self._child(self._crossing, one, other), self._child(self._crossing, other, one)

    def _mutate(self, one: City) -> tuple[City]:
        """Return a child of one parent, by an operator of the recipe that needs no other."""
        _refuse_others(one)
        return (self._child(self._changing, one),)

    def _evaluate(self, one: City) -> tuple[float, ...]:
        """Return the losses of the recipe's goals, lower is better; set its ``values``."""
        return self._losses([one])[0]

    def _map(self, function: Callable, *iterables: Iterable) -> list:
        """Do as Python's ``map``; the workers share the individuals of `evaluate`."""
        if function is not self._evaluates:
            return list(map(function, *iterables))
        (individuals,) = iterables
        return self._losses(list(individuals))

    # -- breeding and evaluation ---------------------------------------------------------

    def _founder(self, slot: int) -> City:
        plan = founder_plan(self.recipe, self._sources, slot)
        return self._new(plan.operator, plan.genomes, plan.rng)

    def _child(self, weights: dict[str, float], *parents: City) -> City:
        if not weights:
            kind, chance = ("two parents", "cxpb") if len(parents) > 1 else ("one parent", "mutpb")
            raise OperatorError(
                f"[operators] has no operator for {kind}, only {', '.join(self.recipe.operators)}",
                f"an operator that breeds from {kind}",
                f"add such an operator to the recipe, or set DEAP's probability {chance} to 0",
            )
        rng = birth_generator(self.recipe.run.seed, _BIRTHS, next(self._births))
        names = list(weights)
        chances = np.array([weights[name] for name in names])
        name = names[rng.choice(len(names), p=chances / chances.sum())]
        operator = self.recipe.operator_drawn(name, rng)
        living, genomes = [], []
        for parent in parents:
            with contextlib.suppress(OperatorError):
                genomes.append(parent.genome)
                living.append(parent)
        if len(living) < len(parents):  # a failed parent has no children
            return self.clone(living[0] if living else parents[0])
        if getattr(operator, "takes_founders", False):
            genomes += self._sources
        return self._new(operator, genomes, rng)

    def _new(self, operator, genomes: Sequence[Genome], rng: np.random.Generator) -> City:
        return City(self._fitness(), self._breed, operator, genomes, rng)

    def _breed(self, one: City) -> None:
        (outcome,) = self._workers.run("breed", [one.plan])
        one.genome, one.error = outcome.genome, outcome.error

    def _losses(self, individuals: list[City]) -> list[tuple[float, ...]]:
        _refuse_others(*individuals)
        fresh = [one for one in individuals if not one.bred and one.error is None]
        known = [one for one in individuals if one.bred]
        outcomes = self._workers.run("born", [one.plan for one in fresh])
        for one, outcome in zip(fresh, outcomes, strict=True):
            one.genome = outcome.genome
        outcomes += self._workers.run("evaluate", [(one.genome, one.parents) for one in known])
        aims = self.prepared.aims
        losses = {}
        for one, outcome in zip([*fresh, *known], outcomes, strict=True):
            one.values = dict(outcome.values)
            if outcome.status != "ok":
                one.error = outcome.error or outcome.status
                continue
            one.error, one.violation = None, aims.violation(one.values)
            losses[id(one)] = (
                (BROKEN * (1 + min(one.violation, 1e6)),) * len(aims.names)
                if one.violation
                else aims.losses(one.values)
            )
        return [losses.get(id(one), (FAILED,) * len(aims.names)) for one in individuals]

    @property
    def _workers(self) -> Engine:
        if self._pool is None:
            setup = self.prepared, self._crew, self._shipment, self._tell, self._tell
            self._pool = start_engine(*setup)
        return self._pool


def deap_toolbox(
    recipe: Recipe,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Toolbox:
    """Make a ``deap.base.Toolbox`` with the cities, operators and measures of a recipe; every
    algorithm of DEAP runs on this toolbox.

    >>> from deap import algorithms, tools  # doctest: +SKIP
    >>> with evocity.deap_toolbox(evocity.read_recipe("demo")) as toolbox:  # doctest: +SKIP
    ...     population, log = algorithms.eaMuPlusLambda(
    ...         toolbox.population(n=24), toolbox, 24, 24, cxpb=0.6, mutpb=0.4, ngen=10
    ...     )
    ...     best = tools.selBest(population, 1)[0].city

    The fitness of an individual is one loss for each goal, and lower losses are better. If an
    individual breaks a constraint, its losses are at least the constant `BROKEN`. If an individual
    failed, each of its losses is the constant `FAILED`.

    The argument ``workers`` replaces the recipe's number of processes; with ``workers=0``, the
    calling process evaluates all births. Operators draw random numbers from a generator with the
    recipe's seed. DEAP draws random numbers from Python's module ``random``, which you seed
    yourself.

    The function raises the same errors as `Search.prepare`. Raises `RecipeError` for a recipe with
    islands.
    """
    if not isinstance(recipe, Recipe):
        raise OperatorError(
            f"{spell(recipe)} is not a recipe",
            "an object of the class evocity.Recipe",
            "read the recipe first: evocity.read_recipe(path)",
        )
    if recipe.islands:
        raise RecipeError(
            f"the recipe has {len(recipe.islands)} islands, but a DEAP toolbox breeds no islands",
            "a recipe with one population",
            "remove [[islands]]; deap.tools.migRing moves individuals between your own populations",
        )
    return Toolbox(recipe, workers, progress or (lambda text: None))


def _refuse_others(*individuals: object) -> None:
    for one in individuals:
        if not isinstance(one, City):
            raise OperatorError(
                f"{spell(one)} is not an individual of this toolbox",
                "a result of the toolbox function 'individual', 'population', 'mate' or 'mutate'",
                "register only functions that return individuals of this toolbox",
            )


def _wrong_values(values: object, goals: int) -> EvocityError:
    return OperatorError(
        f"the fitness values {spell(values)} do not fit the goals",
        f"{goals} finite number{'s' if goals > 1 else ''}, one for each goal of the recipe",
        "return a tuple of these numbers from the function registered as 'evaluate'",
    )
