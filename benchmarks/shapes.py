"""Shapes drawn, against the chaos game: python benchmarks/shapes.py

Of each known shape of the plane: processor seconds to draw it at 512², the least of three; and how
far its picture and that of four million points of the chaos game are apart, px (Hausdorff).
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
from _machine import description, seconds
from scipy.spatial import cKDTree

from evocity.shapes import KNOWN, box_dimension, dimension_of, known, mask_of
from evocity.shapes.languages import ShapeError
from evocity.shapes.rendering import Frame

SIDE, POINTS = 512, 4_000_000


def apart(name: str) -> float:
    shape = known(name)
    frame = Frame.of(shape.box, SIDE)
    played = np.zeros((SIDE, SIDE), bool)
    played[tuple(frame.cells(shape.chaos(POINTS, np.random.default_rng(1))).T)] = True
    a, b = np.argwhere(played), np.argwhere(mask_of(shape, SIDE))
    return max(cKDTree(b).query(a)[0].max(), cKDTree(a).query(b)[0].max())


def main() -> None:
    print(description())
    print(f"{'':12}{'s':>8}{'px apart':>10}{'exact':>9}{'boxes':>9}")
    for name in KNOWN:
        try:
            exact = f"{dimension_of(known(name)):9.4f}"
        except ShapeError:
            exact = f"{'–':>9}"
        told = f"{box_dimension(known(name)).dimension:9.4f}"
        if known(name).size == 3:
            print(f"{name:12}{'':18}{exact}{told}", flush=True)
            continue
        drawn = seconds(lambda name=name: mask_of(known(name), SIDE))
        print(f"{name:12}{drawn:8.3f}{apart(name):10.2f}{exact}{told}", flush=True)


if __name__ == "__main__":
    main()
