"""What operators of shapes and curves share: parents of one kind and window, and a child that is
an individual."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.errors import EvocityError, OperatorError, shown
from evocity.forms import Form
from evocity.operators.parameters import Check, check_parameters


@dataclass(frozen=True, kw_only=True)
class Forming:
    """An operator of forms. A subclass is a frozen dataclass with ``name``, ``parents``, ``of``,
    parameters of its own, their checks in ``_checks()``, and a method ``_child(parents, rng)``,
    which returns a form and what is noted of how it came about.

    tries : so often it is drawn before the last child is kept that is no individual: one whose maps
        do not contract, or that crosses itself or leaves the window.
    """

    name: ClassVar[str]
    of: ClassVar[str]
    parents: ClassVar[tuple[int, int | None]]

    tries: int = 8

    def __post_init__(self):
        tries = (lambda tries: 1 <= tries <= 100, "1…100")
        check_parameters(self, {**self._checks(), "tries": tries})

    def _checks(self) -> dict[str, Check]:
        return {}

    def _child(self, parents: Sequence[Form], rng: np.random.Generator) -> tuple[Form, dict]:
        raise NotImplementedError

    def __call__(self, parents: Sequence[Form], rng: np.random.Generator) -> Form:
        """A child of ``parents``; its ``made`` tells how it came about.

        Raises `OperatorError` if the parents do not suit the operator or one another, and
        `evocity.shapes.ShapeError` if no try was a form: of maps that do not contract, which it
        names.
        """
        self._check(parents, rng)
        found, fault = None, None
        for _ in range(self.tries):
            try:
                child, made = self._child(parents, rng)
                child = child.replace(made={"operator": self.name, **made})
                if child.problem is None:
                    return child
            except OperatorError:
                raise
            except EvocityError as error:
                fault = error
            else:
                found = child
        if found is None:
            raise fault
        return found

    def _check(self, parents: Sequence[Form], rng: np.random.Generator) -> None:
        if not isinstance(rng, np.random.Generator):
            raise OperatorError(
                f"{self.name}: rng = {shown(rng)}",
                "a NumPy Generator",
                "pass numpy.random.default_rng(seed)",
            )
        fewest, most = self.parents
        if not (isinstance(parents, Sequence) and fewest <= len(parents) <= (most or len(parents))):
            count = len(parents) if isinstance(parents, Sequence) else shown(parents)
            wanted = f"{fewest}" if most == fewest else f"{fewest} or more"
            raise OperatorError(
                f"{self.name}: parents {count}", f"a list of {wanted}", "pass so many"
            )
        strange = [type(one).__name__ for one in parents if getattr(one, "kind", None) != self.of]
        if strange:
            raise OperatorError(
                f"{self.name}: parents of type {', '.join(strange)}",
                f"{self.of}s",
                f"take an operator of theirs; this one is of {self.of}s",
            )
        windows = {(one.pixels, one.metres_per_pixel) for one in parents}
        if len(windows) > 1:
            raise OperatorError(
                f"{self.name}: parents in windows of "
                + " and ".join(f"{n} px, {m:g} m" for n, m in sorted(windows)),
                "parents in one window",
                "make them with the same pixels and metres_per_pixel",
            )


def step_checks() -> dict[str, Check]:
    """Checks of a ``step`` and a ``share``."""
    return {
        "step": (lambda step: 0 <= step <= 10, "0…10"),
        "share": (lambda share: 0 <= share <= 1, "0…1"),
    }


def chosen(count: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """Bool ``(count,)``: a ``share`` of so many, drawn each, one at least."""
    found = rng.random(count) < share
    if not found.any():
        found[rng.integers(count)] = True
    return found


__all__ = ["Forming", "chosen", "step_checks"]
