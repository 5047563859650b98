"""Measured roofs as surfaces, and as planes: python benchmarks/roof_surfaces.py DSM.tif [DSM.tif …]

Each raster has heights of roofs, and beside it lies the raster of the ground, with "dem" for "dsm"
in its name. For windows of 17 × 17 m on roofs: RMS errors of the mean height, of a surface of 5 × 5
control heights with fitted maps, of the polynomial surface of as many heights, and of K planes.
Planes are found by alternating between fits and the choice of the nearest plane for each pixel.
"""

import os
import sys

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import scipy
from _machine import description

from evocity.io.ground_rasters import read_ground
from evocity.shapes import DetailedSurface, fit_surface, polynomial_maps, surface_rms

SIDE, PLANES, WINDOWS, STARTS = 17, 6, 25, 6


def rms(off: np.ndarray) -> float:
    return float(np.sqrt((off**2).mean()))


def planes_rms(heights: np.ndarray, rng: np.random.Generator) -> float:
    y, x = (at.ravel() for at in np.indices(heights.shape))
    design, z = np.column_stack([np.ones(z_size := heights.size), y, x]), heights.ravel()
    best = np.inf
    for _ in range(STARTS):
        places = np.column_stack([y, x, 3 * z])
        middles = places[rng.choice(z_size, PLANES)]
        label = ((places[:, None] - middles) ** 2).sum(axis=-1).argmin(axis=1)
        for _ in range(15):
            off = np.full((PLANES, z_size), np.inf)
            for k in range(PLANES):
                if np.count_nonzero(own := label == k) >= 3:
                    fitted = np.linalg.lstsq(design[own], z[own], rcond=None)[0]
                    off[k] = (design @ fitted - z) ** 2
            label = off.argmin(axis=0)
        best = min(best, float(np.sqrt(off.min(axis=0).mean())))
    return best


def main(paths: list[str]) -> None:
    print(description())
    maps, names = polynomial_maps(5, 2), ("mean", "surface", "polynomial", "planes")
    for path in paths:
        roofs, ground = (read_ground(p).heights for p in (path, path.replace("dsm", "dem")))
        deep, wide = np.minimum(roofs.shape, ground.shape)
        built = roofs[:deep, :wide] - ground[:deep, :wide] > 3
        half = SIDE // 2
        places = np.argwhere(scipy.ndimage.minimum_filter(built, SIDE, mode="constant"))
        rng, taken, rows = np.random.default_rng(1), np.empty((0, 2), int), []
        for place in rng.permutation(places):
            if len(rows) == WINDOWS:
                break
            if len(taken) and (np.abs(taken - place).max(axis=1) < SIDE).any():
                continue
            taken = np.vstack([taken, place])
            (y, x) = place
            own = roofs[y - half : y + half + 1, x - half : x + half + 1]
            fitted = fit_surface(own, points=5, depth=2, drawn=2, starts=1, rounds=8)
            plain = surface_rms(DetailedSurface.of(own, maps, maps, 2), 2)
            errors = surface_rms(fitted, 2), plain, planes_rms(own, rng)
            rows.append((rms(own - own.mean()), *errors))
        found = np.array(rows)
        middle = ", ".join(
            f"{n} {v:.3f} m" for n, v in zip(names, np.median(found, 0), strict=True)
        )
        better = np.count_nonzero(found[:, 3] < found[:, 1:3].min(axis=1))
        name = os.path.basename(path)
        print(f"{name}: {len(rows)} windows; medians: {middle}; planes are nearest "
              f"in {better}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
