"""How much of the city is a copy of itself."""

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.registry import fitness

#: Range blocks of this many pixels a side are looked for among blocks twice as large.
BLOCK = 4
#: How far away, in pixels along each axis, a block looks for one like itself.
REACH = 12


@fitness(goal="max", range=(0, 1))
def autosimilarity(city: CityMap) -> float:
    """How well the city's blocks are drawn by larger blocks of the city nearby.

    Formula: 1 − mean of (1 − ρ²), ρ the correlation of a range block with the domain block,
    shrunk, that is most like it under the 8 isometries. Range blocks of 4 × 4 px on the
    pavement, those that are not uniform; domain blocks of 8 × 8 px within 12 px. Neither
    flat ground nor low contrast scores.
    Unit: none. Range: 0 to 1; noise has about 0.66, districts .90 to .97.
    Empty map: 0, and on any map without a block that is not uniform. Rows and columns beyond
    the last whole block are left out.
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
