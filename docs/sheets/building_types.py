"""Draws building-types.png: each building of three districts in the colour of its type.

Run it with the Python that has evocity installed: python docs/sheets/building_types.py
"""

import numpy as np
from _sheet import contact_sheet, save
from PIL import Image

import evocity
from evocity.fitness import building_types, types_of

COLOURS = {
    "detached": (232, 192, 60),
    "row": (222, 118, 56),
    "courtyard_block": (158, 56, 84),
    "slab": (64, 118, 186),
    "tower": (34, 38, 92),
    "hall": (92, 160, 92),
    "shed": (150, 150, 150),
}
SIDE = 512


def main() -> None:
    names = ("lyon-1er", "new-york-west-village", "montpellier-pas-du-loup")
    cities = [evocity.read_map(name) for name in names]
    row = [(city.name, coloured(city)) for city in cities]
    below = [told(city) for city in cities] + [key()]
    thanks = [*below, *dict.fromkeys(city.attribution for city in cities)]
    save(contact_sheet([row], thanks=thanks), "building-types.png")


def coloured(city) -> Image.Image:
    """The map, its buildings in the colours of their types, a darker rim about each."""
    labels = city.building_labels
    palette = np.array([(250, 250, 247), *(COLOURS[kind] for kind in types_of(city))], float)
    picture = palette[labels]
    rim = np.zeros(labels.shape, bool)
    rim[1:] |= labels[1:] != labels[:-1]
    rim[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    picture[rim & city.built] *= 0.75
    image = Image.fromarray(picture.astype(np.uint8))
    return image.resize((SIDE, SIDE), Image.Resampling.NEAREST)


def told(city) -> str:
    shares = sorted(building_types(city).items(), key=lambda one: -one[1])
    return f"{city.name}: " + ", ".join(
        f"{kind.replace('_', ' ')} {share:.0%}" for kind, share in shares if share >= 0.005
    )


def key() -> str:
    return (
        "Detached yellow, row orange, courtyard block dark red, slab blue, tower dark blue, "
        "hall green, shed grey"
    )


if __name__ == "__main__":
    main()
