"""Object classes: shares and counts of buildings, furniture, trees, lawns, fountains, posts."""

from collections.abc import Mapping

from evocity.citymap import CityMap
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.views.classes import packaged

#: The classes of this package.
CLASSES = packaged().names

_HECTARE = 1e4


@fitness(range=(0, 1), numbers=CLASSES, any_site=True)
def object_classes(city: CityMap) -> Mapping[str, float]:
    """Shares of each class of objects in the ground that objects cover.

    Gaps and steps of height separate the objects on a map. Each object has one class, by its area,
    its height and its shape: `object_classes.building`; `object_classes.furniture`, benches,
    kiosks, hedges; `object_classes.tree`; `object_classes.ground`, pools, lawns, car parks;
    `object_classes.fountain`; `object_classes.shelter`, sheds; `object_classes.post`, poles and
    lamps. `evocity/data/classes.toml` has the limits and the reason for each; `CityMap.classes`
    has the class of each object.

    Formula: Σ A over the objects of the class / Σ A over all, with A the area of the footprint.
    Unit: none. Range: 0 to 1, all classes together 1. Maps made from footprints have only buildings
    and shelters, and a few of the smallest look like trees or posts.
    Empty map: NaN (there is no object).
    Source: the seven classes, Marsault 2005 (001 §3.1, fig. 10); known distributions of types as a
    goal, Marsault 2002 §6.2; the limits are ours.

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


@fitness(range=(0, float("inf")), unit="/ha", numbers=CLASSES, any_site=True)
def object_counts(city: CityMap) -> Mapping[str, float]:
    """Number of objects of each class per hectare.

    The classes are those of `object_classes`: `object_counts.building`,
    `object_counts.furniture`, `object_counts.tree`, `object_counts.ground`,
    `object_counts.fountain`, `object_counts.shelter`, `object_counts.post`.

    Formula: number of objects of the class / area of the map in hectares.
    Unit: 1/ha. Range: 0 upwards. Adjoining houses of nearly one height count as one building.
    Empty map: 0.
    Source: the seven classes, Marsault 2005 (001 §3.1, fig. 10); the limits are ours.

    >>> heights = np.zeros((100, 100))
    >>> heights[8:18, 8:18] = 6
    >>> heights[30::20, 50] = 8  # four lamps
    >>> counts = object_counts(CityMap(heights, 1.0))
    >>> counts["building"], counts["post"]
    (1.0, 4.0)
    """
    return {name: count * _HECTARE / city.area for name, count in city.classes.counts.items()}
