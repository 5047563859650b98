"""Births as maps: decoded, and as small pictures on one scale of heights."""

from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from itertools import chain, groupby

import numpy as np
from PIL import Image

from evocity.analysis.births import Told
from evocity.citymap import CityMap
from evocity.coding.matching import available_cores
from evocity.pictures import render
from evocity.pictures.colours import scale_end
from evocity.store import Birth

# Individuals whose genomes are held at a time.
_AT_A_TIME = 64
# So many parts are read by each core, so that none is waited for; a file is opened once in each.
_PARTS = 4
# Bytes of small pictures that are kept; letters of a fault that are told.
_KEPT, _LETTERS = 64_000_000, 300
# Births that are asked whether the log holds thumbnails.
_ASKED = 8


def cities_of(told: Told, ids: Sequence[int]) -> dict[int, CityMap]:
    """The decoded cities of births; those that stand for none are left out."""
    found = {}
    for start in range(0, len(ids), _AT_A_TIME):
        some = [int(one) for one in ids[start : start + _AT_A_TIME]]
        for birth in told.run.individuals(some, stones=False):
            city = told.expressed(birth).city
            if city is not None:
                found[birth.id] = city
    return found


def highest_of(told: Told) -> float:
    """Metres at which the colours of all maps of a run end: above its parents' roofs."""
    return scale_end(*(source.city for source in told.sources))


def thumbnail(city: CityMap, highest: float, largest: int) -> Image.Image:
    """The bare map, at most ``largest`` px along its longer side."""
    picture = render(city, highest=highest, legend=False)
    picture.thumbnail((largest, largest), Image.Resampling.BOX)
    return picture


def _finer(city: CityMap) -> CityMap:
    """A ``city`` of twice as many pixels each way, so that shadows are as fine as on the map that
    it is small of."""
    heights = city.heights.repeat(2, axis=0).repeat(2, axis=1)
    return CityMap(heights, city.metres_per_pixel / 2)


class Thumbnails:
    """Small pictures of the births that are ``told``, made when they are asked for; the last ones
    are kept."""

    def __init__(self, told: Told):
        self._told = told
        self._kept: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()
        self._bytes = 0

    @cached_property
    def highest(self) -> float:
        """Metres at which their colours end."""
        return highest_of(self._told)

    @cached_property
    def logged(self) -> bool:
        """Whether the log holds small maps of births: of some of the last generation's first."""
        told = self._told
        first = told.ids[told.generation == told.last][:_ASKED]
        return bool(told.run.header.thumbnails and told.run.thumbnails(first.tolist()))

    def of(self, ids: Sequence[int], side: int) -> tuple[dict[int, np.ndarray], dict[int, str]]:
        """Pictures of the births ``ids``, uint8 ``(height, width, 3)``, at most ``side`` px along
        the longer side; of those that have none, why. What a log leaves out is not bred again for
        a picture."""
        missing = [one for one in ids if (one, side) not in self._kept]
        lacking = {}
        for one, found in self._made(missing, side).items():
            if isinstance(found, str):
                lacking[one] = found
            else:
                self._kept[one, side] = found
                self._bytes += found.nbytes
        pictures = {}
        for one in ids:
            if (one, side) in self._kept:
                self._kept.move_to_end((one, side))
                pictures[one] = self._kept[one, side]
        while self._bytes > _KEPT:
            self._bytes -= self._kept.popitem(last=False)[1].nbytes
        return pictures, lacking

    def _made(self, ids: Sequence[int], side: int) -> dict[int, np.ndarray | str]:
        """A picture of each birth, or why there is none: of what the log has in small where that is
        large enough, else of what its genome decodes to."""
        run, found = self._told.run, {}
        made = run.header.thumbnails
        # enlarged by half at most
        if ids and made and 2 * side < 3 * max(made.shape(run.header.height, run.header.width)):
            small = run.thumbnails(ids)
            found = {
                one: np.asarray(self._picture(_finer(city), side)) for one, city in small.items()
            }
        return found | self._decoded([one for one in ids if one not in found], side)

    def _picture(self, city: CityMap, side: int) -> Image.Image:
        return thumbnail(city, self.highest, side)

    def _decoded(self, ids: Sequence[int], side: int) -> dict[int, np.ndarray | str]:
        """As `_made`, of genomes: generations are read in threads, and then pictures made."""
        _ = self.highest  # before threads ask for it
        cores, population = available_cores(), self._told.run.header.population
        groups = groupby(sorted(ids), lambda one: one // population)
        generations = [list(some) for _, some in groups]
        size = max(1, len(generations) // (_PARTS * cores))

        def begun(some: list[int]) -> dict[int, Future]:
            births = self._told.run.individuals(some, rebred=False, stones=False)
            return {birth.id: pool.submit(self._made_of, birth, side) for birth in births}

        with ThreadPoolExecutor(cores) as pool:
            starts = range(0, len(generations), size)
            parts = [list(chain(*generations[at : at + size])) for at in starts]
            coming = [pool.submit(begun, some) for some in parts]
            return {one: made.result() for some in coming for one, made in some.result().items()}

    def _made_of(self, birth: Birth, side: int) -> np.ndarray | str:
        """A picture, or why there is none."""
        if birth.left_out:
            return f"the log leaves its genome out; run[{birth.id}].picture() breeds it again"
        expressed = self._told.expressed(birth)
        if expressed.city is None:
            why = birth.error or "" if birth.genome is None else expressed.problem
            return f"{birth.status}: {why}"[:_LETTERS]
        return np.asarray(self._picture(expressed.city, side))


__all__ = ["Thumbnails", "cities_of", "highest_of", "thumbnail"]
