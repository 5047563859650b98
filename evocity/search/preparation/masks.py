"""Masks of a recipe: locked pixels, and the parts of the map that its measures are taken of."""

from collections.abc import Mapping, Sequence

import numpy as np

from evocity import io
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import FitnessError, RecipeError, blame, near_miss, spell
from evocity.fitness import Part
from evocity.recipe.measures import MeasureEntry
from evocity.recipe.recipe import Recipe
from evocity.recipe.values import resolve_path


def locked_layer(recipe: Recipe, cities: list[CityMap]) -> tuple[Condensation | None, str]:
    """Read the layer of ``[locked]`` on the grid of the source ``cities``, and the attribution that
    its files require; (None, "") if nothing is locked. Raises `RecipeError` if the city is no
    source or nothing is left to breed, `MapError`, which names the key, if a file cannot be used.
    """
    locked = recipe.locked
    if locked.place is None:
        return None, ""
    city = _city(locked.city, cities)
    heights = locked.heights
    if isinstance(heights, str):
        heights = resolve_path(recipe.folder, heights)
    place = resolve_path(recipe.folder, locked.place)
    key = "footprints" if locked.footprints else "mask"
    with blame(f"locked.{key} = {spell(locked.place)}"):
        io.read_mask(place, [city])
    with blame(f"locked.heights = {spell(locked.heights)}"):  # the place is right
        layer, attribution = io.read_condensation(place, city, heights)
    if layer.mask.all():
        raise RecipeError(
            f"locked: {locked.place} covers every pixel of {city.name}",
            "some pixels that are not locked, so that births can change them",
            "lock only a part of the map",
        )
    return layer, attribution


def _city(name: str | None, cities: list[CityMap]) -> CityMap:
    by_name = {city.name: city for city in cities}
    if name is None:
        return cities[0]
    if name not in by_name:
        raise RecipeError(
            f"locked.city: {name!r} is not a source of this recipe",
            f"one of {', '.join(by_name)}",
            near_miss(name, by_name) or "name one of them, or leave the key out for the first",
        )
    return by_name[name]


def part_names(recipe: Recipe) -> list[str]:
    """Return the files that mark parts, as the ``recipe`` names them, each once."""
    return list(dict.fromkeys(entry.within for entry in recipe.entries if entry.within is not None))


def parts_of(
    recipe: Recipe, cities: Sequence[CityMap], kept: Mapping[str, np.ndarray] | None = None
) -> dict[str, Part]:
    """Read the parts that measures of the ``recipe`` are taken of, by the files that mark them,
    each on the first of the ``cities`` that it covers. A resumed run has ``kept`` the masks. Raises
    `MapError` or `RecipeError`, which name the key."""
    masks = {}
    for name in part_names(recipe):
        with blame(f"{_key(recipe, name)}: within = {spell(name)}"):
            masks[name] = (
                io.read_mask(resolve_path(recipe.folder, name), cities)
                if kept is None
                else kept[name]
            )
    parts = {name: Part(name, mask) for name, mask in masks.items()}
    for key, entry in _entries_by_key(recipe):
        for measure in entry.measures if entry.within is not None else ():
            try:
                parts[entry.within].check(measure)
            except FitnessError as error:
                found = f"{key}: {error.found}"
                raise RecipeError(found, error.expected, error.remedy) from None
    return parts


def _entries_by_key(recipe: Recipe) -> list[tuple[str, MeasureEntry]]:
    lists = ("fitness", recipe.fitness), ("run.record", recipe.run.record)
    return [(f"{key}[{k}]", entry) for key, entries in lists for k, entry in enumerate(entries)]


def _key(recipe: Recipe, name: str) -> str:
    key, entry = next(pair for pair in _entries_by_key(recipe) if pair[1].within == name)
    return key + (f" ({entry.name})" if entry.name else "")
