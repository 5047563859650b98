"""Cache of decodings by genome: a process decodes a parent once, not for each child.

The cached map keeps its computed views (labels, buildings, …) while there is room.
"""

from collections import OrderedDict
from threading import Lock

from evocity.coding.decode import Decoding, decode
from evocity.genome import Genome

#: The cache holds so many maps, and so many pixels of them (64 maps of 256²), but always two. With
#: all its views a map takes about 50 bytes per pixel.
MOST_MAPS, MOST_PIXELS, AT_LEAST = 64, 1 << 22, 2


class Decodings:
    """A cache of at most ``maps`` decodings with at most ``pixels`` px together, but always the
    last `AT_LEAST`; the least recently used goes first.

    Threads may call it together: two with the same new genome both decode it, and get one map.
    """

    def __init__(self, maps: int = MOST_MAPS, pixels: int = MOST_PIXELS):
        self._maps, self._pixels = maps, pixels
        self._entries: OrderedDict[tuple, Decoding] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._entries)

    def __call__(self, genome: Genome) -> Decoding:
        """Return ``decode(genome)`` of this genome or of one with equal heights and description."""
        # the digest covers the heights, the rest the map's name and place
        key = (genome.digest, genome.cities, genome.attribution, genome.origin, genome.crs)
        with self._lock:
            known = self._entries.get(key)
            if known is not None:
                self._entries.move_to_end(key)
                return known
        decoding = decode(genome)
        decoding.blamed.setflags(write=False)  # many callers share it
        with self._lock:
            decoding = self._entries.setdefault(key, decoding)
            self._entries.move_to_end(key)
            self._make_room()
        return decoding

    def clear(self) -> None:
        """Empty the cache."""
        with self._lock:
            self._entries.clear()

    def _make_room(self) -> None:
        total = sum(decoding.attractor.size for decoding in self._entries.values())
        while len(self._entries) > AT_LEAST and (
            len(self._entries) > self._maps or total > self._pixels
        ):
            _, oldest = self._entries.popitem(last=False)
            total -= oldest.attractor.size


_decodings = Decodings()


def decoded(genome: Genome) -> Decoding:
    """Return ``decode(genome)`` from a cache of this process.

    The same genome gives the same `Decoding` object, whose ``city`` keeps its computed views.

    The result is bit for bit that of `decode`. The cache holds `MOST_MAPS` decodings, or fewer if
    the maps are large. All arrays are read-only.

    Raises
    ------
    GenomeError : raised as by `decode`. A genome that failed is decoded again at each call.
    """
    return _decodings(genome)
