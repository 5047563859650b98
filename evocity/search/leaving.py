"""Which genomes a run's log leaves out, as ``[log] genomes`` of its recipe says.

One that is left out can be bred again from its parents: from what the log tells in its place,
without the recipe and without measuring anybody.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache

from evocity import operators
from evocity.errors import EvocityError
from evocity.search.breeding import Plan
from evocity.search.mixture import Drawn
from evocity.search.opening import open_run
from evocity.store import MOST_BREEDINGS, Again, Behind, Birth, Member, state_of


def again_of(plan: Plan) -> Again | None:
    """How the birth of a ``plan`` that was not carried out yet is bred once more; None where its
    operator and its parents do not tell that: of sources, of refinements, and of another package's
    operators that are more than their parameters."""
    settings = _settings(plan.name, plan.operator)
    return None if settings is None else Again(settings, state_of(plan.rng))


def _settings(name: str, operator) -> str | None:
    """The parameters that make an ``operator``, by its ``name``, what it is."""
    try:
        if isinstance(operator, Drawn):
            return json.dumps({**operator.parameters, **operator.drawn})
        told = _told(operator)
        return told if told is not None and _made_by(name, type(operator), told) else None
    except (TypeError, ValueError, RecursionError):  # parameters that JSON cannot hold
        return None


def _told(operator) -> str | None:
    """The fields of an ``operator`` that is nothing but its fields."""
    if not is_dataclass(operator) or not all(one.init for one in fields(operator)):
        return None
    names = [one.name for one in fields(operator)]
    if set(getattr(operator, "__dict__", ())) != set(names):
        return None
    return json.dumps({name: getattr(operator, name) for name in names})


@lru_cache
def _made_by(name: str, kind: type, settings: str) -> bool:
    """Whether ``settings`` make an operator of this ``kind`` that has them."""
    try:
        made = operators.make(name, **json.loads(settings))
    except EvocityError:
        return False
    return type(made) is kind and _told(made) == settings


class Leaving:
    """What the log of a run leaves out, generation by generation.

    genomes : "survivors" keeps the genomes of births that live on in the generation they are born
        in, "front" of those the first front, of any island.
    breedings : of all births so far, by id, how many are bred to have each; 0 where it is kept.

    Kept are besides births that nobody could breed again, see `again_of`, and those for which, with
    their ancestors, more than `MOST_BREEDINGS` would be bred.
    """

    def __init__(self, genomes: str, breedings: Iterable[int] = ()):
        self._genomes, self._breedings = genomes, bytearray(breedings)

    @classmethod
    def of(cls, writer: Behind) -> "Leaving":
        """Of the run that a ``writer`` begins, or goes on with."""
        genomes = writer.header.genomes
        if genomes == "all":
            return cls(genomes)
        run = open_run(writer.path)
        told = run.births(columns=["breedings"])["breedings"].to_pylist() if run.generations else []
        return cls(genomes, told)

    def written(self, births: Sequence[Birth], members: Sequence[Member]) -> Sequence[Birth]:
        """The ``births`` of the next generation, by id, as they are written down; ``members`` live
        in it."""
        if self._genomes == "all":
            return births
        kept = {one.id for one in members if self._genomes == "survivors" or one.rank == 0}
        return [self._written(one, one.id in kept) for one in births]

    def _written(self, birth: Birth, kept: bool) -> Birth:
        breedings = 1 + sum(self._breedings[one] for one in birth.parents)
        lasting = kept or birth.again is None or birth.genome is None
        if lasting or breedings > MOST_BREEDINGS:
            self._breedings.append(0)
            return birth
        self._breedings.append(breedings)
        again = replace(birth.again, breedings=breedings, digest=birth.genome.digest)
        return replace(birth, genome=None, again=again)


__all__ = ["Leaving", "again_of"]
