"""Maps as pictures on one scale of heights, and the contact sheet of a run."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from evocity.analysis import Run
from evocity.analysis.export import caption
from evocity.analysis.thumbnails import highest_of, thumbnail
from evocity.citymap import CityMap
from evocity.pictures.colours import ramp
from evocity.pictures.sheet import sheet_of
from evocity.report.shown_births import ShownBirths
from evocity.scene import scene
from evocity.templates import Palette, data_uri

_WIDE = 560  # pixels of a scene
_LARGEST = 288  # pixels along a picture of a card: a page of many stays small
_COLOURS = 192  # of the shared palette: to the eye as near as 128 of each picture's own
_EXAMPLES = 4  # maps of each kind that the palette is made of


class Pictures:
    """Bare maps on the scale that ends at ``highest`` metres, as ``data:`` addresses with one
    palette, made of the scale's colours and of some ``examples``."""

    def __init__(self, highest: float, examples: Sequence[CityMap]):
        self.highest = highest
        scale = Image.fromarray(
            ramp(np.linspace(0, highest, 1024, dtype=np.float32)[None], highest)
        )
        pictures = [thumbnail(city, highest, _LARGEST) for city in examples]
        self._palette = Palette([scale, *pictures], _COLOURS)
        self._made: dict[int | str, str] = {}

    def of(self, name: int | str, city: CityMap) -> str:
        """Return the picture of a ``city``, kept under a ``name`` or id."""
        if name not in self._made:
            picture = thumbnail(city, self.highest, _LARGEST)
            self._made[name] = data_uri(picture, self._palette)
        return self._made[name]


def pictures_of(shown: ShownBirths) -> Pictures:
    """Return the pictures of a report, with a palette of a few of its maps."""
    examples = [source.city for source in shown.sources[:_EXAMPLES]]
    for some in (shown.shown, shown.shown_gone):
        examples += [one.city for one in some[:: len(some) // _EXAMPLES + 1]]
    return Pictures(highest_of(shown.births), examples)


def scene_uris(cities: Sequence[CityMap], highest: float) -> list[str]:
    """Draw the cities in three dimensions, bare; return ``data:`` addresses with one palette."""
    drawn = [scene(one).picture(width=_WIDE, highest=highest, legend=False) for one in cities]
    palette = Palette(drawn, _COLOURS) if drawn else None
    return [data_uri(picture, palette) for picture in drawn]


def scale_colours(highest: float, steps: int = 24) -> list[str]:
    """Return ``steps`` colours from the ground to ``highest`` metres, evenly, as ``#rrggbb``."""
    row = ramp(np.linspace(0, highest, steps, dtype=np.float32)[None], highest)[0]
    return ["#" + bytes(colour).hex() for colour in row]


def contact_sheet(run: Run, *, best: int = 8, columns: int = 4) -> Image.Image:
    """Draw the maps of a run on one sheet: first the parents, then the best individuals of the last
    generation. Each measure in turn adds its next best individual to the sheet. If several
    individuals look almost the same, the sheet shows only one of these individuals.

    All maps on the sheet have one scale of heights. The sheet has a legend of the scale and the
    attributions of the source cities. Raises `RunError` if the run has no complete generation yet,
    or is damaged.
    """
    shown = ShownBirths(run)
    parents = [source.city for source in shown.sources]
    chosen = shown.best(best)
    cells: list = [(city, [city.name, "parent"]) for city in parents]
    cells += [None] * (-len(parents) % columns)  # the bred begin a row of their own
    logged = shown.births.logged
    cells += [(one.city, caption(one.birth.id, logged, one.birth.values)) for one in chosen]
    title = f"{run.name}, generation {shown.births.last}"
    highest = highest_of(shown.births)
    return sheet_of(cells, title, highest, run.header.attribution, columns)
