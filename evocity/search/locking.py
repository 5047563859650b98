"""What a recipe locks: which pixels keep their heights through a whole run."""

from evocity import io
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import RecipeError, blaming, near_miss, shown
from evocity.search.recipe import Recipe
from evocity.search.values import resolved


def locked_layer(recipe: Recipe, cities: list[CityMap]) -> tuple[Condensation | None, str]:
    """The layer that ``[locked]`` asks for, on the grid of the source ``cities``, and what the
    licences of its files ask for; (None, "") if nothing is locked.

    Raises `RecipeError` if the city is no source or nothing is left to breed; `MapError`, which
    names the key, where a file does not serve.
    """
    asked = recipe.locked
    if asked.place is None:
        return None, ""
    city = _city(asked.city, cities)
    heights = asked.heights
    if isinstance(heights, str):
        heights = resolved(recipe.folder, heights)
    place, key = resolved(recipe.folder, asked.place), "footprints" if asked.footprints else "mask"
    with blaming(f"locked.{key} = {shown(asked.place)}"):
        io.read_mask(place, [city])
    with blaming(f"locked.heights = {shown(asked.heights)}"):  # the place is right
        layer, attribution = io.read_condensation(place, city, heights)
    if layer.mask.all():
        raise RecipeError(
            f"locked: {asked.place} covers every pixel of {city.name}",
            "pixels that are free to be bred",
            "lock a part of the map",
        )
    return layer, attribution


def _city(name: str | None, cities: list[CityMap]) -> CityMap:
    by_name = {city.name: city for city in cities}
    if name is None:
        return cities[0]
    if name not in by_name:
        raise RecipeError(
            f"locked.city: {name!r} is no source of this recipe",
            f"one of {', '.join(by_name)}",
            near_miss(name, by_name) or "name one of them, or leave the key out for the first",
        )
    return by_name[name]
