"""Strip of fabric around a map, in which buildings at the border of the map are whole."""

import numpy as np

from evocity.citymap import CityMap
from evocity.growth.fabric import Growth
from evocity.views.connected_components import pieces

#: Widths of the strip around a map, pixels, from the first that is tried to the last.
MARGINS = (128, 256, 512)
# Distance from a building up to which pixels decide the directions of its walls, px.
_REACH = 4


def map_with_margin(fabric: Growth) -> tuple[CityMap, int]:
    """Make the map of a fabric with a strip around it: the map, and the width of the strip, px.

    The strip holds all buildings on the map, and all that touch these in a chain, as a whole. The
    walls of a building depend only on this chain and on 4 px around it. So the windows of two maps
    beside each other have the same walls, bit for bit. The strip is one of `MARGINS` wide; longer
    chains are cut at its outer border.
    """
    high, wide = fabric.shape
    for margin in MARGINS:
        city = fabric.city(-margin, -margin, high + 2 * margin, wide + 2 * margin)
        if margin == MARGINS[-1] or are_whole(city.built, margin):
            break
    return city, margin


def are_whole(built: np.ndarray, margin: int) -> bool:
    """Whether all pieces of ``built``, bool ``(H, W)``, that reach into the map within the
    ``margin``, px, end before the outer border."""
    chains, count = pieces(built, corners=True)
    inner = slice(margin, -margin)
    known = np.zeros(count + 1, bool)
    known[chains[inner, inner]] = True
    known[0] = False
    outer = slice(_REACH, -_REACH)
    edge = known[chains]
    edge[outer, outer] = False
    return not edge.any()
