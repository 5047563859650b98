"""The door of a run: what an operator returned is checked before it becomes one of its births.

Operators of other packages may return anything. What does not suit the run costs one birth, with
a text that says why; nothing of it reaches the log or another operator.
"""

import json

from pydantic_core import from_json

from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.store import Header
from evocity.store.schema import plain


def admitted(child, header: Header, condensation: Condensation | None = None) -> Genome:
    """The genome ``child`` told in the terms of the run's ``header`` (`Kind.adopt`), with the
    layer that is locked in it; its ``made`` is what a reader of the log will find.

    Raises `OperatorError` unless it is a `Genome`, or what else the run breeds, of the run's map
    and pixel size, with \\|σ\\| ≤ the run's ``sigma_max``, of cities the run knows, and with a
    ``made`` that can be written as JSON.
    """
    kind = header.chromosome
    if faults := kind.faults(child, header):
        raise OperatorError("; ".join(faults), "; ".join(faults.values()), _REMEDY)
    return kind.adopt(child, header, condensation, _written(child.made))


_REMEDY = "correct the operator: a child is of the map, the cities and the bounds of its parents"


def _written(made: dict) -> dict:
    """``made`` as it comes back from the log, where a resumed run reads it."""
    try:
        return dict(from_json(json.dumps(made, default=plain)))
    except (TypeError, ValueError, RecursionError) as error:
        raise OperatorError(
            f"a made that JSON cannot hold ({type(error).__name__}: {error})",
            "a mapping from texts to numbers, texts, lists and mappings",
            "record plain values, for example str(key) in place of a tuple",
        ) from error
