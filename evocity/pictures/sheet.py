"""Contact sheets: many maps on one sheet, on one scale of heights, a caption under each."""

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from evocity.citymap import CityMap
from evocity.pictures.colours import FAINT, INK, PAPER, ramp
from evocity.pictures.legend import font, round_steps, shorten_text, wrap_text
from evocity.pictures.picture import render

_GAP, _LINE, _TOP = 20, 17, 64  # px: between maps, of a line of text, above the first map
_NARROWEST, _WIDEST = 200, 400  # px of a map, across
_SCALE = 420  # px of the scale of heights, at most


def sheet_of(
    cells: Sequence[tuple[CityMap, Sequence[str]] | None],
    title: str,
    highest: float,
    attribution: str = "",
    columns: int = 4,
    note: str = "",
) -> Image.Image:
    """Draw maps in rows of ``columns``, each with its lines of text beneath, the first line darker.

    cells : a map and its lines for each place, all maps of one shape; None for an empty place.
    highest : metres at which the colours of all maps end; a scale beneath them shows it.
    attribution : the lines that the licences of the maps ask for, at the foot.
    note : the meaning of marks in the lines of text, at the foot.
    """
    shown = [cell for cell in cells if cell is not None]
    plain = font(13)
    rows, across = shown[0][0].shape if shown else (1, 1)
    side = min(across * -(-_NARROWEST // across), _WIDEST)  # of a small map a whole multiple
    tall = round(side * rows / across)
    step = tall + _GAP + _LINE * max((len(lines) for _, lines in shown), default=0)
    width = max(_GAP + columns * (side + _GAP), _SCALE + 2 * _GAP)
    about = _extent([city for city, _ in shown], highest) if shown else ""
    about += f"; {note}" if note else ""
    feet = [
        line for text in (about, attribution) for line in wrap_text(text, plain, width - 2 * _GAP)
    ]
    low = _TOP + -(-len(cells) // columns) * step + 8
    sheet = Image.new("RGB", (width, low + 52 + _GAP + _LINE * len(feet)), PAPER)
    draw = ImageDraw.Draw(sheet)
    large = font(22)
    draw.text((_GAP, 20), shorten_text(title, large, width - 2 * _GAP), INK, large)
    for number, cell in enumerate(cells):
        if cell is None:
            continue
        city, lines = cell
        row, column = divmod(number, columns)
        left, high = _GAP + column * (side + _GAP), _TOP + row * step
        picture = render(city, highest=highest, legend=False)
        method = Image.Resampling.BOX if across > side else Image.Resampling.NEAREST
        sheet.paste(picture.resize((side, tall), method), (left, high))
        for index, text in enumerate(lines):
            place = (left, high + tall + 4 + index * _LINE)
            draw.text(place, shorten_text(text, plain, side), FAINT if index else INK, plain)
    draw_scale(sheet, draw, (_GAP, low), min(width - 2 * _GAP, _SCALE), highest, plain)
    for index, text in enumerate(feet):
        draw.text((_GAP, low + 44 + index * _LINE), text, FAINT, plain)
    return sheet


def _extent(cities: Sequence[CityMap], highest: float) -> str:
    first = cities[0]
    rows, across = (f"{count * first.metres_per_pixel:.4g}" for count in first.shape)
    top = max(float(city.heights.max()) for city in cities)
    above = f"; the darkest is up to {top:.0f} m high" if top > highest else ""
    return f"height above ground in metres; each map is {across} × {rows} m{above}"


def draw_scale(sheet, draw, place, width: int, highest: float, plain) -> None:
    """Draw the scale of heights, ``width`` px wide and 36 high, at the ``place`` (left, top)."""
    left, top = place
    bar = np.linspace(0, highest, width, dtype=np.float32)[None].repeat(12, axis=0)
    sheet.paste(Image.fromarray(ramp(bar, highest)), (left, top))
    for metres in round_steps(highest, 5):
        text = f"{metres:g}" if metres else "0 m"
        x = left + metres / highest * (width - 1)
        anchor = "lt" if not metres else "mt" if metres < highest else "rt"
        draw.text((x, top + 17), text, FAINT, plain, anchor)


def columns_for(count: int) -> int:
    """Choose the number of columns for ``count`` maps, so that the sheet is not a strip."""
    return max(1, min(count, max(4, math.isqrt(max(count - 1, 0)) + 1)))
