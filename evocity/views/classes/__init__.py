"""Classes of objects: building, furniture, tree, ground-levelled, fountain, shelter, post.

- `table`: limits and colour of each class: `ClassTable`
- `classes`: objects of a map, low ones too, and their classes: `classified`, `Classes`
"""

from evocity.views.classes.classes import Classes, classified
from evocity.views.classes.table import ClassTable, packaged

__all__ = ["ClassTable", "Classes", "classified", "packaged"]
