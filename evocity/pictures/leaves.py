"""Pictures of the range blocks of a code, over its map."""

from dataclasses import dataclass

import numpy as np
from PIL import Image

from evocity.citymap import CityMap
from evocity.pavement import Pavement
from evocity.pictures.colours import INK, PAPER, scale_end
from evocity.pictures.legend import draw_with_scale
from evocity.pictures.picture import render

#: The least number of picture pixels a map pixel, so that lines stay distinct.
CLOSEST = 4

# Opacity of lines on pale pixels and on dark ones; the greatest level of dark pixels.
_ON_PALE, _ON_DARK, _DARK = 0.5, 0.35, 105


@dataclass(frozen=True, eq=False)
class Leaves:
    """The range blocks of a code, together with a map.

    city : the map, usually the decoded one; its name and attribution go into every picture.
    pavement : the range blocks, for a map of the same size as the city.
    """

    city: CityMap
    pavement: Pavement

    @property
    def title(self) -> str:
        p = self.pavement
        return f"{len(p)} range blocks of {_sides(p)} px"


def render_leaves(leaves: Leaves, *, legend: bool = True, zoom: int = CLOSEST) -> Image.Image:
    """Draw a map with the borders of its range blocks. Each border is a line of one picture pixel
    along the north and west sides of a block. The line is dark on pale heights and pale on dark
    heights. Use ``legend`` and ``zoom`` as in `render`. Below a zoom of 4 the borders of blocks of
    2 px run together."""
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


def _sides(pavement: Pavement) -> str:
    return f"{pavement.block}" if pavement.uniform else f"{pavement.finest}…{pavement.coarsest}"
