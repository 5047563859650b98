"""Breed city fabrics: real districts coded as fractal genomes, crossed, decoded and measured.

A `CityMap` is a raster of building heights. Its code is a `Genome`: one gene for each range block
of its `Pavement`. Operators breed genomes; decoding makes a map of a genome; a measure gives a map
one number. A `Recipe` says what to breed and reward, and a `Search` does it, generation by
generation. `open_run` reads what it wrote, `archive` finds the best births, `replay` repeats any.
"""

from importlib import import_module

from evocity.lazy_imports import lazy_names

__version__ = "0.2.0"

_ROOMS = {
    "analysis": ["open_run"],
    "citymap": ["CityMap"],
    "coding": ["decode", "encode"],
    "condensation": ["Condensation"],
    "errors": ["EvocityError"],
    "genome": ["Genome", "merged", "read_genome", "split"],
    "io": ["cities", "read_map", "write_map"],
    "pavement": ["Pavement"],
    "recipe.reader": ["read_recipe"],
    "search": ["Recipe", "Search", "archive", "deap_toolbox", "pick", "refine", "replay"],
}
_MODULES = ("fitness", "plot", "scene", "shapes")  # fitness and scene can be called

_HOMES = {name: f"evocity.{room}" for room, names in _ROOMS.items() for name in names}
_load, _, __all__ = lazy_names(__name__, __file__, _HOMES)
__all__ += _MODULES


def __getattr__(name: str):  # each name loads its room at first use: `--help` stays quick
    return import_module(f"evocity.{name}") if name in _MODULES else _load(name)


def __dir__() -> list[str]:
    return __all__
