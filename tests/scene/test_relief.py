"""Scenes on a relief: rigid solids whose floors lie at the lowest ground, on draped ground."""

import json
import shutil
import subprocess

import numpy as np
import pytest
import shapely
from cli_tools import call, refused
from towns import draw_town

import evocity
from evocity.errors import MapError
from evocity.formats.materials import is_surface
from evocity.formats.trees import mesh_of
from evocity.scene import write_on_relief
from evocity.scene.relief import stand_on
from evocity.shapes import DetailedSurface, StoredSurface, polynomial_maps, write_surface

TOWN = evocity.CityMap(draw_town(3, side=48).heights, 2.0)
LODS = ("1.2", "1.3", "2.2")


def relief(tilt=0.2, crs=None, spacing=2.0, wave=0.0):
    maps = polynomial_maps(4, 2)
    at = np.arange(49.0)
    heights = 100 + tilt * np.add.outer(at, at) + wave * np.multiply.outer(np.sin(at), np.cos(at))
    surface = DetailedSurface.of(heights, maps, maps, 4, (spacing, spacing))
    return StoredSurface(surface, crs)


def points_of(document, name):
    numbers = []
    stack = [one["boundaries"] for one in document["CityObjects"][name]["geometry"]]
    while stack:
        node = stack.pop()
        if isinstance(node, list):
            stack += node
        else:
            numbers.append(node)
    move = document["transform"]["translate"]
    return np.array(document["vertices"])[sorted(set(numbers))] * 0.001 + move


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_buildings_move_up_as_they_are_and_none_hovers(tmp_path, tilt):
    scene = evocity.scene(TOWN)
    scene.write(tmp_path / "flat.city.json")
    write_on_relief(scene, relief(tilt), tmp_path / "high.city.json")
    flat, high = (json.loads((tmp_path / f"{n}.city.json").read_text()) for n in ("flat", "high"))
    named = [name for name in flat["CityObjects"] if name.startswith("building")]
    assert named
    for name in named:
        before, after = points_of(flat, name), points_of(high, name)
        up = after[:, 2].min() - before[:, 2].min()
        order = [np.lexsort(points.T) for points in (before, after)]
        np.testing.assert_allclose(before[order[0]] + (0, 0, up), after[order[1]], atol=1e-6)
        # of a plane that rises to the south and the east
        ground = 100 + tilt * (before[:, 0] / 2 + (96 - before[:, 1]) / 2)
        assert up == pytest.approx(ground.min(), abs=2e-3)
    ground = high["CityObjects"]["ground-1"]
    assert ground["type"] == "TINRelief"
    assert ground["geometry"][0]["type"] == "CompositeSurface"
    at = points_of(high, "ground-1")
    np.testing.assert_allclose(
        at[:, 2], 100 + tilt * (at[:, 0] / 2 + (96 - at[:, 1]) / 2), atol=2e-3
    )
    assert not any(one["type"] == "LandUse" for one in high["CityObjects"].values())


@pytest.mark.parametrize("lod", LODS)
@pytest.mark.parametrize("streets", [False, True])
def test_solids_keep_their_form_and_surfaces_lie_on_the_ground(lod, streets):
    scene = evocity.scene(TOWN, lod=lod, streets=streets)
    groups, about = scene.placed()
    raised = stand_on(groups, about, relief(wave=3.0))
    heights = raised[0].relief.heights
    for before, after in zip(groups, raised, strict=True):
        flat, high = mesh_of(before), mesh_of(after)
        up = after.lift[flat.owner][:, None]
        if not is_surface(before):
            a, b = (mesh.points[mesh.triangles] for mesh in (flat, high))
            np.testing.assert_allclose(a[..., 2] + up, b[..., 2], atol=1e-9)
            np.testing.assert_array_equal(a[..., :2], b[..., :2])
            rings = shapely.get_coordinates(after.polygons)
            assert (after.lift <= heights(rings).max(initial=-np.inf)).all()
            for polygon, low in zip(after.polygons, after.lift, strict=True):
                assert low <= heights(shapely.get_coordinates(polygon)).min() + 1e-9
            continue
        ground = heights(high.points[:, :2])
        off = high.points[:, 2] - ground
        on_level, on_kerb = np.abs(off - before.level) < 1e-9, np.abs(off) < 1e-9
        assert (on_level | on_kerb).all()
        assert after.volume == before.volume == 0 or before.level
        plan = high.points[high.triangles, :2]
        plan = plan[high.part != 1]  # without kerbs
        one, two = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
        area = (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2
        assert area == pytest.approx(shapely.area(before.polygons).sum(), abs=1e-3)


def test_draped_surfaces_share_their_edges():
    groups, about = evocity.scene(TOWN, streets=True).placed()
    raised = stand_on(groups, about, relief(wave=3.0))
    edges = {}
    for group in raised:
        if not group.is_draped or group.level:
            continue
        mesh = group.mesh
        for triangle in mesh.points[mesh.triangles].round(6).tolist():
            corners = [tuple(point) for point in triangle]
            for k in range(3):
                key = frozenset((corners[k], corners[k - 1]))
                edges[key] = edges.get(key, 0) + 1
    assert max(edges.values()) == 2
    single = [tuple(key) for key, count in edges.items() if count == 1]
    # single edges lie at walls, at kerbs, and at the border of the map
    outlines = shapely.union_all(
        np.concatenate(
            [shapely.boundary(g.polygons) for g in groups if not is_surface(g) or g.level]
        )
    )
    around = shapely.union(outlines, shapely.box(0, 0, *about.size).exterior)
    middles = shapely.points([((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in single])
    assert shapely.distance(around, middles).max() < 0.02


def test_trees_and_copies_stand_on_the_ground(tmp_path):
    group = evocity.formats.Group(
        "tree", (0.2, 0.6, 0.2), shapely.points([(20, 20), (60, 70)]) , np.array([5.0, 6.0]),
        city_object="SolitaryVegetationObject",
    )  # fmt: skip
    groups, about = evocity.scene(TOWN).placed()
    trees = evocity.formats.Group(
        "tree", group.colour, shapely.buffer(group.polygons, 1.5), group.heights,
        city_object="SolitaryVegetationObject",
    )  # fmt: skip
    raised = stand_on((*groups, trees), about, relief())[-1]
    low = mesh_of(raised).points.reshape(2, -1, 3)[..., 2].min(axis=1)
    np.testing.assert_allclose(low, raised.lift)
    from evocity.formats import glb

    data = glb([raised], about)
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    moves = [one["translation"][1] for one in document["nodes"] if "translation" in one]
    np.testing.assert_allclose(sorted(moves), sorted(raised.lift), rtol=1e-5)


@pytest.mark.parametrize(
    ("suffix", "streets"),
    [
        *((suffix, ()) for suffix in (".city.json", ".obj", ".x3d", ".3dm")),
        *((suffix, ("--streets",)) for suffix in (".glb", ".obj", ".wrl", ".dxf")),
    ],
)
def test_the_command_writes_each_format(tmp_path, suffix, streets):
    if suffix in (".dxf", ".3dm"):
        pytest.importorskip({".dxf": "ezdxf", ".3dm": "rhino3dm"}[suffix])
    ground, path = tmp_path / "ground.json", tmp_path / f"a{suffix}"
    write_surface(relief(), ground)
    np.save(tmp_path / "town.npy", TOWN.heights)
    words = "--relief", ground, "-o", path, *streets, "--json"
    told = call("scene", tmp_path / "town.npy", "--metres-per-pixel", 2, *words)
    (facts,) = json.loads(told.stdout)["scenes"]
    assert facts["ground"] == pytest.approx([100, 100 + 0.2 * 96], abs=0.2)
    assert path.stat().st_size == facts["bytes"] > 0
    if suffix == ".obj":
        up = [float(line.split()[2]) for line in path.read_text().splitlines() if line[:2] == "v "]
        assert min(up) == pytest.approx(100, abs=0.2)


@pytest.mark.parametrize("lod", LODS)
@pytest.mark.parametrize("streets", [False, True])
def test_val3dity_finds_no_errors(tmp_path, lod, streets):
    if shutil.which("val3dity") is None:
        pytest.skip("val3dity is not there")
    path = tmp_path / "a.city.json"
    write_on_relief(evocity.scene(TOWN, lod=lod, streets=streets), relief(wave=3.0), path)
    report = tmp_path / "report.json"
    subprocess.run(["val3dity", path, "-r", report], check=True, capture_output=True)
    assert json.loads(report.read_text())["validity"] is True


def test_reliefs_at_fault_are_refused(tmp_path):
    scene, path = evocity.scene(TOWN), tmp_path / "a.city.json"
    with pytest.raises(MapError, match="does not cover"):
        write_on_relief(scene, relief(spacing=1.0), path)
    with pytest.raises(MapError, match=r"city\.json"):
        write_on_relief(scene, relief(), tmp_path / "a.gpkg")
    with pytest.raises(MapError, match="footprints"):
        write_on_relief(evocity.scene(TOWN, lod="0"), relief(), path)
    placed = evocity.CityMap(TOWN.heights, 2.0, crs="EPSG:32631", origin=(640_000, 5_070_000))
    with pytest.raises(MapError, match="EPSG:2154"):
        write_on_relief(evocity.scene(placed), relief(crs="EPSG:2154"), path)
    assert not list(tmp_path.iterdir())


def test_the_command_refuses_a_relief_where_it_cannot_serve(tmp_path):
    write_surface(relief(), tmp_path / "ground.json")
    write_surface(relief(spacing=1.0), tmp_path / "small.json")
    write_surface(relief(crs="EPSG:2154"), tmp_path / "elsewhere.json")
    np.save(tmp_path / "town.npy", TOWN.heights)
    town = "scene", tmp_path / "town.npy", "--metres-per-pixel", 2
    given = "--relief", tmp_path / "ground.json"
    for words, says in (
        ((*given, "-o", tmp_path / "a.gpkg"), ".city.json"),
        ((*given, "-o", tmp_path / "a.png"), ".city.json"),
        ((*given, "-o", tmp_path / "a.glb", "--lod", "0"), "footprints"),
        ((*given, "-o", tmp_path / "a.glb", "--crs", "EPSG:2154"), "--crs"),
        ((*given, "--tiles", tmp_path / "tiles"), "-o"),
        (("--relief", tmp_path / "small.json", "-o", tmp_path / "a.glb"), "does not cover"),
        (("--relief", tmp_path / "town.npy", "-o", tmp_path / "a.glb"), "town.npy"),
    ):
        refused(tmp_path, *town, *words, says=says)
    words = "--relief", tmp_path / "elsewhere.json", "-o", tmp_path / "a.glb"
    refused(tmp_path, "scene", "lyon-1er", *words, says="EPSG:2154")
