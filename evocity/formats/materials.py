"""The materials and the names of objects, for all formats.

A material has a name that programs can map to a material of their own. Objects of a class have the
class's colour. Buildings have two materials, for walls and for roofs.
"""

from collections.abc import Sequence
from typing import NamedTuple

from evocity.formats.solids import Group

#: Height of a storey where the objects of a group have no storeys, metres; also the side of a tile
#: of a wall's texture.
TILE = 3.0

#: The kinds of ground, which become one mesh for each group, and their types in CityJSON.
GROUND = {
    "ground": "LandUse",
    "street": "Road",
    "pavement": "Road",
    "square": "TransportSquare",
    "court": "LandUse",
    "green": "PlantCover",
    "water": "WaterBody",
}


class Material(NamedTuple):
    """A material: its name, its sRGB colour as three numbers of 0…1, and its roughness of 0…1."""

    name: str
    colour: tuple[float, float, float]
    roughness: float = 0.9


#: Materials with colours of their own, by name. Walls and all other objects have the colours of the
#: table of classes.
MATERIALS = {
    one.name: one
    for one in (
        Material("ground", (0.86, 0.84, 0.79), 0.95),
        Material("street", (0.62, 0.62, 0.63), 0.95),
        Material("pavement", (0.76, 0.76, 0.76), 0.95),
        Material("square", (0.83, 0.79, 0.73), 0.95),
        Material("court", (0.80, 0.78, 0.70), 0.95),
        Material("green", (0.56, 0.70, 0.43), 1.0),
        Material("water", (0.42, 0.60, 0.74), 0.2),
        Material("roof", (0.64, 0.45, 0.38), 0.85),
        Material("trunk", (0.42, 0.33, 0.25), 1.0),
    )
}

# The roughness of groups whose materials have the colours of classes.
_ROUGHNESS = {"tree": 1.0, "ground-levelled": 1.0, "post": 0.6}
_ROUGHNESS |= {name: one.roughness for name, one in MATERIALS.items()}


def surface_colour(name: str) -> tuple[float, float, float]:
    """Return the sRGB colour of the material ``name``, three numbers of 0…1. Raises `KeyError` for
    a name outside `MATERIALS`."""
    return MATERIALS[name].colour


def is_surface(group: Group) -> bool:
    """Whether a ``group`` is a part of the ground, and not a set of objects."""
    kind = group.city_object
    return isinstance(kind, str) and kind in GROUND.values()


def materials_of(group: Group) -> tuple[Material, Material]:
    """Return the materials of walls (floors too) and of roofs of a ``group``, with its colours.

    Buildings have the materials ``wall`` and ``roof``. Other classes of buildings have materials
    such as ``wall-shelter`` and ``roof-shelter``. Trees have ``trunk`` and ``tree``. All other
    groups have one material, which has the name of the group.
    """
    if "Building" in (group.city_objects[:1] or ("",)) and not is_surface(group):
        ending = "" if group.name == "building" else f"-{group.name}"
        roof = MATERIALS["roof"]
        colour = roof.colour if not ending else _lighten(group.colour)
        return Material(f"wall{ending}", group.colour), roof._replace(
            name=f"roof{ending}", colour=colour
        )
    plain = Material(group.name, group.colour)
    if group.name in _ROUGHNESS:
        plain = plain._replace(roughness=_ROUGHNESS[group.name])
    return (MATERIALS["trunk"] if group.name == "tree" else plain), plain


def linear(colour: tuple[float, float, float]) -> list[float]:
    """Convert an sRGB ``colour`` to linear light, as glTF stores colours. Source: IEC 61966-2-1."""
    return [round(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4, 6) for c in colour]


def names_of(group: Group) -> list[str]:
    """Return a name for each object of a ``group``, the same in all formats and unique in a scene:
    the class and the ``id`` of the object, or its place in the group."""
    ids: Sequence[int | None] = group.attributes.get("id", [None] * len(group))
    # objects without an id stand beside objects with one
    without = "low-" if any(own is not None for own in ids) else ""
    return [
        f"{group.name}-{without}{k}" if own is None else f"{group.name}-{own}"
        for k, own in enumerate(ids, 1)
    ]


def properties_of(group: Group) -> dict[str, list]:
    """Return the properties of each object of a ``group``, lists by name: ``class``, ``height`` in
    metres, ``storeys``, and the other attributes. Missing values are None."""
    columns: dict[str, list] = {"class": [group.name] * len(group)}
    columns["height"] = [round(high, 3) for high in group.heights.tolist()]
    for name, column in group.attributes.items():
        own = "storeys" if name == "storeysAboveGround" else name
        columns[own] = [None if value == "" else value for value in column]
    return columns


def tiles_of(group: Group) -> list[float]:
    """Return the height of a texture's tile on the walls of each object, metres: the height of the
    object divided by its storeys, or `TILE`."""
    counts = group.attributes.get("storeysAboveGround", [None] * len(group))
    pairs = zip(group.heights.tolist(), counts, strict=True)
    return [high / count if count and high > 0 else TILE for high, count in pairs]


def _lighten(colour: tuple[float, float, float]) -> tuple[float, float, float]:
    red, green, blue = (c + 0.3 * (1 - c) for c in colour)
    return red, green, blue
