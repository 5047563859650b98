"""Where the range blocks of a code lie, drawn over its map."""

from dataclasses import dataclass

import numpy as np
from PIL import Image

from evocity.citymap import CityMap
from evocity.pavement import Pavement
from evocity.pictures.colours import INK, PAPER, scale_end
from evocity.pictures.legend import on_sheet
from evocity.pictures.picture import render

#: Picture pixels a map pixel, at least: closer lines could not be told from each other.
CLOSEST = 4

# How much of a border's colour is the line's, on pale pixels and on dark ones; what is dark.
_ON_PALE, _ON_DARK, _DARK = 0.5, 0.35, 105


@dataclass(frozen=True, eq=False)
class Leaves:
    """The range blocks of a code and the map they lie on.

    city : the map, usually the decoded one; its name and attribution go into every picture.
    pavement : the range blocks, of a map of the same size.
    """

    city: CityMap
    pavement: Pavement

    @property
    def title(self) -> str:
        p = self.pavement
        return f"{len(p)} range blocks of {_sides(p)} px"


def render_leaves(leaves: Leaves, *, legend: bool = True, zoom: int = CLOSEST) -> Image.Image:
    """Draw a map with the borders of its range blocks: a line of one picture pixel, dark on pale
    heights and pale on dark ones, along the north and the west of each. ``legend`` and ``zoom``
    are as in `render`; below a zoom of 4 borders of 2 px lie too close to be told apart."""
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
    return on_sheet(city, fabric, title, end, zoom) if legend else fabric


def _borders(pavement: Pavement, zoom: int) -> np.ndarray:
    """Bool ``(H·zoom, W·zoom)``: the first picture row and column of each range block."""
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


__all__ = ["CLOSEST", "Leaves", "render_leaves"]
