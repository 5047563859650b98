"""Street blocks: land that streets enclose, and its refill with buildings of other maps."""

from evocity.operators.street_blocks.blocks import StreetBlocks, street_blocks
from evocity.operators.street_blocks.placement import Fit, Room, best_place
from evocity.operators.street_blocks.refill import Filling

__all__ = ["Filling", "Fit", "Room", "StreetBlocks", "best_place", "street_blocks"]
