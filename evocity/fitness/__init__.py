"""Measures of fitness: functions from a city map to one number.

- `measure`: `Measure`, `Family`, and `Undefined`, NaN with a reason
- `registry`: the decorator, the table of measures, look-up by name, users' files
- `declaration`, `local_imports`: checks of a declaration, imports and data files of a file
- `source_transfer`: transfer of a session's measures to worker processes
- `check`: trials of your own measures, and their cost
- `part`: `Part`, a part of a map, and measures within it
- `reference`: `Reference`, the cities to compare with
- `goals`: `Objective`, a measure with a goal (max, min, target, like), as a loss
- `composition`: `Aims`, all objectives, weighted sums and constraints of a search
- `copies`: copies on one map: `repetition`, `repeated_footprints`
- `density`: `gsi`, `fsi`, `osr`, `storeys`, `mean_height`
- `roofs`: `height_deviation`, `height_entropy`, `roof_flatness`, `height_context`
- `sizes`: the distribution of sizes: `salingaros`, `salingaros_buildings`, `fit_sizes`, `crumbs`,
  `small_buildings`, `slivers`
- `size_law`: Salingaros' law on the map's own range of sizes: `salingaros_law`, `fit_size_law`
- `shape`: the shapes of buildings and their number: `elongation`, `rectangularity`, `convexity`,
  `compactness`, `eri`, `shape_index`, `building_density`, `component_density`, `party_wall_ratio`
- `directions`: directions of façades and buildings: `alignment`, `alignment_global`,
  `alignment_neighbours`, `alignment_momepy`, `orientation_order`
- `openness`: open ground: `street_width`, `open_space_connectivity`, `courtyard_index`,
  `sky_view_factor`
- `light`: sun on open ground and light on façades: `winter_sun`, `daylight`
- `walking`: ways along streets to the nearest place: `walk_distance`
- `texture`: built ground as a fractal: `box_dimension`, `correlation_dimension`, `lacunarity`,
  `autosimilarity`
- `fabric`: distance to the shapes of buildings of other cities: `fabric_distance`
- `neighbours`: differences from the nearest points: `mean_over_neighbours`
- `energy`: mean distances of tables of features: `mean_distance`
- `likeness`: distance to the pictures of other cities: `picture_likeness`
- `streets`: distance to the plans of streets of other cities: `street_distance`
- `fronts`: façades on common lines along streets: `frontage`
- `types`, `type_table`: building types by a table of limits, `TypeTable`: `building_types`,
  `types_of`, `type_distance`; classes of objects on a map: `object_classes`, `object_counts`
- `cuts`: buildings cut only along streets: `integrity_along_fronts`
- `heredity`: what a child keeps: `integrity`, `whole_buildings`, `heritability`,
  `smallest_share`, `source_shares`
- `curves`: curves and shapes of runs that breed these: `curve_length`, `sinuosity`,
  `curve_dimension`, `simplicity`, `shape_dimension`, `shape_cover`; distances to a line in GeoJSON
  and to a picture; sites: `built_area_lost`, `buildings_near_course`, `area_within_reach`

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

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
for _name in __all__:  # the table of measures needs all of them
    __getattr__(_name)


class _CallableModule(ModuleType):
    # Python looks up __call__ on the class. So a class of its own lets one name serve as the
    # decorator, evocity.fitness(...), and as the room, evocity.fitness.salingaros.
    def __call__(self, *args, **options):
        return self.fitness(*args, **options)


sys.modules[__name__].__class__ = _CallableModule
