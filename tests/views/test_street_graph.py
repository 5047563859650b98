"""Street graphs: laws of their topology, drawn towns, real ones; the kernels and their twins."""

import itertools
import sys
from pathlib import Path

import naive
import networkx
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from skimage.morphology import skeletonize

from evocity import CityMap, read_map
from evocity.errors import MapError
from evocity.io import cities
from evocity.views.streets import StreetKinds, _kernels
from evocity.views.streets.kinds import packaged
from evocity.views.streets.links import reach_frame
from evocity.views.streets.skeleton import skeleton

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

#: Nothing left out, pruned, or told apart.
WHOLE = {"least_width": 0, "spurs": 0, "places": False, "courts": True}
ALL_ROUND = np.ones((3, 3))
#: The table of the package without what it says of places.
KINDS = (Path(__file__).parents[2] / "evocity/data/street-kinds.toml").read_text(encoding="utf-8")
KINDS = KINDS[: KINDS.index("[place]")]


def ground_of(seed: int, height: int, width: int) -> np.ndarray:
    """Open ground: noise of some density, blobs, drawn streets, all, nothing."""
    rng = np.random.default_rng(seed)
    kind = seed % 5
    if kind == 0:
        return rng.random((height, width)) < rng.choice([0.2, 0.5, 0.8])
    if kind == 1:
        return ndimage.gaussian_filter(rng.normal(size=(height, width)), 1) > -0.03
    if kind == 2:
        return rng.random((height, width)) > rng.choice([0, 0.03, 1])
    ground = np.zeros((height, width), bool)
    for _ in range(6):
        at, wide = rng.integers(0, max(height, width)), rng.integers(1, 5)
        ground[at : at + wide] = rng.random() < 0.8
        ground[:, at // 2 : at // 2 + wide] = True
    return ground


def city_of(ground: np.ndarray, pixel: float = 2.0, site: np.ndarray | None = None) -> CityMap:
    return CityMap(np.where(ground, 0, 9.0), pixel, site=site)


def holes_of(solid: np.ndarray) -> int:
    """Built components that do not touch the frame."""
    labels, count = ndimage.label(solid)
    rim = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return count - len(np.setdiff1d(rim, 0))


def multigraph(nodes: int, first: np.ndarray, last: np.ndarray) -> networkx.MultiGraph:
    graph = networkx.MultiGraph()
    graph.add_nodes_from(range(nodes))
    graph.add_edges_from(zip(first.tolist(), last.tolist(), strict=True))
    return graph


def topology(graph: networkx.MultiGraph) -> tuple[int, int]:
    pieces = networkx.number_connected_components(graph) if len(graph) else 0
    return pieces, graph.number_of_edges() - len(graph) + pieces


# -- laws ------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.integers(1, 24),
    width=st.integers(1, 24),
    closed=st.booleans(),
)
def test_the_graph_has_the_topology_of_the_ground(seed, height, width, closed):
    ground = ground_of(seed, height, width)
    graph = city_of(ground).street_graph_of(closed=closed, **WHOLE)
    pieces = ndimage.label(ground, ALL_ROUND)[1]
    assert (graph.components, graph.cycles) == (pieces, holes_of(~ground))
    oracle = multigraph(len(graph.nodes), *graph.ends.T)
    assert topology(oracle) == (pieces, holes_of(~ground))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), side=st.integers(3, 20), closed=st.booleans())
def test_a_site_has_the_topology_of_its_ground(seed, side, closed):
    rng = np.random.default_rng(seed)
    site = ndimage.gaussian_filter(rng.normal(size=(side, side)), 2) > -0.05
    site[side // 2, side // 2] = True
    ground = ground_of(seed, side, side) & site
    graph = city_of(ground, site=site).street_graph_of(closed=closed, **WHOLE)
    # what lies beyond the site hangs together with what is built along its edge
    holes = ndimage.label(np.pad(~ground, 1, constant_values=True))[1] - 1
    assert (graph.components, graph.cycles) == (ndimage.label(ground, ALL_ROUND)[1], holes)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    side=st.integers(1, 40),
    closed=st.booleans(),
    least=st.sampled_from([0.0, 3.0, 8.0]),
    courts=st.booleans(),
)
def test_any_map_gives_a_sound_graph(seed, side, closed, least, courts):
    city = city_of(ground_of(seed, side, side + 3), 2.0)
    kinds = StreetKinds.of(KINDS + "[place]\nwidth = 9")
    graph = city.street_graph_of(closed=closed, least_width=least, courts=courts, kinds=kinds)
    check(city, graph)
    assert (graph.least >= least).all()
    assert not (closed and graph.at_frame.any())


def check(city: CityMap, graph) -> None:
    """What holds of every graph: lines from node to node, in open ground and on the map."""
    count = len(graph)
    edges = np.array(graph.edges, dtype=object)
    for name in ("ends", "length", "width", "least", "street", "kind", "leaves", "place"):
        assert len(getattr(graph, name)) == count
    assert (graph.low <= graph.width).all()
    assert (graph.width <= graph.high).all()
    assert (graph.measured >= 0).all()
    unseen = graph.measured == 0
    assert (graph.width[unseen] == graph.clear[unseen]).all()
    assert (graph.degree == np.bincount(graph.ends.ravel(), minlength=len(graph.nodes))).all()
    left, top = city.north_west
    height, width = (side * city.metres_per_pixel for side in city.shape)
    walls = shapely.union_all(np.array(city.outline, dtype=object))
    if count:
        assert shapely.is_valid(edges).all()
        begins, ends = (shapely.get_coordinates(shapely.get_point(edges, i)) for i in (0, -1))
        np.testing.assert_allclose(begins, graph.nodes[graph.ends[:, 0]], atol=1e-9)
        np.testing.assert_allclose(ends, graph.nodes[graph.ends[:, 1]], atol=1e-9)
        np.testing.assert_allclose(graph.length, shapely.length(edges))
        # a line may touch a wall where two meet at a corner, and pass between
        inside = shapely.length(shapely.intersection(edges, shapely.buffer(walls, -1e-6)))
        assert inside.max() <= 1e-9
        west, south, east, north = shapely.total_bounds(edges)
        assert left <= west + 1e-9
        assert top - height <= south + 1e-9
        assert east <= left + width + 1e-9
        assert north <= top + 1e-9
    edge = [graph.nodes[:, 0] == left, graph.nodes[:, 0] == left + width]
    edge += [graph.nodes[:, 1] == top, graph.nodes[:, 1] == top - height]
    assert not (graph.at_frame & ~np.any(edge, axis=0)).any()
    assert not (graph.lines & city.built).any()
    assert len(graph.quarters) == len(city.buildings)
    for polygon in graph.places.polygons:
        assert polygon.is_valid
        assert polygon.intersection(walls).area < 1e-6
    np.testing.assert_allclose(graph.places.area, [one.area for one in graph.places.polygons])


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(2, 20), width=st.integers(2, 20))
def test_quarters_are_what_streets_part(seed, height, width):
    city = city_of(ground_of(seed, height, width))
    graph = city.street_graph_of(**WHOLE)
    pieces, _ = ndimage.label(~graph.lines)
    own = [set(pieces[city.building_labels == k + 1].tolist()) for k in range(len(city.buildings))]
    assert all(len(pieces_of) == 1 for pieces_of in own)
    for a, b in itertools.combinations(range(len(own)), 2):
        assert (graph.quarters[a] == graph.quarters[b]) == (own[a] == own[b])


@pytest.mark.parametrize("name", ["new-york-west-village", "montpellier-pas-du-loup"])
def test_the_whole_graph_has_as_many_parts_and_holes_as_another_skeleton(name):
    city = read_map(name)
    lines = skeletonize(np.pad(city.open_ground, 1))
    graph = city.street_graph_of(**WHOLE)
    assert graph.components == ndimage.label(lines, ALL_ROUND)[1]
    assert graph.cycles == ndimage.label(~lines)[1] - 1


# -- drawn towns -----------------------------------------------------------------------------------


def grid_town(begins: int, block: int = 30, wide: int = 8) -> CityMap:
    """Blocks 60 m wide, with streets of 16 m between them, the first from a pixel on."""
    across = (np.arange(3 * (block + wide) + wide) - begins) % (block + wide) < wide
    return city_of(across[:, None] | across)


def test_streets_of_a_closed_city_run_along_its_wall():
    graph = grid_town(0).street_graph_of(closed=True)
    assert sorted(graph.degree.tolist()) == [3] * 8 + [4] * 4
    assert len(graph) == 20
    assert graph.cycles == 9
    assert graph.width == pytest.approx(16, rel=1e-4)
    assert graph.clear == pytest.approx(16)
    assert graph.least == pytest.approx(16)
    assert len(np.unique(graph.quarters)) == 9
    assert set(graph.kind.tolist()) == {"street"}
    # those within are 4, and go on over all crossings; the ring of four sides turns at corners
    inner = np.bincount(graph.street, graph.length)
    assert np.count_nonzero(np.isclose(inner, 3 * 76, atol=7)) == 4


def test_streets_of_an_open_city_run_out_of_the_map():
    city = grid_town(15)
    graph = city.street_graph
    assert sorted(graph.degree.tolist()) == [1] * 12 + [4] * 9
    assert graph.at_frame.sum() == 12
    assert (graph.degree[graph.at_frame] == 1).all()
    assert (len(graph), graph.leaves.sum(), graph.cycles) == (24, 12, 4)
    assert len(np.unique(graph.quarters)) == 16
    assert len(np.unique(graph.street)) == 6
    ribbons = graph.ribbons()
    assert shapely.is_valid(ribbons).all()
    surface = shapely.union_all(ribbons)
    assert surface.area == pytest.approx(city.open_ground.sum() * 4, rel=0.03)
    assert surface.intersection(shapely.union_all(np.array(city.outline))).area < 1e-6
    shut = city.street_graph_of(closed=True)
    assert not shut.at_frame.any()
    assert not shut.leaves.any()
    assert shut.cycles == graph.cycles


def test_passages_spurs_and_courts_are_left_out():
    ground = np.zeros((60, 60), bool)
    ground[:, 27:33] = True  # a street of 12 m
    ground[14:17, 33:50] = True  # a passage of 6 m
    ground[30:34, 33:37] = True  # a dent
    ground[42:48, 3:27] = True  # a dead end of 48 m
    ground[5:15, 5:15] = True  # a court
    city = city_of(ground)
    graph = city.street_graph
    assert sorted(graph.degree.tolist()) == [1, 1, 1, 3]
    assert graph.at_frame.sum() == 2
    assert len(city.street_graph_of(least_width=4)) == 5
    assert city.street_graph_of(spurs=5).degree.tolist() == [1, 1]
    assert city.street_graph_of(courts=True).components == 2
    assert city.street_graph.components == 1


def test_a_square_is_a_place_and_streets_run_round_it():
    ground = np.zeros((120, 120), bool)
    ground[56:64] = ground[:, 56:64] = True
    ground[40:80, 35:85] = True  # 100 m × 80 m
    city = city_of(ground)
    graph = city.street_graph
    assert len(graph.places) == 1
    assert graph.places.area[0] == pytest.approx(8000, rel=0.05)
    assert graph.places.width[0] == pytest.approx(80, abs=2)
    assert graph.cycles == 1
    assert "place" in graph.kind
    assert ((graph.kind == "place") == (graph.place == 0)).all()
    through = city.street_graph_of(places=False)
    assert through.cycles == 0
    assert sorted(through.degree.tolist()) == [1, 1, 1, 1, 4]
    # as wide, but four times as long: no place
    wide = np.zeros((60, 250), bool)
    wide[8:52, 25:225] = wide[28:33] = True
    assert len(city_of(wide).street_graph.places) == 0


def test_widths_are_those_of_streets():
    city = grid_town(15)
    widths = city.street_graph.width_map
    assert np.isnan(widths[city.built]).all()
    beside = np.zeros(city.shape, bool)
    beside[15:23, 30:45] = True  # away from crossings
    assert widths[beside] == pytest.approx(16)
    assert np.nanmax(widths) == pytest.approx(16 * np.sqrt(2), abs=4)
    bare = np.ones((300, 300), bool)
    bare[150, 150] = False
    assert np.nanmin(city_of(bare).street_graph.width_map) > 95
    assert np.nanmax(city_of(bare).street_graph.width_map) == 100


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), side=st.integers(6, 40))
def test_widths_are_those_of_openings(seed, side):
    city = city_of(ground_of(seed, side, side), 1.0)
    graph = city.street_graph_of(closed=True)
    walls = np.pad(~city.open_ground, 1, constant_values=True)
    away = ndimage.distance_transform_edt(walls == 0)
    widths = np.nan_to_num(graph.width_map)
    about = ndimage.maximum_filter(widths, 3)
    for radius in (2.0, 4.0, 8.0):
        opened = ndimage.distance_transform_edt(away < radius) < radius
        opened = (opened & (away.max() >= radius))[1:-1, 1:-1] & city.open_ground
        # within a pixel, in width and in place: a larger disc of pixels holds not all smaller ones
        assert (about[opened] >= 2 * radius - 1).all()
        assert (widths[~ndimage.binary_dilation(opened, ALL_ROUND)] <= 2 * radius).all()


def test_what_winds_about_something_is_no_place():
    ground = np.zeros((130, 130), bool)
    ground[5:28, 5:120] = ground[5:120, 5:28] = True  # two arms of 46 m × 230 m: an L
    ground[15:19, :5] = True  # a way in
    city = city_of(ground)
    assert len(city.street_graph) > 0
    assert len(city.street_graph.places) == 0
    square = StreetKinds.of(KINDS + "[place]\nfilled = 0.3")
    assert len(city.street_graph_of(kinds=square).places) == 1


def test_streets_leave_the_map_beside_a_crossing():
    ground = np.zeros((40, 40), bool)
    ground[16:24] = ground[:, 30:38] = True  # 4 px from the frame in the east
    graph = city_of(ground).street_graph
    assert sorted(graph.degree.tolist()) == [1, 1, 1, 1, 4]
    assert graph.at_frame.sum() == 4
    assert graph.components == 1


def test_a_place_at_an_open_frame_is_none():
    ground = np.zeros((60, 60), bool)
    ground[20:50, :50] = True
    city = city_of(ground)
    assert len(city.street_graph.places) == 0
    assert len(city.street_graph_of(closed=True).places) == 1


def test_water_is_no_street():
    city = grid_town(15)
    water = np.zeros(city.shape, bool)
    water[15:23] = True
    graph = city.street_graph_of(water=water)
    wet = graph.kind == "water"
    assert wet.sum() == 4
    assert (np.array([shapely.bounds(edge)[3] for edge in graph.edges])[wet] > 2 * 90).all()


def test_the_graph_lies_where_the_map_does():
    city = grid_town(15)
    placed = CityMap(city.heights, 2.0, origin=(1000.0, 5000.0), crs="EPSG:2154")
    moved = placed.street_graph.nodes - city.street_graph.nodes
    np.testing.assert_allclose(moved, [[1000.0, 5000.0 - 2 * city.shape[0]]] * len(moved))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(
    "ground",
    [
        np.ones((1, 1), bool),
        np.zeros((1, 1), bool),
        np.ones((60, 40), bool),
        np.zeros((60, 40), bool),
        np.ones((1, 40), bool),
        np.eye(9, dtype=bool),
    ],
    ids=["one open pixel", "one built pixel", "no building", "full", "a row", "corners alone"],
)
def test_poor_maps(ground, closed):
    for how in ({}, WHOLE):
        graph = city_of(ground).street_graph_of(closed=closed, **how)
        check(city_of(ground), graph)
        assert len(graph.ribbons()) == len(graph)
        assert (np.isnan(graph.width_map) == ~ground).all()
    assert graph.components == int(ground.any())


@pytest.mark.slow
def test_very_many_buildings():
    across = np.arange(1000) % 3 < 1
    city = city_of(across[:, None] | across, 3.0)
    graph = city.street_graph_of(least_width=3.0)
    assert len(city.buildings) == 333**2
    assert graph.cycles == len(city.buildings)
    assert len(np.unique(graph.quarters)) == len(city.buildings)


# -- real towns ------------------------------------------------------------------------------------


@pytest.mark.slow_cases("cape-town-salt-river")
@pytest.mark.parametrize("name", cities())
def test_real_towns(name):
    city = read_map(name)
    graph = city.street_graph
    check(city, graph)
    assert graph is city.street_graph
    assert not graph.nodes.flags.writeable
    walls = city.walls.polygons
    ribbons = graph.ribbons(walls)
    assert shapely.is_valid(ribbons).all()
    assert shapely.union_all(ribbons).intersection(shapely.union_all(walls)).area < 1e-3
    assert (np.isnan(graph.width_map) == city.built).all()


@pytest.mark.slow
def test_west_village_is_found():
    _streets = pytest.importorskip("_streets")
    if not _streets.SHARED.is_dir():
        pytest.skip(f"there is no {_streets.SHARED}")
    real = _streets.real("original-new-york-west-village.osm.pbf", center=_streets.WEST_VILLAGE)
    told = _streets.told(real.city.street_graph, real)
    assert told["found"] >= 0.95
    assert told["true"] >= 0.80
    assert told["crossings found"] >= 0.80


# -- the table, and input at fault -----------------------------------------------------------------


def test_kinds_of_the_table():
    kinds = packaged().named(
        np.array([8.0, 9.75, 19.9, 25.0, 25.0, 30.0, 200.0]),
        np.array([500.0, 500.0, 10.0, 99.0, 100.0, 100.0, 1e4]),
    )
    told = ["alley", "street", "street", "street", "avenue", "boulevard", "boulevard"]
    assert kinds.tolist() == told


@settings(max_examples=60, deadline=None)
@given(
    width=st.floats(0, 1e6),
    length=st.floats(0, 1e6),
)
def test_every_street_is_of_one_kind(width, length):
    table = packaged()
    own = np.array([width, length])
    taken = {name for name, (low, high) in table.entries if ((low <= own) & (own < high)).all()}
    assert taken == {table.named(np.array([width]), np.array([length]))[0]}


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("kind = 3", "entries [[kind]]"),
        ("", "0 entries"),
        ("[[kind]]\nname = 'a'\nwidth = { from = 3 }", "no kind includes a street of width"),
        (
            "[[kind]]\nname = 'a'\nwidth = { below = 5 }\n"
            "[[kind]]\nname = 'b'\nwidth = { from = 6 }",
            "no kind includes a street of width 5.5 m",
        ),
        (
            "[[kind]]\nname = 'a'\nwidth = { below = 5 }\n"
            "[[kind]]\nname = 'b'\nlength = { from = 6 }\n"
            "[[kind]]\nname = 'c'\nwidth = { from = 5 }\nlength = { below = 6 }",
            "the limits of a and of b both include a street of",
        ),
        ("[[kind]]\nname = 'a'\nheight = { from = 3 }", "height of entry 1, kind a"),
        ("[[kind]]\nname = 'a'\nwidth = { till = 3 }", "width = "),
        ("[[kind]]\nname = 'a'\nwidth = { from = 3, below = 3 }", "{ from = 3, below = 3 }"),
        ("[[kind]]\nname = 'a'\nwidth = { from = nan }", "from = nan"),
        ("[[kind]]\nname = 'water'", "name = 'water'"),
        ("[[kind]]\nwidth = { from = 3 }", "name = None"),
        ("[[kind]]\nname = 'a'\n[places]\nwidth = 3", "places in a table"),
        ("[[kind]]\nname = 'a'\n[place]\nwide = 3", "wide of [place]"),
        ("[[kind]]\nname = 'a'\n[place]\nwidth = 0", "[place] has the invalid value width = 0"),
        ("[[kind]]\nname = 'a'\n[place]\nfilled = 2", "[place] has the invalid value filled = 2"),
        ("[[kind", "no TOML"),
    ],
)
def test_tables_at_fault(text, found, tmp_path):
    with pytest.raises(MapError) as error:
        StreetKinds.of(text)
    assert found in error.value.found
    path = tmp_path / "kinds.toml"
    path.write_text(text)
    with pytest.raises(MapError, match=r"kinds\.toml"):
        grid_town(15).street_graph_of(kinds=path)


@pytest.mark.parametrize(
    "how",
    [
        {"least_width": -1},
        {"least_width": np.nan},
        {"spurs": "two"},
        {"spurs": np.inf},
        {"water": np.zeros((3, 3), bool)},
        {"water": np.zeros((122, 122))},
        {"kinds": "nowhere.toml"},
    ],
    ids=str,
)
def test_parameters_at_fault(how):
    with pytest.raises(MapError):
        grid_town(15).street_graph_of(**how)


# -- kernels and their twins -----------------------------------------------------------------------


def lines_of(seed: int, height: int, width: int):
    rng = np.random.default_rng(seed)
    if seed % 2:
        lines = np.pad(rng.random((height, width)) < 0.4, 1)
        return lines, np.pad(rng.random((height, width)) < 0.1, 1)
    ground = skeleton(ground_of(seed, height, width), None, bool(seed % 3), None)
    return ground.lines, ground.exits


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(1, 16), width=st.integers(1, 16))
def test_tracing_follows_each_link_once(seed, height, width):
    lines, fixed = lines_of(seed, height, width)
    nodes, first, last, starts, path = _kernels.traced(lines, fixed)
    columns = lines.shape[1]
    seen = []
    for k in range(len(first)):
        own = [divmod(p, columns) for p in path[starts[k] : starts[k + 1]].tolist()]
        assert own[0] == divmod(nodes[first[k]], columns)
        assert own[-1] == divmod(nodes[last[k]], columns)
        inner = {y * columns + x for y, x in own[1:-1]}
        assert not inner & set(nodes.tolist())
        seen += [frozenset(pair) for pair in itertools.pairwise(own)]
    assert len(seen) == len(set(seen))
    assert set(seen) == naive.links_of(lines)
    lengths = _kernels.lengths_of(starts, path, columns)
    for k, length in enumerate(lengths):
        own = np.array(np.divmod(path[starts[k] : starts[k + 1]], columns)).T
        assert length == pytest.approx(np.hypot(*np.diff(own, axis=0).T).sum())
    assert set(np.flatnonzero(lines & fixed)) <= set(nodes.tolist())
    holes = ndimage.label(~lines)[1] - 1
    pieces = ndimage.label(lines, ALL_ROUND)[1]
    assert topology(multigraph(len(nodes), first, last)) == (pieces, holes)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.integers(1, 20),
    width=st.integers(1, 20),
    share=st.sampled_from([0.0, 1.0, 3.0]),
)
def test_contracting_and_joining_keep_the_topology(seed, height, width, share):
    lines, fixed = lines_of(seed, height, width)
    nodes, *graph = _kernels.traced(lines, fixed)
    columns = lines.shape[1]
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0, 5, len(nodes))
    lengths = _kernels.lengths_of(graph[2], graph[3], columns)
    before = topology(multigraph(len(nodes), *graph[:2]))
    became, *smaller = _kernels.contracted(nodes, *graph, lengths, radius, share)
    kept = became == np.arange(len(nodes))
    assert (became[became] == became).all()
    assert (radius[became] >= radius).all()
    left = multigraph(len(nodes), *smaller[:2])
    left.remove_nodes_from(np.flatnonzero(~kept).tolist())
    assert topology(left) == before
    check_paths(nodes, smaller, naive.links_of(lines), columns)
    stays = rng.random(len(nodes)) < 0.2
    alive = rng.random(len(smaller[0])) < 0.9
    joined = _kernels.joined(len(nodes), *smaller, alive, stays)
    check_paths(nodes, joined, naive.links_of(lines), columns)
    whole = multigraph(len(nodes), smaller[0][alive], smaller[1][alive])
    whole.remove_nodes_from([node for node, degree in list(whole.degree) if degree == 0])
    result = multigraph(len(nodes), *joined[:2])
    result.remove_nodes_from([node for node, degree in list(result.degree) if degree == 0])
    assert topology(result) == topology(whole)
    assert sum(len(p) for p in np.split(joined[3], joined[2][1:-1])) - len(joined[0]) == sum(
        smaller[2][k + 1] - smaller[2][k] - 1 for k in np.flatnonzero(alive)
    )
    for node, degree in result.degree:  # only rings keep a node that two ends meet at
        if degree == 2 and not stays[node]:
            assert result.has_edge(node, node)


def check_paths(nodes, graph, links, columns):
    first, last, starts, path = graph
    for k in range(len(first)):
        own = path[starts[k] : starts[k + 1]].tolist()
        assert (own[0], own[-1]) == (nodes[first[k]], nodes[last[k]])
        for pair in itertools.pairwise(own):
            assert frozenset(divmod(p, columns) for p in pair) in links


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), many=st.integers(2, 9), count=st.integers(0, 14))
def test_spurs_and_streets_are_those_of_the_twins(seed, many, count):
    rng = np.random.default_rng(seed)
    first, last = rng.integers(0, many, (2, count))
    lengths, bound = rng.permutation(count) + 0.5, rng.uniform(0, 14, many)
    fixed, alive = rng.random(many) < 0.2, np.ones(count, bool)
    expected = naive.spurs_taken(first, last, lengths, bound, fixed)
    taken = _kernels.without_spurs(first, last, lengths, bound, fixed, alive)
    np.testing.assert_array_equal(alive, expected)
    assert taken == count - alive.sum()
    angles = rng.uniform(0, 2 * np.pi, (count, 2))
    headings = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
    street = np.empty(count, np.int64)
    _kernels.straight_on(first, last, headings, 0.7, street)
    groups = {frozenset(np.flatnonzero(street == one).tolist()) for one in street.tolist()}
    assert groups == naive.straight_streets(first, last, headings, 0.7)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(1, 14), width=st.integers(1, 14))
def test_exits_thickness_and_smooth_lines_are_those_of_the_twins(seed, height, width):
    ground = skeleton(ground_of(seed, height, width), None, bool(seed % 2), None)
    rng = np.random.default_rng(seed)
    frame = ndimage.label(rng.random(ground.open.shape) < 0.5)[0].astype(np.int32)
    out = np.zeros(frame.shape, bool)
    _kernels.exits(frame, ground.squares, out)
    np.testing.assert_array_equal(out, naive.exits(frame, ground.squares))
    spare = rng.uniform(-4, 1, frame.shape).astype(np.float32)
    thick = rng.uniform(0, 3, frame.shape).astype(np.float32)
    given = ground.open, ground.squares, ground.across, int(rng.integers(1, 40))
    expected = naive.thickness(*given, spare, thick)
    _kernels.thickness(*given, spare, thick)
    np.testing.assert_allclose(thick, expected, rtol=1e-6)
    _, first, _, starts, path = _kernels.traced(ground.lines, ground.exits)
    points = np.empty((len(path), 2))
    ends = rng.uniform(0, 9, (len(first), 2, 2))
    _kernels.smoothed(starts, path, ground.squares, ends, 5, points)
    middles, leasts = np.empty(len(first)), np.empty(len(first))
    _kernels.middles_and_leasts(starts, path, ground.across, middles, leasts)
    for k in range(len(first)):
        own = path[starts[k] : starts[k + 1]]
        expected = naive.evened(own.tolist(), ground.squares, ends[k], 5)
        np.testing.assert_allclose(points[starts[k] : starts[k + 1]], expected, atol=1e-9)
        values = ground.across.ravel()[own]
        assert (middles[k], leasts[k]) == pytest.approx((np.median(values), values.min()))


@pytest.mark.parametrize("seed", range(8))
def test_what_reaches_the_frame_against_the_naive_twin(seed):
    rng = np.random.default_rng(seed)
    many, edges, hubs, side = 12, int(rng.integers(0, 9)), 4, 20
    inner = [y * side + x for y in range(1, side - 1) for x in range(1, side - 1)]
    beside = np.where(rng.random((side, side)) < 0.03, rng.integers(1, hubs + 1, (side, side)), 0)
    beside = beside.astype(np.int32)
    beside[0, 0] = hubs
    nodes = rng.choice(inner, many, replace=False)
    first, last = rng.integers(0, many, (2, edges))
    starts = np.concatenate([[0], np.cumsum(rng.integers(2, 6, edges))])
    path = rng.choice(inner, int(starts[-1]))
    out = rng.random(many) < 0.2
    reached = np.empty(many + hubs, bool)
    reach_frame(first, last, starts, path, nodes, out, beside, reached)
    true_nodes, true_hubs = naive.reach_frame(first, last, starts, path, nodes, out, beside)
    assert np.array_equal(reached[:many], true_nodes)
    assert np.array_equal(reached[many:], true_hubs)
