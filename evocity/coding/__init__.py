"""CityMap <-> Genome.

encode    a map's genome, by exact search over domain blocks
decode    a genome's map, the attractor of its collage map
search    which domain block explains a range block best
domains   the pool of domain blocks, folded into D4 coordinates
quality   PSNR
"""

from evocity.coding.decode import CollageMap, Decoding, decode
from evocity.coding.encode import Encoding, encode
from evocity.coding.quality import psnr
from evocity.coding.search import best_correlations

__all__ = ["CollageMap", "Decoding", "Encoding", "best_correlations", "decode", "encode", "psnr"]
