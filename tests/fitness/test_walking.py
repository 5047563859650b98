"""Ways to places: NetworkX's shortest paths, drawn squares, laws."""

import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import evocity
from evocity.citymap import CityMap
from evocity.fitness import _kernels, walk_distance
from evocity.fitness.walking import FARTHEST, measure_ways, ways_to_places

CITIES = ("lyon-1er", "cape-town-salt-river", "villeurbanne-gratte-ciel")


def blocks(square=None, streets=(30, 66, 102), side=132, pixel=2.0, height=9.0):
    """Streets of 6 px along rows and columns, and a square (first row, column, side)."""
    heights = np.full((side, side), height)
    for first in streets:
        heights[first : first + 6] = heights[:, first : first + 6] = 0
    if square:
        top, left, wide = square
        heights[top : top + wide, left : left + wide] = 0
    return CityMap(heights, pixel)


def graph_of(graph):
    made = nx.MultiGraph()
    made.add_nodes_from(range(len(graph.nodes)))
    for (first, last), length in zip(graph.ends.tolist(), graph.length, strict=True):
        made.add_edge(first, last, weight=float(length))
    return made


@pytest.mark.parametrize("name", CITIES)
def test_ways_of_nodes_are_those_of_networkx(name):
    city = evocity.read_map(name)
    graph, ways = city.street_graph, ways_to_places(city)
    squares = shapely.union_all(graph.places.polygons)
    own = {k for k, node in enumerate(shapely.points(graph.nodes)) if node.intersects(squares)}
    own |= set(graph.ends[graph.place >= 0].ravel().tolist())
    assert own == set(np.flatnonzero(ways == 0).tolist())
    truth = nx.multi_source_dijkstra_path_length(graph_of(graph), own)
    expected = [truth.get(k, np.inf) for k in range(len(ways))]
    assert ways == pytest.approx(np.array(expected))


@pytest.mark.parametrize("name", CITIES)
def test_ways_of_houses_are_those_of_networkx(name):
    """Each house as a node of its own, amid the edge that it is nearest to."""
    city = evocity.read_map(name)
    table, graph = city.buildings, city.street_graph
    made, (left, top) = graph_of(graph), city.north_west
    own = set(np.flatnonzero(ways_to_places(city) == 0).tolist())
    edges = shapely.MultiLineString(list(graph.edges)).geoms
    expected = []
    for x, y in zip(left + table.x, top - table.y, strict=True):
        house = shapely.Point(x, y)
        far = [edge.distance(house) for edge in edges]
        k = int(np.argmin(far))
        one = edges[k].project(house)
        first, last = graph.ends[k].tolist()
        made.add_edge("house", first, weight=one)
        made.add_edge("house", last, weight=max(graph.length[k] - one, 0))
        reached = nx.single_source_dijkstra_path_length(made, "house")
        way = min(reached.get(node, np.inf) for node in own)
        made.remove_node("house")
        expected.append(0.0 if graph.place[k] >= 0 else way)
    assert measure_ways(city) == pytest.approx(np.array(expected), abs=1e-6)
    floors = np.maximum(np.floor(table.height / 3 + 0.5), 1)
    mean = np.average(np.minimum(expected, FARTHEST), weights=table.area * floors)
    assert walk_distance(city) == pytest.approx(mean)


@given(st.integers(0, 2**32))
@settings(max_examples=25, deadline=None)
def test_shortened_ways_are_the_shortest(seed):
    rng = np.random.default_rng(seed)
    nodes, edges = rng.integers(1, 12), rng.integers(0, 30)
    first, last = rng.integers(0, nodes, (2, edges)).astype(np.int32)
    length = rng.integers(0, 9, edges).astype(float)
    distance = np.where(rng.random(nodes) < 0.3, 0.0, np.inf)
    made = nx.MultiGraph()
    made.add_nodes_from(range(nodes))
    made.add_weighted_edges_from(zip(first.tolist(), last.tolist(), length, strict=True))
    own = set(np.flatnonzero(distance == 0).tolist())
    truth = nx.multi_source_dijkstra_path_length(made, own) if own else {}
    _kernels.shorten_ways(first, last, length, distance)
    assert distance.tolist() == [truth.get(k, np.inf) for k in range(nodes)]


def test_a_square_in_the_middle_is_nearer_than_one_in_the_corner():
    middle, corner = (blocks((first, first, 34)) for first in (52, 88))
    assert len(middle.street_graph.places) == len(corner.street_graph.places) == 1
    assert walk_distance(middle) < walk_distance(corner)


def test_two_squares_are_nearer_than_one():
    corner = blocks((88, 88, 34))
    heights = corner.heights.copy()
    heights[12:46, 12:46] = 0
    assert walk_distance(corner.replace(heights)) < walk_distance(corner)


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_the_way_grows_with_the_pixel(factor):
    """Widths in metres decide what is a street and a place, so the pixel is only a unit nearby."""
    city = blocks((52, 52, 34))
    larger = city.replace(city.heights, metres_per_pixel=2.0 * factor)
    assert walk_distance(larger) == pytest.approx(factor * walk_distance(city), rel=0.1)


def test_high_houses_count_for_more():
    city = blocks((88, 88, 34))
    heights = city.heights.copy()
    heights[:30, :30] *= 8  # far from the square
    assert walk_distance(city.replace(heights)) > walk_distance(city)


def test_maps_without_places_streets_or_buildings():
    assert walk_distance(blocks()) == FARTHEST
    assert walk_distance(CityMap(np.zeros((32, 32)), 2.0)).reason == "there are no buildings"
    assert walk_distance(CityMap(np.full((32, 32), 9.0), 2.0)).reason == "there are no streets"
    assert walk_distance(CityMap(np.full((1, 1), 9.0), 2.0)).reason == "there are no streets"
