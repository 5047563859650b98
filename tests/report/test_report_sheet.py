"""Contact sheets: what stands where."""

import numpy as np
from PIL import Image

from evocity import CityMap
from evocity.pictures import render
from evocity.pictures.sheet import columns_for, sheet_of


def test_maps_stand_in_rows_on_one_scale_of_whole_pixels():
    rng = np.random.default_rng(3)
    cities = [CityMap(rng.choice([0.0, 9.0, 30.0], (64, 64)), 4.0) for _ in range(3)]
    cells = [(city, [f"individual {n}", "gsi 0.5"]) for n, city in enumerate(cities)]
    sheet = sheet_of([cells[0], None, *cells[1:]], "a run", 40.0, "someone " * 90, columns=2)
    side = 64 * 4  # the least whole multiple of 200 px and more
    for city, (column, row) in zip(cities, [(0, 0), (0, 1), (1, 1)], strict=True):
        left, top = 20 + column * (side + 20), 64 + row * (side + 20 + 2 * 17)
        drawn = sheet.crop((left, top, left + side, top + side))
        bare = render(city, highest=40.0, legend=False)
        assert drawn.tobytes() == bare.resize((side, side), Image.Resampling.NEAREST).tobytes()
    beside = sheet.crop((20 + side + 20, 64, sheet.width, 64 + side))  # the empty place
    assert len(beside.getcolors()) == 1
    short = sheet_of([cells[0], None, *cells[1:]], "a run", 40.0, "someone", columns=2)
    assert sheet.height > short.height  # a long attribution is told whole


def test_sheets_are_no_strips():
    assert [columns_for(n) for n in (0, 1, 3, 4, 5, 16, 17, 100)] == [1, 1, 3, 4, 4, 4, 5, 10]
