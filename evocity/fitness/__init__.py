"""Fitness: a city map in, one number out.

- `registry`: `Measure`, what makes one of a plain function, the table of names, users' files
- `goals`: `Objective`, a measure with a goal (max, min, a target, like a city) as a loss
- `density`: how much is built: `gsi`, `fsi`, `mean_height`
- `sizes`: how the sizes of buildings are distributed: `salingaros`, `fit_sizes`, `crumbs`
- `order`: how façades lie to each other: `alignment`
- `similarity`: how much of the city is a copy of itself: `autosimilarity`

A measure of one's own is a function with one decorator:

>>> import evocity.fitness
>>> @evocity.fitness(goal="max", unit="m")
... def highest_roof(city):
...     return city.heights.max()
>>> highest_roof.goal
'max'
"""

import sys
from types import ModuleType

from evocity.fitness.density import fsi, gsi, mean_height
from evocity.fitness.goals import GOALS, Objective
from evocity.fitness.order import alignment
from evocity.fitness.registry import (
    Measure,
    Undefined,
    fitness,
    get,
    load_file,
    measures,
    plugin_warnings,
)
from evocity.fitness.similarity import autosimilarity
from evocity.fitness.sizes import SizeFit, crumbs, fit_sizes, salingaros


class _CallableModule(ModuleType):
    # Python looks __call__ up on the class: only a class of its own lets one name serve both
    # as the decorator, evocity.fitness(...), and as the room, evocity.fitness.salingaros.
    def __call__(self, *args, **options):
        return fitness(*args, **options)


sys.modules[__name__].__class__ = _CallableModule

__all__ = [
    "GOALS",
    "Measure",
    "Objective",
    "SizeFit",
    "Undefined",
    "alignment",
    "autosimilarity",
    "crumbs",
    "fit_sizes",
    "fitness",
    "fsi",
    "get",
    "gsi",
    "load_file",
    "mean_height",
    "measures",
    "plugin_warnings",
    "salingaros",
]
