"""A map as a picture: heights on an even scale of colours, light from the north-west."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.pictures.change import STOPS, STOREY, Change
from evocity.pictures.field import Field, Shares
from evocity.pictures.light import edges, lit
from evocity.pictures.palette import city_colours

PAPER = (250, 248, 244)
GROUND = (241, 238, 231)
INK = (52, 48, 46)
FAINT = (128, 121, 114)
# Where a field has no value: grey, bluer than ground.
NOTHING = (196, 202, 209)

# From the lowest roof to the highest, each step as much darker as the one before (OKLab).
_RAMP = ("#edd5ae", "#e8b682", "#de9262", "#cb6b54", "#a94a56", "#7c355c", "#4e2655", "#241741")


# Lightness of roofs in `render_shares`, from the lowest to the highest; how pale its ground is.
_LIGHTER, _DARKER, _PALE = 0.08, 0.26, 0.68

# A key has at most so many lines.
_LONGEST_KEY = 12

# Pillow's own font has no ©, é or Cyrillic; names and attributions do.
_FONT = Path(__file__).parent.parent / "data" / "fonts" / "roboto-regular.ttf"


def ramp(heights: np.ndarray, highest: float) -> np.ndarray:
    """Colours of ``heights`` (metres, any shape ``(H, W)``): uint8 ``(H, W, 3)``.

    Ground is pale; from `BUILT_ABOVE` on, colours darken evenly up to ``highest`` metres and
    stay there above. Traces lower than a building are drawn fainter. About 0.5 ms at 256².
    """
    table = _table(max(float(highest), 2 * BUILT_ABOVE))
    steps = np.minimum(heights * ((len(table) - 1) / max(float(highest), 2 * BUILT_ABOVE)), 1023)
    return table.take(steps.astype(np.int16), axis=0)


def scale_end(*cities: CityMap) -> float:
    """A round number of metres to end the colour scale of maps: above nearly all roofs of each.

    A single tower does not turn the rest pale: the scale ends below it if it is more than
    twice as high as 99.5 % of what is built on its map.
    """
    return max(map(_end, cities), default=10.0)


def _end(city: CityMap) -> float:
    roofs = city.heights[city.built]
    if not roofs.size:
        return 10.0
    usual, top = float(np.quantile(roofs, 0.995)), float(roofs.max())
    end = usual if top > 2 * usual else top
    step = 5 if end <= 50 else 10 if end <= 150 else 50
    return float(max(10, step * math.ceil(end / step)))


def render(
    city: CityMap, *, highest: float | None = None, legend: bool = True, zoom: int = 1
) -> Image.Image:
    """Draw a map.

    Parameters
    ----------
    highest : height at which the colours end, metres; give one number to all pictures to be
        compared. None: `scale_end`.
    legend : add name, colour scale, scale bar and attribution. Without it the picture is
        the bare map, ``(H·zoom, W·zoom)``, and who shows it owes the attribution.
    zoom : picture pixels a map pixel.

    Returns
    -------
    PIL.Image : RGB.
    """
    end = scale_end(city) if highest is None else float(highest)
    fabric = Image.fromarray(_shaded(city, end, zoom))
    return on_sheet(city, fabric, city.name, end, zoom) if legend else fabric


def on_sheet(
    city: CityMap, fabric: Image.Image, title: str, highest: float, zoom: int
) -> Image.Image:
    """A picture ``fabric`` of a map's heights, ``zoom`` times its size, with a title and the
    legend of `render` for colours that end at ``highest`` metres."""
    roof = float(city.heights.max(initial=0))
    note = f"up to {roof:.0f}" if roof > highest else ""
    scale = _Scale("height, m", highest, lambda metres: ramp(metres, highest), note)
    return _sheet(city, fabric, title, scale, zoom)


def render_field(field: Field, *, zoom: int = 1) -> Image.Image:
    """Draw values on a city's grid: an even scale of colours from 0 to a round number above
    nearly all of them, with the edges of roofs, and the legend of `render`. Pixels without a
    value (NaN) are `NOTHING`'s grey."""
    values = np.asarray(field.values, np.float32)
    known = values[~np.isnan(values)]
    top = float(known.max(initial=0))
    end = _rounded_up(float(np.quantile(known, 0.995) if known.size else 0) or top)
    pixels = values.repeat(zoom, axis=0).repeat(zoom, axis=1)
    colours = even(pixels, end)
    if zoom > 1:
        roofs = edges(field.city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1))
        colours[roofs] = np.round(colours[roofs] * 0.78).astype(np.uint8)
    notes = [f"up to {top:.3g}"] if top > end else []
    if known.size < values.size:
        notes.append("grey: none")
    unit = f"{field.symbol}, {field.unit}" if field.unit else field.symbol
    scale = _Scale(unit, end, lambda shown: even(shown, end), "\n".join(notes))
    title = f"{field.city.name}: {field.title}"
    return _sheet(field.city, Image.fromarray(colours), title, scale, zoom)


def render_shares(shares: Shares, *, legend: bool = True, zoom: int = 1) -> Image.Image:
    """Draw who has which part of a city: a colour for each part (`city_colours`), mixed as the
    weights are. Roofs are darker the higher they are, ground is pale. The legend
    names the parts and their shares of the whole map, the largest first; ``legend`` and ``zoom``
    are as in `render`."""
    city, weights = shares.city, np.asarray(shares.weights)
    hues = _oklab(np.array([_rgb(colour) for colour in city_colours(shares.parts)]) / 255)
    mixed = weights.reshape(-1, len(hues)) @ hues
    roofs = np.clip(city.heights.ravel() / scale_end(city), 0, 1)
    built = city.built.ravel()
    mixed[:, 0] += np.where(built, _LIGHTER - _DARKER * roofs, 0)
    mixed[~built] += _PALE * (_oklab(np.array([GROUND]) / 255) - mixed[~built])
    colours = np.round(_srgb(mixed) * 255).reshape(*city.shape, 3)
    fabric = Image.fromarray(lit(city, colours.repeat(zoom, axis=0).repeat(zoom, axis=1), zoom))
    if not legend:
        return fabric
    whole = weights.mean(axis=(0, 1), dtype=float)
    plain = np.round(_srgb(hues) * 255).astype(int)
    entries = [
        (tuple(int(c) for c in plain[part]), f"{shares.parts[part]}, {100 * whole[part]:.3g} %")
        for part in np.argsort(-whole, kind="stable")
        if whole[part] > 0
    ]
    return drawn_with_key(city, fabric, f"{city.name}: {shares.title}", entries, zoom)


def change_colours(values: np.ndarray, end: float) -> np.ndarray:
    """Colours of changes, metres, any shape: blue for less, pale at 0, red for more, as strong as
    they get at ``end``; uint8, a last axis of 3 longer."""
    return gradient(STOPS)(np.clip((values / end + 1) / 2, 0, 1))


def render_change(change: Change, *, zoom: int = 1) -> Image.Image:
    """Draw what one city has more (red) and less (blue) than another, with the legend of
    `render`."""
    city = change.second.replace(change.second.heights, attribution=change.attribution)
    colours = change_colours(change.metres, change.end).repeat(zoom, axis=0).repeat(zoom, axis=1)
    end = change.end
    note = f"{change.apart:.0%} by over\n{STOREY:g} m"
    scale = _Scale("more, m", end, lambda shown: change_colours(shown, end), note, -end)
    title = f"{change.second.name} less {change.first.name}"
    return _sheet(city, Image.fromarray(colours), title, scale, zoom)


_Entries = list[tuple[tuple[int, ...] | None, str]]  # colour, text


def drawn_with_key(
    city: CityMap, fabric: Image.Image, title: str, entries: _Entries, zoom: int
) -> Image.Image:
    """A picture ``fabric`` of a map, ``zoom`` times its size, with a title and the legend of
    `render`, but a key for a scale: the colour and text of each of ``entries``."""
    return _sheet(city, fabric, title, _Key(entries), zoom)


@dataclass(frozen=True)
class _Scale:
    """What a picture's colours stand for: values from ``start`` to ``end``, drawn by
    ``colours``."""

    title: str
    end: float
    colours: Callable[[np.ndarray], np.ndarray]
    note: str
    start: float = 0.0


@dataclass(frozen=True)
class _Key:
    """What a picture's colours stand for: a text each."""

    entries: _Entries


def even(values: np.ndarray, end: float) -> np.ndarray:
    """Colours of ``values`` ``(H, W)``, pale at 0, dark at ``end`` and above, grey where NaN."""
    colours = gradient(("#" + bytes(GROUND).hex(), *_RAMP))(np.clip(values / end, 0, 1))
    colours[np.isnan(values)] = NOTHING
    return colours


def gradient(stops: Sequence[str]) -> Callable[[np.ndarray], np.ndarray]:
    """What gives each share of 0…1, any shape, its colour between the ``stops``, ``#rrggbb``, that
    lie evenly: uint8, a last axis of 3 longer."""
    ends = _oklab(np.array([_rgb(text) for text in stops]) / 255)
    where, steps = np.linspace(0, 1, len(stops)), np.linspace(0, 1, 1024)
    between = np.column_stack([np.interp(steps, where, channel) for channel in ends.T])
    table = np.round(_srgb(between) * 255).astype(np.uint8)
    return lambda shares: table[np.round(np.nan_to_num(shares) * 1023).astype(np.int16)]


def _rounded_up(value: float) -> float:
    """The next number of one digit and a power of ten; 1 for nothing."""
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / power * 0.999) * power


@lru_cache(8)  # many pictures are on one scale
def _table(highest: float) -> np.ndarray:
    """Uint8 ``(1024, 3)``: colours from 0 to ``highest`` metres, mixed in OKLab."""
    stops = _oklab(np.array([_rgb(text) for text in _RAMP]) / 255)
    ground = _oklab(np.array([GROUND]) / 255)
    at = np.linspace(BUILT_ABOVE, highest, len(stops))
    # a trace just under the threshold is half-way from the ground to the lowest roof
    where = np.concatenate([[0.0, BUILT_ABOVE * 0.999], at])
    colours = np.concatenate([ground, (ground + stops[:1]) / 2, stops])
    metres = np.linspace(0, highest, 1024)
    mixed = np.column_stack([np.interp(metres, where, channel) for channel in colours.T])
    return np.round(_srgb(mixed) * 255).astype(np.uint8)


def _shaded(city: CityMap, end: float, zoom: int) -> np.ndarray:
    """Colours with cast shadows and roof edges, uint8 ``(H·zoom, W·zoom, 3)``."""
    heights = city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1)
    return lit(city, ramp(heights, end), zoom)


def _sheet(
    city: CityMap, fabric: Image.Image, name: str, legend: _Scale | _Key, zoom: int
) -> Image.Image:
    """The map on paper, with all that tells what it shows."""
    size = text_size(fabric)  # all else follows it
    plain, small = font(size), font(size * 0.85)
    key = legend.entries if isinstance(legend, _Key) else []
    margin, beside = 2 * size, 6 * size if isinstance(legend, _Scale) else 0
    # a tiny map still gets a sheet on which its legend has room
    width, height = max(fabric.width, 14 * size), max(fabric.height, 9 * size)
    lines = wrapped(city.attribution, small, width + beside)
    top = margin + int(2.4 * size)
    rows = _key_rows(key, plain, width)
    bottom = int(3.2 * size) + int(1.8 * size) * len(rows) + int(1.25 * size) * len(lines) + margin
    sheet = Image.new("RGB", (width + 2 * margin + beside, height + top + bottom), PAPER)
    draw = ImageDraw.Draw(sheet)
    title = _fitting(name, size, width + beside)
    draw.text((margin, margin), shortened(name, title, width + beside), INK, title, "lt")
    sheet.paste(fabric, (margin, top))
    draw.rectangle((margin - 1, top - 1, margin + fabric.width, top + fabric.height), outline=FAINT)
    right, low = margin + width, top + height
    if isinstance(legend, _Scale):
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


def _draw_colours(sheet, draw, place, scale: _Scale, font, small, size) -> None:
    """The colour scale, its start at the foot, with ticks."""
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
    """``entries`` in rows of at most ``width``; those beyond the last row are counted there."""
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
        rows[-1].append((colour, shortened(text, font, width - 2.6 * font.size)))
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
    """A round length of at most a quarter of the map's width; ``side`` in metres a pixel."""
    left, top = place
    metres = round_steps(width * side / 4, 1)[-1] or 1
    length, thick = metres / side, max(2, round(font.size / 4))
    draw.rectangle((left, top, left + length, top + thick), outline=INK)
    draw.rectangle((left, top, left + length / 2, top + thick), fill=INK)
    draw.text((left + length + font.size / 2, top), f"{metres:g} m", INK, font, "lt")


def round_steps(end: float, most: float) -> list[float]:
    """Round numbers from 0 to ``end``, at most about ``most`` steps."""
    wanted = end / max(most, 1)
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= wanted * 0.999)
    if most <= 1 and step > end:
        step = max(m * power for m in (0.5, 1, 2, 5) if m * power <= end)
    return [step * i for i in range(int(end / step + 1e-9) + 1)]


def text_size(fabric: Image.Image) -> int:
    """Height in px of the text beside a picture."""
    return int(np.clip(min(fabric.size) / 40, 11, 40))


@cache
def font(size: float) -> ImageFont.FreeTypeFont:
    """The font of all pictures, ``size`` px high."""
    return ImageFont.truetype(_FONT, size)


def _fitting(text: str, size: int, width: float) -> ImageFont.FreeTypeFont:
    """The font of a title: half as large again as ``size``, or smaller down to it to fit."""
    needed = font(1.5 * size).getlength(text)
    return font(max(size, min(1.5 * size, math.floor(1.5 * size * width / max(needed, 1)))))


def wrapped(text: str, font, width: float) -> list[str]:
    """``text`` in lines of at most ``width`` px, or of one word."""
    lines: list[str] = []
    for word in text.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= width:
            lines[-1] = f"{lines[-1]} {word}"
        else:
            lines.append(word)
    return lines


def shortened(text: str, font, width: float) -> str:
    while len(text) > 1 and font.getlength(text) > width:
        text = text[:-2] + "…"
    return text


def _rgb(text: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(text[1:]))


# Ottosson, "A perceptual color space for image processing" (2020)
_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def _oklab(srgb: np.ndarray) -> np.ndarray:
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return np.cbrt(linear @ _TO_LMS.T) @ _TO_LAB.T


def _srgb(lab: np.ndarray) -> np.ndarray:
    linear = (lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_LMS).T
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


__all__ = [
    "change_colours",
    "drawn_with_key",
    "even",
    "font",
    "gradient",
    "on_sheet",
    "ramp",
    "render",
    "render_change",
    "render_field",
    "render_shares",
    "round_steps",
    "scale_end",
    "shortened",
    "text_size",
    "wrapped",
]
