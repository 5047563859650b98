"""Simple 3D Buildings of OpenStreetMap: parts of buildings replace the outlines that they stand in.

A part belongs to an outline if half of the part's area lies in it. The outline's own height is that
of its highest part, so the outline gives way to its parts. If an outline is lower than a part of
it, or has no height, its tags describe the rest of the building: the ground outside the parts.
"""

import math
from collections.abc import Sequence

import numpy as np
import shapely

from evocity.io.account import REPLACED, Account
from evocity.io.building_rest import DEGREE, rest_of
from evocity.io.heights import height_of
from evocity.io.openstreetmap.elements import Tags
from evocity.io.polygon_repair import repair_polygons

# Heights that differ by less are equal, metres.
_STEP = 0.5


def replace_outlines(
    polygons: np.ndarray, tags: Sequence[Tags], account: Account
) -> tuple[np.ndarray, list[Tags]]:
    """Replace outlines by their parts, in ``polygons`` of degrees with their ``tags``, and count in
    ``account`` those that no rest is left of. Parts without a height take their outline's tags."""
    tags, polygons = list(tags), polygons.copy()
    parts = np.array([_is_part(own) for own in tags], dtype=bool)
    pairs = _pairs(polygons, np.flatnonzero(parts), np.flatnonzero(~parts))
    if not pairs:
        return polygons, tags
    kept = np.ones(len(tags), bool)
    for outline, inside in pairs.items():
        height, rule = height_of(tags[outline], 0.0)
        for part in inside:
            if height_of(tags[part], 0.0)[1] == "default":
                tags[part] = {**tags[outline], **tags[part]}
        tallest = max(height_of(tags[part], 0.0)[0] for part in inside)
        rest = None
        if rule == "default" or height < tallest - _STEP:
            middle = math.radians(polygons[outline].centroid.y)
            scale = DEGREE * np.array([math.cos(middle), 1.0])
            rest = rest_of(polygons[outline], polygons[inside], scale)
        if rest is None:
            kept[outline] = False
            account.drop(REPLACED)
        else:
            polygons[outline] = rest
    return polygons[kept], [own for own, stays in zip(tags, kept, strict=True) if stays]


def _is_part(tags: Tags) -> bool:
    return tags.get("building:part") not in (None, "", "no")


def _pairs(polygons: np.ndarray, parts: np.ndarray, outlines: np.ndarray) -> dict[int, list[int]]:
    """Return the parts of each outline that has some, by their numbers; `polygons` that take part
    are repaired in place."""
    if not len(parts) or not len(outlines):
        return {}
    tree = shapely.STRtree(polygons[outlines])
    one, other = tree.query(polygons[parts])  # by their bounds
    part, outline = parts[one], outlines[other]
    near = np.zeros(len(polygons), bool)
    near[part] = near[outline] = True
    polygons[:], tangled = repair_polygons(polygons, near)
    sound = ~(tangled[part] | tangled[outline])
    part, outline = part[sound], outline[sound]
    common = shapely.area(shapely.intersection(polygons[part], polygons[outline]))
    inside = common > 0.5 * shapely.area(polygons[part])
    pairs: dict[int, list[int]] = {}
    for number, at in zip(outline[inside].tolist(), part[inside].tolist(), strict=True):
        pairs.setdefault(number, []).append(at)
    return pairs
