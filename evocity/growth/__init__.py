"""Growth: a genome becomes a fabric of any size (Marsault 2005 §4.2).

- `grow`: lay groups of lifs beyond the original extent
- `Growth`: the fabric, by windows, as a map, as a genome
"""

from evocity.growth.fabric import Growth
from evocity.growth.laying import WINDOW, grow

__all__ = ["WINDOW", "Growth", "grow"]
