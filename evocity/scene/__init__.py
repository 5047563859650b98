"""From code to place: a map's buildings as solids on their ground, in files that others open.

- `building`: `Scene`, what stands where
- `library`, `likeness`, `substitution`: objects of real maps in place of buildings
- `picture`: a scene drawn, by kernels of its own
- `writing`: a scene becomes a file, by its suffix

`evocity.scene` is this module, and, called, `building.scene`.
"""

import sys
from types import ModuleType

from evocity.scene.building import Scene, scene
from evocity.scene.library import Library
from evocity.scene.substitution import Substitution, substituted
from evocity.scene.writing import SUFFIXES, check_suffix, suffix_of

__all__ = [
    "SUFFIXES",
    "Library",
    "Scene",
    "Substitution",
    "check_suffix",
    "scene",
    "substituted",
    "suffix_of",
]


class _CallableModule(ModuleType):
    # Python looks __call__ up on the class: only a class of its own lets one name serve both
    def __call__(self, *args, **options):
        return scene(*args, **options)


sys.modules[__name__].__class__ = _CallableModule
