"""Maps as pictures, coloured and with a legend.

- `field`: values on a city's grid that are no heights: `Field`, `Shares`
- `change`: what one city has more and less than another: `Change`
- `picture`: a map, a field, shares, or a change, as a picture
- `colours`: of heights, values and changes
- `legend`: title, scale or key, scale bar and attribution around a picture
- `light`: cast shadows, edges of roofs
- `palette`: one colour a source city, everywhere
- `classes`: what stands on a map, each class in its colour
- `leaves`: the range blocks of a code, over its map
- `sheet`: many maps on one contact sheet
"""

from evocity.pictures.change import Change
from evocity.pictures.classes import render_classes
from evocity.pictures.field import Field, Shares
from evocity.pictures.leaves import Leaves, render_leaves
from evocity.pictures.palette import city_colours
from evocity.pictures.picture import render, render_change, render_field, render_shares

__all__ = [
    "Change",
    "Field",
    "Leaves",
    "Shares",
    "city_colours",
    "render",
    "render_change",
    "render_classes",
    "render_field",
    "render_leaves",
    "render_shares",
]
