"""Checks of a measure's declaration: function, numbers, goal, unit, range and data files.

All of them raise `FitnessError` for a wrong declaration.
"""

import contextlib
import inspect
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath

from evocity.errors import FitnessError
from evocity.fitness.measure import EXTRAS, shown

HOW_TO_DECLARE = '@evocity.fitness(goal="max", unit="m", range=(0, 1)) above def name(city):'


def check_function(function) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """List the names of `EXTRAS` that the ``function`` needs, and those that it takes."""
    if not inspect.isfunction(function) or not function.__name__.isidentifier():
        raise FitnessError(
            f"@evocity.fitness(...) stands above {shown(function)}, not above a named function",
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
            f"the parameter 'city' first, then only optional parameters: {', '.join(EXTRAS)}",
            "remove all other parameters, or give them default values",
        ) from None
    return needs, takes


def check_numbers(numbers: Sequence[str]) -> tuple[str, ...]:
    """Check the names of the ``numbers`` that a function returns, each once."""
    listed = isinstance(numbers, Sequence) and not isinstance(numbers, str)
    names = tuple(numbers) if listed else ()
    right = all(isinstance(name, str) and name.isidentifier() for name in names)
    if not (listed and right and len(set(names)) == len(names)):
        raise FitnessError(
            f"numbers = {numbers!r} is not a list of different names",
            'names of the numbers that the function returns, for example ("count", "tallest")',
            "leave the parameter 'numbers' out if the function returns one number",
        )
    return names


def value_for(values, number: str | None, default):
    """Look up the value of a ``number``; ``values`` that are not a mapping hold for all numbers."""
    return values.get(number, default) if isinstance(values, Mapping) else values


def check_goal(goal) -> str | None:
    """Check the default goal of a search: "max", "min", or None."""
    if goal not in ("max", "min", None):
        raise FitnessError(
            f"goal = {goal!r} is not a goal",
            '"max", "min" or None',
            "choose one of these goals; a target, such as target = 0.35, belongs in the recipe",
        )
    return goal


def check_unit(unit) -> str:
    """Check the unit: text, empty for a pure number."""
    if not isinstance(unit, str):
        raise FitnessError(
            f"unit = {unit!r} is not a text", 'text, for example "m"', "put the unit in quotes"
        )
    return unit


def check_bounds(range) -> tuple[float, float]:
    """Check the lowest and the highest value."""
    with contextlib.suppress(TypeError, ValueError):
        low, high = (float(bound) for bound in range)
        if low < high:
            return low, high
    raise FitnessError(
        f"range = {range!r} is not a pair of bounds",
        "two numbers, the lower number first; float('inf') means no bound",
        "write for example range=(0, 1)",
    )


def check_names(data: str | Sequence[str]) -> tuple[str, ...]:
    """Check the names of ``data`` files, one or several: relative to a folder and within it.

    Raises `FitnessError` for anything else.
    """
    names = (data,) if isinstance(data, str) else data
    if isinstance(names, Sequence) and all(isinstance(name, str) and name for name in names):
        paths = [PurePosixPath(name) for name in names]
        within = all(p.parts and not p.is_absolute() and ".." not in p.parts for p in paths)
        if within and not any(set(name) & set("\\:\0") for name in names):
            return tuple(dict.fromkeys(map(str, paths)))
    raise FitnessError(
        f"data = {shown(data)} is not a list of data files",
        'files in the folder of the Python file, or in a folder within it, for example "trees.csv"',
        "give the paths of the files, relative to the Python file, with / between folders",
    )
