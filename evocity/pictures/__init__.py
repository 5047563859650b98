"""Pictures of maps, coloured and with a legend.

- `field`: what a picture shows besides heights: `Field`, `Shares`, `Leaves`, `Faces`, `Change`
- `picture`: pictures of a map, a field, shares, leaves, faces, a change, and classes of objects
- `colours`: of heights, values, changes and source cities
- `legend`: title, scale or key, scale bar and attribution around a picture
- `light`: cast shadows, edges of roofs
- `sheet`: many maps on one contact sheet
"""

from evocity.pictures.colours import city_colours
from evocity.pictures.field import Change, Faces, Field, Leaves, Shares
from evocity.pictures.picture import (
    render,
    render_change,
    render_classes,
    render_faces,
    render_field,
    render_leaves,
    render_shares,
)

__all__ = [
    "Change",
    "Faces",
    "Field",
    "Leaves",
    "Shares",
    "city_colours",
    "render",
    "render_change",
    "render_classes",
    "render_faces",
    "render_field",
    "render_leaves",
    "render_shares",
]
