"""Measures of fitness: functions from a city map to one number.

- `measure`: `Measure`, `Family`, and `Undefined`, NaN with a reason
- `registry`: the decorator, the table of measures, look-up by name, users' files
- `declaration`, `data`, `local_imports`: checks of a declaration, data files, imports of a file
- `source_transfer`: transfer of a session's measures to worker processes
- `check`: trials of your own measures, and their cost
- `part`: `Part`, a part of a map, and measures within it
- `reference`: `Reference`, the cities to compare with
- `goals`: `Objective`, a measure with a goal (max, min, target, like), as a loss
- `composition`: `Aims`, all objectives, weighted sums and constraints of a search
- `density`: `gsi`, `fsi`, `osr`, `storeys`, `mean_height`
- `roofs`: `height_deviation`, `height_entropy`, `roof_flatness`
- `sizes`: the distribution of sizes: `salingaros`, `salingaros_buildings`, `fit_sizes`, `crumbs`,
  `small_buildings`, `slivers`
- `shape`: the shapes of buildings and their number: `elongation`, `rectangularity`, `convexity`,
  `compactness`, `eri`, `shape_index`, `building_density`, `component_density`, `party_wall_ratio`
- `order`: alignment of façades: `alignment`, `alignment_global`
- `directions`: directions of buildings: `alignment_neighbours`, `alignment_momepy`,
  `orientation_order`
- `openness`: open ground: `street_width`, `open_space_connectivity`, `courtyard_index`,
  `sky_view_factor`
- `texture`: built ground as a fractal: `box_dimension`, `correlation_dimension`, `lacunarity`
- `fabric`: distance to the shapes of buildings of other cities: `fabric_distance`
- `types`, `type_table`: building types by a table of limits, `TypeTable`: `building_types`,
  `types_of`, `type_distance`
- `classes`: classes of objects on a map: `object_classes`, `object_counts`
- `heredity`: what a child keeps: `integrity`, `whole_buildings`, `heritability`
- `curves`: curves and shapes of runs that breed these: `curve_length`, `sinuosity`,
  `curve_dimension`, `simplicity`, `shape_dimension`, `shape_cover`; distances to a line in GeoJSON
  and to a picture
- `courses`: sites with courses: `built_area_lost`, `buildings_near_course`, `area_within_reach`
- `similarity`: `autosimilarity`
- `root_finding`: Brent's method

Your own measure is a function with one decorator:

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
    # Python looks up __call__ on the class. So a class of its own lets one name serve as the
    # decorator, evocity.fitness(...), and as the room, evocity.fitness.salingaros.
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
