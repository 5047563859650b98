"""Draws the ground of two cities as surfaces with details: without the finest levels, and each with
the details of the other.

Run it with the Python that has evocity installed:
python docs/sheets/surfaces.py ATHENS.tif GOTEBORG.tif
"""

import sys

import numpy as np
from _sheet import contact_sheet, save
from PIL import Image

from evocity.io.ground_rasters import read_ground
from evocity.shapes import DetailedSurface, fit_surface, surface_rms

SIDE, DROPPED = 240, 3


def shaded(ground: DetailedSurface) -> Image.Image:
    """Shade the ground by light from the north-west."""
    down, across = np.gradient(ground.heights(), *ground.spacing)
    down, across = 2 * down, 2 * across
    light = (0.6 * across + 0.6 * down + 0.8) / np.sqrt(1 + down**2 + across**2)
    grey = np.clip(40 + 215 * light / 1.2, 0, 255).astype(np.uint8)
    return Image.fromarray(grey).resize((SIDE, SIDE), Image.Resampling.BILINEAR).convert("RGB")


def main() -> None:
    grounds = []
    for path in sys.argv[1:3]:
        raster = read_ground(path)
        grounds.append(fit_surface(raster.heights, 4, depth=7, spacing=raster.spacing))
        error = surface_rms(grounds[-1], DROPPED)
        print(f"{path}: {grounds[-1].number_count(DROPPED)} numbers, {error:.4f} m off")
    rows = []
    for one, other in (grounds, grounds[::-1]):
        given = one.transferred(other.recoded(one), levels=5)
        rows.append([
            ("a ground", shaded(one)),
            ("without its 3 finest levels", shaded(one.dropped(DROPPED))),
            ("details doubled", shaded(one.amplified(2, range(2, 7)))),
            ("details of the other ground", shaded(given)),
        ])  # fmt: skip
    thanks = ["Athens: Hellenic Cadastre; raster of the solweig project. Göteborg: UMEP."]
    sheet = contact_sheet(rows, titles=("Athens", "Göteborg"), thanks=thanks)
    save(sheet, "shapes-surfaces.png", colours=48)


if __name__ == "__main__":
    main()
