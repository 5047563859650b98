"""Buildings: told apart by gaps and by steps of height, measured, and drawn as outlines.

- `apart`: which built pixels are one building: `told_apart`, `zones_of`
- `table`: what is known of each building: `Buildings`, `measured`
- `hulls`: the smallest convex shapes about each
- `outline`: their polygons: `outlines`
- `settled`: their roofs laid flat
"""

from evocity.views.buildings.apart import CRUMB, STEP, told_apart, zones_of
from evocity.views.buildings.outline import outlines
from evocity.views.buildings.settled import settled, settled_zones
from evocity.views.buildings.table import Buildings, measured

__all__ = [
    "CRUMB",
    "STEP",
    "Buildings",
    "measured",
    "outlines",
    "settled",
    "settled_zones",
    "told_apart",
    "zones_of",
]
