"""All operators by name: those of the package and of plugins; their origins and parameters."""

import inspect
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, ClassVar, Protocol

import numpy as np

from evocity.errors import OperatorError, add_near_miss, describe_error, near_miss, spell
from evocity.genome import Genome
from evocity.operators.content_fusion import AsymmetricFusion, SymmetricFusion
from evocity.operators.form_operators import (
    CurveMetamorphosis,
    DetailExchange,
    DetailScaling,
    MapExchange,
    MapPerturbation,
    PartPerturbation,
    PointExchange,
    PointPerturbation,
    ShapeMetamorphosis,
)
from evocity.operators.height_operators import HeightField, HeightScaling
from evocity.operators.lambda_crossover import Interpolation, LambdaCrossover
from evocity.operators.lambda_field import LambdaField
from evocity.operators.mutation import Mutation
from evocity.operators.parameters import Faults, at_fault, wrong_types
from evocity.operators.pavement_fusion import DirectFusion, PavementFusion
from evocity.operators.plan_change import PlanChange
from evocity.operators.plan_crossing import PlanCrossing
from evocity.operators.plan_fusion import PlanFusion
from evocity.operators.plan_return import PlanReturn
from evocity.operators.plan_seam import PlanSeam
from evocity.operators.plan_spread import PlanSpread
from evocity.operators.plan_storeys import PlanStoreys
from evocity.operators.quarter_fusion import QuarterFusion, QuarterRefill
from evocity.operators.rearrangements import BlockExchange, GeneCopy, GeneExchange, Relocation
from evocity.operators.region_fusion import RegionFusion
from evocity.plugins import load_plugins, origin_of


class Operator(Protocol):
    """Protocol of operators: a number of parents, and a call that breeds a child.

    The attribute ``parents`` holds the smallest and the largest number of parents; None means no
    limit. The call never changes a parent, and takes random numbers only from the generator
    ``rng``. A call of the operator sets the fields ``parent`` and ``source`` of every lifs.

    An operator whose parameters do not suit every number of parents has a method
    ``check_count(count)``. The method ``check_count`` raises `OperatorError` for a number of
    parents that the parameters do not suit. An operator that changes only faces that other
    operators filled sets ``needs_filled_faces`` to True; it copies a parent without such faces. An
    operator of fabric that breeds children of its own kind of difference sets ``takes_turns`` to
    True: studio uses it where a user chooses no operator. An operator that can be too strict to
    change anything has a method ``relaxed()``, which returns a less strict operator of the same
    name.
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
        PlanFusion,
        PlanChange,
        PlanSeam,
        PlanCrossing,
        PlanSpread,
        PlanReturn,
        PlanStoreys,
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


_PLURALS = {"fabric": "city fabrics", "shape": "shapes", "curve": "curves"}


def operators(of: Collection[str] | None = None) -> dict[str, type[Operator]]:
    """List all operators by name: operators of evocity, and operators of other packages with entry
    points ``evocity.operators``. The argument ``of`` selects the operators that breed "fabric",
    "shape" or "curve"."""
    known = OPERATORS | OF_FORMS | _plugins()[0]
    return {name: kind for name, kind in known.items() if of is None or bred_by(kind) in of}


def bred_by(operator: object) -> str:
    """Return the kind of chromosome that an operator, or a class of operators, breeds: "fabric",
    "shape" or "curve"."""
    return getattr(operator, "of", "fabric")


def takes_turns(operator: object) -> bool:
    """Return whether an operator, or a class of operators, takes turns with others where a user
    chooses none: operators of fabric that say so, and all others."""
    return getattr(operator, "takes_turns", bred_by(operator) != "fabric")


def reason_against(operator: object, factors: Collection[str], parents: Sequence[Genome]) -> str:
    """Explain why an operator, or a class of operators, does not suit ``parents``; an empty text if
    it suits them. ``factors``: what the parents' kind of chromosome breeds, as for `operators`."""
    from evocity.operators.plans.inheritance import InheritedPlan, founder_name

    bred, (fewest, _) = bred_by(operator), operator.parents
    if bred not in factors:
        return f"it breeds {_PLURALS[bred]}, not {' or '.join(_PLURALS[one] for one in factors)}"
    if len(parents) < fewest:
        return f"it needs {fewest} or more parents"
    if getattr(operator, "needs_filled_faces", False):
        plans = [InheritedPlan.from_made(parent.made) for parent in parents]
        known = [plan for plan in plans if plan is not None]
        founders = sum(founder_name(parent) is not None for parent in parents)
        # a founder among the parents shows which faces of the others are changed
        if not any(one.genes or one.edited or one.touched for one in known) and (
            founders in (0, len(parents))
        ):
            return "it changes only faces that plan fusion filled, and no parent has such faces"
    return ""


def origins() -> dict[str, str]:
    """Return the origin of each operator by name: "evocity", or the package and version of a
    plugin."""
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

    Raises `OperatorError` for an unknown name; the message lists all operators. For wrong
    parameters, the message of the error lists each parameter with its value and the allowed values.
    """
    known_kinds = operators()
    if name not in known_kinds:
        raise OperatorError(
            "; ".join([f"no operator is called {name!r}", *plugin_warnings()]),
            f"one of the operators {', '.join(sorted(known_kinds))}",
            near_miss(name, known_kinds) or "correct the name of the operator",
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
                f"the operator {name} with the parameters {spell(parameters)} raised "
                f"{describe_error(error)}",
                "parameters that the operator accepts",
                f"read about the parameters in the docstring of {kind.__name__}",
            ) from error
    if faults:
        raise at_fault(name, faults, remedy)
    return operator


def parameters_of(kind: type[Operator]) -> list[str]:
    """List the names of the parameters of a class of operators, in the order of the class's
    signature."""
    return list(_parameters_of(kind))


def with_older_values(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Complete ``parameters`` from a recipe or a log: keys that older releases did not have get the
    values of the operator's attribute ``older_values``, so that it breeds as before."""
    return {**getattr(operators().get(name), "older_values", {}), **parameters}


@cache  # every birth calls this
def _parameters_of(kind: type[Operator]) -> tuple[str, ...]:
    return tuple(inspect.signature(kind).parameters)
