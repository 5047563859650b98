"""Files of scenes in Blender: objects, names, materials, properties, normals."""

import functools
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import shapely

import evocity
import evocity.scene
from evocity.formats.materials import names_of

BLENDER = shutil.which("blender")
SCRIPT = Path(__file__).parent / "blender_objects.py"

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(BLENDER is None, reason="Blender is not installed"),
]


def opened(path: Path) -> dict[str, dict]:
    """The objects that Blender makes of a file, by name."""
    words = (BLENDER, "-b", "--python-exit-code", "1", "-P", SCRIPT, "--", path)
    told = subprocess.run(words, capture_output=True, text=True, check=True, timeout=240)
    (line,) = (one for one in told.stdout.splitlines() if one.startswith("OBJECTS "))
    return json.loads(line.removeprefix("OBJECTS "))


@functools.cache
def scene() -> evocity.scene.Scene:
    return evocity.scene(evocity.read_map("lyon-1er"), streets=True)


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".wrl", ".x3d"])
def test_each_building_is_an_object_of_blender(tmp_path, suffix):
    path = tmp_path / f"lyon{suffix}"
    scene().write(path)
    found = opened(path)
    (group,) = (one for one in scene().groups if one.name == "building")
    ending = "_IndexedFaceSet" if suffix in (".wrl", ".x3d") else ""
    wanted = [name + ending for name in names_of(group)]
    assert {name for name in found if name.startswith("building-")} == set(wanted)
    own = [found[name] for name in wanted]
    assert [one["top"] for one in own] == pytest.approx(group.heights, abs=2e-3)
    assert max(one["top"] for one in found.values()) == pytest.approx(
        max(one.heights.max() for one in scene().groups), abs=2e-3
    )
    # turned outwards, so volumes are above 0
    volumes = shapely.area(group.polygons) * group.heights
    assert [one["volume"] for one in own] == pytest.approx(volumes, rel=0.01, abs=1)
    flat = suffix in (".wrl", ".x3d")
    materials = ["wall-material"] if flat else ["wall", "roof"]
    assert all(one["materials"] == materials for one in own)
    if suffix == ".glb":
        assert all(one["textured"] for one in own)
        ids = group.attributes["id"]
        assert [one["properties"]["id"] for one in own] == ids
        assert all({"class", "height", "storeys"} <= set(one["properties"]) for one in own)


def test_blender_opens_a_merged_scene(tmp_path):
    path = tmp_path / "lyon.glb"
    scene().write(path, merge=True)
    found = opened(path)
    (group,) = (one for one in scene().groups if one.name == "building")
    assert found["building"]["volume"] == pytest.approx(group.volume, rel=1e-3)
    assert not [name for name in found if name.startswith("building-")]
    trees = [one for name, one in found.items() if name.startswith("tree")]
    assert np.isclose([one["volume"] > 0 for one in trees], True).all()


def test_the_highest_object_is_the_highest_roof(tmp_path):
    roofed = evocity.scene(evocity.read_map("lyon-1er"), roofs=True)
    roofed.write(tmp_path / "lyon.glb")
    found = opened(tmp_path / "lyon.glb")
    (group,) = (one for one in roofed.groups if one.name == "building")
    tops = np.zeros(len(group))
    corners = group.mesh.points[group.mesh.triangles][:, :, 2].max(axis=1)
    np.maximum.at(tops, group.mesh.owner, corners)
    own = [found[name] for name in names_of(group)]
    assert [one["top"] for one in own] == pytest.approx(tops, abs=2e-3)
    assert max(one["top"] for one in found.values()) == pytest.approx(tops.max(), abs=2e-3)
    assert all(one["volume"] > 0 for one in own)
    assert (tmp_path / "lyon.glb").stat().st_size <= 8000 * len(roofed.walls)
