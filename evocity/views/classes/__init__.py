"""Classes of objects: building, furniture, tree, ground-levelled, fountain, shelter, post.

- `objects`: objects lower than buildings, and the features of all objects
- `table`: limits and colour of each class: `ClassTable`
- `classes`: the classes of a map: `classified`, `Classes`
"""

from evocity.views.classes.classes import Classes, classified
from evocity.views.classes.table import ClassTable, packaged

__all__ = ["ClassTable", "Classes", "classified", "packaged"]
