"""Buildings: segmentation by gaps and steps of height, a table, outlines, and flat roofs.

- `segmentation`: `separate_buildings`, `zones_of`; `settled`, each building at its median height
- `table`: `Buildings`, one row for each building, and `measured`; polygons: `outlines`
- `hulls`: convex hull, smallest rectangle and smallest circle of each
"""

from evocity.views.buildings.segmentation import (
    CRUMB,
    STEP,
    separate_buildings,
    settled,
    settled_roofs,
    settled_zones,
    zones_of,
)
from evocity.views.buildings.table import Buildings, measured, outlines

__all__ = [
    "CRUMB",
    "STEP",
    "Buildings",
    "measured",
    "outlines",
    "separate_buildings",
    "settled",
    "settled_roofs",
    "settled_zones",
    "zones_of",
]
