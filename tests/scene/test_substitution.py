"""Libraries of objects, and buildings that give way to them."""

import dataclasses
import warnings

import naive
import numpy as np
import pyogrio
import pytest
import shapely
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from rasterio import features as raster
from towns import draw_town

import evocity
from evocity.citymap import STOREY, CityMap
from evocity.errors import MapError
from evocity.scene._kernels import shared, tried
from evocity.scene.library import COLUMNS, LEAST, Library
from evocity.scene.library_table import LAYER, TABLE
from evocity.scene.matching import SCALE, Boards, Sides, match_objects, place_objects
from evocity.scene.substitution import MARGIN, substituted


def town(*shapes, side=120, pixel=1.0, **about):
    """A map of polygons with heights, x to the east and y to the north from its south-west."""
    heights = raster.rasterize(
        list(shapes),
        out_shape=(round(side / pixel),) * 2,
        transform=Affine(pixel, 0, 0, 0, -pixel, side),
        dtype="float32",
    )
    return CityMap(heights, pixel, **({"name": "town"} | about))


def block(x, y, wide, deep, turn=0.0):
    return shapely.affinity.rotate(shapely.box(x, y, x + wide, y + deep), turn)


def ell(x, y, size=20.0, turn=0.0, mirrored=False):
    one = shapely.union(
        shapely.box(0, 0, size, size * 0.4), shapely.box(0, 0, size * 0.4, size * 0.8)
    )
    one = shapely.affinity.scale(one, -1 if mirrored else 1, 1)
    return shapely.affinity.translate(shapely.affinity.rotate(one, turn), x, y)


def library_of(*shapes, heights=9.0, classes="building", attached=False):
    """A library of drawn footprints."""
    count = len(shapes)
    centred = [shapely.affinity.translate(s, -s.centroid.x, -s.centroid.y) for s in shapes]
    polygons = np.empty(count, object)
    polygons[:] = centred
    texts = dict.fromkeys(("atmospheres", "attributions"), ("",) * count)
    return Library(
        ids=tuple(f"drawn-{k}" for k in range(count)),
        classes=(classes,) * count,
        polygons=polygons,
        heights=np.broadcast_to(np.array(heights, float), count).copy(),
        licences=("CC0-1.0",) * count,
        attached=np.full(count, attached),
        **texts,
    )


VILLAGE = [
    (block(10 + 30 * k, 10 + 30 * j, 12 + k, 9 + j, 10 * k), 6 + k)
    for k in range(3)
    for j in range(3)
]


@pytest.fixture(scope="module")
def village():
    return town(*VILLAGE, attribution="drawn by hand")


@pytest.fixture(scope="module")
def bred():
    parents = [evocity.encode(draw_town(k, side=128, buildings=60)).genome for k in (1, 2)]
    from evocity.operators import make

    return evocity.decode(make("pavement_fusion")(parents, np.random.default_rng(3))).city


@pytest.fixture(scope="module")
def objects():
    """Of other towns than the bred one's parents."""
    towns = [draw_town(k, side=256, buildings=220) for k in range(10, 16)]
    return Library.joined(Library.of(one, licence="CC0-1.0", atmosphere="drawn") for one in towns)


# -- libraries -------------------------------------------------------------------------------------


def test_a_library_is_made_of_the_buildings_of_a_map(village):
    library = Library.of(village, licence="ODbL-1.0", atmosphere="village")
    assert library.ids == tuple(f"town-{k}" for k in range(1, 10))
    assert set(library.classes) == {"building"}
    assert set(library.attributions) == {"drawn by hand"}
    assert not library.attached.any()
    assert np.allclose(library.heights, village.walls.heights, atol=1e-3)
    assert np.allclose(shapely.area(library.polygons), shapely.area(village.walls.polygons))
    middles = shapely.get_coordinates(shapely.centroid(library.polygons))
    assert np.abs(middles).max() < 1e-3


def test_what_the_border_cuts_and_what_is_small_are_no_objects():
    city = town((block(-5, 20, 20, 20), 9), (block(40, 40, 3, 4), 9), (block(60, 60, 20, 12), 9))
    assert len(city.buildings) == 3
    library = Library.of(city, licence="CC0-1.0")
    assert len(library) == 1
    assert shapely.area(library.polygons)[0] == pytest.approx(240)
    assert (shapely.area(library.polygons) >= LEAST).all()


def test_attached_ones_are_told_or_left_out():
    row = [(block(10 + 8 * k, 10, 8, 12), 6 + 3 * (k % 2)) for k in range(4)]
    city = town(*row, (block(60, 60, 20, 12), 9))
    both = Library.of(city, licence="CC0-1.0")
    assert both.attached.sum() == 4
    assert len(both) == 5
    assert len(Library.of(city, licence="CC0-1.0", attached=False)) == 1


def test_a_part_of_a_map_leaves_out_what_its_site_cuts(village):
    mask = np.add.outer(np.arange(120), np.arange(120)) < 130
    part = village.within(mask)
    library = Library.of(part, licence="CC0-1.0")
    assert 0 < len(library) < len(part.buildings)


def test_a_map_without_buildings_makes_an_empty_library(tmp_path):
    library = Library.of(CityMap(np.zeros((8, 8)), 2.0), licence="CC0-1.0")
    assert len(library) == 0
    library.write(tmp_path / "none")
    assert len(Library.read(tmp_path / "none")) == 0


def test_without_a_licence_there_is_no_library(village):
    with pytest.raises(MapError, match="has no licence"):
        Library.of(village, licence=" ")


def test_written_and_read_it_is_the_same(tmp_path, village):
    library = Library.of(village, licence="ODbL-1.0", atmosphere="village")
    assert library.write(tmp_path / "own") == tmp_path / "own" / TABLE
    library.write(tmp_path / "own")  # written over
    again = Library.read(tmp_path / "own")
    for field in dataclasses.fields(Library):
        if field.name != "polygons":
            assert np.array_equal(getattr(again, field.name), getattr(library, field.name)), (
                field.name
            )
    apart = shapely.area(shapely.symmetric_difference(again.polygons, library.polygons))
    assert apart.max() < 0.1  # a millimetre of shift


def test_the_table_is_one_that_a_gis_shows(tmp_path, village):
    Library.of(village, licence="ODbL-1.0").write(tmp_path)
    meta, _, shapes, _ = pyogrio.raw.read(tmp_path / TABLE, layer=LAYER)
    assert tuple(meta["fields"]) == COLUMNS
    polygons = shapely.from_wkb(shapes)
    assert shapely.area(polygons).sum() == pytest.approx(shapely.union_all(polygons).area)  # apart


def test_libraries_are_joined_and_parted(village):
    one = Library.of(village, licence="CC0-1.0")
    other = Library.of(town(*VILLAGE, name="other"), licence="MIT")
    both = Library.joined([one, other])
    assert both.ids == one.ids + other.ids
    assert both.only(both.heights > 7).heights.min() > 7
    assert both.only([3]).ids == (one.ids[3],)
    with pytest.raises(MapError, match="town-1 occurs twice"):
        Library.joined([one, one])


def table_of(
    folder, polygons=None, name=TABLE, layer=LAYER, crs="EPSG:3857", kind="Polygon", **columns
):
    """A table of two objects, some of it as told; a column that is None is left out."""
    polygons = [block(0, 0, 10, 8), block(20, 0, 9, 9)] if polygons is None else polygons
    told = {
        "id": ["a", "b"],
        "class": ["building", "shelter"],
        "height": [6.0, 3.0],
        "atmosphere": ["", "village"],
        "licence": ["CC0-1.0", "MIT"],
    }
    told |= {key.rstrip("_"): value for key, value in columns.items()}
    told = {key: value for key, value in told.items() if value is not None}
    shapes = np.array(
        [one if isinstance(one, bytes) else shapely.to_wkb(one) for one in polygons], object
    )
    kinds = [float if all(isinstance(v, float) for v in one) else object for one in told.values()]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pyogrio.raw.write(
            folder / name,
            geometry=shapes,
            field_data=[np.array(v, dtype=k) for v, k in zip(told.values(), kinds, strict=True)],
            fields=list(told),
            layer=layer,
            driver="GPKG",
            geometry_type=kind,
            crs=crs,
        )
    return folder


def test_a_table_by_other_hands_is_read(tmp_path):
    found = Library.read(table_of(tmp_path, path=["", None], storeys=[2.0, 1.0]))
    assert found.ids == ("a", "b")
    assert found.classes == ("building", "shelter")
    assert not found.attached.any()
    assert found.attributions == ("", "")


OPEN = (
    bytes.fromhex("0103000000010000000400000000000000000000000000000000000000")
    + np.array([10, 0, 10, 8, 0, 8], "<f8").tobytes()
)
BOW = shapely.Polygon([(0, 0), (10, 8), (10, 0), (0, 8)])

FAULTS = {
    "an open polygon": ({"polygons": [block(0, 0, 9, 9), OPEN]}, "object b: a ring that is open"),
    "a line": (
        {"polygons": [block(0, 0, 9, 9), block(0, 0, 9, 9).exterior], "kind": "Unknown"},
        "object b: a LineString",
    ),
    "a polygon that crosses itself": (
        {"polygons": [BOW, block(0, 0, 9, 9)]},
        "object a: an invalid",
    ),
    "two parts": (
        {
            "polygons": [shapely.union(block(0, 0, 9, 9), block(20, 0, 9, 9)), BOW],
            "kind": "Unknown",
        },
        "object a: a MultiPolygon",
    ),
    "nothing": ({"polygons": [shapely.Polygon(), BOW]}, "object a: an invalid"),
    "no licence": ({"licence": ["MIT", " "]}, "object b without a licence"),
    "no column of licences": ({"licence": None}, "columns are missing: licence"),
    "no class": ({"class_": [None, "building"]}, "object a without a class"),
    "no id": ({"id": ["a", ""]}, "row 2 has no id"),
    "an id twice": ({"id": ["a", "a"]}, "id a occurs twice"),
    "height 0": ({"height": [6.0, 0.0]}, "object b: the height 0"),
    "height below 0": ({"height": [-6.0, 3.0]}, "object a: the height -6"),
    "height above 1 km": ({"height": [6.0, 1001.0]}, "object b: the height 1001"),
    "no number": ({"height": ["6", "high"]}, "object b: the height high"),
    "degrees": ({"crs": "EPSG:4326"}, "footprints are in degree"),
    "another layer": ({"layer": "things"}, "no layer 'objects'"),
    "a path outside": (
        {"path": ["", "../secret.glb"]},
        "object b has the mesh file '../secret.glb'",
    ),
    "a path from the root": ({"path": ["/etc/hostname", ""]}, "object a has the mesh file"),
    "a path inside": ({"path": ["none.glb", ""]}, "object a has the mesh file 'none.glb'"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_library_at_fault_is_refused(tmp_path, name):
    told, says = FAULTS[name]
    (tmp_path / "secret.glb").write_bytes(b"glTF")
    (tmp_path / "own").mkdir()
    table_of(tmp_path / "own", **told)
    with pytest.raises(MapError) as caught:
        Library.read(tmp_path / "own")
    assert says in str(caught.value)
    assert TABLE in caught.value.found


def test_what_is_no_table_is_refused(tmp_path):
    with pytest.raises(MapError, match="no such folder"):
        Library.read(tmp_path / "none")
    with pytest.raises(MapError, match="no table"):
        Library.read(tmp_path)
    (tmp_path / TABLE).write_text("id,class")
    with pytest.raises(MapError, match="a GeoPackage"):
        Library.read(tmp_path)
    (tmp_path / TABLE).write_bytes(b"SQLite format 3\x00" + bytes(2000))
    with pytest.raises(MapError, match="cannot be read"):
        Library.read(tmp_path)
    with pytest.raises(MapError, match="cannot be written"):
        library_of(block(0, 0, 9, 9)).write(tmp_path / "none" / "deeper")


# -- placings --------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0, 25, 90, 160, 245, 300])
@pytest.mark.parametrize("mirrored", [False, True])
def test_an_object_is_turned_and_mirrored_onto_its_like(turn, mirrored):
    own = np.array([ell(60, 60, turn=turn, mirrored=mirrored)], object)
    library = library_of(ell(0, 0, turn=40), block(0, 0, 14, 14))
    found = match_objects(
        own, np.full(1, np.nan), np.array([9.0]), ["building"], library, STOREY, 5
    )
    first = found.select(np.array([0]))
    assert first.object.tolist() == [0]
    stood = place_objects(first, library.polygons)[0]
    assert shapely.area(shapely.intersection(stood, own[0])) == pytest.approx(own[0].area, rel=1e-6)


def test_boards_tell_what_polygons_tell():
    own = np.array([ell(60, 60, turn=20), block(20, 20, 14, 10, 30)], object)
    library = library_of(ell(0, 0), block(0, 0, 15, 9), block(0, 0, 12, 12), ell(0, 0, 16, 70))
    found = match_objects(
        own, np.full(2, np.nan), np.full(2, 9.0), ["building"] * 2, library, STOREY, 4
    )
    assert len(found) >= 4
    for by in (0.0, 0.2, -0.3):
        moved = found.shift(0, by).shift(3, 10 * by)
        stood, there = place_objects(moved, library.polygons), own[moved.building]
        common = shapely.area(shapely.intersection(stood, there))
        iou = common / (shapely.area(stood) + shapely.area(there) - common)
        wide = shapely.buffer(own, MARGIN)
        beyond = shapely.area(shapely.difference(stood, wide[moved.building])) / shapely.area(stood)
        assert np.allclose(Boards(own, wide, library).measure(moved), iou - 4 * beyond, atol=0.08)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_polygons_share_is_the_same_to_shapely(seed):
    rng = np.random.default_rng(seed)
    ring = shapely.difference(block(0, 0, 20, 14), block(3, 4, 9, 5))
    two = shapely.union(block(0, 0, 8, 8), block(11, 2, 6, 9))
    shapes = np.array([ell(0, 0, 18, 30), ring, block(-4, -3, 12, 7, 45)], object)
    grounds = np.array([ell(2, 3), ring, two, shapely.Polygon()], object)
    matrices = rng.uniform(-1.2, 1.2, (12, 2, 3)) * [1, 1, 15]
    matrices[:4, :, :2] = [[[1, 0], [0, 1]], [[-1, 0], [0, 1]], [[0, -1], [1, 0]], [[0, 1], [1, 0]]]
    matrices[:4] = np.round(matrices[:4])  # upright sides, and sides that lie on others
    which, where = rng.integers(0, 3, 12), rng.integers(0, 4, 12)
    one, other = Sides(shapes), Sides(grounds)
    told = shared(matrices, which, where, one.edges, one.starts, other.edges, other.starts)
    wanted = naive.shared_areas(matrices, which, where, shapes, grounds)
    assert told == pytest.approx(wanted, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_placings_are_tried_as_the_slow_twin_does(seed):
    rng = np.random.default_rng(seed)
    numbers = rng.uniform([-4, 0.8, 0.8, -6, -6], [4, 1.2, 1.2, 20, 20], (9, 5))
    flips = rng.choice([-1.0, 1.0], 9)
    shape, where = rng.integers(0, 2, 9), rng.integers(0, 3, 9)
    points, inside = rng.uniform(-0.5, 0.5, (20, 2)), rng.random((2, 20)) < [[0.7], [0]]
    sides, sizes, areas = rng.uniform(5, 15, (2, 2)), np.array([80.0, 30.0]), rng.uniform(9, 99, 3)
    cells = rng.integers(0, 3, (3, 6, 6)).astype(np.uint8)
    low, step = rng.uniform(-3, 3, (3, 2)), rng.uniform(1, 4, (3, 2))
    words = (numbers, flips, shape, where, points, inside, sides, sizes, cells, low, step, areas)
    assert tried(*words) == pytest.approx(naive.tried_by_points(*words), abs=1e-12)


# -- substitution ----------------------------------------------------------------------------------


def test_a_town_takes_its_own_buildings(village):
    library = Library.of(village, licence="CC0-1.0")
    found = substituted(village, library, np.random.default_rng(1))
    assert found.counts["isolated_fitted"] == found.counts["isolated"] == 9
    assert found.counts["kept"] == 0
    assert found.iou.min() > 0.9
    assert found.attribution == "drawn by hand"


def laws(found, city, library):
    """What holds of every substitution."""
    walls = np.array(found.walls.polygons, dtype=object)
    fitted = found.objects >= 0
    assert shapely.is_valid(found.polygons).all()
    assert (found.heights > 0).all()
    # nothing overlaps
    one, other = shapely.STRtree(found.polygons).query(found.polygons, predicate="intersects")
    apart = one < other
    common = shapely.intersection(found.polygons[one[apart]], found.polygons[other[apart]])
    assert shapely.area(common).max(initial=0) < 1e-6
    # no object stands on another's ground, nor beyond its margin, nor off the map
    stood = found.polygons[fitted]
    one, other = shapely.STRtree(walls).query(stood, predicate="intersects")
    foreign = np.flatnonzero(fitted)[one] != other
    common = shapely.intersection(stood[one[foreign]], walls[other[foreign]])
    assert shapely.area(common).max(initial=0) < 1e-6
    assert shapely.covers(shapely.buffer(walls[fitted], MARGIN + 1e-3), stood).all()
    left, bottom, right, top = shapely.bounds(stood).T
    deep, wide = (side * city.metres_per_pixel for side in city.shape)
    x, y = city.origin or (0.0, deep)
    assert (left >= x - 1e-6).all()
    assert (right <= x + wide + 1e-6).all()
    assert (top <= y + 1e-6).all()
    assert (bottom >= y - deep - 1e-6).all()
    # what keeps its form keeps all of it
    assert (found.polygons[~fitted] == walls[~fitted]).all()
    assert np.array_equal(found.heights[~fitted], found.walls.heights[~fitted])
    assert np.isnan(found.iou[~fitted]).all()
    # objects are of the library, each axis by 15 % at most, of one class, within a storey
    used = found.objects[fitted]
    for polygon, matrix, number in zip(stood, found.transforms[fitted], used, strict=True):
        (a, b, c), (d, e, f) = matrix
        moved = shapely.affinity.affine_transform(library.polygons[number], [a, b, d, e, c, f])
        assert shapely.area(shapely.symmetric_difference(moved, polygon)) < 1e-5
        assert np.all(np.abs(np.linalg.svd(matrix[:, :2])[1] - 1) <= SCALE + 1e-9)
    own = found.walls.heights[fitted]
    assert (np.abs(library.heights[used] - own) <= STOREY).all()
    assert np.allclose(found.heights[fitted], library.heights[used] * found.vertical[fitted])
    assert (np.abs(found.vertical[fitted] - 1) <= SCALE + 1e-9).all()
    classes = [city.classes.names[k] for k in city.classes.of_buildings[found.walls.buildings - 1]]
    assert [library.classes[k] for k in used] == [
        k for k, fit in zip(classes, fitted, strict=True) if fit
    ]
    # the same in parts: an object about the corner of its frame, scaled, turned, moved
    copies = found.copies((3.0, -4.0), np.ones(len(found), bool), 1)
    assert (copies is None) == (not fitted.any())
    if copies is not None:
        assert copies.of[-1] == -1
        assert np.array_equal(copies.of[:-1] >= 0, fitted)
    for k in np.flatnonzero(fitted):
        assert copies.names[copies.of[k]] == found.ids[k]
        moved = shapely.affinity.scale(
            copies.polygons[copies.of[k]], *copies.scales[k, :2], origin=(0, 0)
        )
        moved = shapely.affinity.rotate(moved, copies.turns[k], (0, 0), use_radians=True)
        moved = shapely.affinity.translate(moved, *(copies.places[k] + (3.0, -4.0)))
        assert shapely.area(shapely.symmetric_difference(moved, found.polygons[k])) < 1e-5
        high = copies.heights[copies.of[k]] * copies.scales[k, 2]
        assert high == pytest.approx(found.heights[k])
    # what is told is so
    common = shapely.area(shapely.intersection(stood, walls[fitted]))
    union = shapely.area(stood) + shapely.area(walls[fitted]) - common
    assert np.allclose(found.iou[fitted], common / union, atol=1e-6)
    counts = found.counts
    assert counts["isolated"] + counts["attached"] + counts["small"] == len(found)
    assert counts["kept"] == np.count_nonzero(~fitted)
    assert counts["fitted"] == len(found) - counts["kept"]
    parted = (counts[f"{name}_fitted"] for name in ("isolated", "attached", "small"))
    assert sum(parted) == counts["fitted"]


def test_a_bred_town_takes_objects_of_others(bred, objects):
    found = substituted(bred, objects, np.random.default_rng(1))
    laws(found, bred, objects)
    counts = found.counts
    assert counts["isolated_fitted"] >= 0.9 * counts["isolated"] > 0
    assert np.nanmedian(found.iou[~found.attached]) >= 0.85
    assert counts["attached_fitted"] >= 0.3 * counts["attached"] > 0


@pytest.mark.slow
def test_the_same_seed_gives_the_same_and_another_other_ties(bred, objects):
    first, again, other = (
        substituted(bred, objects, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert first.ids == again.ids
    assert shapely.to_wkb(first.polygons).tolist() == shapely.to_wkb(again.polygons).tolist()
    assert first.ids != other.ids
    assert np.array_equal(first.objects >= 0, other.objects >= 0)


def test_a_town_with_a_place_on_earth_stays_there(bred, objects):
    placed_ = bred.replace(bred.heights, origin=(5e5, 4.5e6), crs="EPSG:32631")
    found = substituted(placed_, objects, np.random.default_rng(1))
    laws(found, placed_, objects)
    here = substituted(bred, objects, np.random.default_rng(1))
    assert np.mean(np.array(found.ids) == np.array(here.ids)) > 0.9


def test_other_walls_and_other_classes(bred, objects):
    walls = bred.walled(squared=True, storeys=3)
    found = substituted(bred, objects, np.random.default_rng(1), walls=walls)
    laws(found, bred, objects)
    assert found.walls is walls


def test_a_house_of_a_row_stays_between_its_party_walls():
    row = [(block(10 + 9 * k, 30, 9, 12), 6 + 3 * (k % 2)) for k in range(10)]
    turned = [(shapely.affinity.rotate(one, 20, origin=(60, 60)), height) for one, height in row]
    library = library_of(
        *(block(0, 0, 9 + 0.1 * k, 11.5 + 0.1 * k) for k in range(8)), heights=7.5, attached=True
    )
    for shapes in (row, turned):
        city = town(*shapes)
        found = substituted(city, library, np.random.default_rng(1))
        laws(found, city, library)
        assert found.counts["attached"] >= 9
        assert found.counts["attached_fitted"] >= 0.8 * found.counts["attached"]


def test_no_object_closes_a_passage():
    """Two slabs 3 m apart, and objects 15 % wider: a third of the passage stays open."""
    city = town((block(20, 20, 60, 12), 9), (block(20, 35, 60, 12), 9))
    library = library_of(block(0, 0, 62, 13.8), block(0, 0, 66, 12.9), heights=9)
    found = substituted(city, library, np.random.default_rng(1))
    laws(found, city, library)
    assert (found.objects >= 0).all()
    assert shapely.distance(*found.polygons) >= 1 - 1e-6


def test_heights_and_classes_that_differ_fit_nothing():
    city = town((block(20, 20, 20, 12), 9))
    same = library_of(block(0, 0, 20, 12), heights=9)
    for library, count in (
        (same, 1),
        (library_of(block(0, 0, 20, 12), heights=13), 0),
        (library_of(block(0, 0, 20, 12), classes="tree"), 0),
        (library_of(block(0, 0, 40, 24)), 0),
        (library_of(), 0),
    ):
        found = substituted(city, library, np.random.default_rng(1))
        laws(found, city, library)
        assert found.counts["isolated_fitted"] == count
        assert found.ids == (("drawn-0",) if count else (None,))


@pytest.mark.parametrize(
    "heights",
    [np.zeros((8, 8)), np.full((16, 16), 9.0), np.eye(12) * 9, np.pad([[9.0]], 5)],
    ids=["empty", "full", "touching by corners", "one pixel"],
)
def test_maps_of_any_kind(heights, objects):
    city = CityMap(heights, 2.0)
    laws(substituted(city, objects, np.random.default_rng(1)), city, objects)


@pytest.mark.parametrize(
    "fault", [{"margin": -1}, {"margin": np.nan}, {"least": 0}, {"least": 1.2}]
)
def test_numbers_that_are_none_are_refused(village, fault):
    library = Library.of(village, licence="CC0-1.0")
    with pytest.raises(MapError, match=next(iter(fault))):
        substituted(village, library, np.random.default_rng(1), **fault)
