"""Scenes for CAD and printers, and scenes in other reference systems."""

import sys
import xml.etree.ElementTree as ElementTree
import zipfile

import ezdxf
import manifold3d
import numpy as np
import pytest
import rhino3dm
import shapely
from pyproj import Transformer
from towns import draw_town, four_houses

import evocity
from evocity.citymap import CityMap
from evocity.errors import EvocityError, MapError
from evocity.formats.materials import names_of
from evocity.formats.printing import PLATE, SIDE

LYON = {"crs": "EPSG:2154", "origin": (842_300.0, 6_520_700.0)}


def court() -> CityMap:
    """A house with a court, and a tower."""
    heights = np.zeros((48, 64))
    heights[6:30, 6:34] = 9
    heights[14:22, 14:26] = 0
    heights[36:44, 44:56] = 30
    return CityMap(heights, 1.0, name="a court", attribution="© drawn", **LYON)


def buildings(scene):
    (group,) = (one for one in scene.groups if one.name == "building")
    return group


# -- DXF --------------------------------------------------------------------------------------


def drawing(scene, path):
    scene.write(path)
    read = ezdxf.readfile(path)
    assert not read.audit().errors
    return read


def test_a_drawing_has_outlines_and_faces_on_layers(tmp_path):
    scene = evocity.scene(court())
    read = drawing(scene, tmp_path / "a.dxf")
    assert read.header["$INSUNITS"] == 6
    notes = dict(read.header.custom_vars)
    assert notes["attribution"] == "© drawn"
    assert notes["crs"] == "EPSG:2154"
    assert notes["offset"] == "842300.000 6520652.000"
    lines = read.modelspace().query('LWPOLYLINE[layer=="building"]')
    group = buildings(scene)
    assert all(one.closed and one.dxf.elevation == 0 for one in lines)
    assert [one.dxf.thickness for one in lines] == pytest.approx(group.heights.tolist())
    areas = [shapely.Polygon(one.get_points("xy")).area for one in lines]
    shells = [shapely.Polygon(one.exterior).area for one in group.polygons]
    assert areas == pytest.approx(shells, abs=0.01)
    assert len(read.modelspace().query('LWPOLYLINE[layer=="building-holes"]')) == 1
    colour = read.layers.get("building").rgb
    assert colour == tuple(round(255 * channel) for channel in group.colour)


@pytest.mark.parametrize("roofs", [False, True])
def test_the_faces_of_a_drawing_are_the_solids(tmp_path, roofs):
    scene = evocity.scene(court(), roofs=roofs)
    faces = drawing(scene, tmp_path / "a.dxf").modelspace().query('3DFACE[layer=="building-faces"]')
    volume = 0.0
    for face in faces:
        a, b, c, d = (np.array(face.dxf.get(f"vtx{k}")) for k in range(4))
        volume += (a @ np.cross(b, c) + a @ np.cross(c, d)) / 6
    assert volume == pytest.approx(buildings(scene).volume, rel=1e-4)


def test_no_edge_is_drawn_across_a_flat_face(tmp_path):
    scene = evocity.scene(four_houses())
    faces = drawing(scene, tmp_path / "a.dxf").modelspace().query('3DFACE[layer=="building-faces"]')
    flat = [face for face in faces if face.dxf.vtx2 == face.dxf.vtx3]
    assert len(flat) == 4 * 4  # two triangles of a roof and of a floor
    assert len(faces) - len(flat) == 4 * 4  # walls
    # one diagonal of each pair is hidden
    assert all(face.dxf.invisible_edges in (1, 2, 8) for face in flat)


def test_a_drawing_is_a_map_again(tmp_path):
    city = draw_town(3)
    evocity.scene(city).write(tmp_path / "a.dxf")
    again = evocity.read_map(tmp_path / "a.dxf", pixels=64, layer="building")
    assert again.built.sum() == pytest.approx(city.built.sum(), rel=0.05)
    assert again.heights.max() == pytest.approx(city.heights.max(), abs=0.5)


@pytest.mark.parametrize("layer", [None, "building"])
def test_courts_stay_open_when_a_drawing_is_a_map_again(tmp_path, layer):
    evocity.scene(court()).write(tmp_path / "a.dxf")
    again = evocity.read_map(tmp_path / "a.dxf", layer=layer, pixels=64, metres_per_pixel=1.0)
    assert again.built.sum() == pytest.approx(court().built.sum(), rel=0.01)
    with pytest.raises(MapError, match="no layer 'court'"):
        evocity.read_map(tmp_path / "a.dxf", layer="court")


def test_the_thickness_of_a_building_with_a_roof_ends_at_its_eaves(tmp_path):
    scene = evocity.scene(court(), roofs=True)
    group = buildings(scene)
    lines = drawing(scene, tmp_path / "a.dxf").modelspace().query('LWPOLYLINE[layer=="building"]')
    eaves = group.attributes["eavesHeight"]
    wanted = [top if low is None else low for top, low in zip(group.heights, eaves, strict=True)]
    assert [line.dxf.thickness for line in lines] == pytest.approx(wanted, abs=1e-3)
    assert min(wanted) < group.heights.min() + 1e-9
    assert any(low < top for low, top in zip(wanted, group.heights, strict=True))


# -- 3DM --------------------------------------------------------------------------------------


@pytest.mark.parametrize("roofs", [False, True])
def test_a_model_has_a_closed_mesh_for_each_building(tmp_path, roofs):
    scene = evocity.scene(court(), roofs=roofs)
    scene.write(tmp_path / "a.3dm")
    model = rhino3dm.File3dm.Read(str(tmp_path / "a.3dm"))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Meters
    layers = [layer.Name for layer in model.Layers]
    assert layers == ["ground", "ground-outlines", "building", "building-outlines"]
    group, wanted = buildings(scene), {}
    for found in model.Objects:
        if layers[found.Attributes.LayerIndex] == "building":
            wanted[found.Attributes.Name] = found
    assert list(wanted) == names_of(group)
    for found, high, number in zip(
        wanted.values(), group.heights, group.attributes["id"], strict=True
    ):
        assert found.Geometry.IsClosed
        assert pytest.approx(high, abs=1e-3) == found.Geometry.GetBoundingBox().Max.Z
        texts = dict(found.Attributes.GetUserStrings())
        assert (texts["class"], texts["id"]) == ("building", str(number))
        assert float(texts["height"]) == pytest.approx(high, abs=1e-3)
    lines = [one for one in model.Objects if layers[one.Attributes.LayerIndex][9:] == "outlines"]
    assert all(one.Geometry.IsClosed for one in lines)
    assert len(lines) == 3  # two shells and a court


@pytest.mark.parametrize(("suffix", "name"), [(".dxf", "ezdxf"), (".3dm", "rhino3dm")])
def test_the_extra_is_named_if_a_library_is_missing(tmp_path, monkeypatch, suffix, name):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(EvocityError, match=rf"needs {name}[^~]*evocity\[cad\]"):
        evocity.scene(court()).write(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())


# -- printers ---------------------------------------------------------------------------------


def printed(path) -> dict[str, manifold3d.Manifold]:
    """The objects of a 3MF package, by name."""
    with zipfile.ZipFile(path) as package:
        root = ElementTree.fromstring(package.read("3D/3dmodel.model"))
        assert {"[Content_Types].xml", "_rels/.rels"} <= set(package.namelist())
    assert root.get("unit") == "millimeter"
    space = {"m": root.tag[1:].split("}")[0]}
    found = {}
    for one in root.iterfind(".//m:object", space):
        points = [
            [float(each.get(axis)) for axis in "xyz"] for each in one.iterfind(".//m:vertex", space)
        ]
        corners = [
            [int(each.get(f"v{k}")) for k in (1, 2, 3)]
            for each in one.iterfind(".//m:triangle", space)
        ]
        mesh = manifold3d.Mesh(np.array(points, np.float32), np.array(corners, np.uint32))
        found[one.get("name")] = manifold3d.Manifold(mesh)
    items = [one.get("objectid") for one in root.iterfind(".//m:item", space)]
    assert len(items) == len(found)
    return found


@pytest.mark.parametrize("roofs", [False, True])
@pytest.mark.parametrize("streets", [False, True])
def test_a_print_is_closed_solids_on_a_plate(tmp_path, roofs, streets):
    scene = evocity.scene(court(), roofs=roofs, streets=streets)
    scene.write(tmp_path / "a.3mf", side=100)
    parts = printed(tmp_path / "a.3mf")
    assert set(parts) == {"plate", "building"}
    assert all(part.status() == manifold3d.Error.NoError for part in parts.values())
    assert all(part.volume() > 0 for part in parts.values())
    scale = 100 / 64
    low, high = np.split(np.array(parts["plate"].bounding_box()), 2)
    assert (high - low).tolist() == pytest.approx([100, 75, PLATE], abs=0.05)
    group = buildings(scene)
    walls = group.volume * scale**3
    base = shapely.area(group.polygons).sum() * scale**2 * PLATE / 2
    assert parts["building"].volume() == pytest.approx(walls + base, rel=0.01)
    whole = parts["plate"] + parts["building"]
    assert len(whole.decompose()) == 1
    assert whole.bounding_box()[5] == pytest.approx(group.heights.max() * scale, abs=0.01)


@pytest.mark.parametrize("lod", ["1.2", "1.0", "afar"])
def test_prints_and_models_of_coarse_levels_are_closed(tmp_path, lod):
    scene = evocity.scene(draw_town(3), lod=lod)
    scene.write(tmp_path / "a.3mf")
    parts = printed(tmp_path / "a.3mf").values()
    assert all(part.status() == manifold3d.Error.NoError for part in parts)
    scene.write(tmp_path / "a.3dm")
    model = rhino3dm.File3dm.Read(str(tmp_path / "a.3dm"))
    layers = [layer.Name for layer in model.Layers]
    own = [one for one in model.Objects if layers[one.Attributes.LayerIndex] == "building"]
    assert own
    assert all(one.Geometry.IsClosed for one in own)


@pytest.mark.parametrize(
    ("lod", "suffix"), [("0", ".stl"), ("0", ".3mf"), ("2.2", ".fgb"), ("2.2", ".geoparquet")]
)
def test_levels_that_a_format_lacks_are_refused(tmp_path, lod, suffix):
    with pytest.raises(MapError, match=f"LoD {lod}"):
        evocity.scene(court(), lod=lod).write(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())


def test_an_stl_has_the_same_triangles(tmp_path):
    scene = evocity.scene(court())
    scene.write(tmp_path / "a.stl")
    data = (tmp_path / "a.stl").read_bytes()
    count = int.from_bytes(data[80:84], "little")
    assert len(data) == 84 + 50 * count
    rows = np.frombuffer(data[84:], np.dtype([("n", "<f4", 3), ("t", "<f4", (3, 3)), ("a", "<u2")]))
    a, b, c = np.moveaxis(rows["t"].astype(float), 1, 0)
    normals = np.cross(b - a, c - a)
    assert ((normals * rows["n"]).sum(axis=1) > 0).all()
    volume = (a * np.cross(b, c)).sum() / 6
    scene.write(tmp_path / "a.3mf")
    assert volume == pytest.approx(
        sum(part.volume() for part in printed(tmp_path / "a.3mf").values()), rel=1e-4
    )
    assert rows["t"][..., 0].max() == pytest.approx(SIDE, abs=0.1)
    assert not data.startswith(b"solid")


@pytest.mark.parametrize("side", [0, 5, 1e6, float("nan"), "10"])
def test_sides_of_prints_that_make_no_sense_are_refused(tmp_path, side):
    with pytest.raises(MapError, match="side"):
        evocity.scene(court()).write(tmp_path / "a.stl", side=side)
    assert not list(tmp_path.iterdir())


def test_equal_scenes_make_equal_packages(tmp_path):
    for name in ("a.3mf", "b.3mf"):
        evocity.scene(court()).write(tmp_path / name)
    assert (tmp_path / "a.3mf").read_bytes() == (tmp_path / "b.3mf").read_bytes()


# -- reference systems ------------------------------------------------------------------------


@pytest.mark.parametrize("how", [{}, {"roofs": True}, {"streets": True}])
def test_all_points_of_a_scene_are_converted(how):
    scene = evocity.scene(court(), **how)
    groups, about = scene.placed("EPSG:32631")
    assert about.crs == "EPSG:32631"
    assert all(corner == int(corner) for corner in about.offset)
    change = Transformer.from_crs("EPSG:2154", "EPSG:32631", always_xy=True)
    for own, other in zip(scene.groups, groups, strict=True):
        x, y, z = own.mesh.points.T
        east, north = change.transform(x + scene.about.offset[0], y + scene.about.offset[1])
        wanted = np.column_stack([east - about.offset[0], north - about.offset[1], z])
        np.testing.assert_allclose(other.mesh.points, wanted, atol=1e-6)
        assert (wanted[:, :2] >= 0).all()
        assert (wanted[:, :2] <= about.size).all()
        np.testing.assert_array_equal(other.heights, own.heights)


def test_copies_of_a_library_turn_with_the_map():
    from evocity.scene.library import Library

    city = court()
    library = Library.of(court(), licence="CC0-1.0")
    scene = evocity.scene(city, library=library)
    groups, _ = scene.placed("EPSG:32631")
    (group,) = (one for one in groups if one.name == "building")
    copies = group.copies
    assert (copies.of >= 0).any()
    for k in np.flatnonzero(copies.of >= 0).tolist():
        shape = copies.polygons[copies.of[k]]
        turn = copies.turns[k]
        matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        laid = shapely.transform(
            shape, lambda at, k=k, matrix=matrix: (at * copies.scales[k, :2]) @ matrix.T
            + copies.places[k],
        )  # fmt: skip
        assert shapely.hausdorff_distance(laid, group.polygons[k]) < 1e-3


@pytest.mark.parametrize("suffix", [".city.json", ".gpkg", ".fgb", ".geoparquet"])
def test_a_scene_in_another_system_is_a_map_there(tmp_path, suffix):
    evocity.scene(court()).write(tmp_path / f"a{suffix}", crs="EPSG:32631")
    again = evocity.read_map(tmp_path / f"a{suffix}", pixels=64, metres_per_pixel=1.0)
    assert again.crs == "EPSG:32631"
    assert again.built.sum() == pytest.approx(court().built.sum(), rel=0.05)


@pytest.mark.parametrize(
    ("name", "crs", "says"),
    [
        ("a.glb", "EPSG:4326", "has degrees"),
        ("a.city.json", "EPSG:2263", "US survey foot"),
        ("a.obj", "EPSG:32756", "outside the area"),
        ("a.dxf", "nothing", "is unknown"),
        ("a.stl", "EPSG:32631", "no coordinates"),
        ("a.3mf", "EPSG:32631", "no coordinates"),
        ("a.png", "EPSG:32631", "no coordinates"),
    ],
)
def test_systems_that_do_not_fit_a_scene_are_refused(tmp_path, name, crs, says):
    with pytest.raises(MapError, match=says):
        evocity.scene(court()).write(tmp_path / name, crs=crs)
    with pytest.raises(MapError, match=r"no place on Earth|no coordinates"):
        evocity.scene(four_houses()).write(tmp_path / name, crs="EPSG:32631")
    assert not list(tmp_path.iterdir())
