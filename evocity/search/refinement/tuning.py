"""What of an individual is tuned: numbers, and the operator that they are parameters of."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evocity import operators
from evocity.errors import OperatorError, shown, with_near_miss
from evocity.genome import Genome
from evocity.operators.parameters import number_of, repair_checks
from evocity.search.breeding import Plan
from evocity.search.mixture import Drawn, parted

#: Factors that heights are tuned within.
FACTORS = 0.4, 2.5


@dataclass(frozen=True)
class Tuning:
    """The numbers to be tuned, ``start`` (n,) within ``lower`` and ``upper``; the first tries lie
    ``step`` away. ``operator`` makes of a point the operator that breeds from the ``parents``, by
    draws that are the same for each."""

    parents: Sequence[Genome]
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    step: np.ndarray
    operator: Callable[[np.ndarray], Any]
    rng: np.random.Generator

    @property
    def generator(self) -> np.random.Generator:
        """As the first child has it, for another one."""
        other = np.random.Generator(type(self.rng.bit_generator)())
        other.bit_generator.state = self.rng.bit_generator.state
        return other


def of_field(genome: Genome, others: Sequence[Genome], side: int, make: Callable) -> Tuning:
    """The λ-field that fills street blocks of ``genome`` with the fabric of ``others``, from 0,
    which is the genome itself. ``make(side=…, values=…)`` gives the operator."""
    count = len(others) * side**2

    def operator(point: np.ndarray):
        return make(side=side, values=point)

    ends = np.zeros(count), np.ones(count)
    start, step = np.zeros(count), np.full(count, 0.5)
    return Tuning([genome, *others], start, *ends, step, operator, np.random.default_rng(0))


def of_levels(
    genome: Genome,
    others: Sequence[Genome],
    side: int,
    make: Callable,
    rng: np.random.Generator,
) -> Tuning:
    """The field of `of_field` as a sum of coarser ones: first one number for the whole map, then
    2 × 2 of them, and so on to ``side`` × ``side``, within −1…1 each. So few evaluations try much
    of another's fabric, and then less of it. Within a level ``rng`` draws their order, since an
    optimiser tries the first ones first."""
    levels = [np.arange(side) * count // side for count in _halves(side)]
    shapes, order = [], []
    for at in levels:
        count = int(at[-1]) + 1
        cells = (at[:, None] * count + at[None, :]).ravel()
        found = np.eye(count * count)[:, cells]
        first = sum(map(len, shapes))
        places = [(k, first + n) for n in range(count * count) for k in range(len(others))]
        order += [places[n] for n in rng.permutation(len(places)).tolist()]
        shapes.append(found)
    shape, (of, which) = np.vstack(shapes), np.array(order).T

    def operator(point: np.ndarray):
        numbers = np.zeros((len(others), len(shape)))
        numbers[of, which] = point
        return make(side=side, values=np.clip(numbers @ shape, 0, 1).ravel())

    count = len(order)
    ends = np.full(count, -1.0), np.ones(count)
    start, step = np.zeros(count), np.full(count, 0.5)
    return Tuning([genome, *others], start, *ends, step, operator, np.random.default_rng(0))


def _halves(side: int) -> list[int]:
    """1 … ``side``, each about half of the next."""
    found = [side]
    while found[0] > 1:
        found.insert(0, found[0] // 2)
    return found


def of_heights(genome: Genome, side: int, make: Callable) -> Tuning:
    """The field of factors that heights of street blocks are multiplied by, from 1; the numbers
    are their logarithms. ``make(side=…, values=…)`` gives the operator."""

    def operator(point: np.ndarray):
        return make(side=side, values=np.exp(point))

    low, high = np.log(FACTORS)
    ends = np.full(side**2, low), np.full(side**2, high)
    start, step = np.zeros(side**2), np.full(side**2, 0.3)
    return Tuning([genome], start, *ends, step, operator, np.random.default_rng(0))


def of_parameters(plan: Plan, parameters: Mapping[str, Any], keys: Sequence[str] = ()) -> Tuning:
    """The numbers among the parameters of the operator that an individual was bred by, from those
    it was bred with, by the draws it was bred with.

    plan : how it was bred.
    parameters : what the recipe says of the operator. A parameter that it gives a range for is
        tuned within that, any other between half and twice its value, as far as that is allowed.
    keys : the parameters to be tuned, all numbers but those of repair unless told.

    Raises `OperatorError` if there is nothing to be tuned.
    """
    name = plan.name
    kind = operators.operators().get(name)
    if kind is None:
        raise OperatorError(
            f"individual {plan.id}, which is a {plan.name}",
            "an individual that an operator of the recipe bred",
            "choose another, or another way, such as heights",
        )
    fixed = _told(plan.operator)
    ranges = parted(kind, parameters)[1]
    known = {
        key: value
        for key, value in fixed.items()
        if number_of(kind, key) is not None and _is_number(value) and key not in repair_checks()
    }
    for key in keys:
        if key not in known:
            raise OperatorError(
                with_near_miss(f"{shown(key)} of {name}", key, known),
                f"one of its numbers, {', '.join(known)}" if known else "nothing: it has no number",
                "leave it out, or choose another",
            )
    names = list(keys) or [key for key in known if key in ranges or known[key]]
    bounds = {
        key: (ranges[key].low, ranges[key].high)
        if key in ranges
        else _around(name, fixed, key, known[key])
        for key in names
    }
    names = [key for key in names if bounds[key][1] > bounds[key][0]]
    if not names:
        raise OperatorError(
            f"{name}, which has no number that can be tuned",
            "an operator with numbers among its parameters",
            "choose another individual, or another way, such as heights",
        )
    whole = {key: number_of(kind, key) is int for key in names}

    def operator(point: np.ndarray):
        told = dict(zip(names, point.tolist(), strict=True))
        told = {key: round(value) if whole[key] else value for key, value in told.items()}
        return operators.make(name, **{**fixed, **told})

    lower, upper = (np.array([bounds[key][end] for key in names], float) for end in (0, 1))
    start = np.clip([float(known[key]) for key in names], lower, upper)
    step = np.maximum((upper - lower) / 4, [1.0 if whole[key] else 0.0 for key in names])
    return Tuning(plan.genomes, start, lower, upper, step, operator, plan.rng)


def _told(operator) -> dict[str, Any]:
    """All parameters of one birth's operator."""
    if isinstance(operator, Drawn):
        made = {**operator.parameters, **operator.drawn}
        operator = operators.make(operator.name, **made)
    accepted = operators.parameters_of(type(operator))
    return {key: getattr(operator, key) for key in accepted if hasattr(operator, key)}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _around(name: str, fixed: Mapping, key: str, value: float) -> tuple[float, float]:
    """From half to twice a ``value``, as far as the operator allows it, to an eighth of the way."""
    ends = [value]
    for far in (value / 2, value * 2):
        ways = (value + share / 8 * (far - value) for share in range(8, 0, -1))
        ends.append(next((one for one in ways if _allowed(name, fixed, key, one)), value))
    return min(ends), max(ends)


def _allowed(name: str, fixed: Mapping, key: str, value: float) -> bool:
    told = round(value) if number_of(operators.operators()[name], key) is int else value
    try:
        operators.make(name, **{**fixed, key: told})
    except OperatorError:
        return False
    return True


__all__ = ["FACTORS", "Tuning", "of_field", "of_heights", "of_levels", "of_parameters"]
