"""Draws curved-roofs.png: vaults, sheds and saddles on the wide buildings of a district, and vaults
with the details of a ground.

Run it with the Python that has evocity installed: python docs/sheets/curved_roofs.py ATHENS.tif
"""

import sys

from _sheet import contact_sheet, save

import evocity
from evocity.io.ground_rasters import read_ground
from evocity.shapes import DetailedSurface, StoredSurface, fit_surface, surface_form

SIDE, GAIN = 620, 0.3


def main() -> None:
    city = evocity.read_map("villeurbanne-gratte-ciel", pixels=128)
    raster = read_ground(sys.argv[1])
    ground = fit_surface(raster.heights, 4, depth=4, starts=1, spacing=raster.spacing)
    vault = surface_form("vault")
    rough = vault.transferred(ground.recoded(vault), levels=3, gain=GAIN)
    forms: dict[str, DetailedSurface] = {
        "vaults": vault,
        "sheds": surface_form("shed"),
        "saddles": surface_form("saddle"),
        "vaults with the details of a ground": rough,
    }
    look = {"width": SIDE, "azimuth": 25, "tilt": 42, "colours": "classes", "legend": False}
    pictures = [
        (title, evocity.scene(city, roof_surface=StoredSurface(form)).picture(**look))
        for title, form in forms.items()
    ]
    thanks = [f"{city.attribution}. Ground: Hellenic Cadastre; raster of the solweig project."]
    save(
        contact_sheet([pictures[:2], pictures[2:]], thanks=thanks, text=14), "curved-roofs.png", 64
    )


if __name__ == "__main__":
    main()
