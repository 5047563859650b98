"""Streets: the graph of open ground's middle lines, with widths, kinds, places and quarters.

- `skeleton`: the lines, their topology that of the ground; places kept open
- `lines`: the graph they are; passages left out, dead ends pruned, crossings made one
- `places`: squares, told from streets
- `kinds`: a table of kinds of streets, and of what is a place: `StreetKinds`
- `ribbons`: the surfaces of streets
- `graph`: all of it: `street_graph`, `StreetGraph`
"""

from evocity.views.streets.graph import LEAST_WIDTH, SPURS, StreetGraph, street_graph
from evocity.views.streets.kinds import StreetKinds
from evocity.views.streets.places import Places

__all__ = ["LEAST_WIDTH", "SPURS", "Places", "StreetGraph", "StreetKinds", "street_graph"]
