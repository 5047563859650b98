"""Small towns, drawn without files."""

import numpy as np

from evocity.citymap import CityMap

#: A table of two classes, of which one has the name of the streets.
TWO_CLASSES = """
[[class]]
name = "street"
height = { below = 6 }
[[class]]
name = "high"
[colours]
street = "#9bcb72"
high = "#8fa1b3"
"""


def draw_town(seed: int, side: int = 64, buildings: int = 40, pixel: float = 2.0) -> CityMap:
    """A town of random box-shaped buildings of a few storeys."""
    rng = np.random.default_rng(seed)
    heights = np.zeros((side, side), np.float32)
    for _ in range(buildings):
        y, x = rng.integers(0, side - 4, 2)
        tall, wide = rng.integers(3, 14, 2)
        heights[y : y + tall, x : x + wide] = 3 * rng.integers(1, 9)
    return CityMap(heights, pixel, name=f"town-{seed}", attribution=f"drawn by seed {seed}")


def four_houses(attribution: str = "© drawn", height: float = 9.0) -> CityMap:
    """Four houses that stand apart."""
    heights = np.zeros((64, 64))
    for top, left in ((8, 8), (8, 36), (36, 8), (36, 36)):
        heights[top : top + 12, left : left + 16] = height
    return CityMap(heights, 1.0, name="drawn", attribution=attribution)
