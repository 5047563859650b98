"""What the package names, for checkers of types; `__init__.py` loads each name when first used."""

from collections.abc import Callable, Mapping, Sequence
from typing import overload

import evocity.fitness as _fitness
import evocity.scene as _scene
from evocity import plot as plot
from evocity import shapes as shapes
from evocity.analysis import open_run
from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.condensation import Condensation
from evocity.errors import EvocityError
from evocity.genome import Genome, merged, read_genome, split
from evocity.io import cities, read_map, write_map
from evocity.pavement import Pavement
from evocity.search import (
    Recipe,
    Search,
    archive,
    deap_toolbox,
    pick,
    read_recipe,
    refine,
    replay,
)

__version__: str
__all__ = [
    "CityMap",
    "Condensation",
    "EvocityError",
    "Genome",
    "Pavement",
    "Recipe",
    "Search",
    "archive",
    "cities",
    "deap_toolbox",
    "decode",
    "encode",
    "fitness",
    "merged",
    "open_run",
    "pick",
    "plot",
    "read_genome",
    "read_map",
    "read_recipe",
    "refine",
    "replay",
    "scene",
    "shapes",
    "split",
    "write_map",
]

# A module that can be called is no type that checkers know.
class _Fitness:
    @overload
    def __call__(
        self,
        goal: str | None = None,
        unit: str = "",
        range: tuple[float, float] = ...,
        *,
        any_site: bool = False,
        data: str | Sequence[str] = (),
        of: str = "city",
    ) -> Callable[[Callable], _fitness.Measure]: ...
    @overload
    def __call__(
        self,
        goal: str | Mapping[str, str | None] | None = None,
        unit: str | Mapping[str, str] = "",
        range: tuple[float, float] | Mapping[str, tuple[float, float]] = ...,
        *,
        numbers: Sequence[str],
        any_site: bool = False,
        data: str | Sequence[str] = (),
        of: str = "city",
    ) -> Callable[[Callable], _fitness.Measure | _fitness.Family]: ...
    Aims = _fitness.Aims
    Constraint = _fitness.Constraint
    EXTRAS = _fitness.EXTRAS
    Family = _fitness.Family
    GOALS = _fitness.GOALS
    Measure = _fitness.Measure
    Objective = _fitness.Objective
    Part = _fitness.Part
    Reference = _fitness.Reference
    SizeFit = _fitness.SizeFit
    SizeLaw = _fitness.SizeLaw
    TypeTable = _fitness.TypeTable
    Undefined = _fitness.Undefined
    WEIGHTED = _fitness.WEIGHTED
    Wanted = _fitness.Wanted
    WantedDensity = _fitness.WantedDensity
    alignment = _fitness.alignment
    alignment_global = _fitness.alignment_global
    alignment_momepy = _fitness.alignment_momepy
    alignment_neighbours = _fitness.alignment_neighbours
    area_within_reach = _fitness.area_within_reach
    autosimilarity = _fitness.autosimilarity
    box_dimension = _fitness.box_dimension
    building_density = _fitness.building_density
    building_types = _fitness.building_types
    buildings_near_course = _fitness.buildings_near_course
    built_area_lost = _fitness.built_area_lost
    compactness = _fitness.compactness
    component_density = _fitness.component_density
    convexity = _fitness.convexity
    correlation_dimension = _fitness.correlation_dimension
    courtyard_index = _fitness.courtyard_index
    crumbs = _fitness.crumbs
    curve_dimension = _fitness.curve_dimension
    curve_length = _fitness.curve_length
    daylight = _fitness.daylight
    elongation = _fitness.elongation
    eri = _fitness.eri
    fabric_distance = _fitness.fabric_distance
    fit_size_law = staticmethod(_fitness.fit_size_law)
    fit_sizes = staticmethod(_fitness.fit_sizes)
    fitness = staticmethod(_fitness.fitness)
    frontage = _fitness.frontage
    fsi = _fitness.fsi
    get = staticmethod(_fitness.get)
    gsi = _fitness.gsi
    height_context = _fitness.height_context
    height_deviation = _fitness.height_deviation
    height_entropy = _fitness.height_entropy
    heritability = staticmethod(_fitness.heritability)
    integrity = _fitness.integrity
    integrity_along_fronts = _fitness.integrity_along_fronts
    lacunarity = _fitness.lacunarity
    load_file = staticmethod(_fitness.load_file)
    mean_height = _fitness.mean_height
    measures = staticmethod(_fitness.measures)
    named = staticmethod(_fitness.named)
    object_classes = _fitness.object_classes
    object_counts = _fitness.object_counts
    open_space_connectivity = _fitness.open_space_connectivity
    orientation_order = _fitness.orientation_order
    osr = _fitness.osr
    party_wall_ratio = _fitness.party_wall_ratio
    picture_likeness = _fitness.picture_likeness
    plugin_warnings = staticmethod(_fitness.plugin_warnings)
    rectangularity = _fitness.rectangularity
    repeated_footprints = _fitness.repeated_footprints
    repetition = _fitness.repetition
    roof_flatness = _fitness.roof_flatness
    salingaros = _fitness.salingaros
    salingaros_buildings = _fitness.salingaros_buildings
    salingaros_law = _fitness.salingaros_law
    shape_cover = _fitness.shape_cover
    shape_dimension = _fitness.shape_dimension
    shape_index = _fitness.shape_index
    simplicity = _fitness.simplicity
    sinuosity = _fitness.sinuosity
    sky_view_factor = _fitness.sky_view_factor
    slivers = _fitness.slivers
    small_buildings = _fitness.small_buildings
    smallest_share = _fitness.smallest_share
    source_shares = staticmethod(_fitness.source_shares)
    storeys = _fitness.storeys
    street_distance = _fitness.street_distance
    street_width = _fitness.street_width
    type_distance = _fitness.type_distance
    types_of = staticmethod(_fitness.types_of)
    walk_distance = _fitness.walk_distance
    whole_buildings = staticmethod(_fitness.whole_buildings)
    winter_sun = _fitness.winter_sun

class _Scene:
    __call__ = staticmethod(_scene.scene)
    LEVELS = _scene.LEVELS
    Library = _scene.Library
    SUFFIXES = _scene.SUFFIXES
    Scene = _scene.Scene
    Substitution = _scene.Substitution
    check_suffix = staticmethod(_scene.check_suffix)
    fabric_edges = staticmethod(_scene.fabric_edges)
    facades = staticmethod(_scene.facades)
    picture_outline = staticmethod(_scene.picture_outline)
    scene = staticmethod(_scene.scene)
    skyline = staticmethod(_scene.skyline)
    street_axes = staticmethod(_scene.street_axes)
    substituted = staticmethod(_scene.substituted)
    suffix_of = staticmethod(_scene.suffix_of)
    write_levels = staticmethod(_scene.write_levels)
    write_on_relief = staticmethod(_scene.write_on_relief)
    write_tiles = staticmethod(_scene.write_tiles)

fitness: _Fitness
scene: _Scene
