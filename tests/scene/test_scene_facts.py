"""What a scene tells of itself: attributions, classes, storeys, streets."""

import json

import numpy as np
import pyogrio
import pytest
import shapely
from PIL import Image
from towns import TWO_CLASSES, four_houses

import evocity
from evocity.errors import MapError
from evocity.scene.library import Library
from evocity.views.classes import ClassTable


@pytest.fixture(scope="module")
def fitted():
    """A scene whose houses are objects of a library."""
    library = Library.of(four_houses("© library"), licence="CC0-1.0")
    made = evocity.scene(four_houses("© map"), library=library, streets=True)
    assert made.substitution.counts["fitted"] == 4
    return made


def test_whom_to_thank_stands_in_every_file(fitted, tmp_path):
    assert fitted.about.attribution == "© map; © library"
    fitted.write(tmp_path / "x.gpkg")
    for layer in pyogrio.list_layers(tmp_path / "x.gpkg")[:-1, 0]:  # the last one holds styles
        about = pyogrio.read_info(tmp_path / "x.gpkg", layer=layer)["layer_metadata"]
        assert about["ATTRIBUTION"] == "© map; © library"
    fitted.write(tmp_path / "x.png")
    with Image.open(tmp_path / "x.png") as picture:
        assert "© library" in picture.info["Copyright"]
    again = evocity.scene(four_houses("© map; © map"))
    assert again.about.attribution == "© map"


def test_a_geopackage_tells_objects_and_classes(fitted, tmp_path):
    fitted.write(tmp_path / "x.gpkg")
    _, _, shapes, columns = pyogrio.raw.read(tmp_path / "x.gpkg", layer="buildings")
    told = dict(
        zip(
            pyogrio.read_info(tmp_path / "x.gpkg", layer="buildings")["fields"],
            columns,
            strict=True,
        )
    )
    assert set(told["object"]) <= {"drawn-1", "drawn-2", "drawn-3", "drawn-4"}
    assert set(told["class"]) == {"building"}
    polygons = shapely.from_wkb(shapes)
    assert shapely.equals_exact(polygons, fitted.substitution.polygons, 1e-6, normalize=True).all()


def test_no_street_lies_under_an_object(fitted):
    roads = [group.polygons for group in fitted.groups if group.city_object == "Road"]
    objects = fitted.local(fitted.substitution.polygons)
    whole = shapely.union_all(np.concatenate(roads))
    shared = shapely.intersection(whole, shapely.union_all(objects))
    assert shared.area < 0.1


def test_storeys_are_counted_by_the_height_asked_for(tmp_path):
    made = evocity.scene(four_houses(height=20.0), storeys=4.0)
    made.write(tmp_path / "x.city.json")
    objects = json.loads((tmp_path / "x.city.json").read_text())["CityObjects"]
    told = {one["attributes"].get("storeysAboveGround") for one in objects.values()}
    assert told == {None, 5}


def test_classes_of_low_things_and_of_the_name_of_streets(tmp_path):
    heights = np.array(four_houses().heights)
    heights[52:60, 4:60] = 0.4  # a lawn
    city = evocity.CityMap(heights, 1.0)
    made = evocity.scene(city, classes=ClassTable.of(TWO_CLASSES), streets=True)
    made.write(tmp_path / "x.city.json")
    objects = json.loads((tmp_path / "x.city.json").read_text())["CityObjects"]
    kinds = [one["type"] for one in objects.values()]
    assert kinds.count("Building") == 4
    assert kinds.count("OtherConstruction") == 1
    assert "Road" in kinds
    houses = [one["attributes"] for one in objects.values() if one["type"] == "Building"]
    assert all({"id", "storeysAboveGround", "area"} <= set(one) for one in houses)
    (lawn,) = [one["attributes"] for one in objects.values() if one["type"] == "OtherConstruction"]
    assert "id" not in lawn


def test_the_ground_of_a_part_is_its_pixels():
    rows, columns = np.indices((64, 64))
    city = evocity.CityMap(four_houses().heights, 1.0, site=np.hypot(rows - 32, columns - 32) < 30)
    ground = evocity.scene(city).groups[0]
    assert shapely.area(ground.polygons).sum() == pytest.approx(city.site.sum())


def test_paths_serve_for_tables_and_libraries(tmp_path):
    (tmp_path / "own.toml").write_text(TWO_CLASSES)
    Library.of(four_houses(), licence="CC0-1.0").write(tmp_path / "objects")
    made = evocity.scene(four_houses(), classes=tmp_path / "own.toml")
    assert made.classes.names == ("street", "high")
    assert (
        evocity.scene(four_houses(), library=tmp_path / "objects").substitution.counts["fitted"]
        == 4
    )
    assert evocity.scene(four_houses(), measures={"gsi": np.float32(0.25)}).about.measures == {
        "gsi": 0.25
    }
    with pytest.raises(MapError, match="a scene cannot be made of 'lyon-1er'"):
        evocity.scene("lyon-1er")


@pytest.mark.parametrize(
    "how", [{"sun": 5}, {"sun": (1,)}, {"highest": 0}, {"highest": float("nan")}, {"highest": "a"}]
)
def test_pictures_that_cannot_be_are_refused(how):
    with pytest.raises(MapError, match=next(iter(how))):
        evocity.scene(four_houses()).picture(**how)


def test_a_library_refuses_what_comes_to_a_point_twice(tmp_path):
    shell = [(0, 0), (20, 0), (20, 12), (0, 12)]
    polygon = shapely.Polygon(shell, [[(10, 0), (14, 5), (6, 5)]])
    library = Library.of(four_houses(), licence="CC0-1.0")
    library.polygons[0] = polygon
    library.write(tmp_path / "objects")
    with pytest.raises(MapError, match="occurs twice"):
        Library.read(tmp_path / "objects")


def test_numbers_without_end_and_depth_without_end_are_no_tables(tmp_path):
    long = TWO_CLASSES.replace("below = 6", "below = 1" + "0" * 400)
    with pytest.raises(MapError, match="numbers, 0 or more"):
        ClassTable.of(long)
    with pytest.raises(MapError, match="more than 32 dotted parts"):
        ClassTable.of("x = " + "[" * 5000)
