"""Base of operators of shapes and curves: checks of the parents, retries of unusable children."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.errors import EvocityError, OperatorError
from evocity.kinds import Form
from evocity.operators.parameters import Check, check_generator, check_parameters, check_parents

#: The check of a standard deviation ``step``.
STEP: Check = (lambda step: 0 <= step <= 10, "0…10")


@dataclass(frozen=True, kw_only=True)
class Forming:
    """An operator of forms. A subclass is a frozen dataclass with ``name``, ``parents``, ``of``,
    its own parameters, their checks in ``_checks()``, and a method ``_child(parents, rng)``, which
    returns a form and its ``made``.

    tries : the largest number of draws. After these the last child stays although its maps do not
        contract, or it crosses itself or leaves the window.
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
        """Breed a child of ``parents``; its ``made`` tells how it came about.

        Raises `OperatorError` if the parents do not suit the operator or one another, and
        `evocity.shapes.ShapeError` if no try gave a form; it names the maps that do not contract.
        """
        self._check(parents, rng)
        last, fault = None, None
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
                last = child
        if last is None:
            raise fault
        return last

    def _check(self, parents: Sequence[Form], rng: np.random.Generator) -> None:
        check_generator(self.name, rng)
        check_parents(self.name, parents, self.parents, f"{self.of}s")
        strange = [type(item).__name__ for item in parents if getattr(item, "kind", "") != self.of]
        if strange:
            raise OperatorError(
                f"{self.name}: the parents have the type {', '.join(strange)}",
                f"{self.of}s",
                f"choose an operator for these parents; this operator breeds {self.of}s",
            )
        windows = {(parent.pixels, parent.metres_per_pixel) for parent in parents}
        if len(windows) > 1:
            raise OperatorError(
                f"{self.name}: parents in windows of "
                + " and ".join(f"{n} px, {m:g} m" for n, m in sorted(windows)),
                "parents in one window",
                "make the parents with the same pixels and metres_per_pixel",
            )


def draw_mask(count: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """Draw each of ``count`` items with the chance ``share``, at least one: bool ``(count,)``."""
    mask = rng.random(count) < share
    if not mask.any():
        mask[rng.integers(count)] = True
    return mask
