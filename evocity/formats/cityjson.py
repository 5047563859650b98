"""CityJSON 2.0: solids, of LoD 1.3 by default; buildings consist of floors, walls and roofs."""

import itertools
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from evocity.formats.kerbs import kerb_edges
from evocity.formats.materials import names_of
from evocity.formats.numbering import number_rows
from evocity.formats.shells import WALL, Shells
from evocity.formats.solids import About, Group, Rings

#: Vertices are whole numbers of millimetres.
SCALE = 0.001

#: Attributes of the first object for reading a map again: its reference system, the middle of its
#: window there, and metres a pixel.
PLACE = ("evocity_crs", "evocity_center", "evocity_pixel")

_text = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode

# Types of a solid's surfaces, by their index in ``values``.
_SURFACES = _text([{"type": f"{part}Surface"} for part in ("Ground", "Wall", "Roof")])

_NO_RINGS = Rings(np.empty((0, 2), np.int64), np.zeros(1, np.int64), np.empty(0, np.int64))

# Types of a road's surfaces: carriageways, and pavements with their kerbs.
_TRAFFIC = _text([{"type": f"{part}TrafficArea"} for part in ("", "Auxiliary")])


def cityjson(groups: Sequence[Group], about: About) -> str:
    """Write a CityJSON document (specification 2.0.1, cityjson.org), with an object for each solid
    and surface of the ``groups``."""
    # long arrays become text directly: lists of numbers for json would take most of the time
    rings = [_NO_RINGS if one.is_draped else one.rings.on_grid(SCALE) for one in groups]
    tall = [np.round(group.heights / SCALE).astype(np.int64) for group in groups]
    kerbs = [_kerbs(own, group) for group, own in zip(groups, rings, strict=True)]
    levels = [np.empty((0, 3), np.int64)]
    for group, own, high, edges in zip(groups, rings, tall, kerbs, strict=True):
        tops = high if group.roofs is None else np.where(group.roofs.owned(len(group)), 0, high)
        below, above = 0 * own.owner, tops[own.owner]
        if group.level:
            below, above = _kerb_levels(own, group.level, edges)
        if group.relief is not None:
            lift = np.round(group.lift / SCALE).astype(np.int64)[own.owner]
            below, above = below + lift, above + lift
        levels += [np.column_stack([own.points, z]) for z in (below, above)]
    shells = [_more_corners(group) for group in groups]
    sizes = [len(level) for level in levels]
    corners = np.concatenate([*levels, *(own for own in shells if own is not None)])
    number = number_rows(corners)
    vertices = np.empty((number.max(initial=-1) + 1, 3), np.int64)
    vertices[number] = corners
    corner, vertices = _placed(vertices, about)
    of_levels = np.split(number, np.cumsum(sizes))[1:]
    of_shells = iter(
        np.split(of_levels.pop(), np.cumsum([len(s) for s in shells if s is not None]))
    )
    objects, first = [], _scene_attributes(about)
    for k, group in enumerate(groups):
        floor, roof = of_levels[2 * k : 2 * k + 2]
        if group.is_draped:
            for name, members in _draped(group, next(of_shells)):
                listed, first = _text(first | members.pop("attributes")), {}
                written = ",".join([f'"{key}":{value}' for key, value in members.items()])
                objects.append(f'{_text(name)}:{{{written},"attributes":{listed}}}')
            continue
        faces = {} if group.roofs is None else _shell_faces(group.roofs, next(of_shells))
        for name, kind, attributes, geometry in _objects(
            group, rings[k], tall[k], floor, roof, kerbs[k], about.lod, faces
        ):
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


def _kerb_levels(rings: Rings, level: float, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the level of each point of the ``rings`` of surfaces at ``level``, metres, and the
    level of the upper edge of the kerb there: two int64 arrays ``(p,)``, in units of `SCALE`."""
    low = np.full(len(rings.points), round(level / SCALE))
    high = low.copy()
    high[edges] = high[rings.after[edges]] = 0
    return low, high


def _kerbs(rings: Rings, group: Group) -> np.ndarray:
    """Find the edges of ``rings`` on the grid of `SCALE` that have kerbs; lower groups have
    them."""
    if not group.level or group.is_draped:
        return np.empty(0, np.int64)
    return kerb_edges(rings.points * SCALE, rings.after, group.kerbs)


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
    low = min((group.level for group in groups if len(group)), default=0.0)
    if any(group.relief is not None for group in groups):
        low, top = (float(end) * SCALE for end in (vertices[:, 2].min(), vertices[:, 2].max()))
    metadata = {"title": about.name, "geographicalExtent": [x, y, low, x + wide, y + deep, top]}
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
    group: Group,
    rings: Rings,
    tall: np.ndarray,
    floor: np.ndarray,
    roof: np.ndarray,
    edges: np.ndarray,
    lod: str,
    faces: Mapping[int, tuple[list[str], list[int]]],
) -> Iterator[tuple[str, str, dict, str]]:
    """Yield name, type, attributes and geometry of each object. ``floor`` and ``roof``: the vertex
    of each point of the ``rings`` on the ground, and the vertex ``tall`` units of `SCALE` above.
    ``edges``: the first points of edges with kerbs. ``faces``: walls and roofs of solids that are
    not prisms, and the part of each."""
    after = rings.after
    ways = (way.tolist() for way in (floor, floor[after], roof[after], roof))
    walls = [f"[[{a},{b},{c},{d}]]" for a, b, c, d in zip(*ways, strict=True)]
    below, above = (list(map(str, level.tolist())) for level in (floor, roof))
    starts, first = rings.starts.tolist(), rings.first(len(group)).tolist()
    names = names_of(group)
    kerbs: list[list[str]] = [[] for _ in range(len(group))]
    ends = (way[edges].tolist() for way in (roof, roof[after], floor[after], floor))
    upright = [f"[[{a},{b},{c},{d}]]" for a, b, c, d in zip(*ends, strict=True)]
    for face, own_kerbs in zip(upright, rings.owner[edges].tolist(), strict=True):
        kerbs[own_kerbs].append(face)
    for k, high in enumerate(tall.tolist()):
        spans = list(itertools.pairwise(starts[first[k] : first[k + 1] + 1]))
        kind = group.city_objects[k]
        attributes: dict = {"class": group.name}
        if high:
            attributes["measuredHeight"] = round(high * SCALE, 3)
            own = walls[starts[first[k]] : starts[first[k + 1]]]
            parts = [1] * len(own) + [2]
            own.append(_surface(above, spans, 1))
            if k in faces:
                own, parts = faces[k]
            shell = ",".join([_surface(below, spans, -1), *own])
            geometry = f'"type":"Solid","lod":"{lod}","boundaries":[[{shell}]]'
            if kind == "Building":
                values = f"[[0,{','.join(map(str, parts))}]]"
                geometry += f',"semantics":{{"surfaces":{_SURFACES},"values":{values}}}'
        else:
            surfaces = ",".join([_surface(below, spans, 1), *kerbs[k]])
            level = "1" if group.level else "0"
            geometry = f'"type":"MultiSurface","lod":"{level}","boundaries":[{surfaces}]'
            if kind == "Road":
                values = ",".join(["1" if group.name == "pavement" else "0", *"1" * len(kerbs[k])])
                geometry += f',"semantics":{{"surfaces":{_TRAFFIC},"values":[{values}]}}'
        values = ((name, column[k]) for name, column in group.attributes.items())
        attributes |= {name: value for name, value in values if value is not None}
        yield names[k], kind, attributes, geometry


def _more_corners(group: Group) -> np.ndarray | None:
    """Return corners that do not lie on the rings of a ``group``, in units of `SCALE`, int64 ``(c,
    3)``: those of pitched roofs, or of triangles on a relief; None for a group without them."""
    if group.is_draped:
        return np.round(group.mesh.points / SCALE).astype(np.int64)
    return None if group.roofs is None else _shell_corners(group)


def _draped(group: Group, vertex: np.ndarray) -> Iterator[tuple[str, dict]]:
    """Yield the name and the members of each surface of a ``group`` on a relief, as text, and its
    attributes. ``vertex``: the vertex of each point of the mesh."""
    mesh, names = group.mesh, names_of(group)
    corners = vertex[mesh.triangles]
    places = np.round(mesh.points[mesh.triangles] / SCALE)
    a, b, c = (places[:, k] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    # rounding turns thinner triangles over
    kept = area > 2 * np.sqrt(longest)
    spans = np.searchsorted(mesh.owner, np.arange(len(group) + 1)).tolist()
    for k, name in enumerate(names):
        own = np.arange(spans[k], spans[k + 1])
        own = own[kept[own]]
        kind = group.city_objects[k]
        faces = ",".join([f"[[{a},{b},{c}]]" for a, b, c in corners[own].tolist()])
        form = "CompositeSurface" if group.name == "ground" else "MultiSurface"
        geometry = f'"type":"{form}","lod":"1","boundaries":[{faces}]'
        if kind == "Road":
            pavement = group.name == "pavement"
            values = np.where((mesh.part[own] == WALL) | pavement, 1, 0).tolist()
            geometry += f',"semantics":{{"surfaces":{_TRAFFIC},"values":{_text(values)}}}'
        columns = ((key, column[k]) for key, column in group.attributes.items())
        attributes = {"class": group.name} | {
            key: value for key, value in columns if value is not None
        }
        kind = "TINRelief" if group.name == "ground" else kind
        yield (
            name,
            {
                "type": _text(kind),
                "geometry": f"[{{{geometry}}}]",
                "attributes": attributes,
            },
        )


def _shell_corners(group: Group) -> np.ndarray:
    """Return the corners of the faces of ``group.roofs``, in units of `SCALE`, int64 ``(c, 3)``."""
    roofs, rings = group.roofs, group.rings
    face = np.repeat(np.arange(len(roofs.owner)), np.diff(roofs.starts))
    first = rings.starts[rings.first(len(group))]
    ground = roofs.corners < 0
    at = first[roofs.owner[face[ground]]] - 1 - roofs.corners[ground]
    places = np.empty((len(face), 3))
    places[ground] = np.column_stack([rings.points[at], np.zeros(len(at))])
    places[~ground] = roofs.points[roofs.corners[~ground]]
    places[:, 2] += group.lift[roofs.owner[face]]
    return np.round(places / SCALE).astype(np.int64)


def _shell_faces(roofs: Shells, vertex: np.ndarray) -> dict[int, tuple[list[str], list[int]]]:
    """Write the faces of each solid, and their parts. ``vertex``: the vertex of each corner."""
    names, starts = list(map(str, vertex.tolist())), roofs.starts.tolist()
    faces: dict[int, tuple[list[str], list[int]]] = {}
    for k, (owner, part) in enumerate(zip(roofs.owner.tolist(), roofs.part.tolist(), strict=True)):
        texts, parts = faces.setdefault(owner, ([], []))
        texts.append(f"[[{','.join(names[starts[k] : starts[k + 1]])}]]")
        parts.append(part)
    return faces


def _surface(names: list[str], spans: list[tuple[int, int]], way: int) -> str:
    """Write the rings at ``spans`` of ``names``, in direction ``way``, 1 or −1."""
    rings = [",".join(names[a:b][::way]) for a, b in spans]
    return f"[[{'],['.join(rings)}]]"
