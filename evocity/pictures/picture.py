"""A map as a picture: heights on an even scale of colours, light from the north-west."""

import math

import numpy as np
from PIL import Image

from evocity.citymap import CityMap
from evocity.pictures.change import STOREY, Change
from evocity.pictures.colours import (
    GROUND,
    change_colours,
    even,
    oklab,
    ramp,
    rgb,
    scale_end,
    srgb,
)
from evocity.pictures.field import Field, Shares
from evocity.pictures.legend import Scale, drawn_with_key, legended, on_sheet
from evocity.pictures.light import edges, lit
from evocity.pictures.palette import city_colours

# Lightness of roofs in `render_shares`, from the lowest to the highest; how pale its ground is.
_LIGHTER, _DARKER, _PALE = 0.08, 0.26, 0.68


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
    scale = Scale(unit, end, lambda shown: even(shown, end), "\n".join(notes))
    title = f"{field.city.name}: {field.title}"
    return legended(field.city, Image.fromarray(colours), title, scale, zoom)


def render_shares(shares: Shares, *, legend: bool = True, zoom: int = 1) -> Image.Image:
    """Draw who has which part of a city: a colour for each part (`city_colours`), mixed as the
    weights are. Roofs are darker the higher they are, ground is pale. The legend
    names the parts and their shares of the whole map, the largest first; ``legend`` and ``zoom``
    are as in `render`."""
    city, weights = shares.city, np.asarray(shares.weights)
    hues = oklab(np.array([rgb(colour) for colour in city_colours(shares.parts)]) / 255)
    mixed = weights.reshape(-1, len(hues)) @ hues
    roofs = np.clip(city.heights.ravel() / scale_end(city), 0, 1)
    built = city.built.ravel()
    mixed[:, 0] += np.where(built, _LIGHTER - _DARKER * roofs, 0)
    mixed[~built] += _PALE * (oklab(np.array([GROUND]) / 255) - mixed[~built])
    colours = np.round(srgb(mixed) * 255).reshape(*city.shape, 3)
    fabric = Image.fromarray(lit(city, colours.repeat(zoom, axis=0).repeat(zoom, axis=1), zoom))
    if not legend:
        return fabric
    whole = weights.mean(axis=(0, 1), dtype=float)
    plain = np.round(srgb(hues) * 255).astype(int)
    entries = [
        (tuple(int(c) for c in plain[part]), f"{shares.parts[part]}, {100 * whole[part]:.3g} %")
        for part in np.argsort(-whole, kind="stable")
        if whole[part] > 0
    ]
    return drawn_with_key(city, fabric, f"{city.name}: {shares.title}", entries, zoom)


def render_change(change: Change, *, zoom: int = 1) -> Image.Image:
    """Draw what one city has more (red) and less (blue) than another, with the legend of
    `render`."""
    city = change.second.replace(change.second.heights, attribution=change.attribution)
    colours = change_colours(change.metres, change.end).repeat(zoom, axis=0).repeat(zoom, axis=1)
    end = change.end
    note = f"{change.apart:.0%} by over\n{STOREY:g} m"
    scale = Scale("more, m", end, lambda shown: change_colours(shown, end), note, -end)
    title = f"{change.second.name} less {change.first.name}"
    return legended(city, Image.fromarray(colours), title, scale, zoom)


def _rounded_up(value: float) -> float:
    """The next number of one digit and a power of ten; 1 for nothing."""
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / power * 0.999) * power


def _shaded(city: CityMap, end: float, zoom: int) -> np.ndarray:
    """Colours with cast shadows and roof edges, uint8 ``(H·zoom, W·zoom, 3)``."""
    heights = city.heights.repeat(zoom, axis=0).repeat(zoom, axis=1)
    return lit(city, ramp(heights, end), zoom)


__all__ = ["render", "render_change", "render_field", "render_shares"]
