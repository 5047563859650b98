"""Open ground: distance to walls, pieces and courtyards, middle lines of streets.

- `space`: `OpenSpace`, pieces of open ground and courtyards; `distance_to_built`, metres
- `lines`: middle lines of streets, and their widths: `Streets`, `streets`
"""

from evocity.views.ground.lines import WIDEST, Streets, streets
from evocity.views.ground.space import OpenSpace, distance_to_built, open_space

__all__ = [
    "WIDEST",
    "OpenSpace",
    "Streets",
    "distance_to_built",
    "open_space",
    "streets",
]
