"""Legends: title, scale of colours or key, scale bar and attribution around a picture."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from evocity.citymap import CityMap
from evocity.pictures.colours import FAINT, INK, PAPER, ramp

# The most lines of a key.
_LONGEST_KEY = 12

# Pillow's own font has no ©, é or Cyrillic; names and attributions do.
_FONT = Path(__file__).parent.parent / "data" / "fonts" / "roboto-regular.ttf"


_Entries = list[tuple[tuple[int, ...] | None, str]]  # colour, text


@dataclass(frozen=True)
class Scale:
    """A scale of colours: values from ``start`` to ``end``, coloured by ``colours``."""

    title: str
    end: float
    colours: Callable[[np.ndarray], np.ndarray]
    note: str
    start: float = 0.0


@dataclass(frozen=True)
class Key:
    """A key of colours: a text for each."""

    entries: _Entries


def draw_with_scale(
    city: CityMap, fabric: Image.Image, title: str, highest: float, zoom: int
) -> Image.Image:
    """Draw a title and the legend of `render` around a picture ``fabric`` of a map's heights,
    ``zoom`` times its size, with colours that end at ``highest`` metres."""
    roof = float(city.heights.max(initial=0))
    note = f"up to {roof:.0f}" if roof > highest else ""
    scale = Scale("height, m", highest, lambda metres: ramp(metres, highest), note)
    return draw_legend(city, fabric, title, scale, zoom)


def draw_legend(
    city: CityMap, fabric: Image.Image, name: str, legend: Scale | Key, zoom: int
) -> Image.Image:
    """Draw title, legend, scale bar and attribution around a picture ``fabric`` of a map, ``zoom``
    times its size."""
    size = text_size(fabric)  # all else follows it
    plain, small = font(size), font(size * 0.85)
    key = legend.entries if isinstance(legend, Key) else []
    margin, beside = 2 * size, 6 * size if isinstance(legend, Scale) else 0
    # a tiny map gets a sheet with room for its legend
    width, height = max(fabric.width, 14 * size), max(fabric.height, 9 * size)
    lines = wrap_text(city.attribution, small, width + beside)
    top = margin + int(2.4 * size)
    rows = _key_rows(key, plain, width)
    bottom = int(3.2 * size) + int(1.8 * size) * len(rows) + int(1.25 * size) * len(lines) + margin
    sheet = Image.new("RGB", (width + 2 * margin + beside, height + top + bottom), PAPER)
    draw = ImageDraw.Draw(sheet)
    title = _title_font(name, size, width + beside)
    draw.text((margin, margin), shorten_text(name, title, width + beside), INK, title, "lt")
    sheet.paste(fabric, (margin, top))
    draw.rectangle((margin - 1, top - 1, margin + fabric.width, top + fabric.height), outline=FAINT)
    right, low = margin + width, top + height
    if isinstance(legend, Scale):
        _draw_colours(sheet, draw, (right + size, top, low), legend, plain, small, size)
    _draw_scale_bar(draw, (margin, low + size), city.metres_per_pixel / zoom, width, small)
    extent = f"{city.shape[1]} × {city.shape[0]} px of {city.metres_per_pixel:.4g} m"
    draw.text((right, low + size), extent, FAINT, small, "rt")
    low += int(3.2 * size)
    for row in rows:
        _draw_key_row(draw, (margin, low), row, plain)
        low += int(1.8 * size)
    for number, line in enumerate(lines):
        draw.text((margin, low + 1.25 * size * number), line, FAINT, small, "lt")
    return sheet


def _draw_colours(sheet, draw, place, scale: Scale, font, small, size) -> None:
    """Draw the colour scale, its start at the foot, with ticks."""
    start, end = scale.start, scale.end
    left, top, low = place
    top, width = top + int(1.8 * size), size
    tall = min(low - top, 18 * size)
    bar = scale.colours(np.linspace(end, start, tall)[:, None].repeat(width, axis=1))
    sheet.paste(Image.fromarray(bar), (left, top))
    draw.rectangle((left - 1, top - 1, left + width, top + tall), outline=FAINT)
    draw.text((left, top - int(0.6 * size)), scale.title, FAINT, small, "lb")
    steps = round_steps(end, tall / (2 * size) * end / (end - start))
    for value in [-step for step in steps[:0:-1] if start < 0] + steps:
        y = top + round((tall - 1) * (1 - (value - start) / (end - start)))
        draw.line((left + width, y, left + width + size // 3, y), FAINT)
        draw.text((left + 1.6 * width, y), f"{value:g}", INK, font, "lm")
    if scale.note and low - top - tall > 2 * size:
        for number, line in enumerate(scale.note.splitlines()):
            y = top + tall + size // 2 + number * int(1.25 * size)
            draw.text((left, y), line, FAINT, small, "lt")


def _key_rows(entries: _Entries, font, width: float) -> list[_Entries]:
    """Put ``entries`` in rows of at most ``width``; the last row counts those beyond it."""
    rows: list[_Entries] = []
    room = 0.0
    for number, (colour, text) in enumerate(entries):
        needed = 2.6 * font.size + font.getlength(text)
        if not rows or needed > room:
            if len(rows) == _LONGEST_KEY:
                rows[-1] = [(None, f"and {len(entries) - number + len(rows[-1])} more")]
                break
            rows.append([])
            room = width
        rows[-1].append((colour, shorten_text(text, font, width - 2.6 * font.size)))
        room -= needed
    return rows


def _draw_key_row(draw, place, row: _Entries, font) -> None:
    left, top = place
    for colour, text in row:
        if colour:
            draw.rectangle((left, top, left + font.size, top + font.size), colour, FAINT)
            left += 1.5 * font.size
        draw.text((left, top + font.size / 2), text, INK, font, "lm")
        left += font.getlength(text) + 1.1 * font.size


def _draw_scale_bar(draw, place, side, width, font) -> None:
    """Draw a round length of at most a quarter of the map's width; ``side``: metres a pixel."""
    left, top = place
    metres = round_steps(width * side / 4, 1)[-1] or 1
    length, thick = metres / side, max(2, round(font.size / 4))
    draw.rectangle((left, top, left + length, top + thick), outline=INK)
    draw.rectangle((left, top, left + length / 2, top + thick), fill=INK)
    draw.text((left + length + font.size / 2, top), f"{metres:g} m", INK, font, "lt")


def round_steps(end: float, most: float) -> list[float]:
    """List round numbers from 0 to ``end``, in at most about ``most`` steps."""
    ideal = end / max(most, 1)
    power = 10.0 ** math.floor(math.log10(ideal))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= ideal * 0.999)
    if most <= 1 and step > end:
        step = max(m * power for m in (0.5, 1, 2, 5) if m * power <= end)
    return [step * i for i in range(int(end / step + 1e-9) + 1)]


def text_size(fabric: Image.Image) -> int:
    """Choose the height of the text beside a picture, px."""
    return int(np.clip(min(fabric.size) / 40, 11, 40))


@cache
def font(size: float) -> ImageFont.FreeTypeFont:
    """Load the font of all pictures, ``size`` px high."""
    return ImageFont.truetype(_FONT, size)


def _title_font(text: str, size: int, width: float) -> ImageFont.FreeTypeFont:
    """Choose the font of a title: from 1.5 times ``size`` down to ``size`` to fit."""
    needed = font(1.5 * size).getlength(text)
    return font(max(size, min(1.5 * size, math.floor(1.5 * size * width / max(needed, 1)))))


def wrap_text(text: str, font, width: float) -> list[str]:
    """Split ``text`` into lines of at most ``width`` px, or of a single word."""
    lines: list[str] = []
    for word in text.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= width:
            lines[-1] = f"{lines[-1]} {word}"
        else:
            lines.append(word)
    return lines


def shorten_text(text: str, font, width: float) -> str:
    """Cut ``text`` with an ellipsis if it is wider than ``width`` px."""
    while len(text) > 1 and font.getlength(text) > width:
        text = text[:-2] + "…"
    return text
