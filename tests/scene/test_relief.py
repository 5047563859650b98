"""Buildings on a relief: rigid solids whose floors lie at the lowest ground, on triangles."""

import json

import numpy as np
import pytest
from towns import draw_town

import evocity
from evocity.errors import MapError
from evocity.scene import write_on_relief
from evocity.shapes import DetailedSurface, StoredSurface, polynomial_maps

TOWN = evocity.CityMap(draw_town(3, side=48).heights, 2.0)


def relief(tilt=0.2, crs=None, spacing=2.0):
    maps = polynomial_maps(4, 2)
    heights = 100 + tilt * np.add.outer(np.arange(49.0), np.arange(49.0))
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
    ground = high["CityObjects"]["ground"]
    assert ground["type"] == "TINRelief"
    assert ground["geometry"][0]["type"] == "CompositeSurface"
    at = points_of(high, "ground")
    np.testing.assert_allclose(
        at[:, 2], 100 + tilt * (at[:, 0] / 2 + (96 - at[:, 1]) / 2), atol=2e-3
    )
    assert not any(one["type"] == "LandUse" for one in high["CityObjects"].values())


def test_reliefs_at_fault_are_refused(tmp_path):
    scene, path = evocity.scene(TOWN), tmp_path / "a.city.json"
    with pytest.raises(MapError, match="does not cover"):
        write_on_relief(scene, relief(spacing=1.0), path)
    with pytest.raises(MapError, match=r"city\.json"):
        write_on_relief(scene, relief(), tmp_path / "a.glb")
    with pytest.raises(MapError, match="streets"):
        write_on_relief(evocity.scene(TOWN, streets=True), relief(), path)
    placed = evocity.CityMap(TOWN.heights, 2.0, crs="EPSG:32631", origin=(640_000, 5_070_000))
    with pytest.raises(MapError, match="EPSG:2154"):
        write_on_relief(evocity.scene(placed), relief(crs="EPSG:2154"), path)
    assert not list(tmp_path.iterdir())
