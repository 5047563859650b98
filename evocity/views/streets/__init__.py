"""Streets: the graph of open ground's middle lines, with widths, kinds, places and quarters.

- `skeleton`: middle lines with the topology of the ground, around open places
- `lines`: the graph of lines, without narrow passages and short dead ends, with merged crossings
- `places`: squares and other wide, compact ground
- `kinds`: a table of kinds of streets, and of the limits of a place: `StreetKinds`
- `facades`: widths between façades across a street, at several places of each edge
- `ribbons`: surfaces of streets, from discs that move along the edges
- `links`: which crossings reach the frame of the map, by a kernel
- `graph`: the street graph of a map: `street_graph`, `StreetGraph`
"""

from evocity.views.streets.graph import ALLEY_WIDTH, LEAST_WIDTH, SPURS, StreetGraph, street_graph
from evocity.views.streets.kinds import StreetKinds
from evocity.views.streets.places import Places

__all__ = [
    "ALLEY_WIDTH",
    "LEAST_WIDTH",
    "SPURS",
    "Places",
    "StreetGraph",
    "StreetKinds",
    "street_graph",
]
