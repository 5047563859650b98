"""Walls: straight lines fitted to the staircases of a raster, a valid coverage of polygons.

- `arcs`: where walls run: each traced once, between two nodes where three labels meet
- `fitting`: the straight runs of each, the lines fitted to them, turned to common angles
- `coverage`: the polygons they bound, and what falls back where lines cross
- `walls`: all of it: `walls_of`, `Walls`
"""

from evocity.views.walls.walls import DETAIL, Walls, walls_of

__all__ = ["DETAIL", "Walls", "walls_of"]
