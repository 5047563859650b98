"""Maps as pictures on one scale of heights, and the contact sheet of a run."""

import numpy as np
from PIL import Image

from evocity.analysis.exporting import caption
from evocity.analysis.thumbnails import highest_of
from evocity.citymap import CityMap
from evocity.pages import data_uri
from evocity.pictures.picture import ramp, render
from evocity.pictures.sheet import sheet_of
from evocity.report.facts import Facts, Shown
from evocity.scene import scene
from evocity.store import Run

_WIDE = 560  # pixels of a scene: so few of them that they may be larger
_LARGEST = 288  # pixels along a picture: what a card shows; a page of many stays small


def map_uri(city: CityMap, highest: float) -> str:
    """The bare map on the scale that ends at ``highest`` metres, as a ``data:`` address.

    Larger maps are shrunk until their longer side has `_LARGEST` pixels.
    """
    picture = render(city, highest=highest, legend=False)
    picture.thumbnail((_LARGEST, _LARGEST), Image.Resampling.BOX)
    return data_uri(picture)


class Pictures:
    """Bare maps on the scale that ends at ``highest`` metres as `map_uri` has them, each made
    once."""

    def __init__(self, highest: float):
        self.highest = highest
        self._made: dict[int | str, str] = {}

    def of(self, name: int | str, city: CityMap) -> str:
        """The picture of the individual, or city, that is called so."""
        if name not in self._made:
            self._made[name] = map_uri(city, self.highest)
        return self._made[name]


def scene_uri(city: CityMap, highest: float) -> str:
    """The city in three dimensions, bare, its roofs on the scale that ends at ``highest`` metres,
    as a ``data:`` address."""
    picture = scene(city).picture(width=_WIDE, highest=highest, legend=False)
    return data_uri(picture)


def scale_colours(highest: float, steps: int = 24) -> list[str]:
    """Colours from the ground to ``highest`` metres, evenly, as ``#rrggbb``."""
    row = ramp(np.linspace(0, highest, steps, dtype=np.float32)[None], highest)[0]
    return ["#" + bytes(colour).hex() for colour in row]


def contact_sheet(run: Run, *, best: int = 8, columns: int = 4) -> Image.Image:
    """A run on one sheet: its parents, then the best of its last generation by each measure,
    of those that look alike only the first.

    One scale of heights for all, with its legend and the sources' attributions. Raises
    `RunError` if the run has no whole generation yet, or is damaged.
    """
    facts = Facts(run)
    parents = [source.city for source in facts.sources]
    chosen = facts.best(best)
    highest = highest_of(facts.told)
    cells: list = [(city, [city.name, "parent"]) for city in parents]
    cells += [None] * (-len(parents) % columns)  # the bred begin a row of their own
    cells += [(one.city, _caption(facts, one)) for one in chosen]
    title = f"{facts.title}, generation {facts.told.last}"
    return sheet_of(cells, title, highest, facts.run.header.attribution, columns)


def _caption(facts: Facts, one: Shown) -> list[str]:
    return caption(one.birth.id, facts.told.logged, one.birth.values)
