"""Scenes in three dimensions: a map's buildings as solids on their ground, pictures and files.

- `building`: `Scene`, the solids and surfaces of a map
- `library`, `library_table`, `matching`, `substitution`: objects of real maps in place of buildings
- `lines`: the lines of a city: edges of the fabric, skylines, façades, streets
- `picture`: axonometric pictures
- `writers`: files, chosen by suffix

`evocity.scene` is this module; calling it calls `building.scene`.
"""

import sys
from types import ModuleType

from evocity.scene.building import Scene, scene
from evocity.scene.library import Library
from evocity.scene.lines import fabric_edges, facades, skyline, street_axes
from evocity.scene.substitution import Substitution, substituted
from evocity.scene.writers import SUFFIXES, check_suffix, suffix_of

__all__ = [
    "SUFFIXES",
    "Library",
    "Scene",
    "Substitution",
    "check_suffix",
    "fabric_edges",
    "facades",
    "scene",
    "skyline",
    "street_axes",
    "substituted",
    "suffix_of",
]


class _CallableModule(ModuleType):
    # Python looks __call__ up on the class of the module
    def __call__(self, *args, **options):
        return scene(*args, **options)


sys.modules[__name__].__class__ = _CallableModule
