"""Draws quarter-fusion.png: streets of one city with the buildings of another, for four pairs.

Run it with the Python that has evocity installed: python docs/sheets/quarter_fusion.py
"""

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.fitness import fabric_distance
from evocity.fitness.heredity import integrity_of
from evocity.operators import make
from evocity.pictures.picture import render

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
PAIRS = ((LYON, NEW_YORK), (NEW_YORK, LYON), (NEW_YORK, MONTPELLIER), (MONTPELLIER, NEW_YORK))


def main() -> None:
    cities = {name: evocity.read_map(name) for pair in PAIRS for name in pair}
    codes = {name: evocity.encode(city).genome for name, city in cities.items()}
    fuse = make("quarter_fusion", fill=0.5)
    rows, titles = [], []
    for streets, buildings in PAIRS:
        row = [(f"streets: {streets}", drawn(cities[streets]))]
        for seed in range(2):
            child = fuse([codes[streets], codes[buildings]], np.random.default_rng(seed))
            city, both = evocity.decode(child).city, [cities[streets], cities[buildings]]
            reached, whole = child.made["fill_reached"][1], integrity_of(child, both)
            far = float(fabric_distance(city, both))
            told = f"fill {reached:.2f}, whole {whole:.2f}, fabric distance {far:.2f}"
            row.append((told, drawn(city)))
        rows.append([*row, (f"buildings: {buildings}", drawn(cities[buildings]))])
        titles.append(f"Streets of {streets}, buildings of {buildings}, fill .5 wanted")
    thanks = [f"{city.name}: {city.attribution}" for city in cities.values()]
    save(contact_sheet(rows, titles=titles, thanks=thanks), "quarter-fusion.png", colours=48)


def drawn(city):
    return render(city, highest=40, legend=False).resize((360, 360))


if __name__ == "__main__":
    main()
