"""The numbers that a refinement tunes, and the operator that has them as parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evocity import operators
from evocity.errors import OperatorError, add_near_miss, is_number, spell
from evocity.genome import Genome
from evocity.operators.parameters import number_of, repair_checks
from evocity.recipe.mixture import Drawn, split_ranges
from evocity.search.breeding.birth_plans import BirthPlan

#: The least and the largest factor of heights.
FACTORS = 0.4, 2.5


@dataclass(frozen=True)
class Tuning:
    """The numbers to be tuned: ``start`` ``(n,)`` within ``lower`` and ``upper``, first tried
    ``step`` away. ``operator`` makes the operator of a point, which breeds from the ``parents``
    with equal draws."""

    parents: Sequence[Genome]
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    step: np.ndarray
    operator: Callable[[np.ndarray], Any]
    rng: np.random.Generator

    @property
    def generator(self) -> np.random.Generator:
        """A copy of ``rng``, as it was before the first child."""
        copy = np.random.Generator(type(self.rng.bit_generator)())
        copy.bit_generator.state = self.rng.bit_generator.state
        return copy


def _from_zero(
    parents: Sequence[Genome],
    count: int,
    bounds: tuple[float, float],
    step: float,
    operator: Callable[[np.ndarray], Any],
) -> Tuning:
    lower, upper, steps = (np.full(count, value) for value in (*bounds, step))
    rng = np.random.default_rng(0)
    return Tuning(parents, np.zeros(count), lower, upper, steps, operator, rng)


def field_tuning(genome: Genome, others: Sequence[Genome], side: int, make: Callable) -> Tuning:
    """Tune the λ-field that fills street blocks of ``genome`` with the fabric of ``others``, from
    0, the genome itself. ``make(side=…, values=…)`` gives the operator."""
    count = len(others) * side**2
    parents, make_at = [genome, *others], lambda point: make(side=side, values=point)
    return _from_zero(parents, count, (0.0, 1.0), 0.5, make_at)


def level_tuning(
    genome: Genome,
    others: Sequence[Genome],
    side: int,
    make: Callable,
    rng: np.random.Generator,
) -> Tuning:
    """Tune the field of `field_tuning` as a sum of coarser ones, within −1…1 each: one number for
    the whole map, then 2 × 2, and so on to ``side`` × ``side``. ``rng`` draws the order within a
    level, since an optimiser tries the first numbers first."""
    shapes, order = [], []
    for level in _halves(side):
        at = np.arange(side) * level // side
        count = int(at[-1]) + 1
        cells = (at[:, None] * count + at[None, :]).ravel()
        first = sum(map(len, shapes))
        places = [(k, first + n) for n in range(count * count) for k in range(len(others))]
        order += [places[n] for n in rng.permutation(len(places)).tolist()]
        shapes.append(np.eye(count * count)[:, cells])
    shape, (of, which) = np.vstack(shapes), np.array(order).T

    def operator(point: np.ndarray):
        numbers = np.zeros((len(others), len(shape)))
        numbers[of, which] = point
        return make(side=side, values=np.clip(numbers @ shape, 0, 1).ravel())

    return _from_zero([genome, *others], len(order), (-1.0, 1.0), 0.5, operator)


def _halves(side: int) -> list[int]:
    levels = [side]
    while levels[0] > 1:
        levels.insert(0, levels[0] // 2)
    return levels


def height_tuning(genome: Genome, side: int, make: Callable) -> Tuning:
    """Tune the field of factors that multiply the heights of street blocks, from 1; the numbers are
    their logarithms. ``make(side=…, values=…)`` gives the operator."""
    bounds, make_at = tuple(np.log(FACTORS)), lambda point: make(side=side, values=np.exp(point))
    return _from_zero([genome], side**2, bounds, 0.3, make_at)


def parameter_tuning(
    plan: BirthPlan, parameters: Mapping[str, Any], keys: Sequence[str] = ()
) -> Tuning:
    """Tune numeric parameters of the operator that bred an individual, with the same draws.

    plan : how it was bred.
    parameters : what the recipe says of the operator. A parameter with a range is tuned within it,
        any other between half and twice its value, as far as the operator allows it.
    keys : the parameters to be tuned; by default all numbers but those of repair.

    Raises `OperatorError` if nothing can be tuned.
    """
    name = plan.name
    kind = operators.operators().get(name)
    if kind is None:
        raise OperatorError(
            f"no operator bred individual {plan.id}: it is a {plan.name}",
            "an individual that an operator of the recipe bred",
            "choose another individual, or another method to refine, such as heights",
        )
    fixed = _parameters(plan.operator)
    ranges = split_ranges(kind, parameters)[1]
    known = {
        key: value
        for key, value in fixed.items()
        if number_of(kind, key) is not None and is_number(value) and key not in repair_checks()
    }
    for key in keys:
        if key not in known:
            raise OperatorError(
                add_near_miss(
                    f"the operator {name} has no number {spell(key)} to tune", key, known
                ),
                f"one of its numbers: {', '.join(known)}"
                if known
                else "no name: the operator has no number",
                "leave this name out, or choose another parameter",
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
            f"the operator {name} has no numeric parameter to tune",
            "an operator with numeric parameters",
            "choose another individual, or another method to refine, such as heights",
        )
    whole = {key: number_of(kind, key) is int for key in names}

    def operator(point: np.ndarray):
        values = dict(zip(names, point.tolist(), strict=True))
        values = {key: round(value) if whole[key] else value for key, value in values.items()}
        return operators.make(name, **{**fixed, **values})

    lower, upper = (np.array([bounds[key][end] for key in names], float) for end in (0, 1))
    start = np.clip([float(known[key]) for key in names], lower, upper)
    step = np.maximum((upper - lower) / 4, [1.0 if whole[key] else 0.0 for key in names])
    return Tuning(plan.genomes, start, lower, upper, step, operator, plan.rng)


def _parameters(operator) -> dict[str, Any]:
    if isinstance(operator, Drawn):
        made = {**operator.parameters, **operator.drawn}
        operator = operators.make(operator.name, **made)
    accepted = operators.parameters_of(type(operator))
    return {key: getattr(operator, key) for key in accepted if hasattr(operator, key)}


def _around(name: str, fixed: Mapping, key: str, value: float) -> tuple[float, float]:
    """From half to twice a ``value``, or to so many eighths of the way as the operator allows."""
    ends = [value]
    for far in (value / 2, value * 2):
        ways = (value + share / 8 * (far - value) for share in range(8, 0, -1))
        ends.append(next((way for way in ways if _is_allowed(name, fixed, key, way)), value))
    return min(ends), max(ends)


def _is_allowed(name: str, fixed: Mapping, key: str, value: float) -> bool:
    value = round(value) if number_of(operators.operators()[name], key) is int else value
    try:
        operators.make(name, **{**fixed, key: value})
    except OperatorError:
        return False
    return True
