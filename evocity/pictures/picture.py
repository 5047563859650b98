"""Pictures of maps, fields, shares, changes and classes, with light from the north-west."""

import math

import numpy as np
from PIL import Image

from evocity.citymap import STOREY, CityMap, Classes
from evocity.pictures.colours import (
    GROUND,
    change_colours,
    city_colours,
    field_colours,
    oklab,
    ramp,
    rgb,
    scale_end,
    srgb,
)
from evocity.pictures.field import Change, Field, Shares
from evocity.pictures.legend import Key, Scale, draw_legend, draw_with_scale
from evocity.pictures.light import add_light, edges

# Lightness of roofs in `render_shares`, from the lowest to the highest; how pale its ground is.
_LIGHTER, _DARKER, _PALE = 0.08, 0.26, 0.68


def render(
    city: CityMap, *, highest: float | None = None, legend: bool = True, zoom: int = 1
) -> Image.Image:
    """Draw a map.

    Parameters
    ----------
    highest : height in metres at which the colour scale ends; None takes `scale_end`. Use the same
        number for all pictures that you compare.
    legend : whether to add the name, colour scale, scale bar and attribution. Without the legend
        the picture is the bare map, ``(H·zoom, W·zoom)``, and the caller must show the attribution.
    zoom : number of picture pixels per map pixel.

    Returns
    -------
    PIL.Image : the picture, in RGB.
    """
    end = scale_end(city) if highest is None else float(highest)
    fabric = Image.fromarray(_shade_heights(city, end, zoom))
    return draw_with_scale(city, fabric, city.name, end, zoom) if legend else fabric


def render_field(field: Field, *, zoom: int = 1) -> Image.Image:
    """Draw values on a city's grid, with the edges of roofs and the legend of `render`. The colour
    scale runs evenly from 0 to a round number above nearly all values. Missing values (NaN) are
    grey."""
    values = np.asarray(field.values, np.float32)
    known = values[~np.isnan(values)]
    top = float(known.max(initial=0))
    end = _round_up(float(np.quantile(known, 0.995) if known.size else 0) or top)
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


def render_shares(shares: Shares, *, legend: bool = True, zoom: int = 1) -> Image.Image:
    """Draw the shares of parts in a city. Each part has a colour (`city_colours`); each pixel mixes
    these colours by its weights. Higher roofs are darker, and ground is pale. The legend lists the
    parts with their shares of the whole map, the largest first. Use ``legend`` and ``zoom`` as in
    `render`."""
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
    """Draw the difference of two cities: red where the second is higher, blue where it is lower.
    The legend is as in `render`."""
    city = change.second.replace(change.second.heights, attribution=change.attribution)
    colours = change_colours(change.metres, change.end).repeat(zoom, axis=0).repeat(zoom, axis=1)
    end = change.end
    note = f"{change.apart:.0%} by over\n{STOREY:g} m"
    scale = Scale("more, m", end, lambda shown: change_colours(shown, end), note, -end)
    title = f"{change.second.name} less {change.first.name}"
    return draw_legend(city, Image.fromarray(colours), title, scale, zoom)


def render_classes(
    city: CityMap, classes: Classes | None = None, *, legend: bool = True, zoom: int = 1
) -> Image.Image:
    """Draw the objects on a city in the colours of their classes, with shadows and edges of roofs.

    classes: the city's classes by a table of your own, see `CityMap.classified`; None takes
    `CityMap.classes`. The legend lists the classes with their number of objects and share of the
    map, the largest first. Use ``legend`` and ``zoom`` as in `render`.
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


def _round_up(value: float) -> float:
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / power * 0.999) * power


def _shade_heights(city: CityMap, end: float, zoom: int) -> np.ndarray:
    heights = city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1)
    return add_light(city, ramp(heights, end), zoom)
