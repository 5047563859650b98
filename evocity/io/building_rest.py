"""Rest of a building's outline outside its parts, for OpenStreetMap and CityJSON."""

import numpy as np
import shapely

# The share of an outline that its parts may leave over, without a rest of its own.
_LEAST_REST = 0.05
# The least width of a rest, metres.
_SLIVER = 1.0

#: Metres of a degree of latitude.
DEGREE = 111_195.0


def rest_of(
    outline: shapely.Geometry, parts: np.ndarray, scale: np.ndarray
) -> shapely.Geometry | None:
    """Return the rest of an ``outline`` outside its ``parts``, without slivers; None if it is
    small. ``scale``: metres of a unit of x and of y."""
    corner = np.array(outline.bounds[:2])
    rest = shapely.transform(
        shapely.difference(outline, shapely.union_all(parts)), lambda at: (at - corner) * scale
    )
    rest = rest.buffer(-_SLIVER / 2, join_style="mitre").buffer(_SLIVER / 2, join_style="mitre")
    rest = shapely.transform(rest, lambda at: at / scale + corner)
    return rest if rest.area > _LEAST_REST * outline.area else None
