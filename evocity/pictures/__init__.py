"""Pictures of maps, coloured and with a legend.

- `field`: values on a city's grid other than heights: `Field`, `Shares`, `Change`
- `picture`: pictures of a map, a field, shares, a change, and classes of objects
- `colours`: of heights, values, changes and source cities
- `legend`: title, scale or key, scale bar and attribution around a picture
- `light`: cast shadows, edges of roofs
- `leaves`: the range blocks of a code, over its map
- `sheet`: many maps on one contact sheet
"""

from evocity.pictures.colours import city_colours
from evocity.pictures.field import Change, Field, Shares
from evocity.pictures.leaves import Leaves, render_leaves
from evocity.pictures.picture import (
    render,
    render_change,
    render_classes,
    render_field,
    render_shares,
)

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
