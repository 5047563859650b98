"""The parts of the map that a recipe's measures are taken of: which pixels, and by which file."""

from collections.abc import Mapping, Sequence

import numpy as np

from evocity import io
from evocity.citymap import CityMap
from evocity.errors import FitnessError, RecipeError
from evocity.fitness import Part
from evocity.search.recipe import Recipe
from evocity.search.values import resolved


def part_names(recipe: Recipe) -> list[str]:
    """The files that mark parts, as the ``recipe`` names them, each once."""
    return list(dict.fromkeys(one.within for one in recipe.entries if one.within is not None))


def parts_of(
    recipe: Recipe, cities: Sequence[CityMap], kept: Mapping[str, np.ndarray] | None = None
) -> dict[str, Part]:
    """The parts that measures of the ``recipe`` are taken of, by the files that mark them.

    A file is laid on the first of the source ``cities`` that it lies on; ``kept``, of a run taken
    up again, has what was found then. Raises `MapError` where a file does not serve, `RecipeError`
    if a measure cannot be taken of a part.
    """
    masks = {
        name: io.read_mask(resolved(recipe.folder, name), cities) if kept is None else kept[name]
        for name in part_names(recipe)
    }
    parts = {name: Part(name, mask) for name, mask in masks.items()}
    for key, entries in (("fitness", recipe.fitness), ("run.record", recipe.run.record)):
        for number, entry in enumerate(entries):
            for measure in entry.measures if entry.within is not None else ():
                try:
                    parts[entry.within].check(measure)
                except FitnessError as error:
                    found = f"{key}[{number}]: {error.found}"
                    raise RecipeError(found, error.expected, error.remedy) from None
    return parts


__all__ = ["part_names", "parts_of"]
