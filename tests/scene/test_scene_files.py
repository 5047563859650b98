"""Scenes and their files: solids, schemas, and what is read back.

`cityjson-2.0.1.schema.json` beside this is the schema in one file of the CityJSON specification,
https://github.com/cityjson/specs, tag 2.0.1, whose licence is CC0 1.0.
"""

import functools
import gc
import json
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import jsonschema_rs
import manifold3d
import numpy as np
import parsed
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
import evocity.scene
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.formats import About, Copies, Group, glb
from evocity.formats.materials import materials_of, names_of
from evocity.formats.solids import FLOOR, ROOF, WALL
from evocity.formats.trees import form_of
from evocity.io.map_reader import data_of
from evocity.io.reader_types import Request
from evocity.scene import export

MESHES = (".glb", ".obj", ".wrl", ".x3d")
NODE = Path(__file__).parents[2] / ".venv" / "node"


def drawn(heights, pixel: float = 2.0, **described) -> CityMap:
    return CityMap(np.asarray(heights, float), pixel, **described)


def empty() -> CityMap:
    return drawn(np.zeros((16, 24)), name="empty")


def full() -> CityMap:
    return drawn(np.full((16, 24), 9.0), name="full")


def one_pixel() -> CityMap:
    heights = np.zeros((16, 24))
    heights[5, 7] = 12
    return drawn(heights, name="one_pixel")


def rings() -> CityMap:
    heights = np.zeros((40, 40))
    for inset, high in ((2, 9), (6, 0), (10, 15), (14, 0), (18, 6)):
        heights[inset:-inset, inset:-inset] = high
    return drawn(heights, name="rings")


def part() -> CityMap:
    rows, columns = np.indices((64, 64))
    return draw_town(3, side=64).within((rows - 30) ** 2 + (columns - 28) ** 2 < 27**2)


def high() -> CityMap:
    heights = np.zeros((16, 16))
    heights[4:8, 4:8], heights[10:13, 3:12] = 1500.0, 1.6
    return drawn(heights, 0.5, origin=(651234.56, 6861234.5), crs="EPSG:2154", name="high & low")


@functools.cache
def children() -> list[CityMap]:
    """Ten bred towns, decoded."""
    from evocity.operators import make

    towns = [evocity.encode(draw_town(seed, side=96)).genome for seed in (11, 12)]
    how = (("quarter_fusion", 4), ("region_fusion", 3), ("quarter_refill", 3))
    found = []
    for name, count in how:
        for seed in range(count):
            operator = make(name)
            parents = towns[: operator.parents[0]]
            child = operator(parents, np.random.default_rng(seed))
            found.append(evocity.decode(child).city)
    return found


MAPS = {f.__name__: f for f in (empty, full, one_pixel, rings, part, high)}
MAPS |= {f"child {n}": functools.partial(lambda n: children()[n], n) for n in range(10)}
MAPS |= {n: functools.partial(evocity.read_map, n) for n in evocity.cities()}


#: Of each operator's children, one or two are read by other programs; the others are slow cases.
SPARE = [f"child {n}" for n in (2, 3, 5, 6, 8, 9)]


@functools.cache
def scene_of(name: str) -> evocity.scene.Scene:
    return evocity.scene(MAPS[name]())


@pytest.fixture(params=MAPS)
def scene(request) -> evocity.scene.Scene:
    return scene_of(request.param)


def check_solids(scene) -> None:
    """Closed, manifold, turned outwards, of the volume of a prism, each by itself."""
    for group in scene.groups:
        mesh = group.mesh
        assert len(group.polygons) == len(group.heights) == len(group)
        points, triangles = mesh.points, mesh.triangles
        if not (group.heights > 0).all():
            assert (mesh.part == ROOF).all()
            assert (mesh.normals[:, 2] > 0).all()
            continue
        edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        way = edges[:, 0].astype(np.int64) * len(points) + edges[:, 1]
        back = edges[:, 1].astype(np.int64) * len(points) + edges[:, 0]
        assert len(np.unique(way)) == len(way)  # no edge twice in one direction
        assert np.array_equal(np.sort(way), np.sort(back))  # and each in both
        a, b, c = (points[triangles[:, k]] for k in range(3))
        volume = np.bincount(
            mesh.owner, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6, minlength=len(group)
        )
        wanted = shapely.area(group.polygons) * group.heights
        assert volume == pytest.approx(wanted, rel=1e-4, abs=1e-6)
        assert (mesh.normals[mesh.part == FLOOR] @ (0, 0, -1) > 0.99).all()
        assert (np.abs(mesh.normals[mesh.part == WALL][:, 2]) < 1e-9).all()
        assert (mesh.normals[mesh.part == ROOF] @ (0, 0, 1) > 0.99).all()


def test_solids_are_closed_and_manifold(scene):
    check_solids(scene)


ANY_MAP = given(st.integers(0, 2**32 - 1), st.sampled_from([0.25, 2.0, 10.0]), st.booleans())


def any_heights(seed: int, noisy: bool, least: int = 1) -> np.ndarray:
    """Heights of a random map of 0 to 3 storeys, with sides of ``least`` px or more."""
    rng = np.random.default_rng(seed)
    heights = rng.integers(0, 4, rng.integers(least, 24, 2)) * 3.0
    return heights + rng.random(heights.shape) if noisy else heights


@settings(max_examples=30, deadline=None)
@ANY_MAP
def test_solids_of_any_map_are_closed(seed, pixel, noisy):
    heights = any_heights(seed, noisy)
    check_solids(evocity.scene(drawn(heights, pixel), squared=bool(seed % 2)))


def test_manifold3d_takes_each_solid(scene):
    for group in scene.groups[1:]:
        check_with_manifold3d(group)


def check_with_manifold3d(group) -> None:
    mesh, wanted = group.mesh, shapely.area(group.polygons) * group.heights
    for owner in range(len(group)):
        own = mesh.triangles[mesh.owner == owner]
        used, index = np.unique(own, return_inverse=True)
        solid = manifold3d.Manifold(
            manifold3d.Mesh64(mesh.points[used], index.reshape(-1, 3).astype(np.uint64))
        )
        assert solid.status() == manifold3d.Error.NoError
        assert solid.volume() == pytest.approx(wanted[owner], rel=1e-4)


@functools.cache
def schema():
    text = (Path(__file__).parent / "cityjson-2.0.1.schema.json").read_text(encoding="utf-8")
    return jsonschema_rs.validator_for(json.loads(text))


def written(scene, folder: Path, suffix: str) -> Path:
    path = folder / f"scene{suffix}"
    scene.write(path)
    return path


def test_cityjson_keeps_to_its_schema_and_semantics(scene, tmp_path):
    document = json.loads(written(scene, tmp_path, ".city.json").read_text(encoding="utf-8"))
    assert [str(error) for error in schema().iter_errors(document)] == []
    vertices = np.array(document["vertices"]).reshape(-1, 3)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    used = set()
    for found in document["CityObjects"].values():
        (geometry,) = found["geometry"]
        if geometry["type"] == "MultiSurface":
            used.update(n for surface in geometry["boundaries"] for ring in surface for n in ring)
            continue
        assert ("semantics" in geometry) == (found["type"] == "Building")
        if found["type"] != "Building":
            shell = geometry["boundaries"][0]
            used.update(n for surface in shell for ring in surface for n in ring)
            continue
        (shell,), (values,) = geometry["boundaries"], geometry["semantics"]["values"]
        kinds = [geometry["semantics"]["surfaces"][value]["type"] for value in values]
        assert len(kinds) == len(shell)
        edges = []
        for surface, kind in zip(shell, kinds, strict=True):
            assert (
                vertical(vertices[surface[0]])
                == {
                    "GroundSurface": -1,
                    "WallSurface": 0,
                    "RoofSurface": 1,
                }[kind]
            )
            for ring in surface:
                assert len(set(ring)) == len(ring) >= 3
                edges += zip(ring, ring[1:] + ring[:1], strict=True)
                used.update(ring)
        assert len(set(edges)) == len(edges)
        assert {(b, a) for a, b in edges} == set(edges)
        top = vertices[[n for surface in shell for ring in surface for n in ring]][:, 2].max()
        assert found["attributes"]["measuredHeight"] == pytest.approx(top / 1000)
    assert used == set(range(len(vertices)))


def vertical(ring: np.ndarray) -> int:
    """Whether a ring is turned up, 1, or down, −1, or stands, 0."""
    normal = np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
    return int(np.sign(normal[2]))


def test_cityjson_is_read_back(scene, tmp_path):
    path, city = written(scene, tmp_path, ".city.json"), scene.city
    if not len(scene.walls):
        assert not evocity.read_map(path).heights.any()
        return
    found, _ = data_of(path, Request())
    solids = [group for group in scene.groups if (group.heights > 0).any()]
    wanted = np.concatenate([group.polygons for group in solids])
    to_grid = scene.about.grid[1] if scene.about.grid else lambda points: points
    wanted = shapely.transform(wanted, lambda points: to_grid(points + scene.about.offset))
    both = shapely.area(shapely.intersection(found.polygons, wanted))
    assert (both / shapely.area(shapely.union(found.polygons, wanted))).min() >= 0.999
    heights = [tags["solid_height"] for tags in found.tags]
    assert heights == pytest.approx(np.concatenate([group.heights for group in solids]), abs=0.01)
    again = evocity.read_map(path, pixels=max(city.shape), metres_per_pixel=city.metres_per_pixel)
    assert again.attribution == scene.about.attribution
    assert (again.origin is None) == (city.crs is None)
    if city.shape[0] == city.shape[1]:
        if again.origin is not None:
            assert again.origin == pytest.approx(city.origin, abs=1e-3)
        assert (again.built == city.built).mean() > 0.9


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize("suffix", [".city.json", ".gpkg"])
def test_a_map_on_which_nothing_stands_is_read_back(tmp_path, suffix, placed):
    town = evocity.read_map("lyon-1er", pixels=64)
    heights = np.zeros((64, 64), np.float32)
    empty = evocity.CityMap(heights, 2.0, origin=town.origin, crs=town.crs, attribution="© none")
    empty = empty if placed else drawn(heights)
    path = tmp_path / f"empty{suffix}"
    evocity.scene(empty).write(path)
    again = evocity.read_map(path, pixels=64, metres_per_pixel=2.0)
    assert not again.heights.any()
    assert again.shape == (64, 64)
    assert "0 of the file's 0 buildings" in again.taken
    assert (again.origin is None) == (not placed)
    if placed:
        assert again.origin == pytest.approx(town.origin, abs=1e-3)
        with pytest.raises(MapError, match="no building"):
            evocity.read_map(path, center=(5, 45))


def test_a_layer_without_areas_is_no_open_ground(tmp_path):
    path = tmp_path / "streets.gpkg"
    evocity.scene(evocity.read_map("lyon-1er", pixels=64), streets=True).write(path)
    with pytest.raises(MapError, match="no building"):
        evocity.read_map(path, layer="street_edges")


@pytest.mark.slow_cases(*(f"{name}-{suffix}" for name in SPARE for suffix in MESHES))
@pytest.mark.parametrize("suffix", MESHES)
def test_meshes_hold_what_was_written(scene, tmp_path, suffix):
    found = parsed.read(written(scene, tmp_path, suffix))
    assert list(found) == [group.name for group in scene.groups if len(group)]
    for group in scene.groups:
        if not len(group):
            continue
        triangles = found[group.name]
        if form_of(group) is not None:
            check_forms(group, triangles)
            continue
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        flat = np.abs(normals[:, 2]) > 1e-3 * np.abs(normals).max(axis=1)
        up = flat & (normals[:, 2] > 0)
        assert normals[up][:, 2].sum() / 2 == pytest.approx(
            shapely.area(group.polygons).sum(), rel=1e-3
        )
        roofs = shapely.polygons(triangles[up][:, :, :2])
        tree = shapely.STRtree(roofs)
        inner = shapely.point_on_surface(group.polygons)
        which, roof = tree.query(inner, predicate="intersects")
        assert set(which) == set(range(len(group)))
        tops = triangles[up][roof][:, :, 2].max(axis=1)
        assert tops == pytest.approx(group.heights[which], abs=0.01)
        order, piece = tree.query(group.polygons, predicate="intersects")
        # on a grid: without, GEOS has nothing in common for some pairs rounded to millimetres
        both = shapely.intersection(group.polygons[order], roofs[piece], grid_size=1e-6)
        shared = shapely.area(both)
        covered = np.bincount(order, shared, minlength=len(group))
        assert (covered / shapely.area(group.polygons)).min() >= 0.999


def check_forms(group, triangles) -> None:
    """Trees and posts: as high as the objects, in their middle, closed and turned outwards."""
    own = triangles.reshape(len(group), -1, 3, 3)
    assert own[..., 2].max(axis=(1, 2)) == pytest.approx(group.heights, abs=0.01)
    assert own[..., 2].min(axis=(1, 2)) == pytest.approx(0.0, abs=1e-6)
    low, high = own[..., :2].min(axis=(1, 2)), own[..., :2].max(axis=(1, 2))
    middles = shapely.get_coordinates(shapely.centroid(group.polygons))
    radii = np.sqrt(shapely.area(group.polygons) / np.pi)
    assert (np.abs((low + high) / 2 - middles) < 0.1 * radii[:, None] + 0.01).all()
    a, b, c = np.moveaxis(own, 2, 0)
    assert (np.einsum("nij,nij->n", a, np.cross(b, c)) > 0).all()


@pytest.mark.slow_cases(*SPARE)
def test_glb_is_valid_to_khronos(scene, tmp_path):
    if shutil.which("node") is None or not (NODE / "node_modules" / "gltf-validator").is_dir():
        pytest.skip("node or its gltf-validator is not there: make .venv/installed-node")
    check_with_khronos(written(scene, tmp_path, ".glb"))


def check_with_khronos(path: Path) -> None:
    script = path.parent / "check.js"
    script.write_text(
        "const v = require('gltf-validator'), fs = require('fs');"
        "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])))"
        ".then(r => console.log(JSON.stringify(r)))",
        encoding="utf-8",
    )
    told = subprocess.run(
        ["node", script, path],
        env={"NODE_PATH": str(NODE / "node_modules"), "PATH": "/usr/bin:/usr/local/bin:/bin"},
        capture_output=True,
        check=True,
    )
    check_issues(json.loads(told.stdout)["issues"])


def check_issues(issues: dict) -> None:
    """Texture coordinates wait for a texture; the validator does not know some extensions."""
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0)
    codes = {one["code"] for one in issues["messages"]}
    assert codes <= {"UNUSED_OBJECT", "UNSUPPORTED_EXTENSION"}


def test_vrml_and_x3d_have_the_same_viewpoint(tmp_path):
    scene = scene_of("rings")
    for suffix in (".wrl", ".x3d"):
        scene.write(tmp_path / f"a{suffix}")
    found = ElementTree.parse(tmp_path / "a.x3d").getroot().find("Scene/Viewpoint")
    lines = (tmp_path / "a.wrl").read_text(encoding="utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith("Viewpoint"))
    assert f"position {found.get('position')} orientation {found.get('orientation')}" in line
    wide, deep = scene.about.size
    x, y, z = map(float, found.get("position").split())
    assert 0 < x < wide
    assert y > 0 < z
    assert -deep < z - y < 0  # it looks down by 45 degrees, and meets the ground


@pytest.mark.slow_cases(*(f"{name}-{suffix}" for name in SPARE for suffix in (".wrl", ".x3d")))
@pytest.mark.parametrize("suffix", [".wrl", ".x3d"])
def test_view3dscene_reads_it_in_silence(scene, tmp_path, suffix):
    if shutil.which("tovrmlx3d") is None:
        pytest.skip("Debian's view3dscene, with tovrmlx3d, is not installed")
    path = written(scene, tmp_path, suffix)
    told = subprocess.run(["tovrmlx3d", "--encoding", "xml", path], capture_output=True, check=True)
    assert told.stderr == b""
    assert told.stdout.count(b"<Shape") == sum(len(group) for group in scene.groups)


def test_faces_of_vrml_and_x3d_have_the_colours_of_their_materials(tmp_path):
    scene = evocity.scene(evocity.read_map("lyon-1er"), roofs=True)
    for suffix in (".wrl", ".x3d"):
        scene.write(tmp_path / f"a{suffix}")
    shapes = []
    for face_set in ElementTree.parse(tmp_path / "a.x3d").getroot().iter("IndexedFaceSet"):
        colours = [one.get("color") for one in face_set.iter("Color")]
        (points,) = face_set.iter("Coordinate")
        texts = points.get("point"), face_set.get("coordIndex"), face_set.get("colorIndex") or ""
        shapes.append((*texts[:2], *(colours or [""]), texts[2]))
    text = (tmp_path / "a.wrl").read_text(encoding="utf-8")
    given = parsed.vrml_faces(text)
    assert [(a, b, c.replace(",", ""), d) for a, b, c, d in given] == shapes
    owners = [(group, k) for group in scene.groups for k in range(len(group))]
    for (group, k), (_, faces, colours, parts) in zip(owners, shapes, strict=True):
        walls, roofs = materials_of(group)
        assert bool(colours) == (walls != roofs)
        if not colours:
            continue
        expected = [*walls.colour, *roofs.colour]
        assert [float(c) for c in colours.split()] == pytest.approx(expected, abs=1e-4)
        assert len(parts.split()) == faces.count("-1")
        if group.name == "building":
            mesh = group.mesh
            roof = (mesh.part == ROOF) & (mesh.owner == k)
            assert parts.split().count("1") == roof.sum()


VOLUMES = """
import { readFileSync } from "fs";
import { Vector3 } from "three";
import { VRMLLoader } from "three/examples/jsm/loaders/VRMLLoader.js";
const scene = new VRMLLoader().parse(readFileSync(process.argv[2], "utf8"), "");
scene.updateMatrixWorld(true);
const told = {};
scene.traverse(one => {
  if (!one.isMesh) return;
  let group = one;
  for (let above = one; above; above = above.parent) if (above.name) group = above;
  const points = one.geometry.attributes.position;
  const [a, b, c] = [0, 1, 2].map(() => new Vector3());
  let six = 0;
  for (let k = 0; k < points.count; k += 3) {
    [a, b, c].forEach((x, i) => x.fromBufferAttribute(points, k + i).applyMatrix4(one.matrixWorld));
    six += a.dot(b.cross(c));
  }
  (told[group.name] ??= []).push(six / 6);
});
console.log(JSON.stringify(told));
"""


@pytest.mark.slow_cases(*SPARE)
def test_three_js_makes_the_same_solids_of_vrml(scene, tmp_path):
    if shutil.which("node") is None or not (NODE / "node_modules" / "three").is_dir():
        pytest.skip("node or its three is not there: make .venv/installed-node")
    (tmp_path / "node_modules").symlink_to(NODE / "node_modules")
    script = tmp_path / "volumes.mjs"
    script.write_text(VOLUMES, encoding="utf-8")
    path = written(scene, tmp_path, ".wrl")
    told = subprocess.run(["node", script, path], capture_output=True, check=True)
    volumes = json.loads(told.stdout)
    assert list(volumes) == [group.name for group in scene.groups if len(group)]
    for group in (one for one in scene.groups if form_of(one) is None):
        wanted = shapely.area(group.polygons) * group.heights
        # walls and roofs lie within a millimetre: numbers are whole ones
        slack = 1e-3 * (
            shapely.length(group.polygons) * group.heights + shapely.area(group.polygons)
        )
        assert (np.abs(np.array(volumes.get(group.name, [])) - wanted) <= slack).all()


def test_indices_of_glb_are_of_16_bits_however_many_buildings(tmp_path):
    heights = np.zeros((180, 180))
    heights[::2, ::2] = 6
    scene = evocity.scene(drawn(heights, 6.0))
    path = written(scene, tmp_path, ".glb")
    document, _ = parsed.glb_document(path)
    ground, buildings = (mesh["primitives"] for mesh in document["meshes"])
    assert len(ground) == 1
    assert len(buildings) > 1
    kinds = {document["accessors"][one["indices"]]["componentType"] for one in buildings}
    assert kinds == {5123}
    triangles = parsed.read(path)["building"]
    assert len(triangles) == len(scene.groups[1].mesh.triangles)
    assert np.abs(triangles[:, :, 2]).max() == 6


def test_glb_keeps_where_it_lies_with_its_scene(scene, tmp_path):
    """Of extras Blender takes those of scenes, and of what is in them."""
    document, _ = parsed.glb_document(written(scene, tmp_path, ".glb"))
    (kept,) = [one["extras"] for one in document["scenes"]]
    assert kept == {
        "crs": scene.about.crs or "",
        "offset": list(scene.about.offset),
        "attribution": scene.city.attribution,
    }


def test_colours_of_glb_are_linear(tmp_path):
    scene = scene_of("lyon-1er")
    document, _ = parsed.glb_document(written(scene, tmp_path, ".glb"))
    wanted = dict.fromkeys(one for group in scene.groups for one in materials_of(group))
    assert {"ground", "wall", "roof", "trunk", "tree"} <= {one.name for one in wanted}
    for material, own in zip(document["materials"], wanted, strict=True):
        look = material["pbrMetallicRoughness"]
        linear = look["baseColorFactor"][:3]
        back = [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear]
        assert back == pytest.approx(own.colour, abs=1e-4)
        assert (material["name"], look["roughnessFactor"]) == (own.name, own.roughness)


def test_files_tell_whose_and_where_they_are(tmp_path):
    scene = evocity.scene(evocity.read_map("lyon-1er"), measures={"fsi": 2.5, "odd": float("nan")})
    told = json.loads(written(scene, tmp_path, ".city.json").read_text(encoding="utf-8"))
    first = next(iter(told["CityObjects"].values()))["attributes"]
    assert first["fsi"] == 2.5
    assert "odd" not in first
    assert told["transform"]["translate"] == [642368.0, 5069698.0, 0.0]  # in UTM, which has a code
    for suffix in (".city.json", *MESHES):
        data = written(scene, tmp_path, suffix).read_bytes()
        assert b"BD TOPO" in data
        assert b"lat_0=45.7684" in data
        assert b"-256" in data


@pytest.mark.parametrize("name", ["x.json", "x", "x.GLTF", ".city.json", ".glb"])
def test_other_names_are_refused(name, tmp_path):
    with pytest.raises(MapError, match="scenes cannot be written") as raised:
        scene_of("one_pixel").write(tmp_path / name)
    assert ".city.json" in str(raised.value)
    assert not list(tmp_path.iterdir())


def test_a_file_that_was_there_stays_where_nothing_can_be_written(tmp_path):
    with pytest.raises(MapError, match="no such folder"):
        scene_of("one_pixel").write(tmp_path / "no" / "x.glb")
    (tmp_path / "x.glb").mkdir()
    with pytest.raises(MapError, match="it is a folder"):
        scene_of("one_pixel").write(tmp_path / "x.glb")


def test_how_walls_are_fitted_arrives():
    city = evocity.read_map("new-york-west-village")
    scene = evocity.scene(city, storeys=3, least_area=60, squared=True)
    heights = scene.walls.heights
    assert (heights % 3 == 0).all()
    assert (heights > 0).all()
    assert len(scene.walls) < len(city.walls)
    with pytest.raises(MapError, match="detail"):
        evocity.scene(city, detail=-1)
    with pytest.raises(TypeError):
        evocity.scene(city, colour="red")


def test_the_same_map_makes_the_same_bytes(tmp_path):
    for suffix in (".city.json", *MESHES):
        first = written(evocity.scene(rings()), tmp_path, suffix).read_bytes()
        assert written(evocity.scene(rings()), tmp_path, suffix).read_bytes() == first


@functools.cache
def of_copies() -> evocity.scene.Scene:
    """A town whose buildings become copies of few objects, some of them mirrored."""
    library = evocity.scene.Library.of(draw_town(5, side=96), licence="CC0-1.0")
    town = draw_town(11, side=96)
    city = town.replace(town.heights, origin=(5e5, 4.5e6), crs="EPSG:32631")
    scene = evocity.scene(city, library=library.only(np.arange(12)), rng=np.random.default_rng(2))
    copies = scene.groups[-1].copies
    assert (np.bincount(copies.of[copies.of >= 0]) > 1).sum() > 1
    assert np.nanmin(copies.scales[:, 0]) < 0 < np.nanmax(copies.scales[:, 0])
    return scene


@pytest.mark.slow_cases(*(f"{name}-{suffix}" for name in SPARE for suffix in MESHES))
@pytest.mark.parametrize("suffix", MESHES)
def test_meshes_hold_copies_of_objects(tmp_path, suffix):
    test_meshes_hold_what_was_written(of_copies(), tmp_path, suffix)


def test_copies_of_objects_are_valid_everywhere(tmp_path):
    check_solids(of_copies())
    test_cityjson_keeps_to_its_schema_and_semantics(of_copies(), tmp_path)
    test_cityjson_is_read_back(of_copies(), tmp_path)
    test_glb_is_valid_to_khronos(of_copies(), tmp_path)


@pytest.mark.parametrize("merge", [False, True])
@pytest.mark.parametrize("instances", [False, True])
def test_each_way_of_glb_has_the_same_triangles(tmp_path, merge, instances):
    scene = of_copies()
    path = tmp_path / "x.glb"
    scene.write(path, merge=merge, instances=instances)
    found = parsed.read(path)
    for group in scene.groups:
        wanted = group.mesh.points[group.mesh.triangles]
        where = [
            np.sort(np.round(one.mean(axis=1), 2), axis=0) for one in (found[group.name], wanted)
        ]
        assert where[0] == pytest.approx(where[1], abs=0.02)
        a, b, c = np.moveaxis(found[group.name], 1, 0)
        volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
        assert volume == pytest.approx(group.volume, rel=1e-4, abs=1e-6)
    if shutil.which("node") is not None and (NODE / "node_modules" / "gltf-validator").is_dir():
        check_with_khronos(path)


def test_an_object_that_comes_twice_is_one_mesh_of_glb(tmp_path):
    scene = of_copies()
    path = written(scene, tmp_path, ".glb")
    document, _ = parsed.glb_document(path)
    group, nodes = scene.groups[-1], document["nodes"]
    (root,) = (node for node in nodes if node["name"] == group.name)
    counts = np.bincount(group.copies.of[group.copies.of >= 0])
    below = [nodes[k] for k in root["children"]]
    assert sorted(one["name"] for one in below) == sorted(names_of(group))
    meshes = [document["meshes"][one["mesh"]]["name"] for one in below]
    own = {group.copies.names[shape]: count for shape, count in enumerate(counts) if count > 1}
    assert {name: meshes.count(name) for name in own} == own
    assert len({one["mesh"] for one in below}) == len(group) - sum(own.values()) + len(own)
    assert len(document["meshes"]) == len({one["mesh"] for one in below}) + 1  # and the ground
    assert [one["name"] for one in document["materials"]] == ["ground", "wall", "roof"]
    triangles = parsed.read(path)["building"]
    assert len(triangles) == len(group.mesh.triangles)
    a, b, c = np.moveaxis(triangles, 1, 0)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6  # turned outwards, mirrored ones too
    assert volume == pytest.approx(group.volume, rel=1e-4)


def test_a_mirrored_copy_is_not_lost_where_all_are_copies(tmp_path):
    shape = shapely.Polygon([(0, 0), (9, 0), (9, 3), (3, 3), (3, 6), (0, 6)])
    copies = Copies(
        names=("ell",),
        polygons=np.array([shape]),
        heights=np.array([6.0]),
        of=np.array([0, 0]),
        scales=np.array([[1.0, 1, 1], [-1.1, 0.9, 1.5]]),
        turns=np.array([0.0, np.pi / 2]),
        places=np.array([[5.0, 5], [40, 20]]),
    )
    # mirrored, scaled, turned by a quarter, moved: x' = 40 - .9 y, y' = 20 - 1.1 x
    other = shapely.transform(
        shape, lambda p: np.stack([40 - 0.9 * p[:, 1], 20 - 1.1 * p[:, 0]], 1)
    )
    first = shapely.transform(shape, lambda p: p + 5)
    polygons, heights = np.array([first, other]), np.array([6.0, 9.0])
    group = Group("building", (0.5, 0.5, 0.5), polygons, heights, copies=copies)
    about = About("two", "", None, (0.0, 0.0), (60.0, 60.0), (30.0, 30.0, 2.0))
    (tmp_path / "two.glb").write_bytes(glb([group], about))
    (triangles,) = parsed.read(tmp_path / "two.glb").values()
    wanted = group.mesh.points[group.mesh.triangles]
    where = [np.round(np.sort(one.mean(axis=1), axis=0), 3) for one in (triangles, wanted)]
    assert np.array_equal(*where)
    a, b, c = np.moveaxis(triangles, 1, 0)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(group.volume, rel=1e-6)
    document, _ = parsed.glb_document(tmp_path / "two.glb")
    assert len(document["meshes"]) == 1


@pytest.mark.slow
def test_objects_of_a_library_stand_in_a_scene(tmp_path):
    city = evocity.read_map("montpellier-pas-du-loup")
    library = evocity.scene.Library.of(evocity.read_map("new-york-west-village"), licence="ODbL")
    scene = evocity.scene(city, library=library, rng=np.random.default_rng(3))
    check_solids(scene)
    assert scene.substitution.counts["fitted"] > 0
    assert "OpenStreetMap" in scene.about.attribution
    assert city.attribution in scene.about.attribution
    path = written(scene, tmp_path, ".city.json")
    assert schema().is_valid(json.loads(path.read_text(encoding="utf-8")))
    first = path.read_bytes()
    evocity.scene(city, library=library, rng=np.random.default_rng(3)).write(path)
    assert path.read_bytes() == first


def test_writing_pauses_the_collection_of_cycles_and_restores_it(tmp_path, monkeypatch):
    scene, seen = evocity.scene(drawn(rings().heights)), []

    def failing(*_, **__):
        seen.append(gc.isenabled())
        raise ValueError("drawn")

    monkeypatch.setitem(export._WRITERS, ".glb", failing)
    for enabled in (True, False):
        (gc.enable if enabled else gc.disable)()
        try:
            scene.write(tmp_path / "a.x3d")
            assert gc.isenabled() == enabled
            with pytest.raises(ValueError, match="drawn"):
                scene.write(tmp_path / "a.glb")
            assert gc.isenabled() == enabled
        finally:
            gc.enable()
    assert seen == [False, False]


def test_extras_of_nodes_keep_any_text_and_leave_out_missing_values(tmp_path):
    texts = ['100 %s, "quoted"', "a\\b\n", "Genève, ç", "null"]
    columns = {"%d text": texts, "number": [1, 2.5, None, 1e-7], "mixed": [None, "x, y", 3, 0.0]}
    columns["storeys"] = [1, 2, 3, 4]
    squares = shapely.box(np.arange(4) * 20, 0, np.arange(4) * 20 + 10.0, 10)
    about = About("drawn", "", None, (0.0, 0.0), (80.0, 80.0), (40.0, 40.0, 2.0))
    group = Group("building", (0.5, 0.5, 0.5), squares, np.full(4, 3.25), columns)
    (tmp_path / "a.glb").write_bytes(glb([group], about))
    document, _ = parsed.glb_document(tmp_path / "a.glb")
    read = [node["extras"] for node in document["nodes"] if "extras" in node]
    for k, extras in enumerate(read):
        wanted = {name: values[k] for name, values in columns.items() if values[k] is not None}
        assert extras == {"class": "building", "height": 3.25} | wanted
    assert len(read) == 4
