"""CityJSON 2.0: solids of LoD 1.2; surfaces of buildings are floors, walls and roofs."""

import itertools
import json
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from evocity.formats.solids import About, Group, Rings, number_rows

#: Vertices are whole numbers of millimetres.
SCALE = 0.001

#: Attributes of the first object for reading a map again: its reference system, the middle of its
#: window there, and metres a pixel.
PLACE = ("evocity_crs", "evocity_center", "evocity_pixel")

_text = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode

# Types of a solid's surfaces, by their index in ``values``.
_SURFACES = _text([{"type": f"{part}Surface"} for part in ("Ground", "Wall", "Roof")])


def cityjson(groups: Sequence[Group], about: About) -> str:
    """Write a CityJSON document (specification 2.0.1, cityjson.org), with an object for each solid
    and surface of the ``groups``."""
    # long arrays become text directly: lists of numbers for json would take most of the time
    rings = [group.rings.on_grid(SCALE) for group in groups]
    tall = [np.round(group.heights / SCALE).astype(np.int64) for group in groups]
    levels = [np.empty((0, 3), np.int64)]
    for own, high in zip(rings, tall, strict=True):
        owner = own.owner
        levels += [np.column_stack([own.points, z]) for z in (0 * owner, high[owner])]
    corners = np.concatenate(levels)
    number = number_rows(corners)
    vertices = np.empty((number.max(initial=-1) + 1, 3), np.int64)
    vertices[number] = corners
    corner, vertices = _placed(vertices, about)
    of_levels = np.split(number, np.cumsum([len(level) for level in levels]))[1:-1]
    objects, first = [], _scene_attributes(about)
    for k, group in enumerate(groups):
        floor, roof = of_levels[2 * k : 2 * k + 2]
        for name, kind, attributes, geometry in _objects(group, rings[k], tall[k], floor, roof):
            listed, first = _text(first | attributes), {}
            members = f'"type":"{kind}","attributes":{listed},"geometry":[{{{geometry}}}]'
            objects.append(f"{_text(name)}:{{{members}}}")
    document = {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [SCALE] * 3, "translate": [*corner, 0.0]},
        "metadata": _metadata(vertices, corner, groups, about),
    }
    flat = iter(vertices.ravel().tolist())
    listed = ",".join([f"[{x},{y},{z}]" for x, y, z in zip(flat, flat, flat, strict=True)])
    return f'{_text(document)[:-1]},"CityObjects":{{{",".join(objects)}}},"vertices":[{listed}]}}'


def _placed(vertices: np.ndarray, about: About) -> tuple[tuple[float, float], np.ndarray]:
    """Return the corner from which the ``vertices`` count, and the vertices, in the file's
    reference system."""
    if about.grid is None or not len(vertices):
        return about.offset, vertices
    points = about.grid[1](vertices[:, :2] * SCALE + about.offset)
    if not np.isfinite(points).all():
        return about.offset, vertices
    corner = np.floor(points.min(axis=0))
    placed = np.round((points - corner) / SCALE).astype(np.int64)
    return (float(corner[0]), float(corner[1])), np.column_stack([placed, vertices[:, 2]])


def _metadata(
    vertices: np.ndarray, corner: tuple[float, float], groups: Sequence[Group], about: About
) -> dict:
    (x, y), (wide, deep) = corner, about.size
    if about.grid is not None and len(vertices):
        wide, deep = (float(side) for side in vertices[:, :2].max(axis=0) * SCALE)
    top = max((float(group.heights.max()) for group in groups if len(group)), default=0.0)
    metadata = {"title": about.name, "geographicalExtent": [x, y, 0.0, x + wide, y + deep, top]}
    named = about.grid[0] if about.grid is not None else about.crs or ""
    if code := re.fullmatch(r"(\w+):(\w+)", named):
        authority, number = code.groups()
        metadata["referenceSystem"] = f"https://www.opengis.net/def/crs/{authority}/0/{number}"
    return metadata


def _scene_attributes(about: About) -> dict:
    """Collect the whole scene's attributes, for which CityJSON's metadata has no members."""
    own = {"name": about.name, "attribution": about.attribution, PLACE[0]: about.crs}
    own |= {PLACE[1]: list(about.window[:2]), PLACE[2]: about.window[2]}
    measures = {name: value for name, value in about.measures.items() if math.isfinite(value)}
    return {key: value for key, value in own.items() if value} | measures


def _objects(
    group: Group, rings: Rings, tall: np.ndarray, floor: np.ndarray, roof: np.ndarray
) -> Iterator[tuple[str, str, dict, str]]:
    """Yield name, type, attributes and geometry of each object. ``floor`` and ``roof``: the vertex
    of each point of the ``rings`` on the ground, and the vertex ``tall`` units of `SCALE` above."""
    after = rings.after
    ways = (way.tolist() for way in (floor, floor[after], roof[after], roof))
    walls = [f"[[{a},{b},{c},{d}]]" for a, b, c, d in zip(*ways, strict=True)]
    below, above = (list(map(str, level.tolist())) for level in (floor, roof))
    starts, first = rings.starts.tolist(), rings.first(len(group)).tolist()
    for k, high in enumerate(tall.tolist()):
        spans = list(itertools.pairwise(starts[first[k] : first[k + 1] + 1]))
        kind = group.city_objects[k]
        attributes: dict = {"class": group.name}
        if high:
            attributes["measuredHeight"] = round(high * SCALE, 3)
            own = walls[starts[first[k]] : starts[first[k + 1]]]
            shell = ",".join([_surface(below, spans, -1), *own, _surface(above, spans, 1)])
            geometry = f'"type":"Solid","lod":"1.2","boundaries":[[{shell}]]'
            if kind == "Building":
                values = f"[[0{',1' * len(own)},2]]"
                geometry += f',"semantics":{{"surfaces":{_SURFACES},"values":{values}}}'
        else:
            surface = _surface(below, spans, 1)
            geometry = f'"type":"MultiSurface","lod":"0","boundaries":[{surface}]'
        values = ((name, column[k]) for name, column in group.attributes.items())
        attributes |= {name: value for name, value in values if value is not None}
        yield f"{group.name}-{k + 1}", kind, attributes, geometry


def _surface(names: list[str], spans: list[tuple[int, int]], way: int) -> str:
    """Write the rings at ``spans`` of ``names``, in direction ``way``, 1 or −1."""
    rings = [",".join(names[a:b][::way]) for a, b in spans]
    return f"[[{'],['.join(rings)}]]"
