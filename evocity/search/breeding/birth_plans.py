"""Plans of births: operator, parents and generator of each, drawn before anything is bred."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np

from evocity import operators
from evocity.fitness import Aims
from evocity.genome import Genome
from evocity.recipe.mixture import operator_of
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.levers import draw_move
from evocity.selection.algorithms import Algorithm
from evocity.selection.individual import Individual
from evocity.store import Reconstruction


@dataclass(frozen=True)
class BirthPlan:
    """How one individual is bred; without an operator it is its one parent. ``island``: where it is
    born; ``reconstruction``: how to breed it later, if the log may omit its genome. ``redraw``:
    draws the plan that replaces this one if the child equals a parent; None if nothing does.
    ``before``: the plan that this one replaces."""

    id: int
    operator: object | None
    parents: tuple[int, ...]
    genomes: tuple[Genome, ...] = field(repr=False)
    rng: np.random.Generator = field(repr=False)
    island: str | None = None
    reconstruction: Reconstruction | None = field(default=None, repr=False)
    redraw: "Callable[[BirthPlan], BirthPlan | None] | None" = field(default=None, repr=False)
    before: "BirthPlan | None" = field(default=None, repr=False)

    @property
    def first(self) -> "BirthPlan":
        """The first plan of the birth; the plan itself unless it was drawn again."""
        return self if self.before is None else self.before.first

    @property
    def rejected(self) -> list[str]:
        """The operators of the plans before this one, whose children equalled a parent."""
        return [] if self.before is None else [*self.before.rejected, self.before.name]

    def equals_parent(self, child: Genome) -> bool:
        """Whether the code of a ``child`` equals that of one of its parents."""
        return any(child.digest == genome.digest for genome in self.genomes)

    @property
    def name(self) -> str:
        """The operator's name; "source" without one."""
        return "source" if self.operator is None else self.operator.name

    @property
    def made(self) -> dict:
        """`Genome.made` for a birth that fails: the operator and its drawn parameters."""
        drawn = getattr(self.operator, "drawn", None)
        return {"operator": self.name} | ({"drawn": dict(drawn)} if drawn else {})


@dataclass(frozen=True)
class Picks:
    """Individuals, (id, genome) each, that a user picked as parents: a ``share`` of the births has
    one of them as its first parent."""

    individuals: tuple[tuple[int, Genome], ...] = field(default=(), repr=False)
    share: float = 0.5

    def among(
        self, parents: list[tuple[int, Genome]], rng: np.random.Generator
    ) -> list[tuple[int, Genome]]:
        """Return the ``parents`` of one birth; in a ``share`` of cases the first is a pick."""
        if not self.individuals or rng.random() >= self.share:
            return parents
        chosen = self.individuals[rng.integers(len(self.individuals))]
        if any(identifier == chosen[0] for identifier, _ in parents):  # it moves to the front
            return [chosen, *(parent for parent in parents if parent[0] != chosen[0])]
        return [chosen, *parents[1:]]


@dataclass(frozen=True)
class Guidance:
    """Changes of the breeding by commands and credit: ``picks``, and ``weights``, island ->
    operator -> weight in place of the recipe's. The only island of a search has the name None."""

    picks: Picks = Picks()
    weights: Mapping[str | None, Mapping[str, float]] = field(default_factory=dict)


UNGUIDED = Guidance()


def birth_generator(seed: int, generation: int, slot: int, *more: int) -> np.random.Generator:
    """Return the generator of one birth. Only this birth draws from it, so the number of workers
    changes nothing. Keys with ``more`` numbers are of no birth."""
    sequence = np.random.SeedSequence(seed, spawn_key=(generation, slot, *more))
    return np.random.Generator(np.random.PCG64(sequence))


def selection_generator(recipe: Recipe, generation: int, island: int = 0) -> np.random.Generator:
    """Return the generator of a generation's selection on an island; no birth has its slot."""
    return birth_generator(recipe.run.seed, generation, recipe.generation_size + 2 * island)


def admission_generator(recipe: Recipe, identifier: int) -> np.random.Generator:
    """Return the generator of the selection after one birth."""
    return birth_generator(recipe.run.seed, *divmod(identifier, recipe.run.population), 0)


def migration_generator(recipe: Recipe, generation: int, island: int) -> np.random.Generator:
    """Return the generator of an island's admission of migrants; with the count of islands as
    ``island``, that of the choice of migrants. No birth and no selection has its slot."""
    return birth_generator(recipe.run.seed, generation, recipe.generation_size + 2 * island + 1)


def founder_plans(
    recipe: Recipe, sources: Sequence[Genome], slots: range | None = None
) -> list[BirthPlan]:
    """Plan generation 0, or its ``slots``: the sources, then their fusions and mutants.

    After the sources, two births in three are fusions and one is a mutant. Fusions take the
    ordered pairs of sources in turn, with a fill from the recipe's range, else from 0.1…0.9. A
    single source has only mutants. The first weighted operators of the recipe's kind breed them.
    """
    slots = range(recipe.generation_size) if slots is None else slots
    return [founder_plan(recipe, sources, slot) for slot in slots]


def founder_plan(
    recipe: Recipe,
    sources: Sequence[Genome],
    slot: int,
    rng: np.random.Generator | None = None,
) -> BirthPlan:
    """Plan the birth in one ``slot`` (0 or more) of generation 0, see `founder_plans`. ``rng``: the
    generator of a founder that is born in a later generation."""
    count = len(sources)
    rng = birth_generator(recipe.run.seed, 0, slot) if rng is None else rng
    if slot < count:
        return BirthPlan(slot, None, (), (sources[slot],), rng)
    weighty = {name for name, entry in recipe.operators.items() if entry.weight > 0}
    crossing, changing = (
        next((name for name in names if name in weighty), names[-1])
        for names in recipe.kind.first_operators
    )
    pairs = [(i, j) for i in range(count) for j in range(count) if i != j]
    turn = slot - count
    if pairs and turn % 3 < 2:
        changes = _all_faces(recipe, crossing)
        if recipe.takes(crossing, "fill") and not recipe.ranged(crossing, "fill"):
            changes["fill"] = round(float(rng.uniform(0.1, 0.9)), 3)
        if recipe.parameters(crossing).get("void"):
            changes["void"] = False
        operator = recipe.operator_drawn(crossing, rng, **changes)
        parents = pairs[(turn // 3 * 2 + turn % 3) % len(pairs)]
    else:
        operator = recipe.operator_drawn(changing, rng, **_all_faces(recipe, changing))
        lone = (turn // 3 if pairs else turn) % count
        parents = (lone, *founder_indices(operator, count))
    return BirthPlan(slot, operator, parents, tuple(sources[i] for i in parents), rng)


def _all_faces(recipe: Recipe, name: str) -> dict[str, None]:
    """Parameters of an operator ``name`` that fills faces of a plan: founders fill all of them."""
    fills = recipe.takes(name, "faces") and recipe.takes(name, "slack")
    return {"faces": None} if fills and not recipe.ranged(name, "faces") else {}


def learner_plans(
    recipe: Recipe, algorithm: Algorithm, generation: int, sources: Sequence[Genome]
) -> list[BirthPlan]:
    """Plan a ``generation`` of an ``algorithm`` that breeds by its own operator: of all
    ``sources``, which take the first slots of generation 0."""
    first = generation * recipe.run.population
    rng = birth_generator(recipe.run.seed, generation, recipe.run.population + 1)
    plans = []
    for slot, settings in enumerate(algorithm.settings(first, len(sources), rng)):
        own_rng = birth_generator(recipe.run.seed, generation, slot)
        if generation == 0 and slot < len(sources):
            plans.append(BirthPlan(slot, None, (), (sources[slot],), own_rng))
        else:
            operator = recipe.operator(algorithm.breeds_by, **settings)
            parents = tuple(range(len(sources)))
            plans.append(BirthPlan(first + slot, operator, parents, tuple(sources), own_rng))
    return plans


def founder_indices(operator, count: int) -> range:
    """Return the ids of those of ``count`` sources that ``operator`` has as further parents."""
    return range(count if getattr(operator, "takes_founders", False) else 0)


def choose_mates(
    algorithm: Algorithm, living: Sequence[Individual], count: int, rng: np.random.Generator
) -> list[int]:
    """Let the ``algorithm`` choose ``count`` parents that have one plan, and return their indices.
    If too few of the ``living`` have the plan of the first parent, the others have any plan."""
    (first,) = algorithm.parents(living, 1, rng)
    plan = living[first].plan
    others = [at for at in range(len(living)) if at != first]
    mates = [at for at in others if plan is not None and living[at].plan == plan]
    among = mates if len(mates) >= count - 1 else others or [first]
    chosen = algorithm.parents([living[at] for at in among], count - 1, rng)
    return [first, *(among[at] for at in chosen)]


def child_plans(
    recipe: Recipe,
    algorithm: Algorithm,
    generation: int,
    living: Sequence[Individual],
    sources: Sequence[Genome],
    guidance: Guidance = UNGUIDED,
    island: str | None = None,
    slots: range | None = None,
    aims: Aims | None = None,
) -> list[BirthPlan]:
    """Plan the children of one ``generation`` of an ``island``, or of its ``slots``. Each draws an
    operator by weight, lets the ``algorithm`` choose parents among the ``living``, and draws ranged
    parameters. ``sources`` are further parents of operators that take from anywhere. A share of the
    births, by the key ``steer``, has an operator by what the first parent misses of the ``aims``.
    """
    mixture = {name: entry.weight for name, entry in recipe.operators.items()}
    mixture |= guidance.weights.get(island, {})
    names = [name for name, weight in mixture.items() if weight > 0]
    chances = np.array([mixture[name] for name in names])
    counts = {
        name: recipe.operators[name].parents or recipe.operator(name).parents[0] for name in names
    }
    drawing = cache(recipe.drawing)
    # numpy's choice does the same with these chances, and checks them at every birth
    reached = (chances / chances.sum()).cumsum()
    reached /= reached[-1]
    plans = []
    known, mates = operators.operators(), recipe.search.mates
    # nobody knows what picks miss
    steer = 0.0 if aims is None or guidance.picks.individuals else recipe.search.steer
    related = {name for name in names if mates and getattr(known[name], "crosses_plans", False)}
    for slot in range(recipe.generation_size) if slots is None else slots:
        rng = birth_generator(recipe.run.seed, generation, slot)
        identifier = generation * recipe.generation_size + slot
        if steer and rng.random() < steer:
            plan = steered_plan(recipe, algorithm, identifier, living, sources, aims, rng)
            if plan is not None:
                plans.append(plan)
                continue
        name = names[reached.searchsorted(rng.random(), side="right")]
        choose = algorithm.parents
        if name in related and rng.random() < mates:
            choose = partial(choose_mates, algorithm)
        parents = choose(living, counts[name], rng)
        chosen = guidance.picks.among([(living[i].id, living[i].genome) for i in parents], rng)
        operator = drawing(name)(rng)
        chosen += [(i, sources[i]) for i in founder_indices(operator, len(sources))]
        ids, genomes = zip(*chosen, strict=True)
        plans.append(BirthPlan(identifier, operator, ids, genomes, rng))
    return plans


def steered_plan(
    recipe: Recipe,
    algorithm: Algorithm,
    identifier: int,
    living: Sequence[Individual],
    sources: Sequence[Genome],
    aims: Aims,
    rng: np.random.Generator,
) -> BirthPlan | None:
    """Plan a birth that makes up for what its first parent misses of the ``aims``; None if no lever
    does."""
    (first,) = algorithm.parents(living, 1, rng)
    move = draw_move(aims, living[first].values, rng)
    if move is None:
        return None
    name, parameters = move
    operator = operator_of(name, parameters, recipe.genome.coding)
    rest = [one for at, one in enumerate(living) if at != first] or [living[first]]
    others = algorithm.parents(rest, operator.parents[0] - 1, rng)
    chosen = [(one.id, one.genome) for one in (living[first], *(rest[at] for at in others))]
    chosen += [(i, sources[i]) for i in founder_indices(operator, len(sources))]
    ids, genomes = zip(*chosen, strict=True)
    return BirthPlan(identifier, operator, ids, genomes, rng)
