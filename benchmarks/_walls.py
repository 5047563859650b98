"""Footprints of the sources, and how near polygons come to them."""

import json
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
import shapely
from pyproj import Transformer

import evocity


@dataclass
class Originals:
    """A bundled city: its map, and the footprints it was burnt from in the map's own metres, cut at
    its window; ``walls``: segments (n, 2, 2) of the footprints' outlines within it."""

    city: evocity.CityMap
    footprints: np.ndarray
    walls: np.ndarray


def originals(name: str, metres_per_pixel: float) -> Originals:
    city = evocity.read_map(
        name, pixels=round(512 / metres_per_pixel), metres_per_pixel=metres_per_pixel
    )
    document = json.loads((files("evocity") / f"data/cities/{name}.geojson").read_text())
    into = Transformer.from_crs(4326, city.crs, always_xy=True)
    found = shapely.from_geojson([json.dumps(one["geometry"]) for one in document["features"]])
    found = shapely.transform(found, into.transform, interleaved=False)
    kept = [one["properties"].get("height", 9.0) > 1.5 for one in document["features"]]
    left, top = city.origin
    window = shapely.box(left, top - 512, left + 512, top)
    found = shapely.make_valid(found[np.array(kept)])
    within = shapely.intersection(found, window)
    within = within[shapely.area(within) > 1e-6]
    return Originals(city, within, segments(within, window))


def segments(polygons: np.ndarray, window: shapely.Geometry) -> np.ndarray:
    """The straight bits of outlines, (n, 2, 2), but those along the border of the ``window``."""
    points, which = shapely.get_coordinates(
        shapely.get_parts(shapely.boundary(polygons)), return_index=True
    )
    same = which[1:] == which[:-1]
    bits = np.stack([points[:-1], points[1:]], axis=1)[same]
    middle = bits.mean(axis=1)
    left, bottom, right, top = window.bounds
    rim = np.minimum.reduce(
        [middle[:, 0] - left, right - middle[:, 0], middle[:, 1] - bottom, top - middle[:, 1]]
    )
    return bits[(rim > 1e-6) & (np.hypot(*(bits[:, 1] - bits[:, 0]).T) > 1e-9)]


def told(polygons: np.ndarray, source: Originals) -> dict[str, float]:
    """Vertices; IoU of all that is built; of façades, the median angle to the nearest original wall
    (°), and distance (m), by length; share of right angles; m² that overlap; area over the
    original's."""
    polygons = np.asarray(polygons)
    left, top = source.city.origin
    window = shapely.box(left, top - 512, left + 512, top)
    union, true = shapely.union_all(polygons), shapely.union_all(source.footprints)
    facades = segments(np.array([union]), window)
    angle, away = nearest(facades, source.walls)
    length = np.hypot(*(facades[:, 1] - facades[:, 0]).T)
    return {
        "vertices": int(shapely.get_num_coordinates(polygons).sum()),
        "IoU": shapely.intersection(union, true).area / shapely.union(union, true).area,
        "bearing": median(angle, length),
        "off": median(away, length),
        "right": right_angles(polygons),
        "overlap": float(shapely.area(polygons).sum() - union.area),
        "area": union.area / true.area,
    }


def of_one_building(polygons: np.ndarray, source: Originals) -> float:
    """By how much the area of a building differs from that of the footprints that lie in it, the
    median over buildings; a share."""
    polygons = np.asarray(polygons)
    middles = shapely.point_on_surface(source.footprints)
    footprint, polygon = shapely.STRtree(polygons).query(middles, predicate="within")
    true = np.bincount(polygon, shapely.area(source.footprints)[footprint], len(polygons))
    known = true > 0
    return float(np.median(np.abs(shapely.area(polygons[known]) / true[known] - 1)))


def nearest(facades: np.ndarray, walls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each façade the angle to the wall nearest to its middle, degrees, and how far that is."""
    lines = shapely.linestrings(walls)
    middles = shapely.points(facades.mean(axis=1))
    (_, which), away = shapely.STRtree(lines).query_nearest(
        middles, return_distance=True, all_matches=False
    )
    u, v = facades[:, 1] - facades[:, 0], walls[which][:, 1] - walls[which][:, 0]
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    angle = np.degrees(np.arctan2(cross, (u * v).sum(axis=1))) % 180
    return np.minimum(angle, 180 - angle), away


def median(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def right_angles(polygons: np.ndarray, tolerance: float = 3.0) -> float:
    """Share of corners within a ``tolerance`` of 90°; what turns by less than 10° is no corner."""
    rings = shapely.get_rings(polygons)
    right = corners = 0
    for ring in rings:
        points = shapely.get_coordinates(ring)[:-1]
        u, v = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
        turn = np.degrees(
            np.abs(np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1)))
        )
        corners += np.count_nonzero(turn > 10)
        right += np.count_nonzero(np.abs(turn - 90) < tolerance)
    return right / max(corners, 1)
