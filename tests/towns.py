"""Small towns, drawn without files."""

import numpy as np

from evocity.citymap import CityMap


def draw_town(seed: int, side: int = 64, buildings: int = 40, pixel: float = 2.0) -> CityMap:
    """A town of random box-shaped buildings of a few storeys."""
    rng = np.random.default_rng(seed)
    heights = np.zeros((side, side), np.float32)
    for _ in range(buildings):
        y, x = rng.integers(0, side - 4, 2)
        tall, wide = rng.integers(3, 14, 2)
        heights[y : y + tall, x : x + wide] = 3 * rng.integers(1, 9)
    return CityMap(heights, pixel, name=f"town-{seed}", attribution=f"drawn by seed {seed}")
