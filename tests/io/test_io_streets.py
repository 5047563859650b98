"""GeoPackages with streets: what other programs read in them, and evocity itself."""

import geopandas
import momepy
import networkx
import numpy as np
import pyogrio
import pytest
import shapely

from evocity import CityMap, read_map, write_map
from evocity.errors import MapError


@pytest.fixture(scope="module")
def town() -> CityMap:
    return read_map("new-york-west-village")


@pytest.fixture(scope="module")
def file(town, tmp_path_factory):
    path = tmp_path_factory.mktemp("streets") / "town.gpkg"
    write_map(town, path, streets=True)
    return path


def layer(file, name: str) -> geopandas.GeoDataFrame:
    return geopandas.read_file(file, layer=name)


def test_the_layers_and_the_buildings_first(file, town):
    names = [name for name, _ in pyogrio.list_layers(file)]
    assert names == [
        "buildings",
        "street_edges",
        "street_nodes",
        "places",
        "ground",
        "layer_styles",
    ]
    for name in names[:-1]:
        assert layer(file, name).crs == layer(file, "buildings").crs
        metadata = pyogrio.read_info(file, layer=name)["layer_metadata"]
        assert metadata["ATTRIBUTION"] == town.attribution
    buildings = layer(file, "buildings")
    assert shapely.coverage_is_valid(buildings.geometry.to_numpy())
    quarters = town.street_graph.quarters[buildings["id"] - 1] + 1
    assert buildings["quarter"].tolist() == quarters.tolist()


def test_geopandas_reads_the_graph(file, town):
    graph = town.street_graph
    edges, nodes = layer(file, "street_edges"), layer(file, "street_nodes").set_index("id")
    np.testing.assert_allclose(edges["length"], edges.length, atol=1e-3)
    np.testing.assert_allclose(edges["width"], graph.width, atol=1e-3)
    assert (edges["width_low"] <= edges["width"]).all()
    assert (edges["width"] <= edges["width_high"]).all()
    assert edges["measured"].tolist() == graph.measured.tolist()
    assert edges["kind"].tolist() == graph.kind.tolist()
    assert edges["leaves"].tolist() == graph.leaves.tolist()
    for end, place in (("u", 0), ("v", -1)):
        told = nodes.loc[edges[end]].geometry.to_numpy()
        own = shapely.get_point(edges.geometry.to_numpy(), place)
        assert shapely.distance(told, own).max() < 1e-6
    places = layer(file, "places")
    np.testing.assert_allclose(places["area"], places.area, atol=1e-3)
    assert sorted(set(edges["place"])) == list(range(len(places) + 1))
    assert (nodes["degree"] > 0).all()
    assert set(nodes.index) == {*edges["u"], *edges["v"]}


def test_buildings_and_ground_are_one_coverage(file, town):
    buildings, ground = layer(file, "buildings"), layer(file, "ground")
    polygons = np.concatenate([one.geometry.to_numpy() for one in (buildings, ground)])
    assert shapely.coverage_is_valid(polygons)
    assert shapely.area(polygons).sum() == pytest.approx(town.area, rel=1e-9)
    squares = ground[ground["kind"] == "square"]
    assert set(squares["place"]) == set(layer(file, "places")["id"])
    assert set(ground["street"][ground["kind"] == "street"]) <= set(town.street_graph.kind)
    # walls in place of pixels' edges, of which nearly all are along rows and columns
    bits = [np.diff(shapely.get_coordinates(one), axis=0) for one in squares.geometry]
    bits = np.concatenate(bits)
    along = np.minimum(*np.abs(bits).T) < 0.01
    assert np.hypot(*bits[along].T).sum() < 0.3 * np.hypot(*bits.T).sum()


def test_networkx_reads_the_graph(file, town):
    graph = town.street_graph
    edges, nodes = layer(file, "street_edges"), layer(file, "street_nodes")
    own = networkx.from_pandas_edgelist(
        edges,
        "u",
        "v",
        edge_attr=["length", "kind"],
        edge_key="id",
        create_using=networkx.MultiGraph,
    )
    own.add_nodes_from(nodes["id"].tolist())
    lone = np.count_nonzero(graph.degree == 0)  # the file has only nodes with edges
    assert networkx.number_connected_components(own) == graph.components - lone
    assert own.number_of_edges() - len(own) + graph.components - lone == graph.cycles
    degrees = [own.degree[node] for node in nodes["id"]]
    assert degrees == nodes["degree"].tolist()


@pytest.mark.slow
def test_momepy_measures_the_graph(file, town):
    edges = layer(file, "street_edges")
    graph = momepy.gdf_to_nx(edges, approach="primal", length="length")
    assert graph.number_of_edges() == len(edges)
    # momepy has no lone nodes
    assert len(graph) == np.count_nonzero(town.street_graph.degree)
    degrees = dict(momepy.node_degree(graph).nodes(data="degree"))
    assert sorted(degrees.values()) == sorted(d for d in town.street_graph.degree.tolist() if d)
    whole = momepy.meshedness(graph, radius=None)
    n, e = len(graph), len(edges)
    assert whole == pytest.approx((e - n + 1) / (2 * n - 5))
    buildings = layer(file, "buildings")
    nearest = momepy.get_nearest_street(buildings, edges)
    assert nearest.notna().all()
    profile = momepy.street_profile(edges, buildings, height=buildings["height"])
    beside = edges["kind"].isin(["street", "avenue"]) & (profile["openness"] < 0.3)
    away = (profile["width"] - edges["width"])[beside]
    assert abs(away.median()) < 2


@pytest.mark.parametrize("raw", [False, True])
def test_evocity_reads_the_buildings_back(town, tmp_path, raw):
    plain, told = tmp_path / "plain.gpkg", tmp_path / "told.gpkg"
    write_map(town, plain, raw=raw)
    write_map(town, told, raw=raw, streets=True)
    one, other = read_map(plain), read_map(told)
    # with streets, corners lie on a grid of 1 cm
    assert (one.heights == other.heights).mean() > 0.999
    assert one.origin == other.origin
    if raw:
        assert (one.heights == other.heights).all()
        assert (other.built == town.built).all()


def test_without_streets_files_are_as_they_were(town, tmp_path):
    write_map(town, tmp_path / "plain.gpkg")
    assert pyogrio.list_layers(tmp_path / "plain.gpkg")[:, 0].tolist() == [
        "buildings",
        "layer_styles",
    ]
    fields = pyogrio.read_info(tmp_path / "plain.gpkg", layer="buildings")["fields"].tolist()
    assert fields == ["id", "height", "area", "class"]


@pytest.mark.parametrize("built", [False, True])
def test_maps_without_streets_have_empty_layers(tmp_path, built):
    city = CityMap(np.full((32, 32), 9.0 * built), 2.0)
    write_map(city, tmp_path / "bare.gpkg", streets=True)
    names = pyogrio.list_layers(tmp_path / "bare.gpkg")[:, 0].tolist()
    assert names == [
        "buildings",
        "street_edges",
        "street_nodes",
        "places",
        "ground",
        "layer_styles",
    ]
    assert len(layer(tmp_path / "bare.gpkg", "street_edges")) == len(city.street_graph)


@pytest.mark.parametrize("name", ["town.geojson", "town.tif", "town.png", "town.npy"])
def test_other_formats_hold_no_streets(town, tmp_path, name):
    with pytest.raises(MapError, match=r"\.gpkg"):
        write_map(town, tmp_path / name, streets=True)
    assert not list(tmp_path.iterdir())


def test_an_unknown_suffix_is_told_as_ever(town, tmp_path):
    with pytest.raises(MapError, match="no writer for"):
        write_map(town, tmp_path / "town.doc", streets=True)
