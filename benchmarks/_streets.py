"""Real streets, and how near a street graph comes to them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import osmium
import pyogrio
import shapely
from pyproj import CRS, Transformer

import evocity

SHARED = Path(__file__).parents[2] / "shared" / "data" / "cities"

#: Middle of the bundled district, longitude and latitude; the extract is larger.
WEST_VILLAGE = -74.006690, 40.736400

#: Highways that are streets: what is driven on, and streets given to those who walk. Ways for feet
#: and cycles alone (footway, path, steps, cycleway, track) run through parks and along kerbs.
STREETS = {
    *("motorway", "trunk", "primary", "secondary", "tertiary"),
    *("unclassified", "residential", "living_street", "pedestrian", "service"),
    *("motorway_link", "trunk_link", "primary_link", "secondary_link", "tertiary_link"),
}
WALKS = {"footway", "path", "steps", "cycleway", "track", "bridleway"}

#: Metres: a line is found, or true, with another no farther; a crossing likewise; a highway counts
#: with a building no farther; crossings of real ones nearer to each other are one (carriageways).
NEAR, CROSSING, BESIDE, ONE = 8.0, 15.0, 30.0, 20.0


@dataclass
class Real:
    """A map, and the real streets on it: ``lines`` within 30 m of buildings, ``between`` buildings
    on both sides, ``all`` of them also beyond, ``walks`` for feet alone, ``crossings`` (n, 2), in
    the map's metres."""

    city: evocity.CityMap
    lines: shapely.Geometry
    between: shapely.Geometry
    all: shapely.Geometry
    walks: shapely.Geometry
    crossings: np.ndarray


def real(file: str, metres_per_pixel: float = 2.0, service: bool = True, **read) -> Real:
    """The map of ``file`` in the shared folder, 512 m wide, and its streets."""
    path = SHARED / file
    pixels = round(512 / metres_per_pixel)
    city = evocity.read_map(path, pixels=pixels, metres_per_pixel=metres_per_pixel, **read)
    kinds = STREETS if service else STREETS - {"service"}
    ways = _osm(path, kinds) if ".osm" in file else _layer(path)
    into = Transformer.from_crs(
        4326 if ".osm" in file else pyogrio.read_info(path, layer="streets")["crs"],
        CRS.from_user_input(city.crs),
        always_xy=True,
    )
    streets, walks = (shapely.transform(w, into.transform, interleaved=False) for w in ways)
    (left, top), side = city.origin, 512.0
    window = shapely.box(left, top - side, left + side, top)
    inside = shapely.intersection(streets, window)
    inside = inside[~shapely.is_empty(inside)]
    near = shapely.buffer(shapely.union_all(np.array(city.outline)), BESIDE)
    lines = shapely.intersection(shapely.union_all(inside), near)
    between = _between(lines, city)
    crossings = _crossings(streets)
    kept = shapely.contains_xy(shapely.intersection(window, near), *crossings.T)
    every, walked = shapely.union_all(streets), shapely.union_all(walks)
    return Real(city, lines, between, every, walked, crossings[kept])


def _osm(path: Path, kinds: set[str]) -> tuple[np.ndarray, np.ndarray]:
    found, walks = [], []
    for way in osmium.FileProcessor(path).with_locations():
        if not way.is_way() or way.tags.get("area") == "yes" or way.tags.get("tunnel") == "yes":
            continue
        kind = way.tags.get("highway")
        points = [(n.lon, n.lat) for n in way.nodes if n.location.valid()]
        if len(points) > 1:
            (found if kind in kinds else walks if kind in WALKS else []).append(points)
    return tuple(
        np.array([shapely.LineString(p) for p in some], dtype=object) for some in (found, walks)
    )


def _layer(path: Path) -> tuple[np.ndarray, np.ndarray]:
    _, _, shapes, _ = pyogrio.raw.read(path, layer="streets")
    return shapely.from_wkb(shapes), np.array([], dtype=object)


def _between(lines: shapely.Geometry, city: evocity.CityMap, step: float = 2.0) -> shapely.Geometry:
    """Those bits of ``lines`` that have a building within 30 m on both sides."""
    parts = shapely.get_parts(shapely.segmentize(lines, step))
    bits = np.concatenate(
        [np.stack([c[:-1], c[1:]], 1) for c in map(shapely.get_coordinates, parts)]
    )
    way = bits[:, 1] - bits[:, 0]
    bits, way = bits[(way != 0).any(axis=1)], way[(way != 0).any(axis=1)]
    aside = BESIDE * np.column_stack([-way[:, 1], way[:, 0]]) / np.hypot(*way.T)[:, None]
    middle, walls = bits.mean(axis=1), shapely.union_all(np.array(city.outline))
    shapely.prepare(walls)
    both = np.ones(len(bits), bool)
    for sign in (-1, 1):
        both &= shapely.intersects(
            walls, shapely.linestrings(np.stack([middle, middle + sign * aside], 1))
        )
    return shapely.union_all(shapely.linestrings(bits[both]))


def _crossings(streets: np.ndarray) -> np.ndarray:
    """Where three lines and more meet, those nearer than `ONE` pooled."""
    arms: dict[tuple[float, float], int] = {}
    for line in streets:
        points = np.round(shapely.get_coordinates(line), 3)
        for i, point in enumerate(map(tuple, points.tolist())):
            arms[point] = arms.get(point, 0) + (1 if i in (0, len(points) - 1) else 2)
    points = shapely.points(np.array([p for p, n in arms.items() if n > 2]).reshape(-1, 2))
    pools = shapely.get_parts(shapely.union_all(shapely.buffer(points, ONE / 2)))
    tree = shapely.STRtree(points)
    groups = [points[tree.query(pool, predicate="intersects")] for pool in pools]
    return np.array([shapely.get_coordinates(g).mean(axis=0) for g in groups]).reshape(-1, 2)


def told(graph, real: Real) -> dict[str, float]:
    """Share of the real length found, of that between buildings; of ours true, and true or a walk;
    of real crossings found, of ours true; lengths in m."""
    ours = shapely.union_all(np.array(graph.edges, dtype=object))
    near = shapely.buffer(ours, NEAR)
    found = shapely.intersection(real.lines, near).length / real.lines.length
    between = shapely.intersection(real.between, near).length / max(real.between.length, 1e-9)
    total = max(ours.length, 1e-9)
    true = shapely.intersection(ours, shapely.buffer(real.all, NEAR)).length / total
    both = shapely.union(real.all, real.walks)
    walked = shapely.intersection(ours, shapely.buffer(both, NEAR)).length / total
    own = graph.nodes[graph.degree > 2]
    away = _nearest(real.crossings, own)
    back = _nearest(own, _crossings(shapely.get_parts(real.all)) if len(own) else own)
    return {
        "found": found,
        "between": between,
        "true": true,
        "or walk": walked,
        "crossings found": float((away <= CROSSING).mean()),
        "within 8 m": float((away <= NEAR).mean()),
        "crossings true": float((back <= CROSSING).mean()) if len(own) else 1.0,
        "real m": real.lines.length,
        "ours m": total,
        "crossings": len(real.crossings),
        "our crossings": len(own),
    }


def _nearest(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    if not len(one) or not len(other):
        return np.full(len(one), np.inf)
    return np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1)).min(axis=1)
