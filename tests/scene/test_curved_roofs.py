"""Surfaces on the roofs of wide buildings: closed solids of the right volume, and bad input."""

import json
import shutil
import subprocess

import numpy as np
import pytest
import shapely
from cli_tools import call, refused
from test_pitched_roofs import check_roofs
from test_scene_files import test_glb_is_valid_to_khronos as check_glb

import evocity
from evocity.errors import MapError
from evocity.formats.shells import ROOF
from evocity.scene.roofs.curved import (
    CURVED,
    RISE,
    RoofSurface,
    are_wide,
    curved_roof,
    frame_of,
    rise_of,
)
from evocity.shapes import (
    FORMS,
    DetailedSurface,
    ShapeError,
    StoredSurface,
    polynomial_maps,
    read_surface,
    surface_form,
    write_surface,
)


def town(*boxes, pixel=2.0):
    heights = np.zeros((40, 60))
    for top, bottom, left, right, height in boxes:
        heights[top:bottom, left:right] = height
    return evocity.CityMap(heights, pixel)


HALL = 10, 20, 10, 35, 8.0  # 20 × 50 m
HALLS = town(HALL, (24, 36, 40, 52, 6.0), (24, 36, 10, 22, 7.0), (30, 36, 16, 22, 0.0))


def stored(form, bays=None, credit=""):
    return StoredSurface(surface_form(form, bays), attribution=credit)


def roofs_of(scene):
    return [group for group in scene.groups if "roof" in group.attributes]


def turned(plan, angle):
    return shapely.orient_polygons(
        shapely.transform(
            plan,
            lambda p: (
                p @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            ),
        )
    )


def shell(plan, form="vault", rise=3.0, eaves=8.0, surface=None):
    """Points and roof triangles of a curved roof on a plan of one ring."""
    ring = shapely.get_coordinates(plan.exterior)[:-1]
    after = np.roll(np.arange(len(ring)), -1)
    surface = surface_form(form) if surface is None else surface
    roof = RoofSurface(surface.heights(), rise)
    points, n, faces, parts = curved_roof(plan, ring, after, frame_of(plan), roof, eaves, rise)
    triangles = np.array([face for face, part in zip(faces, parts, strict=True) if part == ROOF])
    return points, n, triangles


def volume_of(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (area > 0).all()
    return float(area @ (a + b + c)[:, 2] / 3), float(area.sum())


FORMULAS = {
    "vault": lambda s, t: 4 * t * (1 - t),
    "dome": lambda s, t: 16 * s * (1 - s) * t * (1 - t),
    "saddle": lambda s, t: (1 + (2 * s - 1) ** 2 - (2 * t - 1) ** 2) / 2,
}


@pytest.mark.parametrize("form", FORMULAS)
def test_forms_are_polynomials(form):
    at = np.linspace(0, 1, 49)
    wanted = FORMULAS[form](at[None, :], at[:, None]) + np.zeros((49, 49))
    np.testing.assert_allclose(surface_form(form).heights(), wanted, atol=1e-9)


@pytest.mark.parametrize("bays", [2, 3, 8])
def test_forms_repeat_in_bays(bays):
    sheds, vaults = (surface_form(form, bays).heights()[:, 0] for form in ("shed", "vault"))
    at = np.linspace(0, 1, 49)
    within = (bays * at) % 1
    np.testing.assert_allclose(vaults, 4 * within * (1 - within), atol=1e-9)
    assert np.interp(1 / (8 * bays), at, sheds) > np.interp(7 / (8 * bays), at, sheds) - 0.1
    assert sheds[0] == sheds[-1] == 0


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.3, 2.9])
@pytest.mark.parametrize(("form", "mean"), [("vault", 2 / 3), ("dome", 4 / 9), ("saddle", 0.5)])
def test_the_volume_is_the_integral_of_the_form(form, mean, angle):
    plan = turned(shapely.box(0, 0, 50, 20), angle)
    volume, area = volume_of(*shell(plan, form)[::2])
    assert area == pytest.approx(1000, abs=0.05)
    assert volume == pytest.approx(area * (8 + 3 * mean), abs=0.01 * 3 * area)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.3])
def test_the_eaves_of_a_vault_have_the_height_of_the_walls(angle):
    plan = turned(shapely.box(0, 0, 50, 20), angle)
    points, n, _ = shell(plan)
    assert points[:n, 2] == pytest.approx(8.0, abs=1e-6)
    down = frame_of(plan).shares(points[:, :2])[:, 0]
    np.testing.assert_allclose(points[:, 2], 8 + 12 * down * (1 - down), atol=0.02)
    assert points[:, 2].max() == pytest.approx(11, abs=1e-6)
    assert points[:, 2].min() == 8.0


def test_rows_lie_from_north_to_south_and_columns_along_the_longer_side():
    at = np.linspace(0, 1, 49)
    maps = polynomial_maps(4, 2)
    down, right = (
        DetailedSurface.of(one, maps, maps, 4)
        for one in (np.tile(at[:, None], 49), np.tile(at, (49, 1)))
    )
    for angle in (0.0, 0.7, -0.7, np.pi):
        plan = turned(shapely.box(0, 0, 50, 20), angle)
        points, _, _ = shell(plan, surface=down)
        low, high = (points[points[:, 2] == z].mean(axis=0) for z in (8.0, 11.0))
        assert low[1] > high[1] + 10
        points, _, _ = shell(plan, surface=right)
        low, high = (points[points[:, 2] == z].mean(axis=0) for z in (8.0, 11.0))
        assert high[0] > low[0] + 30


def test_details_are_carried():
    rng = np.random.default_rng(4)
    smooth = surface_form("vault")
    rough = DetailedSurface.of(
        smooth.heights() + rng.uniform(-0.1, 0.1, (49, 49)), smooth.rows, smooth.columns, 4
    )
    plan = shapely.box(0, 0, 60, 60)  # cells of 1.25 m, so that each corner is a height
    points, _, _ = shell(plan, surface=rough, rise=1.0, eaves=5.0)
    at = np.round(frame_of(plan).shares(points[:, :2]) * 48).astype(int)
    np.testing.assert_allclose(points[:, 2], 5 + rough.heights()[tuple(at.T)], atol=2e-4)
    assert len({tuple(one) for one in at.tolist()}) == 49 * 49
    assert np.ptp(points[:, 2] - 5 - smooth.heights()[tuple(at.T)]) > 0.15


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("roofs", [False, True])
@pytest.mark.parametrize("streets", [False, True])
def test_solids_are_closed(form, roofs, streets):
    scene = evocity.scene(HALLS, roofs=roofs, streets=streets, roof_surface=stored(form))
    check_roofs(scene)
    (group,) = roofs_of(scene)
    assert set(group.attributes["roof"]) == ({"hipped"} if roofs else {CURVED})


@pytest.mark.slow_cases("new-york-west-village")
@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village"])
def test_roofs_of_districts_are_closed(name):
    city = evocity.read_map(name, pixels=96)
    scene = evocity.scene(city, roof_surface=stored("dome"), streets=True)
    check_roofs(scene)
    (group,) = (group for group in roofs_of(scene) if group.name == "building")
    shapes = np.array(group.attributes["roof"])
    wide = are_wide(group.polygons, group.heights)
    assert (shapes[~wide] == "flat").all()
    assert (shapes == CURVED).sum() >= 0.95 * wide.sum() > 5
    pitched = evocity.scene(city, roofs=True)
    both = evocity.scene(city, roofs=True, roof_surface=stored("dome"))
    (plain,), (mixed,) = ([g for g in roofs_of(s) if g.name == "building"] for s in (pitched, both))
    one, other = (np.array(g.attributes["roof"]) for g in (plain, mixed))
    assert (one[other != CURVED] == other[other != CURVED]).all()
    assert (one[other == CURVED] == "flat").all()
    assert CURVED in other


def test_narrow_low_and_hollow_buildings_stay_flat():
    plans = [
        shapely.box(0, 0, 11.5, 60),
        shapely.box(0, 0, 12, 60),
        shapely.box(0, 0, 60, 60) - shapely.box(8, 8, 52, 52),
        shapely.box(0, 0, 60, 60),
        shapely.box(0, 0, 60, 60),
    ]
    heights = np.array([8.0, 8.0, 8.0, 8.0, 1.5])
    wide = are_wide(np.array(plans, object), heights)
    assert wide.tolist() == [False, True, False, True, False]


def test_the_rise_follows_the_width_and_the_height():
    free, given = RoofSurface(np.eye(2)), RoofSurface(np.eye(2), 10.0)
    assert rise_of(free, 20.0, 8.0, False) == RISE * 20
    assert rise_of(free, 60.0, 8.0, False) == pytest.approx(6.4)
    assert rise_of(given, 20.0, 8.0, False) == 10.0
    assert rise_of(given, 20.0, 8.0, True) == pytest.approx(3.2)
    (group,) = roofs_of(evocity.scene(town(HALL), roof_surface=stored("vault"), roof_rise=5))
    assert group.heights == pytest.approx([13.0])
    assert group.attributes["eavesHeight"] == [8.0]
    ridges = np.array([[-1, 1]])
    more = {"roof_surface": stored("vault"), "roof_rise": 3, "given_roofs": ridges}
    (group,) = roofs_of(evocity.scene(town(HALL), **more))
    assert group.heights == pytest.approx([8.0])
    assert group.attributes["eavesHeight"] == [5.0]


@pytest.mark.parametrize(
    "suffix", [".city.json", ".glb", ".obj", ".wrl", ".x3d", ".dxf", ".3dm", ".stl", ".3mf", ".png"]
)
def test_the_command_writes_each_format(tmp_path, suffix):
    if suffix in (".dxf", ".3dm"):
        pytest.importorskip({".dxf": "ezdxf", ".3dm": "rhino3dm"}[suffix])
    np.save(tmp_path / "town.npy", HALLS.heights)
    call("surface", "make", "vault", "-o", tmp_path / "vault.json")
    words = "scene", tmp_path / "town.npy", "--metres-per-pixel", 2, "--json"
    path = tmp_path / f"a{suffix}"
    told = call(*words, "--roof-surface", tmp_path / "vault.json", "--roof-rise", 4, "-o", path)
    (facts,) = json.loads(told.stdout)["scenes"]
    assert facts["lod"] == "2.2"
    assert facts["roofs"]["forms"][CURVED] == 3
    flat = sum(area * height for area, height in ((1000, 8), (576, 6), (432, 7)))
    assert facts["volume"] > flat + 0.6 * 4 * (1000 + 576)
    assert path.stat().st_size > 0
    if suffix == ".city.json":
        document = json.loads(path.read_text())
        (geometry,) = document["CityObjects"]["building-1"]["geometry"]
        assert geometry["lod"] == "2.2"
        assert np.max(document["vertices"], axis=0)[2] == 12_000


def test_a_glb_file_has_unit_normals():
    scene = evocity.scene(HALLS, roof_surface=stored("saddle"))
    from evocity.formats.facets import facets

    (group,) = roofs_of(scene)
    made = facets(group.mesh, np.full(len(group), 3.0))
    assert np.linalg.norm(made.normals, axis=1) == pytest.approx(1)
    assert np.isfinite(made.uv).all()
    roof = made.normals[np.unique(made.triangles[made.of_roof])]
    assert (roof[:, 2] > 0.5).all()
    assert len(np.unique(roof.round(3), axis=0)) > 50


def test_glb_is_valid(tmp_path):
    check_glb(evocity.scene(HALLS, roof_surface=stored("shed")), tmp_path)


def test_tiles_and_reliefs_keep_curved_roofs(tmp_path):
    scene = evocity.scene(HALLS, roof_surface=stored("vault", credit="A. Architect"))
    assert "A. Architect" in scene.about.attribution
    maps = polynomial_maps(4, 2)
    hill = np.add.outer(np.zeros(49), np.arange(49.0))
    relief = StoredSurface(DetailedSurface.of(hill, maps, maps, 4, (4.0, 4.0)))
    evocity.scene.write_on_relief(scene, relief, tmp_path / "a.glb")
    evocity.scene.write_tiles(scene, tmp_path / "tiles", 20)
    with pytest.raises(MapError, match="tiles"):
        evocity.scene.write_tiles(
            evocity.scene(HALLS, roof_surface=stored("dome")), tmp_path / "tiles", 20
        )


@pytest.mark.parametrize("name", ["lyon-1er", None])
@pytest.mark.parametrize("streets", [False, True])
def test_val3dity_finds_no_errors(tmp_path, name, streets):
    if shutil.which("val3dity") is None:
        pytest.skip("val3dity is not there")
    city = HALLS if name is None else evocity.read_map(name, pixels=96)
    path, report = tmp_path / "a.city.json", tmp_path / "report.json"
    evocity.scene(city, roof_surface=stored("vault"), streets=streets).write(path)
    subprocess.run(["val3dity", path, "-r", report], check=True, capture_output=True)
    assert json.loads(report.read_text())["validity"] is True


def test_curved_roofs_at_fault_are_refused():
    for rise in (0, -1.0, 100.5, float("nan"), "4"):
        with pytest.raises(MapError, match="roof_rise"):
            evocity.scene(HALLS, roof_surface=stored("vault"), roof_rise=rise)
    with pytest.raises(MapError, match="roof_surface"):
        evocity.scene(HALLS, roof_rise=3)
    with pytest.raises(MapError, match="roof_surface"):
        evocity.scene(HALLS, roof_surface=np.eye(9))
    maps = polynomial_maps(4, 2)
    level = StoredSurface(DetailedSurface.of(np.full((7, 7), 5.0), maps, maps, 1))
    with pytest.raises(MapError, match="level"):
        evocity.scene(HALLS, roof_surface=level)
    for lod in ("1.3", "1.0", "0", "afar"):
        with pytest.raises(MapError, match=lod):
            evocity.scene(HALLS, roof_surface=stored("vault"), lod=lod)
    with pytest.raises(ShapeError, match="tent"):
        surface_form("tent")
    for form, bays in (("dome", 2), ("vault", 0), ("shed", 9), ("vault", 1.5)):
        with pytest.raises(ShapeError, match="bays"):
            surface_form(form, bays)


def test_the_command_refuses_curved_roofs_at_fault(tmp_path):
    np.save(tmp_path / "town.npy", HALLS.heights)
    write_surface(stored("vault"), tmp_path / "vault.json")
    write_surface(StoredSurface(surface_form("vault").amplified(0.0)), tmp_path / "again.json")
    (tmp_path / "other.json").write_text('{"evocity": "shape"}')
    words = "scene", tmp_path / "town.npy", "--metres-per-pixel", 2, "-o", tmp_path / "a.glb"
    given = "--roof-surface", tmp_path / "vault.json"
    for more, says in (
        ((*given, "--roof-rise", 0), "--roof-rise"),
        ((*given, "--roof-rise", -2), "--roof-rise"),
        ((*given, "--roof-rise", 101), "--roof-rise"),
        (("--roof-rise", 3), "--roof-surface"),
        ((*given, "--lod", "1.3"), "--lod"),
        (("--roof-surface", tmp_path / "town.npy"), "town.npy"),
        (("--roof-surface", tmp_path / "other.json"), "other.json"),
        (("--roof-surface", tmp_path / "none.json"), "none.json"),
    ):
        refused(tmp_path, *words, *more, says=says)
    table = *words[:-1], tmp_path / "a.gpkg"
    refused(tmp_path, *table, *given, says=".gpkg")
    refused(tmp_path, "surface", "make", "dome", "--bays", 2, "-o", tmp_path / "a.json", says="bay")
    refused(tmp_path, "surface", "make", "tent", "-o", tmp_path / "a.json", says="tent")
    assert read_surface(tmp_path / "vault.json").surface.heights().max() == pytest.approx(1)
