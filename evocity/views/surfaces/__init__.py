"""Surfaces of a map: buildings and the ground between them as one coverage of polygons.

- `coverage`: `GroundCover`, streets, pavements, squares, courts, green, water and buildings without
  gaps or overlaps
- `regions`: the parts of the ground before they become a coverage
- `faces`: a coverage on a grid, from polygons that may overlap
"""

from evocity.views.surfaces.coverage import KINDS, GroundCover, cover_map, ground_cover
from evocity.views.surfaces.faces import shared_segments
from evocity.views.surfaces.regions import polygons_of

__all__ = [
    "KINDS",
    "GroundCover",
    "cover_map",
    "ground_cover",
    "polygons_of",
    "shared_segments",
]
