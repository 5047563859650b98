"""Objects of scenes keep names, properties, materials, normals and texture coordinates."""

import functools
import itertools
import json

import numpy as np
import parsed
import pytest
import shapely
from click.testing import CliRunner
from towns import draw_town

import evocity
import evocity.scene
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.fitness.heredity import building_sources
from evocity.formats import About, Group, glb, mtl, obj, vrml97
from evocity.formats.facets import facets, pair_walls
from evocity.formats.materials import materials_of, names_of, tiles_of
from evocity.formats.solids import FLOOR, ROOF, WALL, Mesh
from evocity.formats.trees import form_of, mesh_of
from evocity.operators import make

ABOUT = About("drawn", "© drawn", None, (0.0, 0.0), (60.0, 60.0), (30.0, 30.0, 2.0))


@functools.cache
def lyon() -> evocity.scene.Scene:
    return evocity.scene(evocity.read_map("lyon-1er"))


def read(path):
    document, body = parsed.glb_document(path)
    return document, functools.partial(parsed.glb_array, document, body)


def gable() -> tuple[Group, Mesh]:
    """A house of 10 m × 6 m with a ridge at 8 m above eaves of 5 m: two gables of five corners."""
    plan = [(0, 0), (10, 0), (10, 6), (0, 6)]
    points = [(x, y, z) for z in (0, 5) for x, y in plan] + [(0, 3, 8), (10, 3, 8)]
    floor = [(0, 2, 1), (0, 3, 2)]
    walls = [(0, 1, 5), (0, 5, 4), (2, 3, 7), (2, 7, 6), (1, 2, 6), (1, 6, 9), (1, 9, 5)]
    walls += [(3, 0, 4), (3, 4, 8), (3, 8, 7)]
    roofs = [(4, 5, 9), (4, 9, 8), (6, 7, 8), (6, 8, 9)]
    triangles = np.array(floor + walls + roofs, np.int32)
    part = np.repeat([FLOOR, WALL, ROOF], [2, 10, 4]).astype(np.uint8)
    mesh = Mesh(np.array(points, float), triangles, np.zeros(16, np.int32), part)
    group = Group(
        "building",
        (0.5, 0.5, 0.5),
        np.array([shapely.Polygon(plan)]),
        np.array([5.0]),
        {"id": [7], "storeysAboveGround": [2]},
        ["Building"],
    )
    group.__dict__["mesh"] = mesh
    return group, mesh


# -- faces -----------------------------------------------------------------------------------------


def test_faces_have_their_normals_and_textures_in_metres():
    for group in (*lyon().groups, gable()[0]):
        mesh, tiles = group.mesh, np.array(tiles_of(group))
        made = facets(mesh, tiles)
        assert len(made.triangles) == len(mesh.triangles)
        a, b, c = (made.points[made.triangles[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        area = np.sqrt((cross**2).sum(axis=1)) / 2
        for k in range(3):
            inner = np.einsum("ij,ij->i", cross, made.normals[made.triangles[:, k]])
            assert (inner > 2 * area * (1 - 1e-5) - 1e-9).all()
        # textures keep areas: a square metre is a square metre, or so many square tiles
        u, v, w = (made.uv[made.triangles[:, k]] for k in range(3))
        turned = (v - u)[:, 0] * (w - u)[:, 1] - (v - u)[:, 1] * (w - u)[:, 0]
        wall = np.abs(cross[:, 2]) < 1e-9 * np.maximum(area, 1e-9)
        unit = np.where(wall, tiles[made.of] ** 2, 1.0)
        down = cross[:, 2] < -1e-9  # floors are seen from below
        assert np.where(down, -turned, turned) * unit / 2 == pytest.approx(area, rel=1e-3, abs=1e-5)
        assert (np.diff(made.owner) >= 0).all()


def test_walls_have_a_tile_for_each_storey():
    (group,) = (one for one in lyon().groups if one.name == "building")
    made = facets(group.mesh, np.array(tiles_of(group)))
    wall = np.abs(made.normals[:, 2]) < 1e-6
    most = np.zeros(len(group))
    np.maximum.at(most, made.owner[wall], made.uv[wall, 1])
    assert most == pytest.approx(np.array(group.attributes["storeysAboveGround"], float))
    assert made.uv[wall].min() == pytest.approx(0, abs=1e-9)


def test_faces_of_any_form_are_kept():
    group, mesh = gable()
    quads, owners, threes, rows = pair_walls(mesh)
    assert 2 * len(quads) + len(threes) == len(mesh.triangles)
    assert set(mesh.part[rows]) >= {FLOOR, ROOF}
    assert len(owners) == len(quads)
    (triangles,) = _obj_triangles(obj([group], ABOUT)).values()
    wanted = mesh.points[mesh.triangles]
    assert _volume(triangles) == pytest.approx(_volume(wanted)) == pytest.approx(390)


def _obj_triangles(text: str) -> dict[str, np.ndarray]:
    points, found, name = [], {}, ""
    for line in text.splitlines():
        word, *rest = line.split()
        if word == "v":
            points.append([float(x) for x in rest[:3]])
        elif word == "o":
            (name,) = rest
        elif word == "f":
            a, *others = (int(x) - 1 for x in rest)
            found.setdefault(name, []).extend([a, b, c] for b, c in itertools.pairwise(others))
    placed = np.array(points)[:, [0, 2, 1]] * (1, -1, 1)
    return {name: placed[np.array(own)] for name, own in found.items()}


def _volume(triangles: np.ndarray) -> float:
    a, b, c = np.moveaxis(triangles, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


# -- glTF ------------------------------------------------------------------------------------------


def test_each_building_is_a_node_with_its_properties(tmp_path):
    scene = lyon()
    scene.write(tmp_path / "x.glb")
    document, array = read(tmp_path / "x.glb")
    nodes = {one["name"]: one for one in document["nodes"]}
    assert len(nodes) == len(document["nodes"])
    for group in scene.groups[1:]:
        names = names_of(group)
        assert [document["nodes"][k]["name"] for k in nodes[group.name]["children"]] == names
        for k, name in enumerate(names):
            extras = nodes[name]["extras"]
            assert extras["id"] == group.attributes["id"][k]
            assert extras["class"] == group.name
            assert extras["height"] == pytest.approx(group.heights[k], abs=1e-3)
            assert extras["storeys"] == group.attributes["storeysAboveGround"][k]
            assert "source" not in extras
    (group,) = (one for one in scene.groups if one.name == "building")
    shares = []
    for k, name in enumerate(names_of(group)):
        mesh = document["meshes"][nodes[name]["mesh"]]
        materials = [document["materials"][one["material"]] for one in mesh["primitives"]]
        assert [one["name"] for one in materials] == ["wall", "roof"]
        x, y, z = nodes[name]["translation"]
        left, low, right, high = group.polygons[k].bounds
        assert (x, y, -z) == pytest.approx(((left + right) / 2, 0, (low + high) / 2), abs=2e-3)
        for primitive in mesh["primitives"]:
            normals = array(primitive["attributes"]["NORMAL"])
            assert (normals**2).sum(axis=1) == pytest.approx(1, abs=1e-5)
            points = array(primitive["attributes"]["POSITION"])
            corners = points[array(primitive["indices"]).reshape(-1, 3)]
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            own = normals[array(primitive["indices"]).reshape(-1, 3)[:, 0]]
            assert ((cross * own).sum(axis=1) > 0).all()
        shares.append(np.abs(points[:, 1]).max())
    assert shares == pytest.approx(group.heights, abs=1e-3)
    assert (tmp_path / "x.glb").stat().st_size <= 5000 * len(scene.walls)


def test_textures_of_glb_run_downwards(tmp_path):
    """Viewers put v = 0 at the top of a picture, so higher points of a wall have a smaller v."""
    scene = lyon()
    scene.write(tmp_path / "x.glb")
    document, array = read(tmp_path / "x.glb")
    mesh = next(one for one in document["meshes"] if one["name"].startswith("building"))
    attributes = mesh["primitives"][0]["attributes"]
    points, uv = array(attributes["POSITION"]), array(attributes["TEXCOORD_0"])
    wall = np.abs(array(attributes["NORMAL"])[:, 1]) < 0.1
    assert np.corrcoef(points[wall, 1], uv[wall, 1])[0, 1] < -0.999


def table_of(document: dict, path, name: str) -> dict[str, list]:
    """The columns of a property table, read by the rules of EXT_structural_metadata."""
    body = parsed.glb_document(path)[1]
    whole = document["extensions"]["EXT_structural_metadata"]
    (table,) = (one for one in whole["propertyTables"] if one["name"] == name)
    described = whole["schema"]["classes"][table["class"]]["properties"]
    assert set(described) == set(table["properties"])

    def data(number: int) -> bytes:
        view = document["bufferViews"][number]
        assert view["byteOffset"] % 8 == 0
        return body[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]

    columns = {}
    for key, place in table["properties"].items():
        kind, values = described[key], data(place["values"])
        if kind["type"] == "STRING":
            ends = np.frombuffer(data(place["stringOffsets"]), "<u4")
            found = [values[a:b].decode() for a, b in itertools.pairwise(ends)]
        else:
            number = {"INT32": "<i4", "FLOAT32": "<f4"}[kind["componentType"]]
            found = np.frombuffer(values, number).tolist()
        assert len(found) == table["count"]
        columns[key] = [None if one == kind.get("noData") else one for one in found]
    return columns


def test_a_merged_scene_has_a_table_of_properties(tmp_path):
    scene = lyon()
    scene.write(tmp_path / "x.glb", merge=True)
    document, array = read(tmp_path / "x.glb")
    assert {"EXT_mesh_features", "EXT_structural_metadata"} <= set(document["extensionsUsed"])
    (node,) = (one for one in document["nodes"] if one["name"] == "building")
    assert "children" not in node
    (group,) = (one for one in scene.groups if one.name == "building")
    table = table_of(document, tmp_path / "x.glb", "building")
    assert table["name"] == names_of(group)
    assert table["id"] == group.attributes["id"]
    assert table["storeys"] == group.attributes["storeysAboveGround"]
    tops = np.zeros(len(group))
    for primitive in document["meshes"][node["mesh"]]["primitives"]:
        (feature,) = primitive["extensions"]["EXT_mesh_features"]["featureIds"]
        ids = array(primitive["attributes"]["_FEATURE_ID_0"]).ravel()
        assert feature["featureCount"] == len(np.unique(ids)) == len(group)
        assert (ids == np.round(ids)).all()
        points = array(primitive["attributes"]["POSITION"])
        np.maximum.at(tops, ids.astype(int), points[:, 1])
    assert tops == pytest.approx(group.heights, abs=1e-3)
    assert tops == pytest.approx(np.array(table["height"]), abs=1e-3)
    assert table_of(document, tmp_path / "x.glb", "ground")["class"] == ["ground"]


def test_many_objects_are_merged_without_an_option(tmp_path, monkeypatch):
    scene = lyon()
    scene.write(tmp_path / "merged.glb", merge=True)
    scene.write(tmp_path / "nodes.glb", merge=False)
    scene.write(tmp_path / "few.glb")
    assert (tmp_path / "few.glb").read_bytes() == (tmp_path / "nodes.glb").read_bytes()
    count = sum(len(group) for group in scene.groups[1:])
    monkeypatch.setattr("evocity.formats.gltf.MANY", count)
    scene.write(tmp_path / "many.glb")
    assert (tmp_path / "many.glb").read_bytes() == (tmp_path / "merged.glb").read_bytes()


def park() -> evocity.scene.Scene:
    """Houses, trees of three sizes, and posts."""
    heights = np.zeros((64, 64))
    heights[4:24, 4:40] = 9
    rows, columns = np.indices(heights.shape)
    for row, column, radius, high in ((40, 10, 3, 8), (40, 24, 4, 11), (40, 44, 3, 7.5)):
        heights[np.hypot(rows - row, columns - column) < radius + 0.5] = high
    for column in (8, 20, 32):
        heights[54:56, column : column + 2] = 6
    return evocity.scene(CityMap(heights, 1.0, name="park"))


def test_trees_and_posts_share_a_mesh(tmp_path):
    scene = park()
    counts = {group.name: len(group) for group in scene.groups}
    assert counts == {"ground": 1, "post": 3, "tree": 3, "building": 1}
    scene.write(tmp_path / "x.glb")
    document, _ = read(tmp_path / "x.glb")
    for name in ("tree", "post"):
        own = [one for one in document["nodes"] if one["name"].startswith(f"{name}-")]
        assert len(own) == 3
        assert len({one["mesh"] for one in own}) == 1
        assert all(one["extras"]["class"] == name for one in own)
    assert {one["name"] for one in document["materials"]} >= {"trunk", "tree", "post"}
    for group in scene.groups[1:3]:
        mesh = mesh_of(group)
        assert form_of(group) is not None
        edges = np.concatenate([mesh.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        pairs = set(map(tuple, edges.tolist()))
        assert len(pairs) == len(edges)
        assert {(b, a) for a, b in pairs} == pairs


def test_merged_trees_and_posts_are_one_mesh_with_a_table(tmp_path):
    scene = park()
    scene.write(tmp_path / "merged.glb", merge=True)
    document, _ = read(tmp_path / "merged.glb")
    assert [node["name"] for node in document["nodes"]] == [group.name for group in scene.groups]
    for group in scene.groups[1:3]:
        table = table_of(document, tmp_path / "merged.glb", group.name)
        assert table["name"] == names_of(group)
        triangles = parsed.read(tmp_path / "merged.glb")[group.name]
        assert len(triangles) == len(mesh_of(group).triangles)
    assert scene.triangle_count == sum(len(mesh_of(group).triangles) for group in scene.groups)


def test_instances_stand_where_nodes_stand(tmp_path):
    scene = park()
    scene.write(tmp_path / "nodes.glb")
    scene.write(tmp_path / "instances.glb", instances=True)
    document, _ = read(tmp_path / "instances.glb")
    assert "EXT_mesh_gpu_instancing" in document["extensionsRequired"]
    assert not [one for one in document["nodes"] if one["name"].startswith("tree-")]
    first, second = (parsed.read(tmp_path / f"{n}.glb") for n in ("nodes", "instances"))
    assert list(first) == list(second)
    for name, triangles in first.items():
        assert second[name] == pytest.approx(triangles, abs=1e-4)
    table = table_of(document, tmp_path / "instances.glb", "tree")
    assert table["class"] == ["tree"] * 3


def test_properties_of_any_kind_have_a_table(tmp_path):
    shape = shapely.box(0, 0, 5, 5)
    attributes = {"id": [1, None], "a b": [0.5, None], "3": ["é", None], "none": [None, None]}
    group = Group("odd one", (0, 0, 0), np.array([shape, shape]), np.array([3.0, 4]), attributes)
    (tmp_path / "x.glb").write_bytes(glb([group], ABOUT, merge=True))
    document, _ = read(tmp_path / "x.glb")
    table = table_of(document, tmp_path / "x.glb", "odd one")
    assert table == {
        "name": ["odd one-1", "odd one-low-2"],
        "class": ["odd one"] * 2,
        "height": [3, 4],
        "id": [1, None],
        "a_b": [0.5, None],
        "_3": ["é", None],
    }


def test_options_of_glb_are_refused_elsewhere(tmp_path):
    scene = park()
    for name, options in (
        ("x.obj", {"merge": True}),
        ("x.glb", {"width": 5}),
        ("x.gpkg", {"a": 1}),
    ):
        with pytest.raises(MapError, match="no option"):
            scene.write(tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


# -- OBJ and VRML ----------------------------------------------------------------------------------


def test_obj_names_buildings_and_materials(tmp_path):
    scene = lyon()
    scene.write(tmp_path / "x.obj")
    lines = (tmp_path / "x.obj").read_text(encoding="utf-8").splitlines()
    assert "mtllib x.mtl" in lines
    named = [line.split()[1] for line in lines if line.startswith("o ")]
    wanted = [name for group in scene.groups[1:] for name in names_of(group)]
    assert named == ["ground", *wanted]
    text = (tmp_path / "x.mtl").read_text(encoding="utf-8")
    materials = {one for group in scene.groups for one in materials_of(group)}
    assert set(_words(text, "newmtl")) == {one.name for one in materials}
    used = set(_words("\n".join(lines), "usemtl"))
    assert used <= set(_words(text, "newmtl"))
    assert {"wall", "roof", "ground"} <= used
    assert mtl(scene.groups, scene.about) == text


def _words(text: str, word: str) -> list[str]:
    return [line.split()[1] for line in text.splitlines() if line.startswith(f"{word} ")]


def test_names_are_the_same_in_all_formats(tmp_path):
    scene = park()
    wanted = {name for group in scene.groups[1:] for name in names_of(group)}
    scene.write(tmp_path / "x.city.json")
    document = json.loads((tmp_path / "x.city.json").read_text(encoding="utf-8"))
    assert set(document["CityObjects"]) - wanted == {"ground-1"}
    text = vrml97(scene.groups, scene.about)
    assert {name for name in wanted if f"DEF {name} Shape" in text} == wanted
    assert set(_words(obj(scene.groups, scene.about), "o")) - wanted == {"ground"}


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".wrl", ".x3d"])
def test_files_hold_pitched_roofs(tmp_path, suffix):
    scene = evocity.scene(draw_town(11, side=96), roofs=True)
    (group,) = (one for one in scene.groups if one.name == "building")
    assert group.roofs is not None
    path = tmp_path / f"x{suffix}"
    scene.write(path)
    triangles = parsed.read(path)["building"]
    wanted = group.mesh.points[group.mesh.triangles]
    assert len(triangles) == len(wanted)
    assert _volume(triangles) == pytest.approx(_volume(wanted), rel=1e-4)
    assert triangles[..., 2].max() == pytest.approx(wanted[..., 2].max(), abs=2e-3)


def test_words_of_a_class_stay_together_in_obj(tmp_path):
    shape = np.array([shapely.box(0, 0, 5, 5)])
    group = Group("odd one", (0, 0, 0), shape, np.array([3.0]), {}, ["Building"])
    lines = (obj([group], ABOUT) + mtl([group], ABOUT)).splitlines()
    named = {line.split(maxsplit=1)[1] for line in lines if line.split()[:1] in (["o"], ["newmtl"])}
    assert named == {"odd_one-1", "wall-odd_one", "roof-odd_one"}


# -- source cities ---------------------------------------------------------------------------------


def test_buildings_name_their_source_city(tmp_path):
    genomes = [evocity.encode(draw_town(seed, side=96)).genome for seed in (11, 12)]
    child = make("quarter_fusion")(genomes, np.random.default_rng(1))
    city = evocity.decode(child).city
    sources = building_sources(city, child)
    assert len(sources) == len(city.buildings)
    assert set(sources) - {""} == set(child.cities) - {"void"}
    parents = child.pavement.raster(child.parent)
    for k in range(len(sources)):
        counts = np.bincount(parents[city.buildings.labels == k + 1])
        assert child.cities[counts.argmax()] == (sources[k] or "void")
    finer = evocity.decode(child, zoom=2).city
    assert set(building_sources(finer, child)) - {""} == set(sources) - {""}
    scene = evocity.scene(city, sources=sources)
    scene.write(tmp_path / "x.glb")
    document, _ = read(tmp_path / "x.glb")
    told = {
        one["extras"]["id"]: one["extras"].get("source", "")
        for one in document["nodes"]
        if "id" in one.get("extras", {})
    }
    assert told == {k: sources[k - 1] for k in told}
    assert len(told) == len(scene.walls)
    with pytest.raises(MapError, match="sources"):
        evocity.scene(city, sources=["one"])


def test_the_command_has_the_options_of_glb(tmp_path):
    from evocity.cli import main

    code = tmp_path / "town.parquet"
    evocity.encode(draw_town(11, side=64)).genome.write(code)
    run = functools.partial(CliRunner().invoke, main)
    out = tmp_path / "x.glb"
    told = run(["scene", str(code), "-o", str(out), "--merge", "--instances"])
    assert told.exit_code == 0, told.output
    document, _ = read(out)
    table = table_of(document, out, "building")
    assert set(table["source"]) == {"town-11"}
    told = run(["scene", str(code), "-o", str(tmp_path / "x.obj"), "--merge"])
    assert told.exit_code != 0
    assert "--merge cannot be used" in told.output
    assert not (tmp_path / "x.obj").exists()
