"""Building types and classes of objects: their shares, counts and mixtures."""

import math
from collections.abc import Mapping

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.measure import Undefined, keep_result
from evocity.fitness.reference import Reference
from evocity.fitness.registry import TABLES, fitness, name_of_file
from evocity.fitness.type_table import TypeTable, packaged
from evocity.genome import Genome
from evocity.views.classes import packaged as packaged_classes

#: The types of this package.
TYPES = packaged()
#: The classes of this package.
CLASSES = packaged_classes().names


@fitness(range=(0, 1), numbers=TYPES.names, any_site=True)
def building_types(city: CityMap) -> Mapping[str, float]:
    """Shares of built ground that detached houses, rows, courtyard blocks, slabs and other types
    cover.

    - Sheds (`building_types.shed`) cover less than 36 m².
    - Courtyard blocks (`building_types.courtyard_block`) enclose courts of at least 3 % of the
      footprint, alone or together with adjoining buildings.
    - Rows (`building_types.row`) stand wall to wall with courts of less than 3 % of the footprint,
      or are low, long and free-standing.
    - Slabs (`building_types.slab`) are free-standing: either long and at least 10 m high, or
      compact, large and at least 16 m high.
    - Towers (`building_types.tower`) are free-standing, compact and at least 16 m high, or stand in
      a street block and are at least 40 m high.
    - Halls (`building_types.hall`) are low, and either deep or very long.
    - Detached houses (`building_types.detached`) are the free-standing buildings of no other type.

    Gaps and differences in height separate buildings. Five features decide the type of a building:
    area, mean height, share of party walls in the outline, courts of its built component, and
    elongation. The file `evocity/data/building-types.toml` lists the limits and the reason for
    each. The function `types_of` returns the type of each building.

    Formula: Σ A over the buildings of the type / Σ A over all buildings, with A the area of the
    footprint.
    Unit: none. Range: 0 to 1; the shares of all types sum to 1. Heights decide most types, so the
    shares of a map without heights mean little.
    Empty map: NaN (nothing is built).
    Source: Marsault 2002 §6.2 (the "known distribution of a type of building or dwelling"). The
    types are common in planning. If the table names no source for a limit, the limit is our own.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:14, 8:13] = 6  # a house of 12 m × 10 m
    >>> heights[40:46, 8:48] = 15  # a slab of 80 m × 12 m
    >>> shares = building_types(CityMap(heights, 2.0))
    >>> round(shares["detached"], 3), round(shares["slab"], 3)
    (0.111, 0.889)
    """
    return _numbers(city, TYPES)


@fitness(goal="min", range=(0, 1), any_site=True)
def type_distance(city: CityMap, reference: Reference, genome: Genome | None = None) -> float:
    """Distance between the mixture of building types on the map and the mixture in other cities.

    Formula: ½ Σ \\|p − q\\| over the types, with p the share of built ground that each type has in
    the city (`building_types`), and q the share in the reference. The distance is the least share
    of the built ground that must change its type to reach the mixture of the reference. If the
    reference has several cities, q is the weighted mean of the shares in these cities. The weight
    of a source city of a run is the built ground of the map that comes from this city. Unit: none.
    Range: 0 (the same mixture) to 1 (no type in common). Empty map: NaN. The distance is NaN if the
    reference has no buildings, or if no built ground of the map comes from the reference. Source:
    "known distribution of a type of building or dwelling", Marsault 2002 §6.2; the formula is the
    total variation distance.

    >>> lyon = evocity.read_map("lyon-1er")
    >>> type_distance(lyon, reference=lyon)
    0.0
    >>> type_distance(evocity.read_map("montpellier-pas-du-loup"), reference=lyon) > 0.8
    True
    """
    return _distance(city, TYPES, reference, genome)


@fitness(range=(0, 1), numbers=CLASSES, any_site=True)
def object_classes(city: CityMap) -> Mapping[str, float]:
    """Area of the objects of each class, as a share of the area of all objects.

    - Buildings have the class `object_classes.building`, and sheds have `object_classes.shelter`.
    - Benches, kiosks and hedges have the class `object_classes.furniture`.
    - Pools, lawns and car parks have the class `object_classes.ground`.
    - Poles and lamps have the class `object_classes.post`.
    - Trees have the class `object_classes.tree`, and fountains have `object_classes.fountain`.

    Gaps and differences in height separate the objects on a map. Area, height and shape decide the
    class of an object. The file `evocity/data/classes.toml` lists the limits and the reason for
    each. The property `CityMap.classes` holds the class of each object.

    Formula: Σ A over the objects of the class / Σ A over all objects, with A the area of the
    footprint.
    Unit: none. Range: 0 to 1; the shares of all classes sum to 1. Maps made from footprints have
    only buildings and shelters, but evocity classifies a few of the smallest as trees or posts.
    Empty map: NaN (there is no object).
    Source: the seven classes are by Marsault 2005 (001 §3.1, figure 10). Marsault 2002 (§6.2)
    proposes known distributions of types as a goal. The limits are our own.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:18, 8:18] = 6  # a house of 10 m × 10 m
    >>> heights[40:50, 8:58] = 0.2  # a lawn of 50 m × 10 m
    >>> shares = object_classes(CityMap(heights, 1.0))
    >>> round(shares["building"], 3), round(shares["ground"], 3)
    (0.167, 0.833)
    """
    classes = city.classes
    if not len(classes):
        return dict.fromkeys(CLASSES, Undefined(f"nothing stands on {city.name}"))
    return classes.shares


@fitness(range=(0, math.inf), unit="/ha", numbers=CLASSES, any_site=True)
def object_counts(city: CityMap) -> Mapping[str, float]:
    """Number of objects of each class per hectare.

    Each class of the measure `object_classes` has one number: `object_counts.building`,
    `object_counts.furniture`, `object_counts.tree`, `object_counts.ground`,
    `object_counts.fountain`, `object_counts.shelter` or `object_counts.post`.

    Formula: number of objects of the class / area of the map in hectares.
    Unit: 1/ha. Range: 0 upwards. Adjoining houses of nearly equal height count as one building.
    Empty map: 0.
    Source: the seven classes are by Marsault 2005 (001 §3.1, figure 10); the limits are our own.

    >>> heights = np.zeros((100, 100))
    >>> heights[8:18, 8:18] = 6
    >>> for row in (30, 50, 70, 90):
    ...     heights[row : row + 2, 50:52] = 8  # four posts of 2 m × 2 m
    >>> counts = object_counts(CityMap(heights, 1.0))
    >>> counts["building"], counts["post"]
    (1.0, 4.0)
    """
    return {name: count * 1e4 / city.area for name, count in city.classes.counts.items()}


def types_of(city: CityMap, table: TypeTable | None = None) -> tuple[str, ...]:
    """Return the name of the type of each building, in the order of ``city.buildings``.

    table : the table of types; None means evocity's own table.

    The function takes about 0.3 ms for 256 × 256 px, if the shapes of `CityMap.buildings` are
    already computed.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:14, 8:13] = 6
    >>> heights[40:46, 8:48] = 15
    >>> types_of(CityMap(heights, 2.0))
    ('detached', 'slab')
    """
    table = table or TYPES
    return tuple(table.names[k] for k in table.classified(features(city)))


@keep_result
def features(city: CityMap) -> np.ndarray:
    """Compute the features of the n buildings that a table of types may limit: float64 ``(5, n)``,
    rows as in `type_table.FEATURES`.

    Area in m²; mean height in m; share of the outline that faces other buildings; open ground that
    the built component encloses, divided by its area; area divided by the square of the long side
    of `Buildings.box`, at most 1. Courts of a component that stands in a court count there only.
    """
    table, ground = city.buildings, city.open_space
    enclosed = ground.enclosed_by >= 0
    courts = np.bincount(
        ground.enclosed_by[enclosed], ground.area[enclosed], minlength=city.areas.size
    )
    return np.stack(
        [
            table.area,
            table.height,
            table.shared / table.sides,
            (courts / city.areas)[table.component],
            np.minimum(table.area / table.box[:, 0] ** 2, 1),
        ]
    )


def shares(city: CityMap, table: TypeTable) -> np.ndarray | Undefined:
    """Compute the share of built ground of each type of ``table``: float64; undefined where nothing
    is built."""
    by_type = np.bincount(
        table.classified(features(city)), city.buildings.area, minlength=len(table.names)
    )
    total = by_type.sum()
    return by_type / total if total else Undefined(f"nothing is built in {city.name}")


def _numbers(city: CityMap, table: TypeTable) -> Mapping[str, float]:
    found = shares(city, table)
    if isinstance(found, Undefined):
        return dict.fromkeys(table.names, found)
    return dict(zip(table.names, np.minimum(found, 1).tolist(), strict=True))


def _distance(
    city: CityMap, table: TypeTable, reference: Reference | None, genome: Genome | None
) -> float:
    """Measure the distance from the mixture of the ``reference``, or else of the ``table``."""
    own = shares(city, table)
    target = table.shares if reference is None else _mixture(city, table, reference, genome)
    for mixture in (own, target):
        if isinstance(mixture, Undefined):
            return mixture
    return min(float(np.abs(own - target).sum()) / 2, 1.0)


def _mixture(
    city: CityMap, table: TypeTable, reference: Reference, genome: Genome | None
) -> np.ndarray | Undefined:
    weights = reference.shares(city, genome)
    if not weights.any():
        return Undefined(f"nothing built in {city.name} comes from a city of the reference")
    mixture = np.zeros(len(table.names))
    for other, weight in zip(reference.cities, weights, strict=True):
        if weight:
            found = shares(other, table)
            if isinstance(found, Undefined):
                return found
            mixture += weight * found
    return mixture


def _declare(stem: str, content: bytes) -> None:
    """Declare the measures of a user's table: ``stem.TYPE`` and ``stem_distance``.

    The distance is that from the table's shares if it has them, else from a reference.
    """
    name_of_file(stem, ".toml", "types")
    table = TypeTable.of(content)

    def numbers(city):
        return _numbers(city, table)

    def to_reference(city, reference, genome=None):
        return _distance(city, table, reference, genome)

    def to_shares(city):
        return _distance(city, table, None, None)

    distance = to_reference if table.shares is None else to_shares
    numbers.__doc__ = f"Share of built ground of a type of {stem}.toml."
    distance.__doc__ = f"Half the sum of the differences in shares of the types of {stem}.toml."
    for function, name in ((numbers, stem), (distance, f"{stem}_distance")):
        function.__name__, function.__qualname__ = name, f"{stem}.toml:{name}"
    fitness(range=(0, 1), numbers=table.names, any_site=True)(numbers)
    fitness(goal="min", range=(0, 1), any_site=True)(distance)


TABLES[".toml"] = _declare
