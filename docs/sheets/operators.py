"""Draws operators/NAME.png of every operator: a child of each of three pairs, or of three parents.

Run it with the Python that has evocity installed: python docs/sheets/operators.py [NAME]...
"""

import sys

import numpy as np
from _sheet import IMAGES, contact_sheet, save

import evocity
from evocity.fitness import fabric_distance
from evocity.fitness.heredity import integrity_of
from evocity.operators import OPERATORS, make
from evocity.pictures.picture import render

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
PAIRS = ((LYON, MONTPELLIER), (NEW_YORK, MONTPELLIER), (LYON, NEW_YORK))
ALONE = ((LYON,), (NEW_YORK,), (MONTPELLIER,))
#: Operators of one parent or more that show their effect with two, and their parameters.
WITH_SOURCES = {"plan_fusion": {"faces": None}, "plan_change": {"changes": 8}}


def main(names: list[str]) -> None:
    cities = {name: evocity.read_map(name) for pair in PAIRS for name in pair}
    codes = {name: evocity.encode(city).genome for name, city in cities.items()}
    thanks = [
        "Each map is 512 m wide. Heights from 0 m, pale, to 40 m and more, dark. "
        "whole: share in whole buildings; distance: fabric distance.",
        "Maps: " + "; ".join(dict.fromkeys(city.attribution for city in cities.values())),
    ]
    (IMAGES / "operators").mkdir(exist_ok=True)
    for name in names or sorted(OPERATORS):
        operator, row = make(name, **WITH_SOURCES.get(name, {})), []
        several = operator.parents[0] > 1 or name in WITH_SOURCES
        for pair in PAIRS if several else ALONE:
            parents = [codes[one] for one in pair]
            child = operator(parents, np.random.default_rng(1))
            city = evocity.decode(child).city
            whole = integrity_of(child, list(cities.values()))
            far = float(fabric_distance(city, [cities[one] for one in pair]))
            bred = " × ".join(short(one) for one in pair)
            told = f"{bred}: whole {whole:.2f}, distance {far:.2f}"
            row.append((told, render(city, highest=40, legend=False).resize((300, 300))))
        save(contact_sheet([row], thanks=thanks, text=13), f"operators/{name}.png", colours=32)


def short(name: str) -> str:
    return {LYON: "Lyon", MONTPELLIER: "Montpellier", NEW_YORK: "New York"}[name]


if __name__ == "__main__":
    main(sys.argv[1:])
