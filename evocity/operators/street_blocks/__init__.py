"""Street blocks: what streets enclose, which buildings of another map fit in, how they are laid.

blocks   the street blocks of a map
fits     where the buildings of a map fit into a street block
filling  a genome whose street blocks are filled, one after another
"""

from evocity.operators.street_blocks.blocks import StreetBlocks, street_blocks
from evocity.operators.street_blocks.filling import Filling
from evocity.operators.street_blocks.fits import Fit, Room, best_place

__all__ = ["Filling", "Fit", "Room", "StreetBlocks", "best_place", "street_blocks"]
