"""Scenes in three dimensions: a map's buildings as solids on their ground, pictures and files.

- `building`: `Scene`, the solids and surfaces of a map
- `export`: files of scenes, chosen by suffix; `reprojection`: other reference systems
- `detail`, `blocks`: levels of detail, and the walls of merged buildings
- `detail_switch`: several zooms of one code in one file, by the distance of the viewer
- `ground`, `noding`: streets, squares and other ground, as one coverage with the buildings
- `objects`: buildings and lower objects by class, with their properties
- `library`, `library_table`, `matching`, `substitution`: objects of real maps in place of buildings
- `lines`: the lines of a city: edges of the fabric, skylines, façades, streets
- `tiles`, `cutting`, `globe`: tiles of a scene, surfaces cut at their borders, and the place of
  tiles on the globe
- `relief`: buildings and streets on the ground of a surface
- `roofs`: pitched roofs by straight skeletons
- `picture`: axonometric pictures

`evocity.scene` is this module; calling it calls `building.scene`.
"""

import sys
from types import ModuleType

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)


class _CallableModule(ModuleType):
    # Python looks __call__ up on the class of the module
    def __call__(self, *args, **options):
        return self.scene(*args, **options)


sys.modules[__name__].__class__ = _CallableModule
