"""Genome -> its decoding, kept: parents are decoded once a process, not once a child.

A genome that lives breeds many children. Its map, with the views that were asked of it (labels,
buildings, …), stays as long as there is room.
"""

from collections import OrderedDict
from threading import Lock

from evocity.coding.decode import Decoding, decode
from evocity.genome import Genome

#: So many maps are kept, and so many pixels of them (64 maps of 256²), but two in any case: with
#: all its views a map takes about 50 bytes a pixel.
MOST_MAPS, MOST_PIXELS, AT_LEAST = 64, 1 << 22, 2


class Decodings:
    """Decodings by genome, at most ``maps`` of at most ``pixels`` px together, but the last
    `AT_LEAST` in any case; what was not asked for the longest goes first.

    Threads may ask at once; two that ask for the same new genome both decode it, and get one map.
    """

    def __init__(self, maps: int = MOST_MAPS, pixels: int = MOST_PIXELS):
        self._maps, self._pixels = maps, pixels
        self._kept: OrderedDict[tuple, Decoding] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._kept)

    def __call__(self, genome: Genome) -> Decoding:
        """``decode(genome)``, of this genome or of one that decodes alike and is called alike."""
        # the digest tells the heights, the rest what the map is called and where it lies
        key = (genome.digest, genome.cities, genome.attribution, genome.origin, genome.crs)
        with self._lock:
            known = self._kept.get(key)
            if known is not None:
                self._kept.move_to_end(key)
                return known
        found = decode(genome)
        found.blamed.setflags(write=False)  # many share it
        with self._lock:
            found = self._kept.setdefault(key, found)
            self._kept.move_to_end(key)
            self._make_room()
        return found

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._kept.clear()

    def _make_room(self) -> None:
        total = sum(one.attractor.size for one in self._kept.values())
        while len(self._kept) > AT_LEAST and (len(self._kept) > self._maps or total > self._pixels):
            _, oldest = self._kept.popitem(last=False)
            total -= oldest.attractor.size


_decodings = Decodings()


def decoded(genome: Genome) -> Decoding:
    """``decode(genome)``, kept in this process: asked again for the same genome, it returns the
    same `Decoding`, and with its ``city`` all views that were computed of it.

    The bits are those of `decode`. `MOST_MAPS` decodings are kept, fewer of large maps; all arrays
    are read-only.

    Raises
    ------
    GenomeError : as `decode`; what cannot be decoded is tried again each time.
    """
    return _decodings(genome)


__all__ = ["Decodings", "decoded"]
