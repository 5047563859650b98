"""Operators of breeding: fusions, crossovers, mutations, rearrangements, changes of heights.

- `quarter_fusion`, `region_fusion`, `pavement_fusion`, `direct_fusion`, `content_fusion`: fusions
- `lambda_crossover`, `lambda_field`, `interpolation`: crossovers
- `mutation`, `rearrangements`, `height_operators`: operators of one parent
- `shape_operators`, `curve_operators`, `form_common`: operators of shapes and curves
- `crossover`, `repair`, `parameters`: drafts of children, collage repair, checks of parameters
- `street_blocks`, `pairing`, `groups`, `grid`, `fields`, `building_heights`, `storeys`: shared
parts
"""

import inspect
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, ClassVar, Protocol

import numpy as np

from evocity.errors import OperatorError, add_near_miss, describe_error, near_miss, spell
from evocity.genome import Genome
from evocity.operators.content_fusion import AsymmetricFusion, SymmetricFusion
from evocity.operators.crossover import Draft, Drafting
from evocity.operators.curve_operators import (
    CurveMetamorphosis,
    DetailExchange,
    DetailScaling,
    PartPerturbation,
    PointExchange,
    PointPerturbation,
)
from evocity.operators.direct_fusion import DirectFusion
from evocity.operators.height_operators import HeightField, HeightScaling
from evocity.operators.interpolation import Interpolation
from evocity.operators.lambda_crossover import LambdaCrossover
from evocity.operators.lambda_field import LambdaField
from evocity.operators.mutation import Mutation
from evocity.operators.parameters import Faults, at_fault, wrong_types
from evocity.operators.pavement_fusion import PavementFusion
from evocity.operators.quarter_fusion import QuarterFusion, QuarterRefill
from evocity.operators.rearrangements import BlockExchange, GeneCopy, GeneExchange, Relocation
from evocity.operators.region_fusion import RegionFusion
from evocity.operators.repair import collage_repair
from evocity.operators.shape_operators import MapExchange, MapPerturbation, ShapeMetamorphosis
from evocity.plugins import load_plugins, origin_of


class Operator(Protocol):
    """Protocol of operators: a number of parents, and a call that breeds a child.

    The attribute ``parents`` is (fewest, most), with None for any number. The call never changes a
    parent and takes random numbers only from the generator. It records ``parent`` and ``source`` of
    every lifs.

    If some numbers of parents do not suit the parameters, a method ``check_count(count)`` raises
    `OperatorError` for them.
    """

    name: ClassVar[str]
    parents: ClassVar[tuple[int, int | None]]

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome: ...


#: The operators of the package for fabric, by their names in recipes.
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


#: The operators of shapes and of curves; their ``of`` names what they breed.
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
    """List all operators by name, those of the package and of the entry points
    ``evocity.operators``. The argument ``of`` keeps only operators that breed "fabric", "shape" or
    "curve"."""
    known = OPERATORS | OF_FORMS | _plugins()[0]
    return {name: kind for name, kind in known.items() if of is None or bred_by(kind) in of}


def bred_by(operator: object) -> str:
    """Return the kind of chromosome that an operator, or a class of operators, breeds; by default
    "fabric"."""
    return getattr(operator, "of", "fabric")


def origins() -> dict[str, str]:
    """List the origin of each of `operators`: "evocity", or the package and version of a plugin."""
    return dict.fromkeys(OPERATORS | OF_FORMS, "evocity") | _plugins()[2]


def plugin_warnings() -> tuple[str, ...]:
    """List a warning for each entry point ``evocity.operators`` that failed to load."""
    return _plugins()[1]


@cache
def _plugins() -> tuple[dict[str, type[Operator]], tuple[str, ...], dict[str, str]]:
    """Load operators of other packages: classes, faults of the others, origins."""
    kinds: dict[str, type[Operator]] = {}
    origins: dict[str, str] = {}

    def take(entry: EntryPoint) -> None:
        kind = entry.load()
        if not (isinstance(kind, type) and hasattr(kind, "parents") and hasattr(kind, "name")):
            raise TypeError(f"{spell(kind)} is not a class with `name` and `parents`")
        if entry.name in OPERATORS | OF_FORMS or entry.name in kinds:
            raise ValueError(f"a second operator called {entry.name}")
        wrong_types(kind, {})  # raises if its annotations cannot be checked
        kinds[entry.name], origins[entry.name] = kind, origin_of(entry)

    return kinds, load_plugins("evocity.operators", take), origins


def make(name: str, **parameters: Any) -> Operator:
    """Make the operator called ``name`` with the ``parameters``.

    Raises `OperatorError`. For an unknown name, the message lists all operators. Otherwise it lists
    every wrong parameter with its value and the allowed values.
    """
    known_kinds = operators()
    if name not in known_kinds:
        raise OperatorError(
            "; ".join([f"no operator is called {name!r}", *plugin_warnings()]),
            f"one of {', '.join(sorted(known_kinds))}",
            near_miss(name, known_kinds) or "correct the name",
        )
    kind = known_kinds[name]
    accepted = parameters_of(kind)
    known = {key: value for key, value in parameters.items() if key in accepted}
    faults: Faults = {
        key: (spell(value), add_near_miss("is unknown", key, accepted))
        for key, value in parameters.items()
        if key not in accepted
    }
    remedy = "change these parameters"
    if faults:
        remedy += f"; {name} takes {', '.join(accepted)}"
    faults |= wrong_types(kind, known)
    try:
        operator = kind(**known)
    except OperatorError as error:
        if not error.faults:
            raise
        faults |= error.faults
    except Exception as error:  # another package's operator; ours raise `OperatorError`
        if not faults:
            raise OperatorError(
                f"{name} with {spell(parameters)} raised {describe_error(error)}",
                "parameters that the operator accepts",
                f"find its parameters in the docstring of {kind.__name__}",
            ) from error
    if faults:
        raise at_fault(name, faults, remedy)
    return operator


def parameters_of(kind: type[Operator]) -> list[str]:
    """List the names of the parameters of a class of operators, in the order of the class."""
    return list(_parameters_of(kind))


@cache  # every birth calls this
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
