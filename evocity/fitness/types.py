"""Building types: shares of detached, row, courtyard block, slab, tower, hall and shed."""

from collections.abc import Mapping
from weakref import WeakKeyDictionary

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Undefined
from evocity.fitness.reference import Reference
from evocity.fitness.registry import TABLES, fitness
from evocity.fitness.type_table import TypeTable, packaged
from evocity.genome import Genome

#: The types of this package.
TYPES = packaged()


@fitness(range=(0, 1), numbers=TYPES.names, any_site=True)
def building_types(city: CityMap) -> Mapping[str, float]:
    """Shares of built ground of detached houses, rows, courtyard blocks, slabs and other types.

    Gaps and steps of height separate buildings. Each building has one type, by five features: area,
    mean height, share of party walls in the outline, courts of its built component, and
    elongation. `evocity/data/building-types.toml` has the limits and the reason
    for each; `types_of` gives the type of each building. In short:

    `building_types.shed`, under 36 m²; `building_types.courtyard_block`, built together around
    courts of 3 % of the footprint or more; `building_types.row`, wall to wall without such courts,
    or low, long and free-standing; `building_types.slab`, free-standing and long, 10 m high or
    more, or compact, large and 16 m high; `building_types.tower`, free-standing, compact and 16 m
    high, or within a street block and 40 m high; `building_types.hall`, low and deep or very long;
    `building_types.detached`, all other free-standing buildings.

    Formula: Σ A over the buildings of the type / Σ A over all, with A the area of the footprint.
    Unit: none. Range: 0 to 1, all types together 1. Heights decide most types: a map without
    heights shows little.
    Empty map: NaN (nothing is built).
    Source: Marsault 2002 §6.2 asks for the "known distribution of a type of building or dwelling".
    The types are common in planning; their limits are ours where the table names no source.

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
    """Distance of the city's mixture of building types from that of other cities.

    Formula: ½ Σ \\|p − q\\| over the types, with p the share of built ground that each type has in
    the city (`building_types`), and q that in the reference. It is the least share of the built
    ground that must change its type. For several cities, q is the mean by weight. A source city of
    a run weighs as much as the built ground of the map that comes from it.
    Unit: none. Range: 0 (the same mixture) to 1 (no type in common).
    Empty map: NaN, as where the reference has no buildings, or no built ground comes from it.
    Source: "known distribution of a type of building or dwelling", Marsault 2002 §6.2; the
    distance is that of total variation.

    >>> lyon = evocity.read_map("lyon-1er")
    >>> type_distance(lyon, reference=lyon)
    0.0
    >>> type_distance(evocity.read_map("montpellier-pas-du-loup"), reference=lyon) > 0.8
    True
    """
    return _distance(city, TYPES, reference, genome)


def types_of(city: CityMap, table: TypeTable | None = None) -> tuple[str, ...]:
    """Give the type of each building, by name, in the order of ``city.buildings``.

    table : the table of types; None for the package's. About 0.3 ms at 256² once
    `CityMap.buildings` has its shapes.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:14, 8:13] = 6
    >>> heights[40:46, 8:48] = 15
    >>> types_of(CityMap(heights, 2.0))
    ('detached', 'slab')
    """
    table = table or TYPES
    return tuple(table.names[k] for k in table.classified(features(city)))


def features(city: CityMap) -> np.ndarray:
    """Compute the features of the n buildings that a table of types may limit: float64 ``(5, n)``,
    rows as in `type_table.FEATURES`.

    Area in m²; mean height in m; share of the outline that faces other buildings; open ground that
    the built component encloses, divided by its area; area divided by the square of the long side
    of `Buildings.box`, at most 1. Courts of a component that stands in a court count there only.
    """
    if city not in _features:
        table, ground = city.buildings, city.open_space
        enclosed = ground.enclosed_by >= 0
        courts = np.bincount(
            ground.enclosed_by[enclosed], ground.area[enclosed], minlength=city.areas.size
        )
        _features[city] = np.stack(
            [
                table.area,
                table.height,
                table.shared / table.sides,
                (courts / city.areas)[table.component],
                np.minimum(table.area / table.box[:, 0] ** 2, 1),
            ]
        )
    return _features[city]


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
    if not stem.isidentifier():
        raise FitnessError(
            f"the name of the table file, {stem}, cannot name a measure",
            "a file name that is a valid name of a measure",
            "rename the file, for example to types.toml",
        )
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

_features: WeakKeyDictionary[CityMap, np.ndarray] = WeakKeyDictionary()
