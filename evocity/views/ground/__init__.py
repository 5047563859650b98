"""Open ground: distance to walls, pieces and courtyards, middle lines of streets.

- `distance`: metres from every pixel to the nearest built one: `distance_to_built`
- `space`: pieces of open ground, and courtyards: `OpenSpace`, `open_space`
- `lines`: middle lines of streets, and their widths: `Streets`, `streets`
"""

from evocity.views.ground.distance import distance_to_built
from evocity.views.ground.lines import WIDEST, Streets, streets
from evocity.views.ground.space import OpenSpace, open_space

__all__ = [
    "WIDEST",
    "OpenSpace",
    "Streets",
    "distance_to_built",
    "open_space",
    "streets",
]
