"""CityMap <-> Genome.

encode          a map's genome, by exact search over domain blocks
decode          a genome's map, the attractor of its collage map
fit             which σ and β bring a genome's attractor closest to a map
search          which domain block explains a range block best
autosimilarity  where a map is like itself at another scale
domains         the pool of domain blocks, folded into D4 coordinates
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

__all__ = [
    "AutosimilarityMaps",
    "CollageMap",
    "Decoding",
    "Encoding",
    "FreeBlockMaps",
    "autosimilarity_maps",
    "best_correlations",
    "decode",
    "encode",
    "fit_attractor",
    "free_block_maps",
    "psnr",
]
