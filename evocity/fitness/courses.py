"""Courses through a city: what they take of it, and what lies near them."""

import math

import numpy as np

from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: What is near a course, metres from its bank.
NEAR = 50.0


@fitness(of="site", goal="min", range=(0, 1))
def built_area_lost(site) -> float:
    """Share of the fabric's built ground that its courses take.

    Formula: built pixels under the courses, of the map that the fabric alone decodes to / its built
    pixels. Range: 0 to 1. Undefined for a fabric without buildings.
    Source: none needed.
    """
    built = site.before.built
    if not built.any():
        return Undefined("a fabric without buildings")
    return np.count_nonzero(built & site.mask) / np.count_nonzero(built)


@fitness(of="site", goal="max", range=(0, 1))
def buildings_near_course(site) -> float:
    """Share of the buildings that lie within 50 m of a course.

    Formula: buildings with a pixel whose centre is within 50 m of the nearest pixel of a course /
    all buildings, of the map with its courses. Range: 0 to 1. Undefined without buildings.
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

    Formula: built pixels of the map with its courses whose centre is within 50 m of the nearest
    pixel of a course · area of a pixel. Unit: m².
    Source: none needed.
    """
    return np.count_nonzero(site.city.built & _near(site)) * site.metres_per_pixel**2


def _near(site) -> np.ndarray:
    """Bool ``(H, W)``: pixels within reach of a course, its own left out."""
    import scipy

    apart = scipy.ndimage.distance_transform_edt(~site.mask) * site.metres_per_pixel
    return (apart <= NEAR) & ~site.mask


__all__ = ["area_within_reach", "buildings_near_course", "built_area_lost"]
