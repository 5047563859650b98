"""Classes of objects: building, furniture, tree, ground-levelled, fountain, shelter, post.

- `objects`: what stands on a map, buildings and lower things, and how each is shaped
- `table`: which limits make an object of a class, and the class's colour
- `classes`: all of it: `classified`, `Classes`
"""

from evocity.views.classes.classes import Classes, classified
from evocity.views.classes.table import ClassTable, packaged

__all__ = ["ClassTable", "Classes", "classified", "packaged"]
