"""Maps as pictures on one scale of heights, and the contact sheet of a run."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from evocity.analysis.exporting import caption
from evocity.analysis.thumbnails import highest_of, thumbnail
from evocity.citymap import CityMap
from evocity.pages import Palette, data_uri
from evocity.pictures.colours import ramp
from evocity.pictures.sheet import sheet_of
from evocity.report.facts import Facts, Shown
from evocity.scene import scene
from evocity.store import Run

_WIDE = 560  # pixels of a scene: so few of them that they may be larger
_LARGEST = 288  # pixels along a picture: what a card shows; a page of many stays small
_COLOURS = 192  # of all pictures together: then each is as near as with 128 of its own, to the eye
_EXAMPLES = 4  # of each kind of map tell these colours


class Pictures:
    """Bare maps on the scale that ends at ``highest`` metres, as ``data:`` addresses, each made
    once. Larger maps are shrunk until their longer side has `_LARGEST` pixels.

    All share one palette: that of the scale's own colours and of some ``examples``.
    """

    def __init__(self, highest: float, examples: Sequence[CityMap]):
        self.highest = highest
        scale = Image.fromarray(
            ramp(np.linspace(0, highest, 1024, dtype=np.float32)[None], highest)
        )
        pictures = [thumbnail(city, highest, _LARGEST) for city in examples]
        self._palette = Palette([scale, *pictures], _COLOURS)
        self._made: dict[int | str, str] = {}

    def of(self, name: int | str, city: CityMap) -> str:
        """The picture of the individual, or city, that is called so."""
        if name not in self._made:
            picture = thumbnail(city, self.highest, _LARGEST)
            self._made[name] = data_uri(picture, self._palette)
        return self._made[name]


def pictures_of(facts: Facts) -> Pictures:
    """The pictures of a report, whose palette a few of its maps tell."""
    examples = [source.city for source in facts.sources[:_EXAMPLES]]
    for shown in (facts.shown, facts.shown_gone):
        examples += [one.city for one in shown[:: len(shown) // _EXAMPLES + 1]]
    return Pictures(highest_of(facts.told), examples)


def scene_uris(cities: Sequence[CityMap], highest: float) -> list[str]:
    """The cities in three dimensions, bare, their roofs on the scale that ends at ``highest``
    metres, as ``data:`` addresses. All share one palette."""
    drawn = [scene(one).picture(width=_WIDE, highest=highest, legend=False) for one in cities]
    palette = Palette(drawn, _COLOURS) if drawn else None
    return [data_uri(picture, palette) for picture in drawn]


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
