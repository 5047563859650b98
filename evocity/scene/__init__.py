"""From code to place: a map's buildings as solids on their ground, in files that others open.

- `building`: `Scene`, what stands where
- `library`, `likeness`, `substitution`: objects of real maps in place of buildings
- `lines`: the lines of a city: edges of the fabric, skylines, façades, streets
- `picture`: a scene drawn, by kernels of its own
- `writing`: a scene becomes a file, by its suffix

`evocity.scene` is this module, and, called, `building.scene`.
"""

import sys
from types import ModuleType

from evocity.scene.building import Scene, scene
from evocity.scene.library import Library
from evocity.scene.lines import fabric_edges, facades, skyline, street_axes
from evocity.scene.substitution import Substitution, substituted
from evocity.scene.writing import SUFFIXES, check_suffix, suffix_of

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
    # Python looks __call__ up on the class: only a class of its own lets one name serve both
    def __call__(self, *args, **options):
        return scene(*args, **options)


sys.modules[__name__].__class__ = _CallableModule
