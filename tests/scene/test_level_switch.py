"""Several zooms of one code in one VRML97 or X3D file, as levels of a node LOD."""

import re
import xml.etree.ElementTree as ET

import pytest
from codes import uniformly
from towns import draw_town

import evocity
from evocity.errors import MapError
from evocity.scene import write_levels

ZOOMS = (2, 1, 0.5)


@pytest.fixture(scope="module")
def scenes():
    genome = uniformly(draw_town(4, side=48, buildings=14)).genome
    return [evocity.scene(evocity.decode(genome, zoom=zoom).city) for zoom in ZOOMS]


def faces(text: str) -> int:
    """The faces of all solids: each ends with −1."""
    return len(re.findall(r"(?<![\d.])-1(?![\d.])", text))


def test_x3d_has_the_solids_of_each_zoom(tmp_path, scenes):
    path = tmp_path / "levels.x3d"
    ranges = write_levels(scenes, path)
    assert ranges == (72.0, 144.0)  # of 96 m
    document = ET.parse(path).getroot()
    assert document.get("profile") == "Immersive"  # Interchange has no LOD
    (switch,) = document.iter("LOD")
    assert [float(one) for one in switch.get("range").split()] == [72, 144]
    assert [float(one) for one in switch.get("center").split()] == [48, 0, -48]
    levels = list(switch)
    assert [level.tag for level in levels] == ["Transform"] * 3
    counts = []
    for level, scene in zip(levels, scenes, strict=True):
        alone = tmp_path / "alone.x3d"
        scene.write(alone)
        (whole,) = ET.parse(alone).getroot().iter("Transform")
        assert level.attrib == whole.attrib
        found, expected = (
            [(set_.get("coordIndex"), set_[0].get("point")) for set_ in one.iter("IndexedFaceSet")]
            for one in (level, whole)
        )
        assert found == expected
        counts.append(sum(faces(index) for index, _ in found))
    assert min(counts) > 0
    names = [one.get("DEF") for one in document.iter() if one.get("DEF")]
    assert len(names) == len(set(names))


def test_vrml97_has_the_solids_of_each_zoom(tmp_path, scenes):
    path = tmp_path / "levels.wrl"
    write_levels(scenes, path, ranges=[50, 400])
    text = path.read_text(encoding="utf-8")
    assert text.count("LOD {") == 1
    assert "LOD { center 48 0 -48 range [ 50 400 ] level [" in text
    assert text.count("{") == text.count("}")
    assert text.count("[") == text.count("]")
    levels = re.split(r"^Transform ", text, flags=re.M)[1:]
    assert len(levels) == 3
    for level, scene in zip(levels, scenes, strict=True):
        alone = tmp_path / "alone.wrl"
        scene.write(alone)
        found, expected = (
            re.findall(r"geometry (IndexedFaceSet.*)\}$", one, re.M)
            for one in (level, alone.read_text(encoding="utf-8"))
        )
        assert found == expected
    names = re.findall(r"DEF (\S+)", text)
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("which", "how", "says"),
    [
        (slice(1), {}, "two or more scenes"),
        (slice(3), {"ranges": [10]}, "2 rising distances"),
        (slice(3), {"ranges": [10, 5]}, "2 rising distances"),
        (slice(3), {"ranges": [0, 5]}, "2 rising distances"),
        (slice(3), {"ranges": [1, float("nan")]}, "2 rising distances"),
    ],
)
def test_levels_that_do_not_fit_are_refused(tmp_path, scenes, which, how, says):
    with pytest.raises(MapError, match=says):
        write_levels(scenes[which], tmp_path / "levels.wrl", **how)


def test_levels_of_other_formats_or_grounds_are_refused(tmp_path, scenes):
    with pytest.raises(MapError, match=r"\.wrl"):
        write_levels(scenes, tmp_path / "levels.glb")
    other = evocity.scene(draw_town(1, side=32))
    with pytest.raises(MapError, match="of one ground"):
        write_levels([scenes[0], other], tmp_path / "levels.wrl")
