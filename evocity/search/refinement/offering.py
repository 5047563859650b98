"""Whose fabric is offered to an individual that is refined, round by round."""

from collections.abc import Sequence

import numpy as np

from evocity.errors import RunError
from evocity.genome import Genome
from evocity.search.breeding import founders_of
from evocity.search.founding import alive
from evocity.search.recipe import Recipe
from evocity.search.refinement.climbing import Breed
from evocity.store import Birth, Run

#: Steps by which a variant is bred, and how many are tried at most: some fail.
_STEPS, _TRIES = 3, 12


class Offers:
    """What each round offers. Of named ``ids``: all of them. Else one of those who live in the last
    generation, and a variant of what the rounds before made: bred from it in a few steps by the
    ``recipe``'s own operators, parameters drawn, and not measured. ``sources``: further parents of
    operators that take from anywhere."""

    def __init__(
        self,
        run: Run,
        birth: Birth,
        ids: Sequence[int] | None,
        recipe: Recipe,
        sources: Sequence[Genome],
        breed: Breed,
        seed: int,
    ):
        named, living = ids is not None, run.members(run.generations[-1]).column("id").to_pylist()
        found = alive(
            run, [one for one in dict.fromkeys(ids if named else living) if one != birth.id]
        )
        self._others = [one for one in found if one.genome.digest != birth.genome.digest]
        if named and not self._others:
            raise RunError(
                f"{run.path}: nobody but individual {birth.id} to take fabric from",
                "one other individual or more",
                "name others, or none: then those who live are drawn from",
            )
        self._named, self._breed, self._sources = named, breed, sources
        self._recipe, self._rng = recipe, np.random.default_rng(seed)
        self.taken: dict[int, None] = {}

    def next(self, genome: Genome) -> list[Genome]:
        """The genomes that are offered to ``genome``, other than it; none only if neither is there
        anybody nor can anything be bred. ``taken`` tells the ids of all until then."""
        chosen, variants = self._others, []
        if not self._named:
            chosen = [self._others[k] for k in self._rng.permutation(len(self._others))[:1]]
            variants = [self._variant(genome)]
        self.taken.update(dict.fromkeys(one.id for one in chosen))
        offered = [*(one.genome for one in chosen), *variants]
        return [one for one in offered if one.digest != genome.digest]

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
            parents += [self._sources[k] for k in founders_of(operator, len(self._sources))]
            child = self._breed(operator, parents, self._rng).genome
            if child is not None:
                genome, steps = child, steps + 1
            if steps == _STEPS:
                break
        return genome


__all__ = ["Offers"]
