"""Draws asymmetric-fusion.png: two drawn and two real towns, each in the fabric of the other.

Run it with the Python that has evocity installed: python docs/sheets/asymmetric_fusion.py
"""

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.operators import AsymmetricFusion
from evocity.pictures.picture import render
from evocity.towns.patterns import chessboard_town, concentric_town

PIXELS, METRES_PER_PIXEL, HIGHEST = 256, 1.0, 24.0
REAL = ("lyon-1er", "new-york-west-village")


def main() -> None:
    drawn_towns = [draw(PIXELS, METRES_PER_PIXEL) for draw in (concentric_town, chessboard_town)]
    rows, titles = [], []
    for towns in (drawn_towns, [evocity.read_map(name) for name in REAL]):
        pixel = towns[0].metres_per_pixel
        rows.append([(f"{n}: {town.name}", drawn(town)) for n, town in enumerate(towns, 1)])
        titles.append(f"Two towns, {PIXELS} px of {pixel:g} m")
        for block in (4, 8):
            parents = [evocity.encode(town, block=block).genome for town in towns]
            row = []
            for how, text in (
                ({}, ""),
                ({"side": 0.0}, ", side 0"),
                ({"side": 0.0, "repair": None}, ", side 0, repair none"),
            ):
                orders = (("1 mod 2", parents), ("2 mod 1", parents[::-1]))
                for name, order in orders[: 1 if "repair" in how else 2]:
                    child = AsymmetricFusion(**how)(order, np.random.default_rng(0))
                    row.append((name + text, drawn(evocity.decode(child).city)))
            rows.append(row)
            titles.append(f"Range blocks of {block} px, domain blocks of {2 * block}")
    thanks = [f"{name}: {evocity.io.attribution_of(name)}" for name in REAL]
    sheet = contact_sheet(rows, titles=titles, thanks=thanks)
    save(sheet, "asymmetric-fusion.png", colours=64)


def drawn(city):
    return render(city, highest=HIGHEST, legend=False)


if __name__ == "__main__":
    main()
