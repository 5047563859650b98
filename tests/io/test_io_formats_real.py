"""Real files of each new format, as the README beside them says; skipped without these files."""

from pathlib import Path

import pytest

from evocity.errors import MapError
from evocity.io import read_map

MORE = Path(__file__).parents[2].parent / "shared" / "data" / "more"

pytestmark = pytest.mark.skipif(not MORE.is_dir(), reason="the real files are not here")


@pytest.mark.parametrize(
    ("name", "built", "highest", "rules", "options"),
    [
        ("original-berlin-lod2.gml", 0.13, 34.9, {"solid": 61}, {}),
        ("original-potsdam-lod1.gml", 0.13, 20.0, {"solid": 88}, {}),
        (
            "original-overture-ochtendung.parquet",
            0.04,
            6.0,
            {"height": 39, "default": 61},
            {},
        ),
        ("st-petersburg.parquet", 0.04, None, None, {"center": (30.25038, 59.943086)}),
        ("original-zurich-epsg3857.fgb", 0.21, None, None, {"center": (8.522075, 47.384342)}),
        ("boulder-table-mesa-shapefile.zip", 0.14, 6.0, {"default": 171}, {}),
        ("original-kml-samples.kml", 0.09, 25.0, {"solid": 4}, {"layer": "Google Campus"}),
    ],
)
def test_real_files(name, built, highest, rules, options):
    city = read_map(MORE / name, **options)
    assert city.built.mean() == pytest.approx(built, abs=0.01)
    assert highest is None or city.heights.max() == pytest.approx(highest, abs=0.06)
    assert rules is None or city.height_rules == rules


def test_folders_of_a_kml_file_are_listed():
    with pytest.raises(MapError, match="3 layers") as fault:
        read_map(MORE / "original-kml-samples.kml")
    assert "Google Campus" in str(fault.value)
