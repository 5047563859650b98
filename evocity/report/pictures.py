"""Maps as pictures on one scale of heights, and the contact sheet of a run."""

import math
import textwrap
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from evocity.analysis.thumbnails import highest_of
from evocity.citymap import CityMap
from evocity.pages import data_uri
from evocity.pictures.picture import FAINT, INK, PAPER, ramp, render
from evocity.report.facts import Facts, Shown
from evocity.report.plots import ticks
from evocity.scene import scene
from evocity.store import Run

#: Names and attributions have letters that Pillow's own font lacks.
FONT = Path(__file__).parent.parent / "data" / "fonts" / "roboto-regular.ttf"

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
    return _sheet(facts, cells, highest, columns)


def _caption(facts: Facts, one: Shown) -> list[str]:
    values = [
        f"{aim.name} {one.birth.values.get(aim.name, math.nan):.4g} {aim.unit}".rstrip()
        for aim in facts.told.logged
    ]
    return [f"individual {one.birth.id}", *values]


def _sheet(facts: Facts, cells: list, highest: float, columns: int) -> Image.Image:
    plain, title = ImageFont.truetype(FONT, 13), ImageFont.truetype(FONT, 22)
    gap, line, top = 20, 17, 64
    rows, cols = cells[0][0].shape
    side = min(max(cols, 200), 400)
    tall = round(side * rows / cols)
    step = tall + gap + line * max(len(cell[1]) for cell in cells if cell)
    width = gap + columns * (side + gap)
    credits = textwrap.wrap(facts.run.header.attribution, (width - 2 * gap) // 7)
    low = top + -(-len(cells) // columns) * step + 8
    sheet = Image.new("RGB", (width, low + 52 + gap + line * len(credits)), PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text((gap, 20), f"{facts.title}, generation {facts.told.last}", INK, title)
    for number, cell in enumerate(cells):
        if cell is None:
            continue
        city, caption = cell
        row, column = divmod(number, columns)
        left, high = gap + column * (side + gap), top + row * step
        picture = render(city, highest=highest, legend=False)
        method = Image.Resampling.BOX if cols > side else Image.Resampling.NEAREST
        sheet.paste(picture.resize((side, tall), method), (left, high))
        for index, text in enumerate(caption):
            place = (left, high + tall + 4 + index * line)
            draw.text(place, text, INK if index == 0 else FAINT, plain)
    draw_scale(sheet, draw, (gap, low), min(width - 2 * gap, 420), highest, plain)
    for index, text in enumerate(credits):
        draw.text((gap, low + 44 + index * line), text, FAINT, plain)
    return sheet


def draw_scale(sheet, draw, place, width: int, highest: float, plain) -> None:
    """The scale of heights, ``width`` px wide and 36 high, at the ``place`` (left, top)."""
    left, top = place
    bar = np.linspace(0, highest, width, dtype=np.float32)[None].repeat(12, axis=0)
    sheet.paste(Image.fromarray(ramp(bar, highest)), (left, top))
    for metres in ticks(0, highest):
        text = f"{metres:g}" if metres else "0 m"
        x = left + metres / highest * (width - 1)
        draw.text((x, top + 17), text, FAINT, plain, "mt" if 0 < metres < highest else "lt")
