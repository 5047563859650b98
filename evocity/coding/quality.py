"""How close a decoded map is to its original."""

import numpy as np

from evocity.citymap import CityMap, same_grid


def psnr(original: CityMap, decoded: CityMap) -> float:
    """Peak signal-to-noise ratio, dB: 10 log₁₀(peak² / mean squared difference).

    The peak is the original's highest roof. ``inf`` for equal maps, and for differing ones
    ``-inf`` if the original is all ground. Raises `MapError` for maps of different grids.
    """
    same_grid([original, decoded])
    difference = original.heights.astype(np.float64) - decoded.heights
    error = np.mean(difference**2)
    peak = float(original.heights.max())
    if error == 0:
        return float("inf")
    return float(10 * np.log10(peak**2 / error)) if peak > 0 else float("-inf")
