"""Genomes breed a genome. One operator, one file; every operator takes parents and a generator.

- `pavement_fusion`: square groups of lifs of two or more parents
- `region_fusion`: groups that hold whole buildings
- `quarter_fusion`: street blocks of one parent, buildings of the others
- `quarter_refill`: street blocks of one parent, buildings of any
- `direct_fusion`: lifs by lifs, of two or more parents
- `asymmetric_fusion`: the lifs of the second parent's likest blocks
- `symmetric_fusion`: of each block's matches in both parents, one or between
- `lambda_crossover`: every lifs between those of two parents, in patches
- `lambda_field`: street blocks of two parents or more, as a field of numbers tells
- `interpolation`: all lifs between those of two parents, or their steps of decoding
- `mutation`: any nucleotide of one parent
- `gene_copy`: genes of one parent copied to other places
- `gene_exchange`: genes of one parent exchanged
- `height_scaling`: buildings of one parent raised and lowered by whole storeys
- `height_field`: street blocks of one parent raised and lowered, as a field of numbers tells
- `block_exchange`: macro-blocks of one parent exchanged
- `relocation`: groups of lifs of one parent moved, their domains with them
- `repair`: collage repair, used by all of them
- `crossing`: what they share: drafts, and how a draft becomes a child
- `grid`: the cells that crossings follow, sizes in metres
- `groups`, `footings`: groups of cells, and what stands on them
- `turning`: cells laid turned and mirrored
- `heights`: what operators of heights share
- `fields`: few numbers over a map, smooth in between
- `refitting`: lifs fitted to a changed map, domain blocks as they are
- `storeys`: by how many storeys buildings may rise or fall
- `street_blocks`: what streets enclose, what fits into it, how it is filled
- `pairing`: which block of another city is likest
- `shares`: how much of a child is whose
- `parameters`: what their parameters may be
"""

import inspect
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, ClassVar, Protocol

import numpy as np

from evocity.errors import OperatorError, near_miss, shown, told, with_near_miss
from evocity.genome import Genome
from evocity.operators.asymmetric_fusion import AsymmetricFusion
from evocity.operators.block_exchange import BlockExchange
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.direct_fusion import DirectFusion
from evocity.operators.gene_copy import GeneCopy
from evocity.operators.gene_exchange import GeneExchange
from evocity.operators.height_field import HeightField
from evocity.operators.height_scaling import HeightScaling
from evocity.operators.interpolation import Interpolation
from evocity.operators.lambda_crossover import LambdaCrossover
from evocity.operators.lambda_field import LambdaField
from evocity.operators.mutation import Mutation
from evocity.operators.of_curves import (
    CurveMetamorphosis,
    DetailExchange,
    DetailScaling,
    PartPerturbation,
    PointExchange,
    PointPerturbation,
)
from evocity.operators.of_shapes import MapExchange, MapPerturbation, ShapeMetamorphosis
from evocity.operators.parameters import Faults, at_fault, wrong_types
from evocity.operators.pavement_fusion import PavementFusion
from evocity.operators.quarter_fusion import QuarterFusion
from evocity.operators.quarter_refill import QuarterRefill
from evocity.operators.region_fusion import RegionFusion
from evocity.operators.relocation import Relocation
from evocity.operators.repair import collage_repair
from evocity.operators.symmetric_fusion import SymmetricFusion
from evocity.plugins import load_plugins, origin_of


class Operator(Protocol):
    """What breeding asks of an operator: the number of parents, and a call that makes a child.

    ``parents`` is (fewest, most), most None for any number. The call never changes a parent,
    draws from the generator alone, and records ``parent`` and ``source`` of every lifs.

    Where parameters suit some numbers of parents only, a method ``check_count(count)`` raises
    `OperatorError` for the others.
    """

    name: ClassVar[str]
    parents: ClassVar[tuple[int, int | None]]

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome: ...


#: The operators of the package, by the name recipes use.
OPERATORS: Mapping[str, type[Operator]] = {
    operator.name: operator
    for operator in (
        PavementFusion,
        RegionFusion,
        QuarterFusion,
        QuarterRefill,
        DirectFusion,
        AsymmetricFusion,
        SymmetricFusion,
        LambdaCrossover,
        LambdaField,
        Interpolation,
        Mutation,
        GeneCopy,
        GeneExchange,
        HeightScaling,
        HeightField,
        BlockExchange,
        Relocation,
    )
}


#: The operators of shapes and of curves, which have ``of`` for what they breed.
OF_FORMS: Mapping[str, type[Operator]] = {
    operator.name: operator
    for operator in (
        MapPerturbation,
        MapExchange,
        ShapeMetamorphosis,
        PointPerturbation,
        PartPerturbation,
        PointExchange,
        CurveMetamorphosis,
        DetailExchange,
        DetailScaling,
    )
}


def operators(of: Collection[str] | None = None) -> dict[str, type[Operator]]:
    """All operators by name: the package's, and those of entry points ``evocity.operators``.
    ``of``: those alone that breed this: "fabric", "shape", "curve"."""
    known = OPERATORS | OF_FORMS | _from_plugins()[0]
    return {name: one for name, one in known.items() if of is None or bred_by(one) in of}


def bred_by(operator: object) -> str:
    """What an operator, or a class of them, breeds: "fabric" unless it says otherwise."""
    return getattr(operator, "of", "fabric")


def origins() -> dict[str, str]:
    """Where each of `operators` comes from: "evocity", or a plugin's package and version."""
    return dict.fromkeys(OPERATORS | OF_FORMS, "evocity") | _from_plugins()[2]


def plugin_warnings() -> tuple[str, ...]:
    """One text for each entry point ``evocity.operators`` that could not be loaded."""
    return _from_plugins()[1]


@cache
def _from_plugins() -> tuple[dict[str, type[Operator]], tuple[str, ...], dict[str, str]]:
    """Operators of other packages, what is wrong with those left out, and where each is from."""
    found: dict[str, type[Operator]] = {}
    origins: dict[str, str] = {}

    def take(entry: EntryPoint) -> None:
        kind = entry.load()
        if not (isinstance(kind, type) and hasattr(kind, "parents") and hasattr(kind, "name")):
            raise TypeError(f"{shown(kind)} is no class with `name` and `parents`")
        if entry.name in OPERATORS | OF_FORMS or entry.name in found:
            raise ValueError(f"a second operator called {entry.name}")
        wrong_types(kind, {})  # raises if its annotations cannot be checked
        found[entry.name], origins[entry.name] = kind, origin_of(entry)

    return found, load_plugins("evocity.operators", take), origins


def make(name: str, **parameters: Any) -> Operator:
    """The operator called ``name`` with ``parameters``.

    Raises `OperatorError`, which lists the operators there are if the name is at fault, else
    every parameter at fault, with what was found and what is allowed.
    """
    exist = operators()
    if name not in exist:
        raise OperatorError(
            "; ".join([f"no operator is called {name!r}", *plugin_warnings()]),
            f"one of {', '.join(sorted(exist))}",
            near_miss(name, exist) or "correct the name",
        )
    kind = exist[name]
    accepted = parameters_of(kind)
    known = {key: value for key, value in parameters.items() if key in accepted}
    faults: Faults = {
        key: (shown(value), with_near_miss("is unknown", key, accepted))
        for key, value in parameters.items()
        if key not in accepted
    }
    remedy = "change these parameters"
    if faults:
        remedy += f"; there are {', '.join(accepted)}"
    faults |= wrong_types(kind, known)
    try:
        operator = kind(**known)
    except OperatorError as error:
        if not error.faults:
            raise
        faults |= error.faults
    except Exception as error:  # of another package's operator: ours tell their own faults
        if not faults:
            raise OperatorError(
                f"{name} with {shown(parameters)} raised {told(error)}",
                "parameters it can be made with",
                f"see the docstring of {kind.__name__}",
            ) from error
    if faults:
        raise at_fault(name, faults, remedy)
    return operator


def parameters_of(kind: type[Operator]) -> list[str]:
    """Names of the parameters of a class of operators, in its order."""
    return list(_parameters_of(kind))


@cache  # asked for at every birth
def _parameters_of(kind: type[Operator]) -> tuple[str, ...]:
    return tuple(inspect.signature(kind).parameters)


__all__ = [
    "OF_FORMS",
    "OPERATORS",
    "AsymmetricFusion",
    "BlockExchange",
    "CurveMetamorphosis",
    "DetailExchange",
    "DetailScaling",
    "DirectFusion",
    "Draft",
    "Drafting",
    "GeneCopy",
    "GeneExchange",
    "HeightField",
    "HeightScaling",
    "Interpolation",
    "LambdaCrossover",
    "LambdaField",
    "MapExchange",
    "MapPerturbation",
    "Mutation",
    "Operator",
    "PartPerturbation",
    "PavementFusion",
    "PointExchange",
    "PointPerturbation",
    "RegionFusion",
    "Relocation",
    "ShapeMetamorphosis",
    "SymmetricFusion",
    "bred_by",
    "collage_repair",
    "make",
    "operators",
    "origins",
    "parameters_of",
    "plugin_warnings",
]
