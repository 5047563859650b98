"""Fitness: a city map in, one number out.

- `measure`: `Measure`, what one is and how its faults are told; `Undefined`
- `registry`: what makes one of a plain function, the table of names, users' files
- `shipping`: how a measure of the session, of a notebook's cell, reaches worker processes
- `siblings`: what such a file imports from its own folder
- `part`: `Part`, a part of a map that a measure is taken of: this quarter, that bank
- `goals`: `Objective`, a measure with a goal (max, min, a target, like a city) as a loss
- `composition`: `Aims`, all that is wanted: objectives, weighted sums of them, constraints
- `density`: how much is built: `gsi`, `fsi`, `osr`, `storeys`, `mean_height`
- `roofs`: how high roofs are, one beside the other: `height_deviation`, `height_entropy`,
  `roof_flatness`
- `roots`: where a function is 0
- `sizes`: how the sizes of buildings are distributed: `salingaros`,
  `salingaros_buildings`, `fit_sizes`, `crumbs`, `small_buildings`,
  `slivers`
- `shape`: what shape buildings have, how many there are: `elongation`, `rectangularity`,
  `convexity`, `compactness`, `eri`, `shape_index`, `building_density`, `component_density`,
  `party_wall_ratio`
- `order`: how façades lie to each other: `alignment`, `alignment_global`
- `directions`: which way buildings are turned: `alignment_neighbours`, `alignment_momepy`,
  `orientation_order`
- `openness`: how open ground is: `street_width`, `open_space_connectivity`, `courtyard_index`,
  `sky_view_factor`
- `texture`: built ground as a fractal: `box_dimension`, `correlation_dimension`, `lacunarity`
- `fabric`: how far buildings are from those of other cities: `fabric_distance`, of a `Reference`
- `types`: what types of buildings there are: `building_types`, `types_of`, `type_distance`, by a
  table of limits, a `TypeTable` (`type_table`)
- `classes`: what stands on a map besides buildings: `object_classes`, `object_counts`
- `heredity`: what a child keeps: `integrity`, of its sources' buildings (`whole_buildings` says
  which); `heritability`, of the map that was meant
- `curves`: of curves and shapes, in runs that breed these: `curve_length`, `sinuosity`,
  `curve_dimension`, `simplicity`, `shape_dimension`, `shape_cover`; distances to a line in GeoJSON
  and to a picture
- `courses`: of sites: `built_area_lost`, `buildings_near_course`, `area_within_reach`
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

from evocity.fitness.classes import object_classes, object_counts
from evocity.fitness.composition import WEIGHTED, Aims, Constraint, Wanted
from evocity.fitness.courses import area_within_reach, buildings_near_course, built_area_lost
from evocity.fitness.curves import (
    curve_dimension,
    curve_length,
    shape_cover,
    shape_dimension,
    simplicity,
    sinuosity,
)
from evocity.fitness.density import fsi, gsi, mean_height, osr, storeys
from evocity.fitness.directions import (
    alignment_momepy,
    alignment_neighbours,
    orientation_order,
)
from evocity.fitness.fabric import fabric_distance
from evocity.fitness.goals import GOALS, Objective
from evocity.fitness.heredity import heritability, integrity, whole_buildings
from evocity.fitness.measure import EXTRAS, Family, Measure, Undefined
from evocity.fitness.openness import (
    courtyard_index,
    open_space_connectivity,
    sky_view_factor,
    street_width,
)
from evocity.fitness.order import alignment, alignment_global
from evocity.fitness.part import Part
from evocity.fitness.reference import Reference
from evocity.fitness.registry import (
    fitness,
    get,
    load_file,
    measures,
    named,
    plugin_warnings,
)
from evocity.fitness.roofs import height_deviation, height_entropy, roof_flatness
from evocity.fitness.shape import (
    building_density,
    compactness,
    component_density,
    convexity,
    elongation,
    eri,
    party_wall_ratio,
    rectangularity,
    shape_index,
)
from evocity.fitness.similarity import autosimilarity
from evocity.fitness.sizes import (
    SizeFit,
    crumbs,
    fit_sizes,
    salingaros,
    salingaros_buildings,
    slivers,
    small_buildings,
)
from evocity.fitness.texture import box_dimension, correlation_dimension, lacunarity
from evocity.fitness.type_table import TypeTable
from evocity.fitness.types import building_types, type_distance, types_of


class _CallableModule(ModuleType):
    # Python looks __call__ up on the class: only a class of its own lets one name serve both
    # as the decorator, evocity.fitness(...), and as the room, evocity.fitness.salingaros.
    def __call__(self, *args, **options):
        return fitness(*args, **options)


sys.modules[__name__].__class__ = _CallableModule

__all__ = [
    "EXTRAS",
    "GOALS",
    "WEIGHTED",
    "Aims",
    "Constraint",
    "Family",
    "Measure",
    "Objective",
    "Part",
    "Reference",
    "SizeFit",
    "TypeTable",
    "Undefined",
    "Wanted",
    "alignment",
    "alignment_global",
    "alignment_momepy",
    "alignment_neighbours",
    "area_within_reach",
    "autosimilarity",
    "box_dimension",
    "building_density",
    "building_types",
    "buildings_near_course",
    "built_area_lost",
    "compactness",
    "component_density",
    "convexity",
    "correlation_dimension",
    "courtyard_index",
    "crumbs",
    "curve_dimension",
    "curve_length",
    "elongation",
    "eri",
    "fabric_distance",
    "fit_sizes",
    "fitness",
    "fsi",
    "get",
    "gsi",
    "height_deviation",
    "height_entropy",
    "heritability",
    "integrity",
    "lacunarity",
    "load_file",
    "mean_height",
    "measures",
    "named",
    "object_classes",
    "object_counts",
    "open_space_connectivity",
    "orientation_order",
    "osr",
    "party_wall_ratio",
    "plugin_warnings",
    "rectangularity",
    "roof_flatness",
    "salingaros",
    "salingaros_buildings",
    "shape_cover",
    "shape_dimension",
    "shape_index",
    "simplicity",
    "sinuosity",
    "sky_view_factor",
    "slivers",
    "small_buildings",
    "storeys",
    "street_width",
    "type_distance",
    "types_of",
    "whole_buildings",
]
