"""The parts of the map that a recipe's measures are taken of: which pixels, and by which file."""

from collections.abc import Mapping, Sequence

import numpy as np

from evocity import io
from evocity.citymap import CityMap
from evocity.errors import FitnessError, RecipeError, blaming, shown
from evocity.fitness import Part
from evocity.search.recipe import Recipe
from evocity.search.values import resolved
from evocity.search.wanted import MeasureEntry


def part_names(recipe: Recipe) -> list[str]:
    """The files that mark parts, as the ``recipe`` names them, each once."""
    return list(dict.fromkeys(one.within for one in recipe.entries if one.within is not None))


def parts_of(
    recipe: Recipe, cities: Sequence[CityMap], kept: Mapping[str, np.ndarray] | None = None
) -> dict[str, Part]:
    """The parts that measures of the ``recipe`` are taken of, by the files that mark them.

    A file is laid on the first of the source ``cities`` that it lies on; ``kept``, of a run taken
    up again, has what was found then. Raises `MapError`, which names the key, where a file does not
    serve, `RecipeError` if a measure cannot be taken of a part.
    """
    masks = {}
    for name in part_names(recipe):
        with blaming(f"{_key(recipe, name)}: within = {shown(name)}"):
            masks[name] = (
                io.read_mask(resolved(recipe.folder, name), cities) if kept is None else kept[name]
            )
    parts = {name: Part(name, mask) for name, mask in masks.items()}
    for key, entry in _keyed(recipe):
        for measure in entry.measures if entry.within is not None else ():
            try:
                parts[entry.within].check(measure)
            except FitnessError as error:
                found = f"{key}: {error.found}"
                raise RecipeError(found, error.expected, error.remedy) from None
    return parts


def _keyed(recipe: Recipe) -> list[tuple[str, MeasureEntry]]:
    """What is measured, each with its key."""
    lists = ("fitness", recipe.fitness), ("run.record", recipe.run.record)
    return [(f"{key}[{k}]", one) for key, entries in lists for k, one in enumerate(entries)]


def _key(recipe: Recipe, name: str) -> str:
    """The key of the first entry that names the file ``name`` of a part, with its measure."""
    key, entry = next(pair for pair in _keyed(recipe) if pair[1].within == name)
    return key + (f" ({entry.name})" if entry.name else "")


__all__ = ["part_names", "parts_of"]
