"""Features of a window of a map, by which real and bred cities can be told apart.

Their heights are whole metres, and flatness of roofs does not count: both tell codes from maps.
"""

import warnings

import numpy as np
import shapely

from evocity import fitness
from evocity.citymap import CityMap
from evocity.fitness.fronts import facades
from evocity.fitness.neighbours import nearest_points

#: Metres: a setback is a step of a front of more; alleys are streets of less.
SETBACK, ALLEY = 3.0, 7.0


def traits(city: CityMap) -> dict[str, float]:
    """Features of a map by name; NaN where the map does not have one."""
    city = city.replace(np.round(city.heights))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ground(city) | buildings(city) | neighbours(city) | streets(city) | fronts(city)


def spread(name: str, values: np.ndarray) -> dict[str, float]:
    """Mean, deviation, and the 10th, 50th and 90th percentile of some values."""
    names = [f"{name}, {which}" for which in ("mean", "deviation", "10 %", "50 %", "90 %")]
    if values.size < 3:
        return dict.fromkeys(names, np.nan)
    numbers = [values.mean(), values.std(), *np.percentile(values, (10, 50, 90))]
    return dict(zip(names, map(float, numbers), strict=True))


def ground(city: CityMap) -> dict[str, float]:
    built, away = city.built, city.distance_to_built
    space, pixel = city.open_space, city.metres_per_pixel
    yards = space.area[space.enclosed_by >= 0]
    hectares = city.area / 1e4
    components = city.areas
    off = away[city.open_ground]
    edges = sum(np.count_nonzero(np.diff(built, axis=axis)) for axis in (0, 1))
    return {
        "gsi": float(built.mean()),
        "fsi": float(fitness.fsi(city)),
        "courtyards, share of ground": float(yards.sum() / city.area),
        "components per ha": components.size / hectares,
        "components < 24 m² per ha": float((components < 24).sum() / hectares),
        "largest component, share": float(components.max(initial=0) / max(components.sum(), 1)),
        "open pieces per ha": space.area.size / hectares,
        "walls, m per m² built": float(edges / pixel / max(built.sum(), 1)),
        "open ground within 3 m of a wall": float((off <= 3).mean()) if off.size else np.nan,
        "open ground farther than 15 m": float((off > 15).mean()) if off.size else np.nan,
        "box dimension": float(fitness.box_dimension(city)),
        "lacunarity": float(fitness.lacunarity(city)),
    } | spread("heights built on", city.heights[built].astype(float))


def buildings(city: CityMap) -> dict[str, float]:
    table, hectares = city.buildings, city.area / 1e4
    large = table.area >= 24
    area, height = table.area[large], table.height[large]
    long, short = table.box[large].T
    storey = np.round(height / 3).astype(int)
    shares = np.bincount(storey) / max(storey.size, 1)
    return (
        {
            "buildings per ha": large.sum() / hectares,
            "buildings < 24 m²": float((~large).mean()),
            "buildings < 50 m²": float((table.area < 50).mean()),
            "buildings < 5 m wide": float((short < 5).mean()),
            "buildings with a courtyard": float((table.courtyards[large] > 0).mean()),
            "entropy of storeys": float(-(shares[shares > 0] * np.log(shares[shares > 0])).sum()),
            "party walls": float(table.shared.sum() / max(table.sides.sum(), 1)),
            "footprints that come again": float(fitness.repeated_footprints(city)),
        }
        | spread("log area", np.log(area))
        | spread("height", height)
        | spread("elongation", short / long)
        | spread("rectangularity", np.minimum(area / (long * short), 1))
        | spread("convexity", area / table.hull_area[large])
        | spread("perimeter by root of area", table.perimeter[large] / np.sqrt(area))
    )


def neighbours(city: CityMap) -> dict[str, float]:
    """Steps of each building to its five nearest."""
    table = city.buildings
    large = np.flatnonzero(table.area >= 24)
    names = ("height step", "log-area step", "direction step", "distance", "height over median")
    if large.size < 8:
        return {key: np.nan for name in names for key in spread(name, np.empty(0))}
    distance, index = nearest_points(table.y[large], table.x[large], 6)
    near = index[:, 1:]
    height, area = table.height[large], np.log(table.area[large])
    turn = table.direction[large]
    apart = np.abs(turn[:, None] - turn[near]) % 90
    apart = np.minimum(apart, 90 - apart)
    parts = (
        np.abs(height[:, None] - height[near]).mean(axis=1),
        np.abs(area[:, None] - area[near]).mean(axis=1),
        np.nanmean(apart, axis=1),
        distance[:, 1],
        height - np.median(height[near], axis=1),
    )
    found = {}
    for name, part in zip(names, parts, strict=True):
        found |= spread(name, part[~np.isnan(part)])
    return found


def streets(city: CityMap) -> dict[str, float]:
    graph, table, hectares = city.alley_graph, city.buildings, city.area / 1e4
    count = len(graph)
    way = (
        graph.nodes[graph.ends[:, 1]] - graph.nodes[graph.ends[:, 0]] if count else np.empty((0, 2))
    )
    chord, length = np.hypot(*way.T), np.maximum(graph.length, 1e-9)
    turn = np.degrees(np.arctan2(way[:, 1], way[:, 0])) % 180
    inner, total = ~graph.at_frame, max(length.sum(), 1e-9)
    degree = graph.degree[inner]
    shares = np.histogram(turn, 18, (0, 180), weights=length)[0] / total
    order = np.abs((length * np.exp(4j * np.radians(turn))).sum()) / total
    strokes = np.bincount(graph.street, length) if count else np.empty(0)
    crossings = max((degree >= 3).sum(), 1)
    side = 4 * np.sqrt(city.area)
    quarters = np.bincount(graph.quarters) if len(table) else np.empty(0)
    ground_of = np.bincount(graph.quarters, table.area) if len(table) else np.empty(0)
    return (
        {
            "edges per ha": count / hectares,
            "street length, m per ha": total / hectares,
            "cycles per ha": graph.cycles / hectares,
            "crossings per ha": float((degree >= 3).sum() / hectares),
            "dead ends by crossings": float((degree == 1).sum() / crossings),
            "crossings of three": float((degree == 3).sum() / crossings),
            "exits by 100 m of frame": float(100 * graph.at_frame.sum() / side),
            "streets < 7 m": float(length[graph.clear < ALLEY].sum() / total),
            "streets > 20 m": float(length[graph.clear > 20].sum() / total),
            "entropy of directions": float(
                -(shares[shares > 0] * np.log(shares[shares > 0])).sum() / np.log(18)
            ),
            "order of directions": float(order),
            "longest street": float(strokes.max(initial=0)),
            "street length by length": float((strokes**2).sum() / total),
            "wall to street": float(wall_to_street(city).mean()) if count else np.nan,
        }
        | spread("segment length", length)
        | spread("street width", graph.clear)
        | spread("bottleneck", graph.least / np.maximum(graph.clear, 1e-9))
        | spread("straightness", np.minimum(chord / length, 1))
        | spread("stroke", strokes)
        | spread("buildings of a quarter", quarters.astype(float))
        | spread("ground of a quarter", ground_of)
    )


def wall_to_street(city: CityMap) -> np.ndarray:
    """Degrees, 0 to 45, between the walls of buildings and the nearest bit of a street."""
    table, graph = city.buildings, city.alley_graph
    turned = np.flatnonzero(~np.isnan(table.direction) & (table.area >= 24))
    points, edge = shapely.get_coordinates(np.array(graph.edges), return_index=True)
    same = np.diff(edge) == 0
    bits = np.stack([points[:-1][same], points[1:][same]], axis=1)
    if not turned.size or not len(bits):
        return np.array([np.nan])
    left, top = city.north_west
    centres = shapely.points(left + table.x[turned], top - table.y[turned])
    lines = shapely.linestrings(bits)
    nearest = shapely.STRtree(lines).nearest(centres)
    # over 12 m about the nearest bit: a single one is a step of the raster
    way = bits[nearest, 1] - bits[nearest, 0]
    apart = np.abs(table.direction[turned] - np.degrees(np.arctan2(way[:, 1], way[:, 0]))) % 90
    return np.minimum(apart, 90 - apart)


def fronts(city: CityMap) -> dict[str, float]:
    x, y, front = facades(city)
    jumps = np.full(3, np.nan)
    if front.size > 10:
        same = np.diff(front) == 0
        count = np.bincount(front)
        u, v = (one - (np.bincount(front, one) / count)[front] for one in (x, y))
        across = np.bincount(front, u * u) - np.bincount(front, v * v)
        turn = np.arctan2(2 * np.bincount(front, u * v), across)[front] / 2
        off = v * np.cos(turn) - u * np.sin(turn)
        step = np.abs(np.diff(off))[same]
        jumps = np.array([(step > SETBACK).mean(), step.mean(), np.abs(off).mean()])
    names = ("setbacks > 3 m", "setback, mean", "façades off their line")
    graph = city.alley_graph
    walled = front.size / max(graph.length.sum(), 1e-9) if len(graph) else np.nan
    return {
        "frontage": float(fitness.frontage(city)),
        "façades per m of street": float(walled),
    } | dict(zip(names, map(float, jumps), strict=True))
