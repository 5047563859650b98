"""Draws height-scaling.png: cities whose buildings, or street blocks, rise or fall by storeys.

Run it with the Python that has evocity installed: python docs/sheets/height_scaling.py
"""

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.fitness import fsi
from evocity.operators import make
from evocity.pictures.picture import render

NAMES = ("lyon-1er", "new-york-west-village", "montpellier-pas-du-loup")
KINDS = (
    ("quarters", make("height_scaling", share=0.3)),
    ("buildings", make("height_scaling", what="buildings", share=0.3)),
    ("quarters, factors 1 to 1.6", make("height_scaling", share=1.0, factors=(1.0, 1.6))),
)


def main() -> None:
    rows, titles, thanks = [], [], []
    for name in NAMES:
        city = evocity.read_map(name)
        code = evocity.encode(city).genome
        before = evocity.decode(code).city
        row = [(f"the code: FSI {float(fsi(before)):.2f}", drawn(before))]
        for told, scale in KINDS:
            child = scale([code], np.random.default_rng(1))
            after = evocity.decode(child).city
            found = f"{told}: {child.made['scaled']} changed, FSI {float(fsi(after)):.2f}"
            row.append((found, drawn(after)))
        rows.append(row)
        titles.append(name)
        thanks.append(f"{city.name}: {city.attribution}")
    save(contact_sheet(rows, titles=titles, thanks=thanks), "height-scaling.png", colours=64)


def drawn(city):
    return render(city, highest=40, legend=False).resize((400, 400))


if __name__ == "__main__":
    main()
