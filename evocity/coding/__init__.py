"""From a map to a genome and back.

- `encode`: a map's genome, by exact search over domain blocks
- `partition`: which leaves follow the city
- `decode`: a genome's map, the attractor of its collage map
- `decoded`: decodings kept by genome
- `fixed_point`: the iteration of a map of maps
- `zoom`: which zooms a partition allows, and what lies between them
- `fit`: which σ and β bring a genome's attractor closest to a map
- `matching`: which domain block explains a range block best
- `topology`: which of several lies in surroundings most like the range block's
- `usage`: how often a code calls its domain blocks; the filters made of that
- `ancestry`: whose stone stands where
- `autosimilarity`: where a map is like itself at another scale
- `quality`: PSNR
"""

from evocity.coding.ancestry import ancestry
from evocity.coding.autosimilarity import (
    AutosimilarityMaps,
    FreeBlockMaps,
    autosimilarity_maps,
    free_block_maps,
)
from evocity.coding.decode import CollageMap, Decoding, decode
from evocity.coding.decoded import decoded
from evocity.coding.encode import Encoding, encode
from evocity.coding.fit import fit_attractor
from evocity.coding.matching import best_correlations
from evocity.coding.quality import psnr
from evocity.coding.topology import Candidates, closest_neighbourhood
from evocity.coding.usage import Usage, high_pass, low_pass, usage

__all__ = [
    "AutosimilarityMaps",
    "Candidates",
    "CollageMap",
    "Decoding",
    "Encoding",
    "FreeBlockMaps",
    "Usage",
    "ancestry",
    "autosimilarity_maps",
    "best_correlations",
    "closest_neighbourhood",
    "decode",
    "decoded",
    "encode",
    "fit_attractor",
    "free_block_maps",
    "high_pass",
    "low_pass",
    "psnr",
    "usage",
]
