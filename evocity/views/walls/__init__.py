"""Walls: straight lines fitted to the staircases of a raster, a valid coverage of polygons.

- `arcs`: walls traced along edges of pixels, each between two nodes where three labels meet
- `fitting`: straight runs of walls, and lines fitted to them, turned to common angles
- `coverage`: the polygons that the lines bound, and fallbacks where lines cross
- `walls`: the walls of a map: `walls_of`, `Walls`
"""

from evocity.views.walls.walls import DETAIL, Walls, walls_of

__all__ = ["DETAIL", "Walls", "walls_of"]
