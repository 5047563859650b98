"""Buildings among the objects of CityJSON: their footprints, and heights above their own foot.

A footprint is, in this order: the surfaces of the highest level of detail that say
``GroundSurface``; all faces of the lowest level of detail, seen from above. Each part of a building
counts as a building. An object gives way to its parts where they lie, if they have more detail: in
3DBAG the building has LoD 0 only. A part inherits attributes, but its own height comes first.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from evocity.io.account import DEGENERATE, EMPTY, NO_POLYGON, REPLACED, UNDERGROUND, Account
from evocity.io.building_feet import find_feet
from evocity.io.building_rest import rest_of
from evocity.io.heights import height_of, inherit, without_heights
from evocity.io.surfaces import WALL, shadow
from evocity.io.underground import is_underground

#: Types of objects that are buildings.
KINDS = ("Building", "BuildingPart", "BuildingUnit")
#: Other objects that stand on a map in evocity's own scenes.
BESIDE = ("CityFurniture", "SolitaryVegetationObject", "OtherConstruction")

# how deep surfaces (lists of rings) lie in `boundaries`
_DEPTH = {
    "MultiSurface": 0,
    "CompositeSurface": 0,
    "Solid": 1,
    "MultiSolid": 2,
    "CompositeSolid": 2,
}

# Heights that differ by less are equal, metres.
_STEP = 0.5
# Parents of an object that are parts themselves, at most.
_MOST_ANCESTORS = 32

Attributes = dict[str, Any]


@dataclass(frozen=True)
class Units:
    """Metres of a unit of x and y (``plan``), and of z (``up``)."""

    plan: np.ndarray
    up: float

    @property
    def area(self) -> float:
        """Square metres of a unit of area."""
        return float(self.plan[0] * self.plan[1])


@dataclass
class _Body:
    """An object with a footprint. ``low`` and ``high``: its lowest and highest point, metres;
    ``grounded``: whether a surface says that it is on the ground."""

    footprint: shapely.Geometry
    lod: str
    low: float
    high: float
    grounded: bool
    foot: float = 0.0
    parts: list["_Body"] = field(default_factory=list)


def read_objects(
    objects: Mapping[str, dict],
    vertices: np.ndarray,
    units: Units,
    kinds: Sequence[str],
    account: Account,
) -> tuple[list[shapely.Geometry], list[Attributes]]:
    """Read footprints and tags of the objects of some ``kinds``, and count them in ``account``.

    vertices : float64 ``(n, 3)``.
    """
    chosen = {name: item for name, item in objects.items() if item["type"] in kinds}
    above = {name: _ancestors(name, objects) for name in chosen}
    bodies: dict[str, _Body] = {}
    reasons: dict[str, str] = {}
    for name, item in chosen.items():
        body = _body(item.get("geometry") or [], vertices, units)
        if isinstance(body, str):
            reasons[name] = body
        else:
            bodies[name] = body
    groups: dict[str, list[_Body]] = {}
    for name, body in bodies.items():
        groups.setdefault((above[name] or [name])[-1], []).append(body)
        for ancestor in above[name]:
            if ancestor in bodies:
                bodies[ancestor].parts.append(body)
            elif ancestor in reasons:
                reasons[ancestor] = REPLACED
    for group in groups.values():
        feet = find_feet(
            [body.footprint for body in group],
            np.array([body.low for body in group]),
            np.array([body.high for body in group]),
            [body.grounded for body in group],
            float(units.plan.max()),
        )
        for body, foot in zip(group, feet.tolist(), strict=True):
            body.foot = foot
    account.features += len(chosen)
    for reason in reasons.values():
        account.drop(reason)
    polygons, tags = [], []
    for name, body in bodies.items():
        own = _tags(body, chosen[name], [objects[one] for one in above[name]], units)
        footprint = _without_parts(body, units)
        if is_underground(own):
            account.drop(UNDERGROUND)
        elif footprint is None:
            account.drop(REPLACED)
        else:
            polygons.append(footprint)
            tags.append(own)
    return polygons, tags


def _ancestors(name: str, objects: Mapping[str, dict]) -> list[str]:
    """List the parents of an object, the nearest first. Raises ValueError for a long chain."""
    listed: dict[str, None] = {}
    while parents := objects[name].get("parents"):
        name = parents[0]
        if name in listed or name not in objects:
            break
        listed[name] = None
        if len(listed) > _MOST_ANCESTORS:
            raise ValueError(f"an object has more than {_MOST_ANCESTORS} parents, each of the next")
    return list(listed)


def _attributes(item: Mapping) -> Attributes:
    attributes = item.get("attributes")
    return attributes if isinstance(attributes, dict) else {}


def _tags(body: _Body, item: Mapping, above: Sequence[Mapping], units: Units) -> Attributes:
    """Return the attributes of an object and its ancestors ``above``, with ``solid_height``. If the
    object has a height of its own, it inherits no height."""
    own, extent = dict(_attributes(item)), body.high - body.low
    height, rule = height_of(own, 0.0)
    stands_on_others = body.low > body.foot + _STEP and abs(height - extent) < _STEP
    in_feet = units.up != 1 and abs(height * units.up - extent) < _STEP
    if rule != "default" and (stands_on_others or in_feet):
        own = without_heights(own)  # which repeat the solid
    own = {"solid_height": body.high - body.foot if extent > 0 else 0.0} | own
    return inherit(own, map(_attributes, above))


def _without_parts(body: _Body, units: Units) -> shapely.Geometry | None:
    """Return the footprint of an object outside parts with more detail; None if that is small."""
    finer = [part.footprint for part in body.parts if part.lod > body.lod]
    if not finer:
        return body.footprint
    return rest_of(body.footprint, np.array(finer, dtype=object), units.plan)


def _body(geometries: list[dict], vertices: np.ndarray, units: Units) -> _Body | str:
    """Make the body of an object, or return the reason why it has no footprint."""
    geometries = [one for one in geometries if one["type"] in _DEPTH]
    if not geometries:
        return NO_POLYGON
    by_lod = sorted(geometries, key=lambda geometry: str(geometry.get("lod", "")))
    if not any(rings for one in by_lod for rings, _ in _surfaces(one)):
        return EMPTY
    finest = str(by_lod[-1].get("lod", ""))
    finest_ones = [one for one in by_lod if str(one.get("lod", "")) == finest]
    ground = [s for one in finest_ones for s, kind in _surfaces(one) if kind == "GroundSurface"]
    footprint = _shadow(ground or [s for s, _ in _surfaces(by_lod[0])], vertices, units)
    if footprint is None:
        return DEGENERATE
    spatial = [one for one in by_lod if not str(one.get("lod", "")).startswith("0")] or by_lod
    low, high = _heights(spatial, vertices).min(), _heights(finest_ones, vertices).max()
    return _Body(footprint, finest, float(low * units.up), float(high * units.up), bool(ground))


def _heights(geometries: list[dict], vertices: np.ndarray) -> np.ndarray:
    used = [i for g in geometries for s, _ in _surfaces(g) for ring in s for i in ring]
    return vertices[used, 2] if used else np.zeros(1)


def _surfaces(geometry: dict) -> Iterator[tuple[list, str | None]]:
    """Yield each surface (a list of rings of vertex indices) with its semantic type."""
    semantics = geometry.get("semantics") or {}
    types = [surface["type"] for surface in semantics.get("surfaces", [])]
    pairs = [(geometry["boundaries"], semantics.get("values"))]
    for _ in range(_DEPTH[geometry["type"]]):
        pairs = [
            (inner, None if values is None else values[i])
            for boundaries, values in pairs
            for i, inner in enumerate(boundaries)
        ]
    for boundaries, values in pairs:
        for i, surface in enumerate(boundaries):
            index = None if values is None else values[i]
            yield surface, None if index is None else types[index]


def _shadow(surfaces: list, vertices: np.ndarray, units: Units) -> shapely.Geometry | None:
    """Unite surfaces, seen from above; None if all are walls or degenerate."""
    rings = ([vertices[np.asarray(ring, dtype=np.intp)] for ring in own] for own in surfaces)
    return shadow(rings, WALL / units.area)
