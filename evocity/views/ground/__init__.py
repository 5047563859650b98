"""Ground: what is not built, and how far it is to the next wall.

- `distance`: metres from every pixel to the nearest built one: `distance_to_built`
- `space`: the pieces of open ground, and which of them are courtyards: `OpenSpace`, `open_space`
- `lines`: the lines streets run along, and how wide they are: `Streets`, `streets`
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
