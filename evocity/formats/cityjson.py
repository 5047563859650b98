"""CityJSON 2.0: solids of LoD 1.2; those of buildings with floors, walls and roofs told apart."""

import json
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from evocity.formats.solids import About, Group, oriented

#: Vertices are whole numbers of millimetres.
SCALE = 0.001

#: Attributes of the first object by which a map is read back: its reference system, the middle of
#: its window there, and metres a pixel.
PLACE = ("evocity_crs", "evocity_center", "evocity_pixel")

#: What a surface is, by its place in ``semantics``.
_SURFACES = ("GroundSurface", "WallSurface", "RoofSurface")

_Rings = list[list[tuple[int, int]]]


def cityjson(groups: Sequence[Group], about: About) -> str:
    """A CityJSON document: an object each solid and each surface of the ``groups``.

    Source: CityJSON 2.0.1 specification (cityjson.org).
    """
    vertices = _Vertices()
    objects = {name: found for group in groups for name, found in _objects(group, vertices)}
    for first in list(objects.values())[:1]:
        first["attributes"] = _told(about) | first["attributes"]
    document = {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [SCALE] * 3, "translate": [*about.offset, 0.0]},
        "metadata": _metadata(groups, about),
        "CityObjects": objects,
        "vertices": list(vertices.numbers),
    }
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


class _Vertices:
    """Points of whole numbers, each once."""

    def __init__(self):
        self.numbers: dict[tuple[int, int, int], int] = {}

    def of(self, ring: list[tuple[int, int]], z: int) -> list[int]:
        numbers = self.numbers
        return [numbers.setdefault((x, y, z), len(numbers)) for x, y in ring]


def _metadata(groups: Sequence[Group], about: About) -> dict:
    (x, y), (wide, deep) = about.offset, about.size
    top = max((float(one.heights.max()) for one in groups if len(one)), default=0.0)
    found = {"title": about.name, "geographicalExtent": [x, y, 0.0, x + wide, y + deep, top]}
    if about.crs and (code := re.fullmatch(r"(\w+):(\w+)", about.crs)):
        authority, number = code.groups()
        found["referenceSystem"] = f"https://www.opengis.net/def/crs/{authority}/0/{number}"
    return found


def _told(about: About) -> dict:
    """What the whole scene's attributes are; CityJSON's metadata has no room for them."""
    found = {"name": about.name, "attribution": about.attribution, PLACE[0]: about.crs}
    found |= {PLACE[1]: list(about.window[:2]), PLACE[2]: about.window[2]}
    measures = {name: value for name, value in about.measures.items() if math.isfinite(value)}
    return {key: value for key, value in found.items() if value} | measures


def _objects(group: Group, vertices: _Vertices) -> Iterator[tuple[str, dict]]:
    tall = np.round(group.heights / SCALE).astype(np.int64).tolist()
    for number, (rings, high) in enumerate(zip(_rings(group), tall, strict=True)):
        told = ((name, column[number]) for name, column in group.attributes.items())
        attributes = {name: value for name, value in told if value is not None}
        kind = group.city_objects[number]
        if high:
            attributes = {"measuredHeight": round(high * SCALE, 3)} | attributes
        geometry = _solid(rings, high, vertices) if high else _surface(rings, vertices)
        if high and kind == "Building":
            geometry["semantics"] = _semantics(len(geometry["boundaries"][0]))
        found = {
            "type": kind,
            "attributes": {"class": group.name} | attributes,
            "geometry": [geometry],
        }
        yield f"{group.name}-{number + 1}", found


def _rings(group: Group) -> list[_Rings]:
    """Of each polygon its rings in whole numbers, without points that rounding laid on others."""
    points, ring, which = oriented(group.polygons)
    found: list[_Rings] = [[] for _ in range(len(group))]
    if len(ring):
        flat = np.round(points / SCALE).astype(np.int64)
        starts = np.flatnonzero(np.r_[True, ring[1:] != ring[:-1]])
        owners = which[ring[starts]].tolist()
        for one, owner in zip(np.split(flat, starts[1:]), owners, strict=True):
            own = [tuple(point) for point in one.tolist()]
            own = [b for a, b in zip([own[-1], *own[:-1]], own, strict=True) if a != b]
            if len(own) >= 3:
                found[owner].append(own)
    return found


def _surface(rings: _Rings, vertices: _Vertices) -> dict:
    boundary = [vertices.of(one, 0) for one in rings]
    return {"type": "MultiSurface", "lod": "0", "boundaries": [boundary]}


def _solid(rings: _Rings, high: int, vertices: _Vertices) -> dict:
    floor = [vertices.of(one, 0) for one in rings]
    roof = [vertices.of(one, high) for one in rings]
    walls = [
        [[a, b, over_b, over_a]]
        for below, above in zip(floor, roof, strict=True)
        for a, b, over_b, over_a in zip(
            below, below[1:] + below[:1], above[1:] + above[:1], above, strict=True
        )
    ]
    shell = [[one[::-1] for one in floor], *walls, roof]
    return {"type": "Solid", "lod": "1.2", "boundaries": [shell]}


def _semantics(surfaces: int) -> dict:
    """Of a shell: its floor, its walls, its roof."""
    return {
        "surfaces": [{"type": name} for name in _SURFACES],
        "values": [[0, *[1] * (surfaces - 2), 2]],
    }
