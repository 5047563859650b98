"""Coding of maps as genomes, decoding of genomes, and analyses of codes.

- `encode`, `partition`, `matching`, `topology`, `parameters`: from a map to a genome
- `source_roofs`: shapes of roofs, and the meaning of heights, that a map passes to its genome
- `decode`, `collage_map`, `decoding_cache`, `fixed_point`, `zoom`: from a genome to a map
- `fit`, `optimiser`: σ and β that bring the attractor closest to the map
- `ancestry`, `autosimilarity`, `usage`: analyses of codes
"""

from evocity.coding.ancestry import ancestry
from evocity.coding.autosimilarity import (
    AutosimilarityMaps,
    FreeBlockMaps,
    autosimilarity_maps,
    free_block_maps,
)
from evocity.coding.collage_map import CollageMap
from evocity.coding.decode import Decoding, decode
from evocity.coding.decoding_cache import decoded
from evocity.coding.encode import Encoding, encode
from evocity.coding.fit import fit_attractor, psnr
from evocity.coding.matching import best_correlations
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
