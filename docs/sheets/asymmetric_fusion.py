"""Draws asymmetric-fusion.png: two synthetic towns, each in the stones of the other.

Run it with the Python that has evocity installed: python docs/sheets/asymmetric_fusion.py
"""

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.operators import AsymmetricFusion
from evocity.pictures.picture import render
from evocity.towns.patterns import chessboard_town, concentric_town

PIXELS, METRES_PER_PIXEL, HIGHEST = 256, 1.0, 24.0


def main() -> None:
    towns = [draw(PIXELS, METRES_PER_PIXEL) for draw in (concentric_town, chessboard_town)]
    rows = [[(f"{number}: {town.name}", drawn(town)) for number, town in enumerate(towns, 1)]]
    titles = [f"Two synthetic towns, {PIXELS} px of {METRES_PER_PIXEL:g} m"]
    for block in (4, 8):
        parents = [evocity.encode(town, block=block).genome for town in towns]
        row = []
        for repair, told in ((0.5, ""), (None, ", repair none")):
            fuse = AsymmetricFusion(repair=repair)
            for name, order in (("1 mod 2", parents), ("2 mod 1", parents[::-1])):
                child = fuse(order, np.random.default_rng(0))
                row.append((name + told, drawn(evocity.decode(child).city)))
        rows.append(row)
        titles.append(f"Range blocks of {block} px, domain blocks of {2 * block}")
    save(contact_sheet(rows, titles=titles), "asymmetric-fusion.png", colours=64)


def drawn(city):
    return render(city, highest=HIGHEST, legend=False)


if __name__ == "__main__":
    main()
