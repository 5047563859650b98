"""Recognition of rasters that hold crowns of trees, not roofs."""

import numpy as np

from evocity.citymap import BUILT_ABOVE

# The largest side of a pixel, m, at which a roof has several pixels; the fewest inner pixels; the
# share of these that is rough in crowns of trees; rows at a time.
_COARSE, _FEW, _ROUGH, _ROWS = 3.0, 200, 0.8, 256


def describe_crowns(heights: np.ndarray, side: float) -> str:
    """Say if ``heights`` on pixels of ``side`` metres are rough like crowns of trees; "" otherwise.

    A pixel is rough if its height differs by more than a quarter of ``side`` from the mean of two
    opposite neighbours. Only pixels whose eight neighbours are built count. Of real towns at 1 to
    2.5 m, 8 to 44 % of these are rough; of the crowns in a park, 94 %.
    """
    if side > _COARSE or min(heights.shape) < 3:
        return ""
    inner = rough = 0
    for top in range(0, heights.shape[0] - 2, _ROWS):
        part = heights[top : top + _ROWS + 2]
        high = part > BUILT_ABOVE
        wide = high[:, :-2] & high[:, 1:-1] & high[:, 2:]
        inside = wide[:-2] & wide[1:-1] & wide[2:]
        twice = 2 * part[1:-1, 1:-1]
        across = np.abs(part[1:-1, :-2] + part[1:-1, 2:] - twice)
        along = np.abs(part[:-2, 1:-1] + part[2:, 1:-1] - twice)
        inner += int(inside.sum())
        rough += int((inside & (np.maximum(across, along) > side / 2)).sum())
    if inner < _FEW or rough <= _ROUGH * inner:
        return ""
    return (
        f"{100 * rough / inner:.0f} % of the built pixels are rough like crowns of trees, so the "
        "raster may hold no buildings"
    )
