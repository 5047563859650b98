"""Genomes -> Genome. One operator, one file; every operator takes parents and a generator.

pavement_fusion    spatial groups of lifs of two or more parents
lambda_crossover   every lifs between those of two parents
mutation           any nucleotide of one parent
repair             collage repair, used by all of them
crossing           what they share
"""

import inspect
from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from typing import ClassVar, Protocol

import numpy as np

from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.operators.lambda_crossover import LambdaCrossover
from evocity.operators.mutation import Mutation
from evocity.operators.pavement_fusion import PavementFusion
from evocity.operators.repair import collage_repair


class Operator(Protocol):
    """What breeding asks of an operator: the number of parents, and a call that makes a child.

    ``parents`` is (fewest, most), most None for any number. The call never changes a parent,
    draws from the generator alone, and records ``parent`` and ``source`` of every lifs.
    """

    name: ClassVar[str]
    parents: ClassVar[tuple[int, int | None]]

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome: ...


#: The operators of the package, by the name recipes use.
OPERATORS: Mapping[str, type[Operator]] = {
    operator.name: operator for operator in (PavementFusion, LambdaCrossover, Mutation)
}


def operators() -> dict[str, type[Operator]]:
    """All operators by name: the package's, and those of entry points ``evocity.operators``."""
    found = dict(OPERATORS)
    for point in entry_points(group="evocity.operators"):
        found.setdefault(point.name, point.load())
    return found


def make(name: str, **parameters) -> Operator:
    """The operator called ``name`` with ``parameters``; `OperatorError` lists what exists."""
    known = operators()
    if name not in known:
        raise OperatorError(
            f"operator {name!r}", f"one of {', '.join(sorted(known))}", "correct the name"
        )
    accepted = list(inspect.signature(known[name]).parameters)
    unknown = [key for key in parameters if key not in accepted]
    if unknown:
        raise OperatorError(
            f"{name}: parameters {', '.join(unknown)}",
            f"among {', '.join(accepted)}",
            "correct or remove them",
        )
    try:
        return known[name](**parameters)
    except (TypeError, ValueError) as error:
        raise OperatorError(
            f"{name} with {parameters} ({error})",
            "parameters of the right types",
            f"see the docstring of {known[name].__name__}",
        ) from None


__all__ = [
    "OPERATORS",
    "LambdaCrossover",
    "Mutation",
    "Operator",
    "PavementFusion",
    "collage_repair",
    "make",
    "operators",
]
