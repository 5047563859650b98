"""Draws levels.png: two districts at four levels of detail.

Run it with the Python that has evocity installed: python docs/sheets/levels.py
"""

from _sheet import contact_sheet, save

import evocity

SIDE = 400
LEVELS = ("1.3", "1.2", "1.0", "afar")


def main() -> None:
    cities = [evocity.read_map(name) for name in ("lyon-1er", "new-york-west-village")]
    rows = [[shown(city, level) for level in LEVELS] for city in cities]
    thanks = list(dict.fromkeys(city.attribution for city in cities))
    save(contact_sheet(rows, thanks=thanks, text=14), "levels.png")


def shown(city, level: str):
    scene = evocity.scene(city, lod=level)
    title = f"{city.name}, LoD {level}" if level != "afar" else f"{city.name}, afar"
    picture = scene.picture(width=SIDE, azimuth=25, tilt=48, legend=False)
    return f"{title}: {scene.triangle_count} triangles", picture


if __name__ == "__main__":
    main()
