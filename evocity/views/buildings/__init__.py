"""Buildings: segmentation by gaps and steps of height, a table, outlines, and flat roofs.

- `segmentation`: `separate_buildings`, `zones_of`
- `table`: `Buildings`, one row for each building, and `measured`
- `hulls`: convex hull, smallest rectangle and smallest circle of each
- `outline`: polygons of buildings: `outlines`
- `flat_roofs`: `settled`, each building at its median height
"""

from evocity.views.buildings.flat_roofs import settled, settled_zones
from evocity.views.buildings.outline import outlines
from evocity.views.buildings.segmentation import CRUMB, STEP, separate_buildings, zones_of
from evocity.views.buildings.table import Buildings, measured

__all__ = [
    "CRUMB",
    "STEP",
    "Buildings",
    "measured",
    "outlines",
    "separate_buildings",
    "settled",
    "settled_zones",
    "zones_of",
]
