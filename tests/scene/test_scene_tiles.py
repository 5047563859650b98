"""Tiles of scenes: they meet exactly, hold each building once, and have a valid tileset.

`3d-tiles-1.1.schema.json` beside this holds schemas of the 3D Tiles specification by Cesium GS,
https://github.com/CesiumGS/3d-tiles, without their descriptions. Their licence is CC BY 4.0.
"""

import functools
import json
from pathlib import Path

import jsonschema_rs
import numpy as np
import parsed
import pytest
import shapely
import shapely.affinity
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.formats.kerbs import kerb_edges, kerbs_near
from evocity.formats.materials import is_surface
from evocity.scene import write_tiles
from evocity.scene.cutting import cut_surfaces
from evocity.scene.globe import globe_transform
from evocity.scene.tiles import check_tiles_folder
from evocity.views.surfaces import KINDS

BASE = "https://schemas.example/"
SIDE = 48


@functools.cache
def schema():
    text = (Path(__file__).parent / "3d-tiles-1.1.schema.json").read_text(encoding="utf-8")
    schemas = json.loads(text)["schemas"]
    registry = jsonschema_rs.Registry([(BASE + name, one) for name, one in schemas.items()])
    draft = "https://json-schema.org/draft/2020-12/schema"
    whole = {"$schema": draft, "$ref": BASE + "tileset.schema.json"}
    return jsonschema_rs.validator_for(whole, registry=registry)


@functools.cache
def town() -> CityMap:
    town = draw_town(5, side=96)
    return town.replace(town.heights, origin=(842000.0, 6520000.0), crs="EPSG:2154")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    scene = evocity.scene(town(), streets=True)
    folder = tmp_path_factory.mktemp("tiles") / "town"
    return scene, folder, write_tiles(scene, folder, SIDE)


def solids_of(folder: Path) -> list[tuple]:
    """The solids of all CityJSONSeq files: id, class, height and footprint, in millimetres."""
    found = []
    for path in sorted(folder.glob("*/*.city.jsonl")):
        head, *features = map(json.loads, path.read_text(encoding="utf-8").splitlines())
        assert head["type"] == "CityJSON"
        assert head["CityObjects"] == {}
        assert head["vertices"] == []
        for feature in features:
            assert feature["type"] == "CityJSONFeature"
            ((name, own),) = feature["CityObjects"].items()
            assert feature["id"] == name
            (geometry,) = own["geometry"]
            vertices = np.array(feature["vertices"])
            if geometry["type"] == "Solid":
                shell, *holes = (vertices[ring][:, :2] for ring in geometry["boundaries"][0][0])
                plan = shapely.normalize(shapely.Polygon(shell, holes))
                about = own["attributes"]
                found.append((about.get("id"), about["class"], vertices[:, 2].max(), plan.wkb))
    return found


def check_solids(found: list[tuple], expected: list[tuple]) -> None:
    """Whether both lists have the same facts and footprints; those found may also have points in
    straight walls, at the borders of tiles."""
    found = [(about, shapely.from_wkb(plan)) for about, plan in found]
    pair = (sorted(one, key=lambda one: (str(one[0]), one[1].bounds)) for one in (found, expected))
    more = 0
    for (about, plan), (other, whole) in zip(*pair, strict=True):
        assert about == other
        own, corners = (shapely.get_coordinates(polygon) for polygon in (plan, whole))
        assert set(map(tuple, corners.tolist())) <= set(map(tuple, own.tolist()))
        assert shapely.hausdorff_distance(plan, whole) <= 1
        more += len(own) - len(corners)
    assert more > 0


def open_borders(folder: Path, level: str, lines: list[float]) -> int:
    """Join the tiles, and count edges of the ground on the ``lines`` that have no partner: neither
    ground nor the foot of a wall."""
    parts, walls = [], []
    for path in sorted((folder / level).glob("*.glb")):
        for name, triangles in parsed.read(path).items():
            (parts if name in KINDS else walls).append(triangles)
    ground = np.concatenate(parts).astype(np.float32)
    every = np.concatenate([ground, *walls]).astype(np.float32)
    points, index = np.unique(every.reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    edges = np.concatenate([index[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    own = np.tile(np.arange(len(index)) < len(ground), 3)
    way, back = (edges[:, a] * len(points) + edges[:, b] for a, b in ((0, 1), (1, 0)))
    alone = own & ~np.isin(back, way)
    begin, end = (points[edges[alone]][:, k] for k in (0, 1))
    on = [(begin[:, k] == line) & (end[:, k] == line) for k in (0, 1) for line in lines]
    return int(np.logical_or.reduce(on).sum())


def test_each_building_is_in_one_tile_as_a_whole(written):
    scene, folder, facts = written
    expected = []
    for group in scene.groups:
        if is_surface(group):
            continue
        ids = group.attributes.get("id", [None] * len(group))
        for own, polygon, height in zip(ids, group.polygons, group.heights, strict=True):
            plan = shapely.transform(polygon, lambda p: np.round(p * 1000))
            expected.append(((own, group.name, round(height * 1000)), plan))
    check_solids([(one[:3], one[3]) for one in solids_of(folder)], expected)
    assert facts["buildings"]["1.3"] == len(scene.walls)


@pytest.mark.parametrize("level", ["1.3", "2.2", "1.2", "1.0"])
def test_a_wall_across_a_border_has_the_points_of_the_ground(level, tmp_path):
    """Each edge of the joined ground has a partner: ground, a kerb, or the foot of a wall."""
    scene = evocity.scene(town(), streets=True, lod=level if level == "2.2" else None)
    write_tiles(scene, tmp_path / "t", SIDE, levels=[level])
    ground, walls = [], []
    for path in sorted((tmp_path / "t" / level).glob("*.glb")):
        for name, triangles in parsed.read(path).items():
            (ground if name in KINDS else walls).append(triangles)
    ground, count = np.concatenate(ground), sum(map(len, ground))
    every = np.concatenate([ground, *walls]).astype(np.float32)
    points, index = np.unique(every.reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    way = {(a, b) for row in index.tolist() for a, b in zip(row, row[1:] + row[:1], strict=True)}
    own = [
        (a, b)
        for row in index[:count].tolist()
        for a, b in zip(row, row[1:] + row[:1], strict=True)
    ]
    alone = np.array([(a, b) for a, b in own if (b, a) not in way])
    begin, end = (points[alone[:, k], :2] for k in (0, 1))
    wide = 2.0 * town().shape[0]
    outer = [(begin[:, k] == side) & (end[:, k] == side) for k in (0, 1) for side in (0, wide)]
    assert np.logical_or.reduce(outer).all()
    assert sum(map(len, walls)) > 100


@pytest.mark.parametrize("level", ["1.3", "1.2", "1.0", "afar"])
def test_tiles_meet_without_open_edges(written, level):
    scene, folder, facts = written
    assert open_borders(folder, level, [SIDE * 2.0]) == 0
    ground = sum(
        shapely.area(shapely.polygons(parsed.read(path)[name])).sum()
        for path in (folder / level).glob("*.glb")
        for name in parsed.read(path)
        if name in KINDS
    )
    surfaces = [group.polygons for group in scene.groups if is_surface(group)]
    own = {"1.3": shapely.area(np.concatenate(surfaces)).sum(), "afar": 192.0**2}
    assert ground == pytest.approx(own.get(level, ground), rel=1e-6)
    assert len(list((folder / level).glob("*.glb"))) == facts["tiles"] == 4


def test_a_wall_on_a_border_meets_the_ground_of_the_next_tile(tmp_path):
    heights = np.zeros((64, 64), np.float32)
    heights[8:24, 16:32] = heights[40:56, 32:44] = 9  # walls on the border between two columns
    scene = evocity.scene(CityMap(heights, 2.0), streets=True)
    write_tiles(scene, tmp_path / "t", 32)
    ground = np.concatenate([group.polygons for group in scene.groups if is_surface(group)])
    wall = shapely.LineString([(64, 80), (64, 112)])
    assert shapely.length(shapely.intersection(shapely.union_all(ground).boundary, wall)) > 31
    for level in ("1.3", "1.2"):
        assert open_borders(tmp_path / "t", level, [64.0]) == 0


def test_the_tileset_keeps_to_its_schema_and_laws(written):
    _, folder, facts = written
    document = json.loads((folder / "tileset.json").read_text(encoding="utf-8"))
    assert [str(error) for error in schema().iter_errors(document)] == []
    assert [str(error) for error in schema().iter_errors(document | {"root": {}})] != []
    assert document["asset"]["version"] == "1.1"
    assert document["geometricError"] > document["root"]["geometricError"]
    files = []

    def check(tile, turn):
        middle, half = np.array(tile["boundingVolume"]["box"][:3]), half_axes(tile)
        if "content" in tile:
            files.append(tile["content"]["uri"])
            points = np.concatenate(list(parsed.read(folder / files[-1]).values())).reshape(-1, 3)
            assert (points >= middle - half - 1e-4).all()
            assert (points <= middle + half + 1e-4).all()
        for child in tile.get("children", []):
            assert child["geometricError"] < tile["geometricError"]
            low = np.array(child["boundingVolume"]["box"][:3]) - half_axes(child)
            high = np.array(child["boundingVolume"]["box"][:3]) + half_axes(child)
            assert (low >= middle - half - 1e-9).all()
            assert (high <= middle + half + 1e-9).all()
            check(child, turn)
        if "children" not in tile:
            assert tile["geometricError"] == 0

    check(document["root"], None)
    assert sorted(files) == sorted(
        str(path.relative_to(folder).as_posix()) for path in folder.glob("*/*.glb")
    )
    own = document["extras"]["evocity"]
    assert (own["tile"], own["rows"], own["columns"]) == (SIDE, 2, 2)
    assert own["levels"] == facts["levels"] == ["1.3", "1.2", "1.0", "afar"]
    held = [path for path in folder.rglob("*") if path.is_file()]
    assert len(held) == facts["files"]
    assert sum(path.stat().st_size for path in held) == facts["bytes"]


def half_axes(tile) -> np.ndarray:
    return np.array(tile["boundingVolume"]["box"])[[3, 7, 11]]


def test_coarser_levels_have_fewer_triangles(written):
    counts = list(written[2]["triangles"].values())
    assert counts == sorted(counts)
    assert sum(written[2]["buildings"].values()) > 0


def test_a_margin_gives_the_buildings_of_the_whole(tmp_path):
    city = draw_town(7, side=128)
    write_tiles(evocity.scene(city), tmp_path / "whole", 64)
    inner = city.replace(city.heights[:, :96])
    write_tiles(evocity.scene(inner), tmp_path / "part", 32, margin=32, levels=["1.3"])
    whole = {own[1:] for own in solids_of(tmp_path / "whole")}
    # the part's corner lies 32 px, 64 m, to the north-east
    moved = set()
    for _, name, high, plan in solids_of(tmp_path / "part"):
        polygon = shapely.transform(shapely.from_wkb(plan), lambda points: points + 64000)
        if polygon.bounds[2] < 96 * 2000 - 2000:
            moved.add((name, high, shapely.normalize(polygon).wkb))
    assert moved
    assert moved <= whole


def test_cut_surfaces_share_points_and_keep_their_area():
    rng = np.random.default_rng(3)
    points = shapely.MultiPoint(rng.random((40, 2)) * 90 + 5)
    cells = shapely.get_parts(shapely.voronoi_polygons(points, extend_to=shapely.box(0, 0, 96, 96)))
    cells = shapely.intersection(cells, shapely.box(0, 0, 96, 96))
    found = cut_surfaces(np.array(cells, object), [0.0, 32.0, 64.0, 96.0], [0.0, 48.0, 96.0])
    assert len(found) == 6
    every = np.concatenate([polygons for polygons, _ in found.values()])
    assert shapely.area(every).sum() == pytest.approx(96**2)
    assert shapely.coverage_is_valid(every)
    for polygons, of in found.values():
        assert (shapely.area(polygons) <= shapely.area(cells[of]) + 1e-9).all()


def test_the_globe_is_below_the_tiles():
    matrix = np.array(globe_transform("EPSG:2154", (842000.0, 6520000.0))).reshape(4, 4).T
    from pyproj import Transformer

    to = Transformer.from_crs("EPSG:2154", "EPSG:4979", always_xy=True)
    lon, lat = to.transform(842000.0 + 300, 6520000.0 + 200)
    globe = Transformer.from_crs(4979, 4978, always_xy=True)
    expected = globe.transform(lon, lat, 40.0)
    assert (matrix @ (300, 200, 40, 1))[:3] == pytest.approx(expected, abs=0.05)
    assert globe_transform(None, (0.0, 0.0)) is None


def test_tiles_lie_on_the_globe_at_their_middle():
    size = (8192.0, 8192.0)
    matrix = np.array(globe_transform("EPSG:2154", (842000.0, 6520000.0), size)).reshape(4, 4).T
    from pyproj import Transformer

    to = Transformer.from_crs("EPSG:2154", "EPSG:4979", always_xy=True)
    globe = Transformer.from_crs(4979, 4978, always_xy=True)

    def off(x, y):
        lon, lat = to.transform(842000.0 + x, 6520000.0 + y)
        return np.linalg.norm((matrix @ (x, y, 0, 1))[:3] - globe.transform(lon, lat, 0.0))

    assert off(4096, 4096) < 1e-6
    assert all(2.4 < off(x, y) < 3.2 for x in (0, 8192) for y in (0, 8192))  # d² / 12.7 Mm, scale


def test_lines_have_another_reference_system(tmp_path):
    scene = evocity.scene(town(), streets=True)
    write_tiles(scene, tmp_path / "own", SIDE, levels=["1.3"])
    write_tiles(scene, tmp_path / "t", SIDE, levels=["1.3"], crs="EPSG:32631")
    found = []
    for path in sorted(tmp_path.glob("t/*/*.city.jsonl")):
        head = json.loads(path.read_text(encoding="utf-8").splitlines()[0])
        assert head["metadata"]["referenceSystem"].endswith("/EPSG/0/32631")
        found.append(head["transform"]["translate"])
    groups, about = scene.placed("EPSG:32631")
    assert [[*about.offset, 0.0]] * 4 == found
    expected = []
    for group in groups:
        ids = group.attributes.get("id", [None] * len(group))
        for own, polygon in zip(ids, group.polygons, strict=True):
            plan = shapely.transform(polygon, lambda p: np.round(p * 1000))
            if not is_surface(group):
                expected.append((own, plan))
    check_solids([(one[0], one[3]) for one in solids_of(tmp_path / "t")], expected)
    for path in tmp_path.glob("own/*/*.glb"):  # tiles on the globe stay where they are
        other = tmp_path / "t" / path.parent.name / path.name
        assert path.read_bytes() == other.read_bytes()
    with pytest.raises(MapError, match="other options"):
        write_tiles(scene, tmp_path / "t", SIDE, levels=["1.3"])
    for crs, says in (("EPSG:4326", "has degrees"), ("EPSG:2056", "outside the area")):
        with pytest.raises(MapError, match=says):
            write_tiles(scene, tmp_path / "x", SIDE, crs=crs)
    with pytest.raises(MapError, match=r"no \.city\.jsonl files for crs"):
        write_tiles(evocity.scene(town(), lod="afar"), tmp_path / "x", SIDE, crs="EPSG:32631")
    assert not (tmp_path / "x").exists()


def test_other_settings_are_refused(tmp_path):
    scene = evocity.scene(town(), lod="1.0")
    settings = {"seed": 3, "share": [0.5, 1.0], "genomes": ["a", "b"]}
    write_tiles(scene, tmp_path / "t", SIDE, settings=settings)
    document = json.loads((tmp_path / "t" / "tileset.json").read_text(encoding="utf-8"))
    assert document["extras"]["evocity"]["settings"] == settings
    write_tiles(scene, tmp_path / "t", SIDE, settings=settings)
    check_tiles_folder(tmp_path / "t")
    check_tiles_folder(tmp_path / "t", settings | {"share": (0.5, 1.0)})
    more = {"seed": 4, "share": None}
    for wrong, says in (({}, ", or tiles"), (settings | more, ", which differs in seed, share\n")):
        with pytest.raises(MapError, match=f"another fabric{says}"):
            check_tiles_folder(tmp_path / "t", wrong)
        with pytest.raises(MapError, match=f"another fabric{says}"):
            write_tiles(scene, tmp_path / "t", SIDE, settings=wrong)


@pytest.mark.parametrize("lod", ["2.2", "1.3", "1.2"])
def test_windows_of_a_fabric_have_the_same_solids(tmp_path, lod):
    """A chain of buildings that reaches into both windows is the same in both."""
    heights = np.pad(draw_town(3, side=128).heights, 32)
    city = CityMap(heights, 2.0)
    found = []
    for name, left in (("west", 0), ("east", 32)):
        part = city.replace(heights[:, left : left + 160])
        write_tiles(evocity.scene(part, lod=lod), tmp_path / name, 32, margin=32, levels=[lod])
        solids = set()
        for _, kind, high, plan in solids_of(tmp_path / name):
            moved = shapely.from_wkb(plan)
            moved = shapely.affinity.translate(moved, 2000 * (left + 32))
            if moved.bounds[0] > 128_000 and moved.bounds[2] < 256_000:
                solids.add((shapely.normalize(moved).wkb, kind, high))
        found.append(solids)
    assert len(found[0]) > 10
    assert found[0] == found[1]


def test_bad_input_leaves_folders_as_they_were(tmp_path):
    scene = evocity.scene(town())
    with pytest.raises(MapError, match="tiles of 40 px do not divide the map of 96 × 96 px"):
        write_tiles(scene, tmp_path / "t", 40)
    odd = CityMap(np.full((90, 97), 6.0, np.float32), 2.0)  # no side divides both
    with pytest.raises(MapError, match="choose a map of 96 × 96 px"):
        write_tiles(evocity.scene(odd), tmp_path / "t", 48)
    for side in (0, 8, 2.5, True):
        with pytest.raises(MapError, match="side"):
            write_tiles(scene, tmp_path / "t", side)
    with pytest.raises(MapError, match="finer than the scene"):
        write_tiles(evocity.scene(town(), lod="1.0"), tmp_path / "t", 48, levels=["1.3"])
    with pytest.raises(MapError, match="no such folder"):
        write_tiles(scene, tmp_path / "no" / "t", 48)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(MapError, match="other files"):
        write_tiles(scene, tmp_path / "other", 48)
    assert [path.name for path in (tmp_path / "other").iterdir()] == ["letter.txt"]


def test_tiles_of_the_coarsest_level_have_no_cityjson(tmp_path):
    facts = write_tiles(evocity.scene(town(), lod="afar"), tmp_path / "t", 48)
    assert facts["levels"] == ["afar"]
    assert not list(tmp_path.rglob("*.city.jsonl"))
    assert facts["files"] == len([path for path in tmp_path.rglob("*") if path.is_file()])


def test_kerbs_near_a_tile_are_those_of_all_kerbs():
    (street,) = (group for group in evocity.scene(town(), streets=True).groups if group.level)
    near = kerbs_near(street.kerbs, np.array(street.polygons[0].bounds))
    own = street.take(np.array([0]))
    rings = own.rings
    everywhere = kerb_edges(rings.points, rings.after, street.kerbs)
    assert len(everywhere)
    assert shapely.get_num_geometries(near) < shapely.get_num_geometries(street.kerbs)
    np.testing.assert_array_equal(kerb_edges(rings.points, rings.after, near), everywhere)


@pytest.mark.parametrize("how", [{"storeys": 4.0}, {"sources": "all"}])
def test_scenes_with_other_options_have_other_digests(tmp_path, how):
    if "sources" in how:
        how = {"sources": ["Lyon"] * len(town().buildings)}
    write_tiles(evocity.scene(town()), tmp_path / "t", SIDE, levels=["1.0"])
    with pytest.raises(MapError, match="tiles of another fabric"):
        write_tiles(evocity.scene(town(), **how), tmp_path / "t", SIDE, levels=["1.0"])


def test_a_folder_of_another_fabric_is_refused(tmp_path):
    scene = evocity.scene(town(), lod="1.0")
    facts = write_tiles(scene, tmp_path / "t", 96)
    assert facts["levels"] == ["1.0", "afar"]
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*") if path.is_file()}
    assert write_tiles(scene, tmp_path / "t", 96) == facts
    other = town().replace(town().heights + np.float32(3))
    for wrong, side in ((evocity.scene(other, lod="1.0"), 96), (scene, 48)):
        with pytest.raises(MapError, match="tiles of another fabric"):
            write_tiles(wrong, tmp_path / "t", side)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*.*") if p.is_file()} == before
