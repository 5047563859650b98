"""The door of a run: what an operator returned is checked before it becomes one of its births.

Operators of other packages may return anything. What does not suit the run costs one birth, with
a text that says why; nothing of it reaches the log or another operator.
"""

import json

import numpy as np
from pydantic_core import from_json

from evocity.condensation import Condensation
from evocity.errors import OperatorError, shown
from evocity.genome import Genome
from evocity.store import Header
from evocity.store.schema import plain


def admitted(child, header: Header, condensation: Condensation | None = None) -> Genome:
    """The genome ``child`` told in the terms of the run's ``header`` (`Header.adopt`), with the
    layer that is locked in it; its ``made`` is what a reader of the log will find.

    Raises `OperatorError` unless it is a `Genome` of the run's map and pixel size, with
    \\|σ\\| ≤ the run's ``sigma_max``, of cities the run knows, and with a ``made`` that can be
    written as JSON.
    """
    if not isinstance(child, Genome):
        raise OperatorError(f"a child that is {shown(child)}", "a Genome", _REMEDY)
    if faults := _faults(child, header):
        raise OperatorError("; ".join(faults), "; ".join(faults.values()), _REMEDY)
    return header.adopt(child, condensation, _written(child.made))


_REMEDY = "correct the operator: a child is of the map, the cities and the bounds of its parents"


def _faults(child: Genome, header: Header) -> dict[str, str]:
    """What was found -> what was expected in its place."""
    faults = {}
    size = child.pavement.height, child.pavement.width
    if size != (header.height, header.width):
        found = f"a child of {size[0]} × {size[1]} px"
        faults[found] = f"{header.height} × {header.width} px, as the run"
    if child.metres_per_pixel != header.metres_per_pixel:
        found = f"pixels of {child.metres_per_pixel!r} m"
        faults[found] = f"pixels of {header.metres_per_pixel!r} m"
    steep = np.abs(child.sigma) > np.float32(header.sigma_max)
    if steep.any():
        found = f"|σ| up to {np.abs(child.sigma).max():.4g} in {np.count_nonzero(steep)} lifs"
        faults[found] = f"|σ| ≤ {header.sigma_max:g}, the run's genome.sigma_max"
    strange = [city for city in child.cities if city not in header.cities]
    if strange:
        found = f"cities {', '.join(map(shown, strange))}"
        faults[found] = f"cities of the run: {', '.join(header.cities)}"
    return faults


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
