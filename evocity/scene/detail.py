"""Levels of detail of a scene, in the sense of Biljecki 2016: footprints, blocks, parts, roofs."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from evocity.errors import MapError, is_whole, keyword, setting, spell
from evocity.formats import Group
from evocity.formats.materials import is_surface
from evocity.io.writers import TABLES
from evocity.views.surfaces import polygons_of

#: Levels from the finest to the coarsest, and the footprints.
LEVELS = ("2.2", "1.3", "1.2", "1.0", "afar", "0")

#: Levels that CityJSON has.
CITYJSON = frozenset(LEVELS) - {"afar"}
#: Times that the cells of "afar" are doubled for a budget of triangles.
_DOUBLED = 4
# Tolerance with which surfaces on the ground are simplified, metres.
_FLAT_TOLERANCE = {"1.2": 1.0, "1.0": 3.0}
# Least distance between a corner of a simplified surface and its other edges, metres.
_CLEAR = 2e-3


@dataclass(frozen=True)
class Level:
    """Level of detail of the walls of a scene.

    name : one of `LEVELS`.
    coarser : number of times that the cells of "afar" are doubled.
    error : greatest distance between this level and LoD 1.3, metres; the geometric error of 3D
        Tiles.
    """

    name: str
    coarser: int = 0

    @property
    def error(self) -> float:
        own = {"2.2": 0.0, "1.3": 1.0, "1.2": 4.0, "1.0": 10.0, "afar": 40.0, "0": 64.0}
        return own[self.name] * 2**self.coarser


def check_level(name: object) -> str:
    """Return the level of detail ``name``, one of `LEVELS`, or raise `MapError`."""
    if name not in LEVELS:
        raise MapError(
            f"the level of detail {spell(name)} is unknown",
            f"one of {', '.join(map(spell, LEVELS))}",
            f"leave {keyword('lod')} out for LoD 1.3",
        )
    return str(name)


def check_budget(triangles: Any) -> None:
    """Raise `MapError` unless ``triangles`` is None or a whole number of at least 12."""
    if triangles is not None and not is_whole(triangles, 12):
        raise MapError(
            f"{setting('triangles', triangles)} is out of range",
            "a whole number, 12 or more: a box has 12 triangles",
            f"choose a larger number, or leave {keyword('triangles')} out",
        )


def too_many(count: int, most: int | None) -> MapError:
    """Make the error for a scene whose coarsest level has ``count`` triangles, and not ``most``."""
    return MapError(
        f"{setting('triangles', most)} is too low: the coarsest level of the scene has {count}",
        f"{keyword('triangles')} of at least {count}",
        f"choose a larger {keyword('triangles')}, a smaller map, or no streets",
    )


def check_library(level: str) -> None:
    """Raise `MapError` for a ``level`` that merges buildings, which a library cannot replace."""
    if level not in ("2.2", "1.3"):
        raise MapError(
            f"LoD {level} merges buildings, or has only footprints",
            "LoD 1.3 or 2.2, if objects of a library replace buildings",
            f"leave {keyword('lod')} or {keyword('library')} out",
        )


def check_format(level: str, suffix: str, streets: bool = False) -> None:
    """Raise `MapError` if files with ``suffix`` cannot have the ``level``, or ``streets``."""
    if streets and suffix in TABLES and suffix != ".gpkg":
        raise MapError(
            f"streets cannot go into a {suffix} file",
            "a .gpkg file, because a GeoPackage can have several layers",
            "write a .gpkg, or leave streets out",
        )
    if level not in CITYJSON and suffix == ".city.json":
        raise MapError(
            'a .city.json file cannot have the level of detail "afar"',
            "for CityJSON, a level of its specification: 0, 1.0, 1.2, 1.3 or 2.2",
            "choose LoD 1.0, or write a .glb file",
        )
    if level == "2.2" and suffix in TABLES:
        raise MapError(
            f"a {suffix} file of footprints cannot have LoD 2.2, because it has no roofs",
            "for footprints, one of the levels 0, 1.0, 1.2, 1.3 and afar",
            "choose LoD 1.3, or write a .city.json file",
        )
    if level == "0" and suffix in (".stl", ".3mf"):
        raise MapError(
            f"a {suffix} file for a printer cannot have LoD 0, because it has no solids",
            "for prints, one of the levels 1.0, 1.2, 1.3, 2.2 and afar",
            "choose LoD 1.3, or write a .glb file",
        )


def detailed(groups: tuple[Group, ...], level: str) -> tuple[Group, ...]:
    """Adapt the ``groups`` of a scene to a ``level``.

    LoD 0 has footprints in place of solids, and no ground below them. LoD 1.2 and 1.0 have simpler
    surfaces on the ground, without kerbs. LoD 1.0 and "afar" have no objects lower than buildings.
    Below LoD 1.3, floors are not drawn.
    """
    if level in ("2.2", "1.3"):
        return groups
    solid = [group for group in groups if not is_surface(group)]
    flat = [_level(group) for group in groups if is_surface(group)]
    if level == "0":
        flat = simplify_ground(flat, 0.0) if len(flat) > 1 else _without_footprints(flat, solid)
        return (*flat, *map(_footprints, solid))
    if len(flat) > 1:
        flat = simplify_ground(flat, _FLAT_TOLERANCE[level])
    if level in ("1.0", "afar"):
        solid = [_take(group, _identified(group)) for group in solid]
    return (*flat, *(dataclasses.replace(group, floors=False) for group in solid))


def _level(group: Group) -> Group:
    """Lift a surface to the height of the other ground."""
    return dataclasses.replace(group, level=0.0, kerbs=None)


def _identified(group: Group) -> np.ndarray:
    """Mark the solids that are buildings, and not objects lower than buildings: bool ``(n,)``."""
    ids = group.attributes.get("id")
    return (
        np.ones(len(group), bool) if ids is None else np.array([k is not None for k in ids], bool)
    )


def _take(group: Group, rows: np.ndarray) -> Group:
    return group if rows.all() else group.take(np.flatnonzero(rows))


def _footprints(group: Group) -> Group:
    """Return the footprints of solids, with their height as an attribute."""
    heights = [round(float(height), 3) for height in group.heights]
    flat = dict(group.attributes) | {"measuredHeight": heights}
    return dataclasses.replace(group, heights=np.zeros(len(group)), attributes=flat)


def _without_footprints(flat: list[Group], solid: list[Group]) -> list[Group]:
    """Cut the footprints of solids out of the ground."""
    standing = shapely.union_all(np.concatenate([group.polygons for group in solid]))
    found = []
    for group in flat:
        parts, of = polygons_of(shapely.difference(group.polygons, standing))
        found.append(dataclasses.replace(group.take(of), polygons=parts))
    return found


def simplify_ground(flat: list[Group], tolerance: float) -> list[Group]:
    """Simplify level surfaces on the ground together, as one coverage. Edges along
    buildings keep their points. A surface that would touch itself keeps all its points."""
    polygons = np.concatenate([np.empty(0, object), *(group.polygons for group in flat)])
    if not tolerance or not shapely.coverage_is_valid(polygons):
        return flat
    simple, rows = polygons.copy(), np.arange(len(polygons))
    while len(rows):
        made = shapely.coverage_simplify(polygons[rows], tolerance, simplify_boundary=False)
        simple[rows] = made
        close = shapely.minimum_clearance(made)
        touching = close < np.minimum(_CLEAR, shapely.minimum_clearance(polygons[rows]))
        if not touching.any():
            break
        simple[rows[touching]] = polygons[rows[touching]]
        rows = rows[~touching]
    parts = np.split(simple, np.cumsum([len(group) for group in flat])[:-1])
    return [
        dataclasses.replace(group, polygons=own) for group, own in zip(flat, parts, strict=True)
    ]


def levels_from(name: str) -> Iterator[Level]:
    """Yield the level ``name`` and all coarser levels with solids, to the coarsest."""
    names = [level for level in LEVELS if level != "0"]
    if name not in names:
        yield Level(name)
        return
    yield from (Level(level) for level in names[names.index(name) :])
    yield from (Level("afar", coarser) for coarser in range(1, _DOUBLED + 1))
