"""Growth: genomes become a fabric without end (Marsault 2005 §4.2).

- `grow`: lay groups of fabric beyond the original extent, of one city or of several
- `Growth`: the fabric, by windows, as a map, as a genome
"""

from evocity.growth._kernels import WINDOW
from evocity.growth.fabric import Growth
from evocity.growth.laying import grow

__all__ = ["WINDOW", "Growth", "grow"]
