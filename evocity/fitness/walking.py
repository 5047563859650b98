"""Walking: the way along streets from each building to the nearest place."""

import numpy as np

from evocity.citymap import STOREY, CityMap
from evocity.fitness import _kernels
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Longest way that counts, metres.
FARTHEST = 1000.0


@fitness(goal="min", unit="m", range=(0, FARTHEST), any_site=True)
def walk_distance(city: CityMap) -> float:
    """Mean way along streets from buildings to the nearest place, weighted by floor area.

    The way runs along the edges of the street graph (`CityMap.street_graph`), so streets are at
    least 8 m wide. It begins at the point of the streets that is nearest to the middle of the
    building. It ends at the first node of a place, such as a square. Nodes of a place are those in
    it, and the ends of edges that lie in it. If a place has none, the ends of the nearest edge
    count. A building beside an edge that lies in a place has the distance 0. The metres from the
    building to its street do not count. A building whose streets reach no place on the map has the
    distance 1000 m, and no distance is longer. Places beyond the map are unknown.

    Formula: Σ f d / Σ f over the buildings, with d the distance, and f the floor area: the
    footprint times the mean height divided by 3 m, rounded, at least 1. Unit: metres. Range: 0 to
    1000. Empty map: NaN, like every map without buildings, and every map without streets. A map
    with streets and without places has 1000 m. Source: our own; shortest ways by Bellman 1958
    (Quarterly of Applied Mathematics 16:87-90), accessibility as in Hansen 1959 (Journal of the
    American Institute of Planners 25:73-76).

    >>> heights = np.full((128, 128), 9.0)
    >>> heights[60:66] = heights[:, 30:36] = heights[:, 90:96] = 0  # streets
    >>> walk_distance(CityMap(heights, 2.0))
    1000.0
    >>> heights[48:78, 50:76] = 0  # a square
    >>> 50 < walk_distance(CityMap(heights, 2.0)) < 70
    True
    """
    table, graph = city.buildings, city.street_graph
    if not len(table):
        return Undefined("there are no buildings")
    if not len(graph):
        return Undefined("there are no streets")
    distance = measure_ways(city)
    floors = np.maximum(np.floor(table.height / STOREY + 0.5), 1)
    area = table.area * floors
    return float((area * np.minimum(distance, FARTHEST)).sum() / area.sum())


def measure_ways(city: CityMap) -> np.ndarray:
    """Measure the way of each building to the nearest place: float64 ``(n,)``, metres, infinite
    where streets reach no place. The map has buildings and streets. See `walk_distance`. About 1
    ms at 256² once the street graph is there."""
    import shapely

    table, graph = city.buildings, city.street_graph
    nodes = ways_to_places(city)
    left, top = city.north_west
    doors = shapely.points(left + table.x, top - table.y)
    edges = np.array(graph.edges, dtype=object)
    door, nearest = shapely.STRtree(edges).query_nearest(doors, all_matches=False)
    edge = np.empty(len(table), np.int64)
    edge[door] = nearest
    along = shapely.line_locate_point(edges[edge], doors)
    first, last = (nodes[graph.ends[edge, k]] for k in (0, 1))
    ways = np.minimum(first + along, last + np.maximum(graph.length[edge] - along, 0))
    return np.where(graph.place[edge] >= 0, 0.0, ways)


def ways_to_places(city: CityMap) -> np.ndarray:
    """Measure the way of each node of the street graph to the nearest place: float64 ``(n,)``,
    metres."""
    import shapely

    graph = city.street_graph
    distance = np.full(len(graph.nodes), np.inf)
    distance[graph.ends[graph.place >= 0]] = 0
    polygons = np.array(graph.places.polygons, dtype=object)
    place, node = shapely.STRtree(shapely.points(graph.nodes)).query(polygons, "intersects")
    distance[node] = 0
    without = np.setdiff1d(np.arange(len(polygons)), np.append(place, graph.place))
    if without.size:
        tree = shapely.STRtree(np.array(graph.edges, dtype=object))
        distance[graph.ends[tree.query_nearest(polygons[without])[1]]] = 0
    first, last = (np.ascontiguousarray(graph.ends[:, k]) for k in (0, 1))
    _kernels.shorten_ways(first, last, graph.length, distance)
    return distance
