"""CityMap <-> Genome.

encode          a map's genome, by exact search over domain blocks
decode          a genome's map, the attractor of its collage map
fit             which σ and β bring a genome's attractor closest to a map
search          which domain block explains a range block best
topology        which of several lies in surroundings most like the range block's
autosimilarity  where a map is like itself at another scale
quality         PSNR
"""

from evocity.coding.autosimilarity import (
    AutosimilarityMaps,
    FreeBlockMaps,
    autosimilarity_maps,
    free_block_maps,
)
from evocity.coding.decode import CollageMap, Decoding, decode
from evocity.coding.encode import Encoding, encode
from evocity.coding.fit import fit_attractor
from evocity.coding.quality import psnr
from evocity.coding.search import best_correlations
from evocity.coding.topology import Candidates, closest_neighbourhood

__all__ = [
    "AutosimilarityMaps",
    "Candidates",
    "CollageMap",
    "Decoding",
    "Encoding",
    "FreeBlockMaps",
    "autosimilarity_maps",
    "best_correlations",
    "closest_neighbourhood",
    "decode",
    "encode",
    "fit_attractor",
    "free_block_maps",
    "psnr",
]
