"""The ground of a scene: streets with kerbs, squares, courts, green and water, as one coverage with
the buildings."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from evocity.citymap import CityMap
from evocity.formats import Group
from evocity.formats.kerbs import KERB
from evocity.formats.materials import GROUND, surface_colour
from evocity.formats.trees import form_of
from evocity.scene.noding import without_nodes
from evocity.views.buildings import outlines
from evocity.views.connected_components import pieces
from evocity.views.surfaces import KINDS
from evocity.views.walls import Walls


class Ground(NamedTuple):
    """Surfaces on the ground, in groups, and the walls of the buildings between them: in metres
    from the south-west corner of the map. ``plain`` are the walls on which roofs stand: without the
    corners at which only kinds of ground meet."""

    groups: list[Group]
    walls: Walls
    plain: Walls


def bare_ground(city: CityMap) -> list[Group]:
    """Return the ground of a scene without streets: one group, which also lies below buildings."""
    pixel = city.metres_per_pixel
    deep, wide = (side * pixel for side in city.shape)
    if city.site is None:
        return [_group("ground", np.array([shapely.box(0, 0, wide, deep)], dtype=object))]
    parts = outlines(pieces(city.site)[0], pixel, (0.0, deep))
    return [_group("ground", np.array(parts, dtype=object))]


def paved_ground(
    city: CityMap,
    walls: Walls,
    polygons: np.ndarray,
    water: np.ndarray | None = None,
    roofs: bool = True,
) -> Ground:
    """Return the ground of a scene with streets: a group for each kind of `KINDS` that occurs, and
    always ``ground`` and ``street``. All polygons, and those of the walls, are one valid coverage.

    polygons : the footprints of the ``walls``, objects ``(n,)``, in metres from the south-west
        corner. water : bool ``(H, W)``, open ground that is water, or None. roofs : whether
        roofs stand on the walls; otherwise ``plain`` has all corners.
    """
    cover = city.ground_cover(polygons, water)
    groups = []
    for kind in KINDS:
        rows = np.flatnonzero(cover.kinds == kind)
        if not len(rows) and kind not in ("ground", "street"):
            continue
        group = _group(kind, cover.surfaces[rows])
        if kind == "street":
            streets = {"kind": cover.streets[rows].tolist()}
            group = replace(group, attributes=streets, level=-KERB, kerbs=cover.kerbs)
        elif kind == "square":
            squares = {"place": (cover.squares[rows] + 1).tolist()}
            group = replace(group, attributes=squares)
        groups.append(group)
    plain = noded = replace(walls, polygons=tuple(cover.buildings))
    if roofs:
        made = without_nodes(cover.buildings, polygons, cover.grid)
        plain = replace(walls, polygons=tuple(made))
    return Ground(groups, noded, plain)


def below_trees(surfaces: Sequence[Group], objects: Sequence[Group]) -> list[Group]:
    """Return the ``surfaces`` with ground below those ``objects`` whose common shape, such as a
    trunk, does not fill their footprint."""
    footprints = [
        group.polygons[[own is not None for own in group.attributes["id"]]]
        for group in objects
        if form_of(group) is not None and "id" in group.attributes
    ]
    polygons = np.concatenate([np.empty(0, object), *footprints])
    found = []
    for group in surfaces:
        if group.name == "ground" and len(polygons):
            group = _group("ground", np.concatenate([group.polygons, polygons]))
        found.append(group)
    return found


def _group(kind: str, polygons: np.ndarray) -> Group:
    colour, heights = surface_colour(kind), np.zeros(len(polygons))
    return Group(kind, colour, polygons, heights, city_object=GROUND[kind])
