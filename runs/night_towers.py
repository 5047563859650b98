"""A measure of one's own: towers that keep their distance. It fails at times, as measures do."""

from statistics import median

import numpy as np
from scipy.spatial import KDTree

import evocity

TOWER = 20.0  # metres


@evocity.fitness(goal="max", unit="m")
def towers_apart(city):
    """Distance from a tower to the next one, the median of all towers.

    Formula: of each building of at least 20 m the distance of its middle to that of the nearest
    other one. Unit: metres. Without a tower it raises, and with a single one it gives no number:
    such a birth fails, and the run goes on without it.
    """
    table = city.buildings
    towers = np.column_stack([table.x, table.y])[table.height >= TOWER]
    to_next = KDTree(towers).query(towers, k=2)[0][:, 1]
    return median(to_next)
