"""What S, the tolerance along outlines, does to children of pavement fusion, as docs tell it."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import evocity

DOCS = Path(__file__).parents[2] / "docs"


def told() -> dict[float, list[float]]:
    """S → the numbers of its row: five of Lyon x Montpellier, five of New York x Montpellier."""
    text = (DOCS / "operators.md").read_text("utf-8").split("## What raising S does")[1]
    rows = re.findall(r"^\| (\d+) \| (.*) \|$", text, re.M)
    return {float(s): [float(cell) for cell in cells.split(" | ")] for s, cells in rows}


@pytest.fixture(scope="module")
def sheet():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS / "sheets"))
        yield runpy.run_path(str(DOCS / "sheets" / "tolerance.py"))


def test_a_cut_and_a_joined_building_are_counted_by_area(sheet):
    first, second = np.zeros((2, 8, 16))
    first[2:6, 2:8] = 9  # 24 px, 8 of them beyond the seam
    second[2:6, 6:12] = 9  # 24 px, all of them there
    first[7, 0:2] = 9  # whole: 2 px
    owner = np.zeros((8, 16), bool)
    owner[:, 6:] = True
    cities = [evocity.CityMap(heights, 2.0) for heights in (first, second)]
    child = evocity.CityMap(np.where(owner, second, first), 2.0)
    assert sheet["cut_share"](cities, owner) == 16 / (16 + 2 + 24)
    assert sheet["joined_share"](child, owner) == 40 / 42
    # in 4 of the 8 rows the first alone has 9 m west of the seam, and both have east of it
    length, step = sheet["seam_of"](owner, [city.heights for city in cities])
    assert (length, step) == (8, 4 * 9 / 16)


@pytest.mark.long
@pytest.mark.parametrize("pair", [0, 1])
def test_what_is_told_of_raising_s_is_true(sheet, pair):
    parents = [evocity.encode(evocity.read_map(name)).genome for name in sheet["PAIRS"][pair]]
    cut = []
    for tolerance, row in told().items():
        found = [
            sheet["bred"](parents, sheet["SIZES"][0], tolerance, seed)[0] for seed in sheet["SEEDS"]
        ]
        means = [
            np.mean([getattr(one, name) for one in found])
            for name in ("fill", "step", "cut", "joined", "child")
        ]
        np.testing.assert_allclose(means, row[5 * pair : 5 * pair + 5], atol=0.06, rtol=0.01)
        cut.append(means[2])
    assert list(told()) == list(sheet["TOLERANCES"])
    assert cut[0] < 0.05 < 0.3 < cut[3] <= cut[4] == cut[5]
