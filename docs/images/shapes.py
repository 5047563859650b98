"""Draws the pictures of docs/shapes.md: known shapes, words that are left out, tops, a
metamorphosis, and a street that takes the details of the edge of a city.

Run it with the Python that has evocity installed: python docs/images/shapes.py
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import evocity
from evocity.pictures.picture import FAINT, INK, PAPER
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

HERE = Path(__file__).parent
FONT = Path(evocity.__file__).parent / "data" / "fonts" / "roboto-regular.ttf"
SIDE, GAP, HEAD = 240, 16, 30
CITY, DEPTH = "lyon-1er", 8
QUARTERS = [[[0.5, 0, x], [0, 0.5, y]] for x in (0, 0.5) for y in (0, 0.5)]


def sheet(panels: Sequence[tuple[str, Image.Image]], foot: str = "") -> Image.Image:
    """Panels side by side, each below its title."""
    width = len(panels) * (SIDE + GAP) + GAP
    found = Image.new("RGB", (width, HEAD + SIDE + GAP + 24 * bool(foot)), PAPER)
    brush = ImageDraw.Draw(found)
    for place, (title, picture) in enumerate(panels):
        left = GAP + place * (SIDE + GAP)
        brush.text((left, 8), title, INK, ImageFont.truetype(FONT, 15))
        found.paste(picture.convert("RGB").resize((SIDE, SIDE)), (left, HEAD))
    if foot:
        brush.text((GAP, HEAD + SIDE + 12), foot, FAINT, ImageFont.truetype(FONT, 13))
    return found


def drawn(shape: Shape, **more) -> Image.Image:
    return picture_of(shape, side=2 * SIDE, **more)


def words() -> Image.Image:
    shape = Shape(QUARTERS, "square", Language.without(4, (3, 3)))
    panels = [(f"no 3 after 3, {n} maps deep", drawn(shape, depth=n)) for n in (2, 4, 8)]
    turned = [[[0.6, -0.25, 0.25], [0.25, 0.6, 0]], [[0.6, 0.25, 0.15], [-0.25, 0.6, 0.25]]]
    colours = [[0.75, 0.25, 0.2], [0.15, 0.3, 0.55]]
    panels += [
        (f"tops, mix = {mix}", drawn(Shape(turned, colours=colours, mix=mix))) for mix in (0.9, 0.4)
    ]
    return sheet(panels)


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
    pictures = [(title, line_picture(lines, side=2 * SIDE)) for title, lines in panels]
    return sheet(pictures, f"{city.name}: {city.attribution}")


def main() -> None:
    names = ("sierpinski", "koch", "dragon", "levy", "carpet", "fern")
    sheet([(name, drawn(known(name))) for name in names]).save(HERE / "shapes-known.png")
    words().save(HERE / "shapes-words.png")
    between = metamorphosis(known("koch"), known("levy"))
    box = np.array([[-0.6, -0.75], [1.6, 1.45]])
    at = np.linspace(0, 1, 5)
    sheet([(f"t = {t:g}", drawn(between(t), box=box)) for t in at]).save(HERE / "shapes-morph.png")
    details().save(HERE / "shapes-details.png")


if __name__ == "__main__":
    main()
