"""Draws growth.png: fabric grown around three districts, each framed where it stands.

Run it with the Python that has evocity installed: python docs/sheets/growth.py
"""

import numpy as np
from _sheet import contact_sheet, save
from PIL import ImageDraw

import evocity
from evocity.growth import grow
from evocity.pictures.colours import INK
from evocity.pictures.picture import render

CITIES = ("lyon-1er", "new-york-west-village", "montpellier-pas-du-loup")
SIDE = 640


def main() -> None:
    row, thanks = [], []
    for name in CITIES:
        city = evocity.read_map(name)
        fabric = grow(evocity.encode(city).genome, SIDE, SIDE, np.random.default_rng(1))
        picture = render(fabric.city(), legend=False)
        top, left = fabric.place
        frame = (left, top, left + city.shape[1] - 1, top + city.shape[0] - 1)
        ImageDraw.Draw(picture).rectangle(frame, outline=INK)
        row.append((f"{name}, {SIDE} × {SIDE} px at {city.metres_per_pixel:g} m", picture))
        thanks.append(f"{name}: {city.attribution}")
    save(contact_sheet([row], thanks=thanks, text=20), "growth.png", colours=48)


if __name__ == "__main__":
    main()
