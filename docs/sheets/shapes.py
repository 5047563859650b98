"""Draws the pictures of docs/shapes.md: known shapes, forms and ranges, words that are left out,
tops, colours from elsewhere, a metamorphosis, and the details of the edge of a city, which a street
takes, and which are made smaller and larger.

Run it with the Python that has evocity installed: python docs/sheets/shapes.py
"""

import warnings

import numpy as np
from _sheet import contact_sheet, save
from PIL import Image

import evocity
from evocity.pictures.picture import render
from evocity.scene import fabric_edges, street_axes
from evocity.shapes import (
    Language,
    Primitive,
    Shape,
    coloured_as,
    fit_curve,
    known,
    line_picture,
    metamorphosis,
    palette_of,
    picture_of,
    stolen,
)

SIDE = 240
CITY, DEPTH = "lyon-1er", 8
QUARTERS = [[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)]


def small(picture: Image.Image) -> Image.Image:
    return picture.convert("RGB").resize((SIDE, SIDE))


def drawn(shape: Shape, **more) -> Image.Image:
    return small(picture_of(shape, side=2 * SIDE, **more))


def reeds() -> Shape:
    """A range with a motif: blades that repeat, smaller, towards a horizon."""
    blade = Primitive.of(
        [(-0.05, 0), (0.05, 0), (0.1, 0.5), (0.0, 0.5), (0.3, 1.0)], (),
        [(0, 1, 2), (0, 2, 3), (3, 2, 4)],
    )  # fmt: skip
    maps = [[[0.7, 0, x], [0, 0.7, y]] for x, y in ((-0.3, 0.3), (0.3, 0.25), (0.02, 0.0))]
    return Shape(maps, blade, None, [(0.16, 0.36, 0.22), (0.33, 0.52, 0.24), (0.66, 0.7, 0.35)])


def branches() -> Shape:
    maps = []
    for turn, size, up in ((0.55, 0.62, 0.55), (-0.5, 0.66, 0.5), (0.05, 0.6, 0.9)):
        cosine, sine = size * np.cos(turn), size * np.sin(turn)
        maps.append([[cosine, -sine, 0], [sine, cosine, up]])
    at = np.linspace(0, 2 * np.pi, 25)[:-1]
    return Shape(maps, Primitive.polygon(np.column_stack([0.3 * np.cos(at), 0.3 * np.sin(at)])))


def spread() -> Shape:
    """Sixteen maps that overlap and turn: the forms that a palette's colours are carried to."""
    maps = []
    for i in range(4):
        for j in range(4):
            turn, size = 0.5 * (i - 1.5), 0.36
            c, s = size * np.cos(turn), size * np.sin(turn)
            maps.append([[c, -s, i / 4 + 0.1 * s], [s, c, j / 4 - 0.1 * s]])
    return Shape(np.array(maps), "square")


def forms() -> Image.Image:
    levels = (0, 1, 3, 5)
    every = np.vstack([branches().pieces(n).points.reshape(-1, 2) for n in levels])
    box = np.stack([every.min(axis=0), every.max(axis=0)])
    panels = [
        (f"a form that branches, n = {n}", drawn(branches(), depth=n, box=box)) for n in levels
    ]
    return contact_sheet([[*panels, ("a motif repeated, n = 3", drawn(reeds(), depth=3))]])


def colours() -> Image.Image:
    city = evocity.read_map(CITY)
    lyon = render(city, highest=30, legend=False)
    sixteen = palette_of(lyon, 4)
    panels = [
        ("a map", small(lyon)),
        ("a palette of 16 of its colours", drawn(sixteen)),
        ("its colours in other forms", drawn(coloured_as(spread(), sixteen))),
        ("a fern's, stolen there", small(stolen(known("fern"), Shape(QUARTERS), lyon, 2 * SIDE))),
    ]
    return contact_sheet([panels], thanks=[f"{city.name}: {city.attribution}"])


def gains() -> Image.Image:
    city = evocity.read_map("montpellier-pas-du-loup")
    one = fit_curve(fabric_edges(city)[0], depth=DEPTH)
    finer = range(3, DEPTH)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one of them crosses itself
        lines = [
            (f"details × {gain:g}", one.amplified(gain, finer).line()) for gain in (0, 0.5, 1, 2)
        ]
    pictures = [(title, small(line_picture([line], side=2 * SIDE))) for title, line in lines]
    return contact_sheet([pictures], thanks=[f"{city.name}: {city.attribution}"])


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
    save(forms(), "shapes-forms.png")
    save(colours(), "shapes-colours.png", colours=128)
    save(gains(), "shapes-gains.png")


if __name__ == "__main__":
    main()
