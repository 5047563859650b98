"""Genomes that the log of a run omits, as ``[log] genomes`` of its recipe says.

An omitted genome can be bred again from its parents by what the log holds in its place, without
the recipe and without any measure.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache

from evocity import operators
from evocity.errors import EvocityError
from evocity.recipe.mixture import Drawn
from evocity.search.breeding.birth_plans import BirthPlan
from evocity.search.record.complete_run import CompleteRun
from evocity.store import MOST_BREEDINGS, BackgroundWriter, Birth, Member, Reconstruction, state_of


def describe_rebreeding(plan: BirthPlan) -> Reconstruction | None:
    """Return what breeds the birth of a ``plan``, not carried out yet, a second time; None for
    sources, refinements, and operators of other packages that are more than their parameters."""
    settings = _settings(plan.name, plan.operator)
    return None if settings is None else Reconstruction(settings, state_of(plan.rng))


def _settings(name: str, operator) -> str | None:
    try:
        if isinstance(operator, Drawn):
            return json.dumps({**operator.parameters, **operator.drawn})
        settings = _fields_as_json(operator)
        return settings if settings and _made_by(name, type(operator), settings) else None
    except (TypeError, ValueError, RecursionError):  # parameters that JSON cannot hold
        return None


def _fields_as_json(operator) -> str | None:
    """None for an operator with state beside the fields of its dataclass."""
    if not is_dataclass(operator) or not all(one.init for one in fields(operator)):
        return None
    names = [one.name for one in fields(operator)]
    if set(getattr(operator, "__dict__", ())) != set(names):
        return None
    return json.dumps({name: getattr(operator, name) for name in names})


@lru_cache
def _made_by(name: str, kind: type, settings: str) -> bool:
    try:
        made = operators.make(name, **json.loads(settings))
    except EvocityError:
        return False
    return type(made) is kind and _fields_as_json(made) == settings


class OmittedGenomes:
    """Decides which genomes the log of a run omits, generation by generation.

    genomes : "survivors" keeps the genomes of births that live on in the generation they are born
        in, "front" those in its first front, of any island; "all" omits none.
    breedings : how many breedings restore the genome of each birth so far; 0 if it is kept.

    The log also keeps births that cannot be bred again, or by more than `MOST_BREEDINGS` breedings.
    """

    def __init__(self, genomes: str, breedings: Iterable[int] = ()):
        self._genomes, self._breedings = genomes, bytearray(breedings)

    @classmethod
    def of(cls, writer: BackgroundWriter) -> "OmittedGenomes":
        """Create it for the run that a ``writer`` begins, or resumes."""
        genomes = writer.header.genomes
        if genomes == "all" or not (run := CompleteRun(writer.path)).generations:
            return cls(genomes)
        return cls(genomes, run.births(columns=["breedings"])["breedings"].to_pylist())

    def omit_from(self, births: Sequence[Birth], members: Sequence[Member]) -> Sequence[Birth]:
        """Return the ``births`` of the next generation, by id, as the log has them; ``members`` are
        those who live in it."""
        if self._genomes == "all":
            return births
        kept = {one.id for one in members if self._genomes == "survivors" or one.rank == 0}
        return [self._omit(birth, birth.id in kept) for birth in births]

    def _omit(self, birth: Birth, kept: bool) -> Birth:
        breedings = 1 + sum(self._breedings[parent] for parent in birth.parents)
        kept = kept or birth.reconstruction is None or birth.genome is None
        if kept or breedings > MOST_BREEDINGS:
            self._breedings.append(0)
            return birth
        self._breedings.append(breedings)
        again = replace(birth.reconstruction, breedings=breedings, digest=birth.genome.digest)
        return replace(birth, genome=None, reconstruction=again)
