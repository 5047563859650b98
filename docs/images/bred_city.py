"""Draws bred-city.png: two real districts and a child of theirs, on one scale of heights; and
bred-city-3d.png: the child in three dimensions.

Run it with the Python that has evocity installed: python docs/images/bred_city.py
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import evocity
from evocity.operators import make
from evocity.pictures.colours import FAINT, INK, PAPER, ramp
from evocity.pictures.picture import render

PARENTS = ("new-york-west-village", "lyon-1er")
SEED = 3
FONT = Path(evocity.__file__).parent / "data" / "fonts" / "roboto-regular.ttf"
HIGHEST, SIDE, GAP, MARGIN = 30.0, 512, 28, 36


def bred() -> tuple[list[evocity.CityMap], evocity.CityMap]:
    """The parents as read, and their child as decoded."""
    parents = [evocity.read_map(name) for name in PARENTS]
    genomes = [evocity.encode(parent, settle="roofs").genome for parent in parents]
    fuse = make("plan_fusion", faces=None)
    return parents, evocity.decode(fuse(genomes, np.random.default_rng(SEED))).city


def draw(parents: list[evocity.CityMap], child: evocity.CityMap) -> Image.Image:
    cities = [parents[0], child, parents[1]]
    titles = [parents[0].name, "the streets of one, with buildings of the other", parents[1].name]
    width = 2 * MARGIN + 3 * SIDE + 2 * GAP
    thanks = [f"{parent.name}: {parent.attribution}" for parent in parents]
    foot = MARGIN + 40 + SIDE + 24
    sheet = Image.new("RGB", (width, foot + max(70, 28 * len(thanks)) + MARGIN), PAPER)
    brush = ImageDraw.Draw(sheet)
    for index, (city, title) in enumerate(zip(cities, titles, strict=True)):
        left = MARGIN + index * (SIDE + GAP)
        brush.text((left, MARGIN), title, INK, font(24), "lt")
        picture = render(city, highest=HIGHEST, legend=False, zoom=SIDE // city.shape[1])
        sheet.paste(picture, (left, MARGIN + 40))
    bar = np.linspace(0, HIGHEST, 360, dtype=np.float32)[None].repeat(16, axis=0)
    sheet.paste(Image.fromarray(ramp(bar, HIGHEST)), (MARGIN, foot))
    for metres in (0, 10, 20, 30):
        text = f"{metres} m" if metres == HIGHEST else f"{metres}"
        brush.text((MARGIN + metres * 12, foot + 24), text, FAINT, font(18), "mt")
    for number, line in enumerate(thanks):
        place = (width - MARGIN, foot + 28 * number)
        brush.text(place, line, FAINT, font(20), "rt")
    return sheet


def font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(FONT, size)


if __name__ == "__main__":
    parents, child = bred()
    pictures = {
        "bred-city.png": draw(parents, child),
        "bred-city-3d.png": evocity.scene(child, squared=True).picture(width=1200),
    }
    for name, picture in pictures.items():
        target = Path(__file__).with_name(name)
        picture.quantize(96, dither=Image.Dither.NONE).save(target, optimize=True)
        print(f"wrote {target}, {target.stat().st_size // 1024} KB")
