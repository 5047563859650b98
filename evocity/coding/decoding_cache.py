"""Cache of decodings by genome: a process decodes a parent once, not for each child.

The cached map keeps its computed views (labels, buildings, …) while there is room.
"""

from collections import OrderedDict
from threading import Lock

from evocity.citymap import CityMap
from evocity.coding.decode import Decoding, decode
from evocity.genome import Genome

#: The cache holds so many maps, and so many pixels of them (64 maps of 256²), but always two. With
#: all its views a map takes about 50 bytes per pixel.
MOST_MAPS, MOST_PIXELS, AT_LEAST = 64, 1 << 22, 2


class Decodings:
    """A cache of at most ``maps`` decodings with at most ``pixels`` px together, but always the
    last `AT_LEAST`; the least recently used goes first. Threads may call it together: two with the
    same new genome both decode it, and get one map."""

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

    def forget(self, genome: Genome) -> None:
        """Remove the decodings of genomes with these heights."""
        with self._lock:
            for key in [one for one in self._entries if one[0] == genome.digest]:
                del self._entries[key]

    @property
    def maps(self) -> list[CityMap]:
        """The maps that it holds and that somebody asked for."""
        with self._lock:
            held = list(self._entries.values())
        return [one.__dict__["city"] for one in held if "city" in one.__dict__]

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

    Equal genomes give the same `Decoding` object, and its attribute ``city`` computes each view of
    the map only once.

    The result equals that of `decode` bit for bit. The cache holds `MOST_MAPS` decodings, or fewer
    if the maps are large. All arrays of the result are read-only.

    Raises
    ------
    GenomeError : the genome cannot be decoded; the causes are those of `decode`. The cache does not
        keep errors of decoding.
    """
    return _decodings(genome)


def cached_maps() -> list[CityMap]:
    """Return the maps that the cache of this process holds."""
    return _decodings.maps


def forget(genome: Genome) -> None:
    """Make the next `decoded` of the ``genome`` decode it."""
    _decodings.forget(genome)
