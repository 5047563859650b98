"""Pitched roofs: skeletons against slow twins, and solids that are closed, flat and valid."""

import functools
import json

import manifold3d
import naive
import numpy as np
import parsed
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from test_scene_files import (
    ANY_MAP,
    MAPS,
    any_heights,
    drawn,
    schema,
    vertical,
    written,
)
from test_scene_files import (
    test_glb_is_valid_to_khronos as check_glb,
)
from towns import draw_town

import evocity
from evocity.errors import MapError
from evocity.formats.shells import FLOOR, ROOF, WALL, flatness
from evocity.formats.solids import rings_of
from evocity.scene.roofs import SHAPES, heights_are_ridges
from evocity.scene.roofs._kernels import sides
from evocity.scene.roofs.plans import BELOW, SPREAD, neighbours
from evocity.scene.roofs.skeleton import skeleton_of


def skeleton(plan, weights=None, most=np.inf):
    rings = rings_of(np.array([plan], object))
    weights = np.ones(len(rings.points)) if weights is None else np.array(weights, float)
    return rings, skeleton_of(rings.points, rings.after, weights, most)


def faces(made):
    return [made.corners[a:b] for a, b in zip(made.starts[:-1], made.starts[1:], strict=True)]


def star(rng, corners, holes=0):
    """A plan without convexity, with small courts."""
    angles = np.sort(rng.random(corners)) * 2 * np.pi
    reach = rng.uniform(8, 25, corners)
    plan = shapely.Polygon(np.column_stack([reach * np.cos(angles), reach * np.sin(angles)]))
    for _ in range(holes):
        x, y = rng.uniform(-4, 4, 2)
        plan = plan.difference(shapely.box(x, y, x + rng.uniform(1, 4), y + rng.uniform(1, 4)))
    return plan


@pytest.mark.parametrize(
    ("plan", "weights", "sizes", "depth"),
    [
        (shapely.box(0, 0, 10, 10), None, [3, 3, 3, 3], 5),  # a pyramid
        (shapely.box(0, 0, 20, 10), None, [3, 4, 3, 4], 5),  # hips
        (shapely.box(0, 0, 20, 10), [0, 1, 0, 1], [3, 4, 3, 4], 5),  # gables
        (shapely.box(0, 0, 20, 10), [0, 1, 0, 0], [3, 4, 3, 4], 10),  # one slope
    ],
)
def test_roofs_of_rectangles(plan, weights, sizes, depth):
    _, made = skeleton(plan, weights)
    assert [len(face) for face in faces(made)] == sizes
    assert made.depth == pytest.approx(depth)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_convex_roofs_are_the_lowest_of_their_planes(seed):
    rng = np.random.default_rng(seed)
    plan = shapely.MultiPoint(rng.uniform(-20, 20, (8, 2))).convex_hull
    plan = shapely.orient_polygons(plan)
    rings = rings_of(np.array([plan], object))
    weights = (rng.random(len(rings.points)) < 0.6).astype(float)
    weights[0] = 1.0
    _, made = skeleton(plan, weights)
    if made is None:
        return
    times = naive.roof_heights(rings.points, weights, made.nodes[:, :2])
    n = len(rings.points)
    beside = np.minimum(weights, np.roll(weights, 1)) == 0
    for node in np.unique(made.corners):
        if node >= n:
            assert made.nodes[node, 2] <= times[node] + 1e-6 or beside.any()
    for face, weight in zip(faces(made), weights, strict=True):
        if weight:
            middle = made.nodes[face].mean(axis=0)
            own = naive.roof_heights(rings.points, weights, middle[None, :2])
            assert own[0] == pytest.approx(middle[2], abs=1e-5)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 2))
def test_faces_of_any_plan_cover_it(seed, holes):
    rng = np.random.default_rng(seed)
    plan = star(rng, int(rng.integers(4, 30)), holes)
    if plan.geom_type != "Polygon" or not plan.is_valid:
        return
    rings, made = skeleton(plan)
    assert made is not None
    area = 0.0
    for edge, face in enumerate(faces(made)):
        start, end = rings.points[edge], rings.points[rings.after[edge]]
        x, y = (end - start) / np.hypot(*(end - start))
        away = (made.nodes[face, :2] - start) @ (-y, x)
        assert away == pytest.approx(made.nodes[face, 2], abs=0.02)
        area += shapely.Polygon(made.nodes[face, :2]).area
    assert area == pytest.approx(plan.area, rel=1e-3)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_remains_is_the_plan_shrunk(seed):
    rng = np.random.default_rng(seed)
    plan = star(rng, int(rng.integers(4, 12)))
    time = float(rng.uniform(0.5, 4))
    _, made = skeleton(plan, most=time)
    lines = made.nodes[made.deck, :2]
    area = (lines[:, 0, 0] * lines[:, 1, 1] - lines[:, 0, 1] * lines[:, 1, 0]).sum() / 2
    expected = naive.shrunk_plan(plan, time, time / 400).area
    assert area == pytest.approx(expected, abs=0.02 * plan.area + 0.05)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_sides_are_their_slow_twin(seed):
    rng = np.random.default_rng(seed)
    plans = [star(rng, int(rng.integers(3, 40))) for _ in range(3)]
    rings = rings_of(np.array(plans, object))
    own, count = sides(rings.points, rings.starts, np.cos(np.radians(SPREAD)))
    lists = np.split(rings.points, rings.starts[1:-1])
    assert own.tolist() == naive.wall_sides([ring.tolist() for ring in lists], SPREAD)
    assert count == own.max() + 1


@functools.cache
def roofed(name: str):
    return evocity.scene(MAPS[name](), roofs=True)


ROOFED = [name for name in MAPS if name not in ("empty", "high")]


@pytest.fixture(params=ROOFED)
def scene(request):
    return roofed(request.param)


def places_of(group):
    """Corners of the faces of a group's roofs."""
    shells, rings = group.roofs, group.rings
    face = np.repeat(np.arange(len(shells.owner)), np.diff(shells.starts))
    first = rings.starts[rings.first(len(group))]
    found = np.zeros((len(face), 3))
    ground = shells.corners < 0
    at = first[shells.owner[face[ground]]] - 1 - shells.corners[ground]
    found[ground, :2] = rings.points[at]
    found[~ground] = shells.points[shells.corners[~ground]]
    return found, face


def check_roofs(scene) -> None:
    """Closed, manifold, turned outwards, of flat faces, as high as the group says."""
    for group in scene.groups:
        mesh = group.mesh
        if "roof" not in group.attributes or not len(group):
            continue
        points, triangles = mesh.points, mesh.triangles
        edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        way = edges[:, 0].astype(np.int64) * len(points) + edges[:, 1]
        back = edges[:, 1].astype(np.int64) * len(points) + edges[:, 0]
        assert len(np.unique(way)) == len(way)
        assert np.array_equal(np.sort(way), np.sort(back))
        assert (mesh.normals[mesh.part == FLOOR] @ (0, 0, -1) > 0.99).all()
        assert (np.abs(mesh.normals[mesh.part == WALL][:, 2]) < 0.05).all()
        assert (mesh.normals[mesh.part == ROOF][:, 2] > 0.1).all()
        tops = np.zeros(len(group))
        np.maximum.at(tops, mesh.owner, points[triangles, 2].max(axis=1))
        assert tops == pytest.approx(group.heights, abs=1e-5)
        own = points[triangles[mesh.part == ROOF], :2]
        (ax, ay), (bx, by) = ((own[:, k] - own[:, 0]).T for k in (1, 2))
        area = np.bincount(mesh.owner[mesh.part == ROOF], (ax * by - ay * bx) / 2, len(group))
        assert area == pytest.approx(shapely.area(group.polygons), rel=2e-3, abs=0.03)
        for owner in range(len(group)):
            rows = triangles[mesh.owner == owner]
            used, index = np.unique(rows, return_inverse=True)
            solid = manifold3d.Manifold(
                manifold3d.Mesh64(points[used], index.reshape(-1, 3).astype(np.uint64))
            )
            assert solid.status() == manifold3d.Error.NoError
            assert solid.volume() > 0
        if group.roofs is not None:
            assert flatness(places_of(group)[0], group.roofs.starts).max() < 0.01


def test_solids_with_roofs_are_closed_and_flat(scene):
    check_roofs(scene)


@settings(max_examples=30, deadline=None)
@ANY_MAP
def test_roofs_of_any_map_are_closed(seed, pixel, noisy):
    heights = any_heights(seed, noisy, least=2)
    heights[0, 0] = 3.0
    check_roofs(evocity.scene(drawn(heights, pixel), roofs=True, squared=bool(seed % 2)))


def test_no_roof_slopes_to_a_shared_wall(scene):
    """Nor has a face of a roof a side along it, except where its top meets the wall."""
    groups = [group for group in scene.groups if "roof" in group.attributes]
    if not groups:
        return
    heights = np.concatenate([group.attributes["eavesHeight"] for group in groups])
    if any(value is None for value in heights):
        return
    polygons = np.concatenate([group.polygons for group in groups])
    rings, eaves = rings_of(polygons), heights.astype(float)
    tops = np.concatenate([group.heights for group in groups])
    given_heights = (
        tops if heights_are_ridges(scene.city.height_rules, scene.city.attribution) else eaves
    )
    beside = neighbours(rings.points, rings.points[rings.after], rings.owner)
    begin = 0
    for group in groups:
        shells, first = group.roofs, rings.starts[rings.first(len(polygons))]
        if shells is not None:
            for face in np.flatnonzero(shells.part == ROOF).tolist():
                owner = int(shells.owner[face]) + begin
                corners = shells.corners[shells.starts[face] : shells.starts[face + 1]]
                points = shells.points[corners]
                low = points[:, 2] <= points[:, 2].min() + 1e-9
                if np.ptp(points[:, 2]) < 1e-6 or low.sum() < 2:
                    continue
                # the eaves of the face
                a, b = points[0, :2], points[1, :2]
                own = slice(first[owner], first[owner + 1])
                edge = np.flatnonzero((np.abs(rings.points[own] - a) < 1e-6).all(axis=1))
                assert len(edge) == 1
                edge = int(edge[0]) + own.start
                assert rings.points[rings.after[edge]] == pytest.approx(b)
                other = beside[edge]
                assert other < 0 or given_heights[other] < given_heights[owner] - BELOW
        begin += len(group)


@pytest.mark.parametrize(
    ("name", "least"),
    [("lyon-1er", 200), ("new-york-west-village", 200), ("montpellier-pas-du-loup", 100)],
)
def test_most_buildings_that_may_have_pitched_roofs_have_them(name, least, monkeypatch):
    from evocity.scene.roofs import roofs

    chosen, choose = [], roofs.choose_shapes
    monkeypatch.setattr(roofs, "choose_shapes", lambda *a: chosen.append(choose(*a)) or chosen[0])
    scene = evocity.scene(MAPS[name](), roofs=True)
    shapes = [shape for group in scene.groups for shape in group.attributes.get("roof", [])]
    pitched = sum(shape not in ("flat", None) for shape in shapes)
    assert set(shapes) - {None} <= set(SHAPES)
    assert pitched >= 0.6 * chosen[0].may.sum()
    assert chosen[0].may.sum() > least


def test_cityjson_of_roofs_keeps_to_its_schema_and_semantics(scene, tmp_path):
    scene.write(tmp_path / "roofs.city.json")
    document = json.loads((tmp_path / "roofs.city.json").read_text(encoding="utf-8"))
    assert [str(error) for error in schema().iter_errors(document)] == []
    vertices, used = np.array(document["vertices"]).reshape(-1, 3), set()
    for found in document["CityObjects"].values():
        (geometry,) = found["geometry"]
        if geometry["type"] == "MultiSurface":
            used.update(n for surface in geometry["boundaries"] for ring in surface for n in ring)
            continue
        assert geometry["lod"] == "2.2"
        shell = geometry["boundaries"][0]
        edges = []
        for surface in shell:
            for ring in surface:
                assert len(set(ring)) == len(ring) >= 3
                edges += zip(ring, ring[1:] + ring[:1], strict=True)
                used.update(ring)
        assert len(set(edges)) == len(edges)
        assert {(b, a) for a, b in edges} == set(edges)
        if found["type"] == "Building":
            (values,) = geometry["semantics"]["values"]
            for surface, value in zip(shell, values, strict=True):
                kind = geometry["semantics"]["surfaces"][value]["type"]
                if kind == "GroundSurface":
                    assert vertical(vertices[surface[0]]) == -1
            assert {0, 1, 2} == set(values)
    assert used == set(range(len(vertices)))


@pytest.mark.parametrize("rule", ["HAUTEUR", "height"])
def test_heights_are_eaves_or_ridges_as_their_rule_says(rule):
    city = evocity.read_map("montpellier-pas-du-loup")
    described = {"height_rules": {rule: 100}, "origin": city.origin, "crs": city.crs}
    city = evocity.CityMap(city.heights, city.metres_per_pixel, **described)
    scene = evocity.scene(city, roofs=True)
    for group in scene.groups:
        if group.roofs is None:
            continue
        eaves = np.array(group.attributes["eavesHeight"], float)
        ids = group.attributes["id"]
        own = city.buildings.height[np.array(ids) - 1]
        assert (group.heights if rule == "height" else eaves) == pytest.approx(own, abs=1e-3)
        assert (group.heights >= eaves - 1e-3).all()


def test_parts_of_a_group_keep_their_roofs():
    group = next(g for g in roofed("lyon-1er").groups if g.roofs is not None)
    rows = np.arange(len(group))[::-3]
    part = group.take(rows)
    check_roofs(type("Part", (), {"groups": [part]}))
    whole, own = group.mesh, part.mesh
    for k, row in enumerate(rows.tolist()):
        one = whole.points[whole.triangles[whole.owner == row]]
        other = own.points[own.triangles[own.owner == k]]
        assert len(one) == len(other)
        assert np.array_equal(np.sort(one.ravel()), np.sort(other.ravel()))


@pytest.mark.parametrize(
    ("heights", "how", "says"),
    [
        (np.zeros((8, 8)), {}, "all heights are 0"),
        (np.full((8, 8), 1500.0), {}, "1500 m"),
        (np.full((8, 8), 9.0), {"lod": "1.2"}, "no pitched roofs"),
    ],
)
def test_roofs_that_cannot_be_are_refused(heights, how, says):
    with pytest.raises(MapError, match=says):
        evocity.scene(drawn(heights), roofs=True, **how)


def test_the_same_map_has_the_same_roofs():
    town = draw_town(4, side=96)
    one, other = (evocity.scene(town, roofs=True).groups[-1].mesh for _ in range(2))
    assert one.points.tobytes() == other.points.tobytes()
    assert one.triangles.tobytes() == other.triangles.tobytes()


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".wrl", ".x3d"])
def test_meshes_with_roofs_hold_what_was_written(tmp_path, suffix):
    scene = roofed("lyon-1er")
    told = parsed.read(written(scene, tmp_path, suffix))
    for group in scene.groups:
        if group.roofs is None:
            continue
        a, b, c = (told[group.name][:, k] for k in range(3))
        volume = (a * np.cross(b, c)).sum() / 6
        assert volume == pytest.approx(group.volume, rel=1e-3)
        assert told[group.name][..., 2].max() == pytest.approx(group.heights.max(), abs=2e-3)


def test_glb_with_roofs_is_valid_and_small(tmp_path):
    scene = roofed("child 0")
    check_glb(scene, tmp_path)
    size = written(scene, tmp_path, ".glb").stat().st_size
    assert size <= 8000 * len(scene.walls)


def test_shapes_of_a_source_come_first(tmp_path):
    """Five houses that stand apart, each 12 × 24 m and 6 m high, with the shape in roof:shape."""
    shapes = ["flat", "skillion", "gabled", "Half-hipped", "no such shape"]
    features = []
    for k, shape in enumerate(shapes):
        x, y = 4.83 + k * 0.0006, 45.76
        ring = [[x, y], [x + 0.0003, y], [x + 0.0003, y + 0.000108], [x, y + 0.000108], [x, y]]
        features.append(
            {
                "type": "Feature",
                "geometry": {"type": "Polygon", "coordinates": [ring]},
                "properties": {"building": "yes", "building:levels": "2", "roof:shape": shape},
            }
        )
    path = tmp_path / "houses.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    city = evocity.read_map(path, metres_per_pixel=1.0)
    assert "4 from roof:shape" in city.taken
    assert len(city.roof_shapes) == 4
    for map_of in (city, city.replace(city.heights), city.within(city.heights >= 0)):
        scene = evocity.scene(map_of, roofs=True)
        order = np.argsort([p.centroid.x for p in scene.groups[-1].polygons])
        shapes = np.array(scene.groups[-1].attributes["roof"])[order].tolist()
        assert shapes == ["flat", "skillion", "gabled", "hipped", "gabled"]
    assert evocity.scene(city).groups[-1].roofs is None


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "child 0"])
def test_roofs_cover_their_plans_with_streets_too(name):
    """Footprints have more corners then, and their real corners stay: no roof over a court."""
    scene = evocity.scene(MAPS[name](), roofs=True, streets=True)
    for group in scene.groups:
        if group.roofs is None:
            continue
        mesh = group.mesh
        own = mesh.points[mesh.triangles[mesh.part == ROOF]][:, :, :2]
        (ax, ay), (bx, by) = ((own[:, k] - own[:, 0]).T for k in (1, 2))
        area = np.bincount(mesh.owner[mesh.part == ROOF], (ax * by - ay * bx) / 2, len(group))
        assert area == pytest.approx(shapely.area(group.polygons), rel=2e-3, abs=0.5)


def test_roofs_are_the_same_wherever_the_buildings_lie():
    """Windows of a fabric share buildings with roofs, bit for bit on the grid of millimetres."""
    heights = evocity.read_map("lyon-1er").heights[:160, :160]

    def found(north, west, south, east):
        city = evocity.CityMap(np.pad(heights, ((north, south), (west, east))), 2.0)
        corner = np.array([west * 2.0, south * 2.0, 0.0])
        (group,) = (one for one in evocity.scene(city, roofs=True).groups if one.name == "building")
        shells = group.roofs
        points = np.round((shells.points - corner) * 1000).astype(int)
        lists = (points, shells.corners, shells.starts, shells.owner, shells.part, group.heights)
        return [group.attributes["roof"], *(one.tolist() for one in lists)]

    first = found(4, 4, 4, 4)
    assert found(37, 5, 6, 131) == first
    assert found(5, 613, 77, 4) == first
