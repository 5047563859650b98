"""Scenes with streets: one coverage, kerbs, and files that stay valid."""

import functools
import json
from dataclasses import replace

import geopandas
import manifold3d
import numpy as np
import pytest
import shapely
import test_scene_files
from towns import draw_town

import evocity
from evocity.errors import MapError
from evocity.formats.materials import GROUND, MATERIALS, is_surface
from evocity.formats.solids import WALL
from evocity.formats.trees import form_of
from evocity.scene.noding import join_nodes
from evocity.views.surfaces import KINDS


@functools.cache
def scene_of(name: str, **how):
    city = draw_town(3, side=96) if name == "drawn" else evocity.read_map(name)
    return evocity.scene(city, streets=True, **how)


@pytest.mark.parametrize(
    ("name", "how"),
    [
        *(("drawn", how) for how in ({}, {"lod": "1.2"}, {"lod": "1.0"}, {"roofs": True})),
        ("new-york-west-village", {"lod": "1.2"}),
        ("new-york-west-village", {"roofs": True}),
        ("lyon-1er", {}),
    ],
)
def test_surfaces_and_buildings_are_one_coverage(name, how):
    scene = scene_of(name, **how)
    groups = [
        one
        for one in scene.groups
        if is_surface(one) or ("id" in one.attributes and form_of(one) is None)
    ]
    polygons = np.concatenate([group.polygons for group in groups])
    assert shapely.coverage_is_valid(polygons)
    assert shapely.area(polygons).sum() == pytest.approx(scene.city.area, rel=1e-6)


def test_the_ground_has_no_hole_below_a_tree():
    scene = scene_of("lyon-1er")
    (tree,) = [one for one in scene.groups if one.name == "tree"]
    (ground,) = [one for one in scene.groups if one.name == "ground"]
    assert len(tree) == 1
    assert shapely.covers(shapely.union_all(ground.polygons), tree.polygons[0])
    assert ground.level == 0


@pytest.mark.parametrize("name", ["drawn", "new-york-west-village"])
def test_roofs_stand_on_footprints_with_more_corners(name):
    scene, plain = scene_of(name, roofs=True), evocity.scene(scene_of(name).city, roofs=True)
    group, without = (one.groups[-1] for one in (scene, plain))
    assert shapely.get_num_coordinates(group.polygons).sum() > (
        shapely.get_num_coordinates(without.polygons).sum()
    )
    flat, before = (one.attributes["roof"].count("flat") for one in (group, without))
    assert abs(flat - before) <= 0.03 * len(group)
    mesh = group.mesh
    for owner in range(len(group)):
        own = mesh.triangles[mesh.owner == owner]
        points, index = np.unique(mesh.points[own.ravel()], axis=0, return_inverse=True)
        triangles = index.reshape(-1, 3).astype(np.uint64)
        solid = manifold3d.Manifold(manifold3d.Mesh64(points, triangles))
        assert solid.status() == manifold3d.Error.NoError
        assert solid.volume() > 0


def test_a_solid_that_loses_its_roof_is_flat():
    groups = evocity.scene(scene_of("drawn").city, roofs=True).groups
    (roofed,) = [one for one in groups if one.roofs is not None]
    tops = roofed.heights - 1
    k = int(np.flatnonzero(roofed.roofs.owned(len(roofed)))[0])
    polygons = roofed.polygons.copy()
    polygons[k] = shapely.transform(polygons[k], lambda points: points + 0.5)
    noded = replace(roofed, polygons=polygons, heights=tops, roofs=None)
    (joined,) = join_nodes([roofed], [noded])
    assert not joined.roofs.owned(len(joined))[k]
    assert joined.heights[k] == tops[k]
    assert joined.attributes["roof"][k] == "flat"
    assert joined.attributes["eavesHeight"][k] == round(tops[k], 3)
    others = np.arange(len(joined)) != k
    assert (joined.heights[others] == roofed.heights[others]).all()


def test_kerbs_lead_from_carriageways_to_the_ground():
    (street,) = [group for group in scene_of("drawn").groups if group.name == "street"]
    mesh = street.mesh
    assert street.level < 0
    assert mesh.points[mesh.triangles.ravel()][:, 2].min() == street.level
    corners = mesh.points[mesh.triangles[mesh.part == WALL]]
    assert set(np.unique(corners[:, :, 2])) == {street.level, 0.0}
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert area.sum() / 2 == pytest.approx(-street.level * shapely.length(street.kerbs))
    # kerbs face the carriageway
    inside = corners.mean(axis=1) + 1e-4 * mesh.normals[mesh.part == WALL]
    assert shapely.contains_xy(shapely.union_all(street.polygons), inside[:, :2]).all()


@pytest.mark.parametrize("how", [{}, {"roofs": True}, {"lod": "1.0"}])
def test_cityjson_has_no_short_edges(tmp_path, how):
    scene_of("new-york-west-village", **how).write(tmp_path / "x.city.json")
    document = json.loads((tmp_path / "x.city.json").read_text(encoding="utf-8"))
    assert [str(error) for error in test_scene_files.schema().iter_errors(document)] == []
    vertices, used = np.array(document["vertices"]), set()
    for found in document["CityObjects"].values():
        (geometry,) = found["geometry"]
        for surface in np.atleast_1d(np.array(geometry["boundaries"], dtype=object)).tolist():
            flat = json.loads(json.dumps(surface))
            while not isinstance(flat[0][0], int):
                flat = [ring for part in flat for ring in part]
            used.update(n for ring in flat for n in ring)
            if geometry["type"] != "MultiSurface":
                continue
            for ring in flat:
                step = vertices[ring] - vertices[np.roll(ring, 1)]
                assert np.sqrt((step**2).sum(axis=1)).min() >= 9.5  # mm
    assert used == set(range(len(vertices)))
    if not how:
        kinds = {found["type"] for found in document["CityObjects"].values()}
        assert {"Road", "LandUse", "TransportSquare", "Building"} <= kinds


@pytest.mark.parametrize("how", [{}, {"roofs": True}])
def test_glb_with_streets_is_valid_to_khronos(tmp_path, how):
    test_scene_files.test_glb_is_valid_to_khronos(scene_of("drawn", **how), tmp_path)


def test_kerbs_stay_in_another_reference_system():
    scene = scene_of("new-york-west-village")
    moved, _ = scene.placed("EPSG:32618")
    for own, other in zip(scene.groups, moved, strict=True):
        assert len(own.mesh.triangles) == len(other.mesh.triangles)


def test_each_kind_of_ground_has_a_type_and_a_material():
    assert tuple(GROUND) == KINDS
    assert set(KINDS) <= set(MATERIALS)


def test_water_is_a_surface(tmp_path):
    city = draw_town(3, side=96)
    water = city.open_ground & (np.indices(city.shape)[1] > 70)
    scene = evocity.scene(city, streets=True, water=water)
    (wet,) = [group for group in scene.groups if group.name == "water"]
    assert wet.city_object == "WaterBody"
    assert shapely.area(wet.polygons).sum() == pytest.approx(water.sum() * 4, rel=0.1)
    scene.write(tmp_path / "wet.gpkg")
    surfaces = geopandas.read_file(tmp_path / "wet.gpkg", layer="ground")
    written = surfaces[surfaces["kind"] == "water"]
    assert written.area.sum() == pytest.approx(shapely.area(wet.polygons).sum(), rel=1e-6)
    with pytest.raises(MapError, match="streets=True"):
        evocity.scene(city, water=water)
    with pytest.raises(MapError, match="streets=True"):
        evocity.write_map(city, tmp_path / "dry.gpkg", water=water)
    for wrong in (water[1:], water.astype(float), "water"):
        with pytest.raises(MapError, match="array of booleans"):
            evocity.scene(city, streets=True, water=wrong)
