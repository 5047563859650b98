"""Decoded maps of births, and small pictures of them on one scale of heights."""

from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from itertools import chain, groupby

import numpy as np
from PIL import Image

from evocity.analysis.births import Births
from evocity.citymap import CityMap
from evocity.coding.matching import available_cores
from evocity.pictures import render
from evocity.pictures.colours import scale_end
from evocity.store import Birth

# Individuals whose genomes are held at a time.
_AT_A_TIME = 64
# Parts that each core reads, so that no core waits; a part opens a file once.
_PARTS = 4
# Bytes of small pictures that are kept; letters of an error that are shown.
_KEPT, _LETTERS = 64_000_000, 300
# Births that are looked up for thumbnails in the log.
_LOOKED_UP = 8


def cities_of(births: Births, ids: Sequence[int]) -> dict[int, CityMap]:
    """Return the decoded maps of births; those without a map are left out."""
    cities = {}
    for start in range(0, len(ids), _AT_A_TIME):
        some = [int(one) for one in ids[start : start + _AT_A_TIME]]
        for birth in births.run.individuals(some, stones=False):
            city = births.expressed(birth).city
            if city is not None:
                cities[birth.id] = city
    return cities


def highest_of(births: Births) -> float:
    """Return the metres at which the colours of all maps of a run end: above its parents' roofs."""
    return scale_end(*(source.city for source in births.sources))


def thumbnail(city: CityMap, highest: float, largest: int) -> Image.Image:
    """Draw the bare map, at most ``largest`` px along its longer side."""
    picture = render(city, highest=highest, legend=False)
    picture.thumbnail((largest, largest), Image.Resampling.BOX)
    return picture


def _finer(city: CityMap) -> CityMap:
    """A ``city`` with twice as many pixels each way, for finer shadows."""
    heights = city.heights.repeat(2, axis=0).repeat(2, axis=1)
    return CityMap(heights, city.metres_per_pixel / 2)


class Thumbnails:
    """Small pictures of the ``births`` of a run, made on request; the last ones are kept."""

    def __init__(self, births: Births):
        self._births = births
        self._kept: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()
        self._bytes = 0

    @cached_property
    def highest(self) -> float:
        return highest_of(self._births)

    @cached_property
    def logged(self) -> bool:
        """Whether the log holds small maps, by the first births of the last generation."""
        births = self._births
        first = births.ids[births.generation == births.last][:_LOOKED_UP]
        return bool(births.run.header.thumbnails and births.run.thumbnails(first.tolist()))

    def of(self, ids: Sequence[int], side: int) -> tuple[dict[int, np.ndarray], dict[int, str]]:
        """Return pictures of the births ``ids``, uint8 ``(height, width, 3)``, at most ``side`` px
        along the longer side; and the reason for each birth without a picture."""
        missing = [one for one in ids if (one, side) not in self._kept]
        lacking = {}
        for one, made in self._made(missing, side).items():
            if isinstance(made, str):
                lacking[one] = made
            else:
                self._kept[one, side] = made
                self._bytes += made.nbytes
        pictures = {}
        for one in ids:
            if (one, side) in self._kept:
                self._kept.move_to_end((one, side))
                pictures[one] = self._kept[one, side]
        while self._bytes > _KEPT:
            self._bytes -= self._kept.popitem(last=False)[1].nbytes
        return pictures, lacking

    def _made(self, ids: Sequence[int], side: int) -> dict[int, np.ndarray | str]:
        """A picture of each birth, from the log's small map or the genome, or the reason."""
        run, pictures = self._births.run, {}
        made = run.header.thumbnails
        # enlarged by half at most
        if ids and made and 2 * side < 3 * max(made.shape(run.header.height, run.header.width)):
            small = run.thumbnails(ids)
            pictures = {
                one: np.asarray(self._picture(_finer(city), side)) for one, city in small.items()
            }
        return pictures | self._decoded([one for one in ids if one not in pictures], side)

    def _picture(self, city: CityMap, side: int) -> Image.Image:
        return thumbnail(city, self.highest, side)

    def _decoded(self, ids: Sequence[int], side: int) -> dict[int, np.ndarray | str]:
        """As `_made`, of genomes: threads read generations, then draw."""
        _ = self.highest  # before threads ask for it
        cores, population = available_cores(), self._births.run.header.population
        groups = groupby(sorted(ids), lambda one: one // population)
        generations = [list(some) for _, some in groups]
        size = max(1, len(generations) // (_PARTS * cores))

        def begun(some: list[int]) -> dict[int, Future]:
            births = self._births.run.individuals(some, rebred=False, stones=False)
            return {birth.id: pool.submit(self._made_of, birth, side) for birth in births}

        with ThreadPoolExecutor(cores) as pool:
            starts = range(0, len(generations), size)
            parts = [list(chain(*generations[at : at + size])) for at in starts]
            coming = [pool.submit(begun, some) for some in parts]
            return {one: made.result() for some in coming for one, made in some.result().items()}

    def _made_of(self, birth: Birth, side: int) -> np.ndarray | str:
        if birth.left_out:
            return f"the log leaves its genome out; run[{birth.id}].picture() breeds it again"
        expressed = self._births.expressed(birth)
        if expressed.city is None:
            why = birth.error or "" if birth.genome is None else expressed.problem
            return f"{birth.status}: {why}"[:_LETTERS]
        return np.asarray(self._picture(expressed.city, side))
