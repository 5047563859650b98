"""Which share of a child has each parent? What an operator's ``fill`` may be, and comes to."""

from collections.abc import Sequence

import numpy as np

from evocity.errors import shown
from evocity.operators.parameters import at_fault

#: What a ``fill`` may be, for `check_parameters`.
TOLD = "0…1, or a list of such shares"


def are_shares(fill: float | Sequence[float] | None) -> bool:
    """Whether ``fill`` is None, a share (0…1) or a list of such."""
    if fill is None:
        return True
    shares = fill if isinstance(fill, Sequence) else [fill]
    return len(shares) > 0 and all(0 <= share <= 1 for share in shares)


def shares_of(
    name: str, fill: float | Sequence[float] | None, count: int, void: bool = False
) -> np.ndarray:
    """The share of each of ``count`` parents, then of the void if it takes part; summing to 1.

    ``fill`` is the share of the second of two, or one a parent, or None for equal shares.
    Raises `OperatorError`, in the name of the operator, if it suits not so many parents.
    """
    total = count + void
    if fill is None:
        return np.full(total, 1 / total)
    shares = np.atleast_1d(np.asarray(fill, float))
    if shares.size == 1 and total == 2:
        shares = np.array([1 - shares[0], shares[0]])
    if shares.size != total or abs(shares.sum() - 1) >= 1e-6:
        also = " and the void" if void else ""
        allowed = f"one share for each of {count} parents{also}, summing to 1"
        raise at_fault(name, {"fill": (shown(fill), allowed)})
    return shares
