"""Pitched roofs of buildings, by the straight skeletons of their plans, and curved roofs.

- `plans`: sides of plans: façades and party walls
- `choice`: the shape and the pitch of each roof
- `skeleton`, `_kernels`: weighted straight skeletons
- `curved`: surfaces on wide buildings
- `roofs`: the faces of roofs, as shells of a scene's solids
- `checks`: levels and heights that can have roofs
"""

from evocity.io.roof_shapes import SHAPES
from evocity.scene.roofs.checks import check_curved, check_heights, check_roofs, level_of
from evocity.scene.roofs.curved import CURVED, RoofSurface
from evocity.scene.roofs.roofs import count_shapes, raise_roofs
from evocity.views.ridges import heights_are_ridges

__all__ = [
    "CURVED",
    "SHAPES",
    "RoofSurface",
    "check_curved",
    "check_heights",
    "check_roofs",
    "count_shapes",
    "heights_are_ridges",
    "level_of",
    "raise_roofs",
]
