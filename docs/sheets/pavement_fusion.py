"""Draws pavement-fusion.png: what the sizes of macro-blocks and the tolerance S do to a child.

Run it with the Python that has evocity installed: python docs/sheets/pavement_fusion.py
"""

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.fitness.heredity import integrity_of
from evocity.operators import make
from evocity.pictures.picture import render

PARENTS = ("new-york-west-village", "montpellier-pas-du-loup")
#: Sides of the macro-blocks, metres.
SIZES = ((8, 32), (32, 128), (96, 256))
TOLERANCES = (2.0, 6.0, 20.0)


def main() -> None:
    cities = [evocity.read_map(name) for name in PARENTS]
    parents = [evocity.encode(city).genome for city in cities]
    rows = [[(f"parent: {city.name}", drawn(city)) for city in cities]]
    titles = ["Parents"]
    for side_min, side_max in SIZES:
        row = []
        for tolerance in TOLERANCES:
            fuse = make(
                "pavement_fusion",
                side_min=side_min,
                side_max=side_max,
                tolerance=tolerance,
                fill=0.5,
            )
            child = fuse(parents, np.random.default_rng(5))
            reached, whole = child.made["fill_reached"][1], integrity_of(child, cities)
            row.append(
                (
                    f"S = {tolerance:g} m: fill {reached:.2f}, whole buildings {whole:.2f}",
                    drawn(evocity.decode(child).city),
                )
            )
        rows.append(row)
        titles.append(f"Macro-blocks of {side_min} to {side_max} m, fill .5 wanted")
    thanks = [f"{city.name}: {city.attribution}" for city in cities]
    save(contact_sheet(rows, titles=titles, thanks=thanks), "pavement-fusion.png", colours=48)


def drawn(city):
    return render(city, highest=30, legend=False).resize((360, 360))


if __name__ == "__main__":
    main()
