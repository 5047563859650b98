"""Measures of sites with courses: built ground lost, buildings and area near a course."""

import math

import numpy as np

from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Reach of a course, metres from its bank.
NEAR = 50.0


@fitness(of="site", goal="min", range=(0, 1))
def built_area_lost(site) -> float:
    """Share of the fabric's built ground that its courses take.

    Formula: built pixels under the courses / all built pixels, on the map of the fabric without
    courses. Range: 0 to 1. Undefined for a fabric without buildings.
    Source: none needed.
    """
    built = site.before.built
    if not built.any():
        return Undefined("a fabric without buildings")
    return np.count_nonzero(built & site.mask) / np.count_nonzero(built)


@fitness(of="site", goal="max", range=(0, 1))
def buildings_near_course(site) -> float:
    """Share of the buildings that lie within 50 m of a course.

    Formula: buildings with a pixel within 50 m of a course / all buildings, on the map with its
    courses. Centres of pixels give the distance. Range: 0 to 1. Undefined without buildings.
    Source: none needed.
    """
    labels = site.city.building_labels
    count = labels.max(initial=0)
    if not count:
        return Undefined("no building to measure")
    return len(np.setdiff1d(np.unique(labels[_near(site)]), [0])) / count


@fitness(of="site", goal="max", unit="m²", range=(0, math.inf))
def area_within_reach(site) -> float:
    """Built ground within 50 m of a course.

    Formula: built pixels within 50 m of a course · area of a pixel, on the map with its courses.
    Centres of pixels give the distance. Unit: m².
    Source: none needed.
    """
    return np.count_nonzero(site.city.built & _near(site)) * site.metres_per_pixel**2


def _near(site) -> np.ndarray:
    """Select the pixels within reach of a course, without those of the courses: bool ``(H, W)``."""
    import scipy

    distance = scipy.ndimage.distance_transform_edt(~site.mask) * site.metres_per_pixel
    return (distance <= NEAR) & ~site.mask
