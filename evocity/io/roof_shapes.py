"""Shapes of roofs from a source: ``roof:shape`` of OpenStreetMap, ``roof_shape`` of Overture."""

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

#: Shapes of roofs that scenes have, by their values in OpenStreetMap.
SHAPES = ("flat", "skillion", "gabled", "hipped", "pyramidal")

# Values of other shapes, as the shape that is nearest.
_NEAREST = {
    "lean_to": "skillion",
    "half-hipped": "hipped",
    "half_hipped": "hipped",
    "side_half-hipped": "hipped",
    "mansard": "hipped",
    "hipped-and-gabled": "hipped",
    "quadruple_saltbox": "hipped",
    "double_saltbox": "gabled",
    "saltbox": "gabled",
    "gambrel": "gabled",
    "round": "gabled",
    "cone": "pyramidal",
    "dome": "pyramidal",
    "onion": "pyramidal",
    "spherical": "pyramidal",
}


def roof_shapes_of(polygons: np.ndarray, tags: Sequence[Mapping[str, object]]) -> np.ndarray | None:
    """Return the shapes of roofs that the ``tags`` of ``polygons`` give, float64 ``(n, 4)``: a
    point in each such polygon, x and y, the number of the shape in `SHAPES`, and the area in m².
    None if there are none. Unknown shapes do not count."""
    shapes = [_shape(one) for one in tags]
    rows = [k for k, shape in enumerate(shapes) if shape is not None]
    if not rows:
        return None
    points = shapely.get_coordinates(shapely.point_on_surface(polygons[rows]))
    numbers = [SHAPES.index(str(shapes[k])) for k in rows]
    return np.column_stack([points, numbers, shapely.area(polygons[rows])])


def _shape(tags: Mapping[str, object]) -> str | None:
    for name, value in tags.items():
        if name.casefold().replace(":", "_") == "roof_shape" and value:
            shape = str(value).strip().casefold()
            shape = _NEAREST.get(shape, shape)
            return shape if shape in SHAPES else None
    return None
