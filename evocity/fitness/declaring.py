"""What a declaration of a measure may say: checks of its function, goal, unit and range."""

import contextlib
import inspect
from collections.abc import Mapping, Sequence

from evocity.errors import FitnessError
from evocity.fitness.measure import EXTRAS, shown

HOW_TO_DECLARE = '@evocity.fitness(goal="max", unit="m", range=(0, 1)) above def name(city):'


def check_function(function) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Which of `EXTRAS` the ``function`` needs, and which it takes. All here raise `FitnessError`
    for what is declared wrongly."""
    if not inspect.isfunction(function) or not function.__name__.isidentifier():
        raise FitnessError(
            f"@evocity.fitness(...) above {shown(function)}",
            "a function with a name",
            f"write {HOW_TO_DECLARE}",
        )
    signature = inspect.signature(function)
    given = dict(list(signature.parameters.items())[1:])
    takes = tuple(name for name in EXTRAS if name in given)
    needs = tuple(name for name in takes if given[name].default is inspect.Parameter.empty)
    try:
        signature.bind("city", **dict.fromkeys(takes))
    except TypeError as error:
        raise FitnessError(
            f"{function.__name__}{signature}: {error}",
            f"a function of the city map: def {function.__name__}(city):, which may ask for "
            f"{', '.join(EXTRAS)} besides",
            "take these alone; give other parameters default values",
        ) from None
    return needs, takes


def checked_numbers(numbers: Sequence[str]) -> tuple[str, ...]:
    """The names of the ``numbers`` that a function returns, each once."""
    listed = isinstance(numbers, Sequence) and not isinstance(numbers, str)
    names = tuple(numbers) if listed else ()
    right = all(isinstance(name, str) and name.isidentifier() for name in names)
    if not (listed and right and len(set(names)) == len(names)):
        raise FitnessError(
            f"numbers = {numbers!r}",
            'names of the numbers that the function returns, for example ("count", "tallest")',
            "leave it out if the function returns one number",
        )
    return names


def own(told, number: str | None, default):
    """What is told of one ``number``, or of all."""
    return told.get(number, default) if isinstance(told, Mapping) else told


def checked_goal(goal) -> str | None:
    """What a search does with it: "max", "min", or None."""
    if goal not in ("max", "min", None):
        raise FitnessError(
            f"goal = {goal!r}",
            '"max", "min" or None',
            "give targets in the recipe (target = 0.35, or like = a city), not here",
        )
    return goal


def checked_unit(unit) -> str:
    """A text, empty for a pure number."""
    if not isinstance(unit, str):
        raise FitnessError(f"unit = {unit!r}", 'text, for example "m"', "put the unit in quotes")
    return unit


def checked_bounds(range) -> tuple[float, float]:
    """The lowest and the highest value."""
    with contextlib.suppress(TypeError, ValueError):
        low, high = (float(bound) for bound in range)
        if low < high:
            return low, high
    raise FitnessError(
        f"range = {range!r}",
        "two numbers, the lower first; float('inf') for no bound",
        "write for example range=(0, 1)",
    )


__all__ = [
    "HOW_TO_DECLARE",
    "check_function",
    "checked_bounds",
    "checked_goal",
    "checked_numbers",
    "checked_unit",
    "own",
]
