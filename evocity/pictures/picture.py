"""Pictures of maps, fields, shares, leaves, changes and classes, with light from the north-west."""

import math

import numpy as np
from PIL import Image, ImageDraw

from evocity.citymap import STOREY, CityMap, Classes
from evocity.pavement import Pavement
from evocity.pictures.colours import (
    GROUND,
    INK,
    PAPER,
    change_colours,
    city_colours,
    field_colours,
    oklab,
    ramp,
    rgb,
    scale_end,
    srgb,
)
from evocity.pictures.field import Change, Faces, Field, Leaves, Shares
from evocity.pictures.legend import Key, Scale, draw_legend, draw_with_scale
from evocity.pictures.light import add_light, edges

# Lightness of roofs in `render_shares`, from the lowest to the highest; how pale its ground is.
_LIGHTER, _DARKER, _PALE = 0.08, 0.26, 0.68

#: The least number of picture pixels a map pixel, so that lines stay distinct.
CLOSEST = 4

# Faces: the number of tints, their opacity on and off lots, half the arms of crosses in map pixels,
# and the colour of crosses.
_TINTS, _STRONG, _WEAK, _ARM, _CROSS = 6, 0.45, 0.18, 4.0, "#c2281d"

# Opacity of lines on pale pixels and on dark ones; the greatest level of dark pixels.
_ON_PALE, _ON_DARK, _DARK = 0.5, 0.35, 105


def render(
    city: CityMap, *, highest: float | None = None, legend: bool = True, zoom: int = 1
) -> Image.Image:
    """Draw a map.

    Parameters
    ----------
    highest : height in metres at which the colour scale ends; None chooses a round number above
        nearly all roofs. Use the same value of ``highest`` for all pictures that you compare.
    legend : whether to add the name, colour scale, scale bar and attribution. Without the legend
        the picture is the bare map, ``(H·zoom, W·zoom)``, and the caller must show the attribution.
    zoom : number of picture pixels per map pixel.

    Returns
    -------
    PIL.Image : the picture, in RGB.
    """
    end = scale_end(city) if highest is None else float(highest)
    heights = city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1)
    fabric = Image.fromarray(add_light(city, ramp(heights, end), zoom))
    return draw_with_scale(city, fabric, city.name, end, zoom) if legend else fabric


def render_field(field: Field, *, zoom: int = 1) -> Image.Image:
    """Draw values on a city's grid, with the edges of roofs and the legend of `render`. The colour
    scale runs evenly from 0 to a round number above nearly all values. Missing values (NaN) are
    grey."""
    values = np.asarray(field.values, np.float32)
    known = values[~np.isnan(values)]
    top, end = float(known.max(initial=0)), values_end(known)
    pixels = values.repeat(zoom, axis=0).repeat(zoom, axis=1)
    colours = field_colours(pixels, end)
    if zoom > 1:
        roofs = edges(field.city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1))
        colours[roofs] = np.round(colours[roofs] * 0.78).astype(np.uint8)
    notes = [f"up to {top:.3g}"] if top > end else []
    if known.size < values.size:
        notes.append("grey: missing")
    unit = f"{field.symbol}, {field.unit}" if field.unit else field.symbol
    scale = Scale(unit, end, lambda shown: field_colours(shown, end), "\n".join(notes))
    title = f"{field.city.name}: {field.title}"
    return draw_legend(field.city, Image.fromarray(colours), title, scale, zoom)


def render_leaves(leaves: Leaves, *, legend: bool = True, zoom: int = CLOSEST) -> Image.Image:
    """Draw a map with the borders of its range blocks. Each border is a line of one picture pixel
    along the north and west sides of a block. The line between two blocks is dark on pale pixels
    and pale on dark pixels. The arguments ``legend`` and ``zoom`` work as in `render`. At a zoom
    below 4, the borders of blocks of 2 px touch each other."""
    city, p = leaves.city, leaves.pavement
    end = scale_end(city)
    colours = np.array(render(city, highest=end, legend=False, zoom=zoom), np.float32)
    line = _borders(p, zoom)
    under = colours[line]
    dark = under.mean(axis=1, keepdims=True) < _DARK
    share = np.where(dark, _ON_DARK, _ON_PALE).astype(np.float32)
    ink = np.where(dark, np.float32(PAPER), np.float32(INK))
    colours[line] = under + (ink - under) * share
    fabric = Image.fromarray(np.round(colours).astype(np.uint8))
    title = f"{city.name}: {leaves.title}"
    return draw_with_scale(city, fabric, title, end, zoom) if legend else fabric


def render_faces(faces: Faces, *, legend: bool = True, zoom: int = CLOSEST) -> Image.Image:
    """Draw a map with its faces between streets. Each face has a tint, and its lot (the ground for
    buildings) has a stronger tint. Dark lines follow the axes of streets. A red cross in each face
    shows the directions of its walls. The arguments ``legend`` and ``zoom`` work as in `render`."""
    city = faces.city
    end = scale_end(city)
    colours = np.array(render(city, highest=end, legend=False), np.float32)
    tints = np.array([rgb(colour) for colour in city_colours(range(_TINTS))], np.float32)
    tint = tints[(faces.labels - 1) % _TINTS]
    strength = np.where(faces.lots > 0, _STRONG, _WEAK).astype(np.float32)[..., None]
    colours += (tint - colours) * np.where(faces.labels[..., None] > 0, strength, 0)
    axes = faces.labels == 0
    if city.site is not None:
        axes &= city.site
    colours[axes] = INK
    pixels = np.round(colours).astype(np.uint8).repeat(zoom, axis=0).repeat(zoom, axis=1)
    fabric = Image.fromarray(pixels)
    draw = ImageDraw.Draw(fabric)
    for (row, column), angle in zip(faces.centres, faces.angles, strict=True):
        for turn in (0, math.pi / 2) if math.isfinite(angle) else ():
            along, down = math.cos(angle + turn) * _ARM, math.sin(angle + turn) * _ARM
            ends = [
                ((column + 0.5 + step * along) * zoom, (row + 0.5 + step * down) * zoom)
                for step in (-1, 1)
            ]
            draw.line(ends, fill=_CROSS, width=max(1, zoom // 2))
    title = f"{city.name}: {faces.title}"
    return draw_with_scale(city, fabric, title, end, zoom) if legend else fabric


def render_shares(shares: Shares, *, legend: bool = True, zoom: int = 1) -> Image.Image:
    """Draw the shares of several parts, for example source cities, in each pixel of a city. Each
    part has a colour (`city_colours`); a pixel mixes the colours of the parts in proportion to
    their shares. Higher roofs are darker than lower roofs, and ground is pale. The legend lists the
    parts with their shares of the whole map, the largest first. The arguments ``legend`` and
    ``zoom`` work as in `render`."""
    city, weights = shares.city, np.asarray(shares.weights)
    hues = oklab(np.array([rgb(colour) for colour in city_colours(shares.parts)]) / 255)
    mixed = weights.reshape(-1, len(hues)) @ hues
    roofs = np.clip(city.heights.ravel() / scale_end(city), 0, 1)
    built = city.built.ravel()
    mixed[:, 0] += np.where(built, _LIGHTER - _DARKER * roofs, 0)
    mixed[~built] += _PALE * (oklab(np.array([GROUND]) / 255) - mixed[~built])
    colours = np.round(srgb(mixed) * 255).reshape(*city.shape, 3)
    fabric = Image.fromarray(
        add_light(city, colours.repeat(zoom, axis=0).repeat(zoom, axis=1), zoom)
    )
    if not legend:
        return fabric
    whole = weights.mean(axis=(0, 1), dtype=float)
    plain = np.round(srgb(hues) * 255).astype(int)
    entries = [
        (tuple(int(c) for c in plain[part]), f"{shares.parts[part]}, {100 * whole[part]:.3g} %")
        for part in np.argsort(-whole, kind="stable")
        if whole[part] > 0
    ]
    return draw_legend(city, fabric, f"{city.name}: {shares.title}", Key(entries), zoom)


def render_change(change: Change, *, zoom: int = 1) -> Image.Image:
    """Draw the difference of two cities: red where the second city is higher, and blue where it is
    lower. The title, scale bar and attribution look like those of the function `render`."""
    city = change.second.replace(change.second.heights, attribution=change.attribution)
    colours = change_colours(change.metres, change.end).repeat(zoom, axis=0).repeat(zoom, axis=1)
    end = change.end
    note = f"{100 * change.apart:.0f} % by over\n{STOREY:g} m"
    scale = Scale("more, m", end, lambda shown: change_colours(shown, end), note, -end)
    title = f"{change.second.name} less {change.first.name}"
    return draw_legend(city, Image.fromarray(colours), title, scale, zoom)


def render_classes(
    city: CityMap, classes: Classes | None = None, *, legend: bool = True, zoom: int = 1
) -> Image.Image:
    """Draw the objects on a city in the colours of their classes, with shadows and edges of roofs.

    The argument ``classes`` comes from `CityMap.classified` with a table of your own; None means
    `CityMap.classes`. The legend lists the classes with their number of objects and share of the
    map, the largest first. The arguments ``legend`` and ``zoom`` work as in `render`.
    """
    classes = city.classes if classes is None else classes
    palette = np.concatenate([[GROUND], classes.table.rgb]).astype(np.uint8)
    colours = palette[classes.image].repeat(zoom, axis=0).repeat(zoom, axis=1)
    fabric = Image.fromarray(add_light(city, colours, zoom))
    if not legend:
        return fabric
    entries = []
    for k in sorted(range(len(classes.names)), key=lambda k: -classes.areas[classes.names[k]]):
        name = classes.names[k]
        if classes.counts[name]:
            share = 100 * classes.areas[name] / city.area
            text = f"{name}: {classes.counts[name]}, {share:.2g} %"
            entries.append((tuple(int(c) for c in classes.table.rgb[k]), text))
    return draw_legend(city, fabric, f"{city.name}: classes of objects", Key(entries), zoom)


def _borders(pavement: Pavement, zoom: int) -> np.ndarray:
    """Mark the first picture row and column of each range block, bool ``(H·zoom, W·zoom)``."""
    index = pavement.index
    north, west = np.ones((2, *index.shape), bool)
    north[1:] = index[1:] != index[:-1]
    west[:, 1:] = index[:, 1:] != index[:, :-1]
    lines = np.zeros((pavement.height * zoom, pavement.width * zoom), bool)
    lines[::zoom] = north.repeat(zoom, axis=1)
    lines[:, ::zoom] |= west.repeat(zoom, axis=0)
    return lines


def values_end(known: np.ndarray) -> float:
    """Choose the end of the colour scale of a field: a round number above nearly all values."""
    usual = float(np.quantile(known, 0.995)) if known.size else 0.0
    return _round_up(usual or float(known.max(initial=0)))


def _round_up(value: float) -> float:
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / power * 0.999) * power
