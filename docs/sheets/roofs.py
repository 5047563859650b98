"""Draws roofs.png: pitched roofs on two districts and on a child of them.

Run it with the Python that has evocity installed: python docs/sheets/roofs.py
"""

import dataclasses
from collections import Counter

import numpy as np
import shapely
from _sheet import contact_sheet, save
from PIL import Image

import evocity
from evocity.genome import building_roofs
from evocity.operators import make
from evocity.pictures.colours import PAPER
from evocity.scene.picture import draw_scene

FORMS = {
    "flat": (168, 168, 168),
    "skillion": (232, 192, 60),
    "gabled": (222, 118, 56),
    "hipped": (158, 56, 84),
    "pyramidal": (64, 118, 186),
}
SIDE, SHOWN = 520, 190.0


def main() -> None:
    names = ("lyon-1er", "new-york-west-village")
    cities = [evocity.read_map(name) for name in names]
    parents = [evocity.encode(city).genome for city in cities]
    child = make("quarter_fusion")(parents, np.random.default_rng(3))
    scenes = [evocity.scene(city, roofs=True) for city in cities]
    bred = evocity.decode(child).city
    given = building_roofs(bred, child)
    scenes.append(evocity.scene(bred, roofs=True, given_roofs=given))
    titles = [*names, "a child of both"]
    near = [(title, part(scene)) for title, scene in zip(titles, scenes, strict=True)]
    above = [(shares(scene), plan(scene)) for scene in scenes]
    key = "From above: " + ", ".join(
        f"{form} {colour}"
        for form, colour in zip(
            FORMS, ("grey", "yellow", "orange", "dark red", "blue"), strict=True
        )
    )
    thanks = [key, *dict.fromkeys(city.attribution for city in cities)]
    save(contact_sheet([near, above], thanks=thanks, text=14), "roofs.png", 200)


def part(scene) -> Image.Image:
    """A square of the middle of a scene, from the south-west."""
    wide = scene.city.shape[1] * scene.city.metres_per_pixel
    low, high = (wide - SHOWN) / 2, (wide + SHOWN) / 2
    shown = []
    for group in scene.groups:
        if group.name == "ground":
            box = np.array([shapely.box(low, low, high, high)], object)
            shown.append(dataclasses.replace(group, polygons=box))
            continue
        middles = shapely.get_coordinates(shapely.centroid(group.polygons)).reshape(-1, 2)
        inside = ((middles > low) & (middles < high)).all(axis=1)
        shown.append(group.take(np.flatnonzero(inside)))
    picture = draw_scene(scene.city, shown, width=SIDE, azimuth=25, tilt=48, legend=False)
    return framed(picture)


def plan(scene) -> Image.Image:
    """A scene from above, each roof in the colour of its form."""
    shown = []
    for group in scene.groups:
        forms = np.array(group.attributes.get("roof", [None] * len(group)), object)
        for form in dict.fromkeys(forms.tolist()):
            own = group.take(np.flatnonzero(forms == form))
            colour = tuple(c / 255 for c in FORMS.get(form, (0, 0, 0)))
            shown.append(dataclasses.replace(own, colour=colour) if form else own)
    look = {"width": SIDE, "azimuth": 0, "tilt": 90, "shadows": False, "colours": "classes"}
    return framed(draw_scene(scene.city, shown, **look, legend=False))


def framed(picture: Image.Image) -> Image.Image:
    sheet = Image.new("RGB", (SIDE, SIDE), PAPER)
    sheet.paste(picture, (0, (SIDE - picture.height) // 2))
    return sheet


def shares(scene) -> str:
    forms = Counter(form for g in scene.groups for form in g.attributes.get("roof", []) if form)
    return ", ".join(f"{form} {forms[form] / forms.total():.0%}" for form in FORMS)


if __name__ == "__main__":
    main()
