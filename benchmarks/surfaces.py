"""Ground as a surface, against a spline: python benchmarks/surfaces.py DTM.tif … [--points N …]

For each raster, number of control points and depth: the numbers of the surface without its three
finest levels (heights of the level, and maps), its error, the error of the least-squares cubic
B-spline of at most as many coefficients, and the share of the two errors. The last column is the
processor time of the fit.
"""

import argparse
import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import time

import numpy as np
from _machine import description
from scipy.interpolate import make_lsq_spline

from evocity.io.ground_rasters import read_ground
from evocity.shapes import fit_surface, surface_rms

DROPPED, LEAST, MOST = 3, 90, 400


def spline_rms(heights: np.ndarray, numbers: int) -> float:
    near, rows = heights, int(np.sqrt(numbers))
    for count in (rows, numbers // rows):
        at = np.arange(len(near))
        inner = np.linspace(0, len(near) - 1, count - 2)
        knots = np.r_[[0] * 3, inner, [len(near) - 1] * 3]
        near = make_lsq_spline(at, near, knots, 3)(at).T
    return float(np.sqrt(((near - heights) ** 2).mean()))


def main(paths: list[str], points: list[int]) -> None:
    print(description())
    print(f"{'ground':28}{'points':>7}{'heights':>9}{'numbers':>9}{'RMS, m':>9}{'spline':>9}"
          f"{'share':>7}{'s':>7}")  # fmt: skip
    for path in paths:
        raster = read_ground(path)
        for count in points:
            for depth in range(4, 9):
                if not LEAST <= (side := (count - 1) * 2**depth + 1) <= MOST:
                    continue
                start = time.process_time()
                found = fit_surface(raster.heights, count, depth=depth, spacing=raster.spacing)
                taken = time.process_time() - start
                numbers, rms = found.number_count(DROPPED), surface_rms(found, DROPPED)
                spline = spline_rms(found.heights(), numbers)
                print(
                    f"{os.path.basename(path):28}{count:7}{side:8}²{numbers:9}{rms:9.4f}"
                    f"{spline:9.4f}{rms / spline:7.3f}{taken:7.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", nargs="+", metavar="DTM")
    parser.add_argument("--points", type=int, nargs="+", default=[4, 5, 7])
    given = parser.parse_args()
    main(given.paths, given.points)
