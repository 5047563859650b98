"""Draws the pictures of docs/shapes.md: known shapes, words that are left out, tops, a
metamorphosis, and a street that takes the details of the edge of a city.

Run it with the Python that has evocity installed: python docs/sheets/shapes.py
"""

import numpy as np
from _sheet import contact_sheet, save
from PIL import Image

import evocity
from evocity.scene import fabric_edges, street_axes
from evocity.shapes import (
    Language,
    Shape,
    fit_curve,
    known,
    line_picture,
    metamorphosis,
    picture_of,
)

SIDE = 240
CITY, DEPTH = "lyon-1er", 8
QUARTERS = [[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)]


def small(picture: Image.Image) -> Image.Image:
    return picture.convert("RGB").resize((SIDE, SIDE))


def drawn(shape: Shape, **more) -> Image.Image:
    return small(picture_of(shape, side=2 * SIDE, **more))


def words() -> Image.Image:
    shape = Shape(QUARTERS, "square", Language.without(4, (3, 3)))
    panels = [(f"no 3 after 3, {n} maps deep", drawn(shape, depth=n)) for n in (2, 4, 8)]
    turned = [[[0.6, -0.25, 0.25], [0.25, 0.6, 0]], [[0.6, 0.25, 0.15], [-0.25, 0.6, 0.25]]]
    colours = [[0.75, 0.25, 0.2], [0.15, 0.3, 0.55]]
    panels += [
        (f"tops, mix = {mix}", drawn(Shape(turned, colours=colours, mix=mix))) for mix in (0.9, 0.4)
    ]
    return contact_sheet([panels])


def details() -> Image.Image:
    city = evocity.read_map(CITY)
    edge, street = (max(lines, key=len) for lines in (fabric_edges(city), street_axes(city)))
    rough = fit_curve(edge, depth=DEPTH)
    smooth = fit_curve(street, depth=DEPTH).recoded(rough).dropped(DEPTH - 1)
    given = smooth.transferred(rough, levels=DEPTH - 2)
    panels = [
        ("the edge of a fabric", [rough.line()]),
        ("without its 3 finest levels", [rough.dropped(3).line(), rough.line()]),
        ("without its 5 finest levels", [rough.dropped(5).line(), rough.line()]),
        ("a street, of two levels", [smooth.line()]),
        ("with the edge's details", [given.line(), smooth.line()]),
    ]
    pictures = [(title, small(line_picture(lines, side=2 * SIDE))) for title, lines in panels]
    return contact_sheet([pictures], thanks=[f"{city.name}: {city.attribution}"])


def main() -> None:
    names = ("sierpinski", "koch", "dragon", "levy", "carpet", "fern")
    save(contact_sheet([[(name, drawn(known(name))) for name in names]]), "shapes-known.png")
    save(words(), "shapes-words.png")
    between = metamorphosis(known("koch"), known("levy"))
    box = np.array([[-0.6, -0.75], [1.6, 1.45]])
    steps = [(f"t = {t:g}", drawn(between(t), box=box)) for t in np.linspace(0, 1, 5)]
    save(contact_sheet([steps]), "shapes-morph.png")
    save(details(), "shapes-details.png")


if __name__ == "__main__":
    main()
