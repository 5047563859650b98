"""Autosimilarity: how well larger blocks of a city draw its blocks."""

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.registry import fitness

#: Side of the range blocks, pixels; domain blocks are twice as large.
BLOCK = 4
#: Greatest distance of a domain block from its range block, pixels along each axis.
REACH = 12


@fitness(goal="max", range=(0, 1))
def autosimilarity(city: CityMap) -> float:
    """How well larger blocks of the city nearby draw its blocks.

    Formula: 1 − mean of (1 − ρ²), with ρ the best correlation of a range block with a shrunk domain
    block under the 8 isometries. Range blocks have 4 × 4 px on the pavement; uniform ones do not
    count. Domain blocks have 8 × 8 px and lie within 12 px. Neither flat ground nor low contrast
    raises the value.
    Unit: none. Range: 0 to 1; noise has about 0.66, districts .90 to .97.
    Empty map: 0, as on any map whose blocks are all uniform. Rows and columns beyond the last whole
    block do not count.
    Source: Marsault 2005 §1.3; 1 − ρ² is its µ normalised by the block's own variance.

    >>> stripes = np.zeros((32, 32))
    >>> stripes[:, 14:18] = 9
    >>> autosimilarity(CityMap(np.zeros((32, 32)), 2.0))
    0.0
    >>> round(autosimilarity(CityMap(stripes, 2.0)), 6)
    1.0
    """
    from evocity.coding.matching import best_correlations

    height, width = (side - side % BLOCK for side in city.shape)
    heights = np.ascontiguousarray(city.heights[:height, :width])
    rho2, uniform = best_correlations(heights, BLOCK, (2,), REACH)
    return float(rho2[~uniform].mean(dtype=np.float64)) if not uniform.all() else 0.0
