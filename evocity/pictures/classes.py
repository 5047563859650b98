"""A map as a picture of what stands on it, each class of objects in its colour."""

import numpy as np
from PIL import Image

from evocity.citymap import CityMap, Classes
from evocity.pictures.colours import GROUND
from evocity.pictures.legend import drawn_with_key
from evocity.pictures.light import lit


def render_classes(
    city: CityMap, classes: Classes | None = None, *, legend: bool = True, zoom: int = 1
) -> Image.Image:
    """Draw what stands on a city in the colours of its class, with shadows and the edges of roofs.

    ``classes``: of the city, by another table than this package's (`CityMap.classified`); None for
    `CityMap.classes`. The legend names those that there are, with how many objects and what share
    of the map they cover, the largest first; ``legend`` and ``zoom`` are as in `render`.
    """
    found = city.classes if classes is None else classes
    palette = np.concatenate([[GROUND], found.table.rgb]).astype(np.uint8)
    colours = palette[found.image].repeat(zoom, axis=0).repeat(zoom, axis=1)
    fabric = Image.fromarray(lit(city, colours, zoom))
    if not legend:
        return fabric
    entries = []
    for k in sorted(range(len(found.names)), key=lambda k: -found.areas[found.names[k]]):
        name = found.names[k]
        if found.counts[name]:
            share = 100 * found.areas[name] / city.area
            text = f"{name}: {found.counts[name]}, {share:.2g} %"
            entries.append((tuple(int(c) for c in found.table.rgb[k]), text))
    return drawn_with_key(city, fabric, f"{city.name}: classes of objects", entries, zoom)


__all__ = ["render_classes"]
