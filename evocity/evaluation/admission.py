"""Admission of children: the checks of what an operator returned, before it becomes a birth.

Operators of other packages may return anything. A child that does not suit the run costs one birth,
with a text that says why; it reaches neither the log nor another operator.
"""

import json

from pydantic_core import from_json

from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.store import Header
from evocity.store.schema import plain


def admit(child, header: Header, condensation: Condensation | None = None) -> Genome:
    """Return the genome ``child`` in the terms of the run's ``header`` (`Kind.adopt`), with the
    locked layer; its ``made`` is as a reader of the log will get it.

    Raises `OperatorError` unless it is a `Genome`, or a chromosome of the run's kind, of the run's
    map and pixel size, with \\|σ\\| ≤ the run's ``sigma_max``, of cities that the run knows, and
    with a ``made`` that JSON can hold.
    """
    kind = header.chromosome
    if faults := kind.faults(child, header):
        raise OperatorError("; ".join(faults), "; ".join(faults.values()), _REMEDY)
    return kind.adopt(child, header, condensation, _written(child.made))


_REMEDY = "correct the operator: a child has the map, the cities and the bounds of its parents"


def _written(made: dict) -> dict:
    """Return ``made`` as the log returns it to a resumed run."""
    try:
        return dict(from_json(json.dumps(made, default=plain)))
    except (TypeError, ValueError, RecursionError) as error:
        raise OperatorError(
            f"the record `made` of a birth cannot be written as JSON ({type(error).__name__}: "
            f"{error})",
            "a mapping whose keys are texts, and whose values are numbers, texts, lists or "
            "mappings",
            "record plain values, for example str(key) instead of a tuple",
        ) from error
