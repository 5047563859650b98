"""Growth of an endless fabric from genomes (Marsault 2005 §4.2).

- `setup`, `fabric`: the function `grow` and its result
- `plane`, `lattice`: the endless plane, and the places of groups on it
- `quarter_plane`, `avenues`, `quarters`: the endless plane with streets, and what it consists of
- `surroundings`: maps of a fabric with a strip around them
- `repetition`, `shares`: windows that must not repeat, and shares of the originals
"""

from evocity.growth._kernels import WINDOW
from evocity.growth.fabric import Growth
from evocity.growth.setup import grow

__all__ = ["WINDOW", "Growth", "grow"]
