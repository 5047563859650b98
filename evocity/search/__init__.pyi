"""What the room names, for checkers of types; `__init__.py` loads each when first used."""

from .archiving import Archive as Archive
from .archiving import archive as archive
from .commands import pick as pick
from .engine import Search as Search
from .generation import Generation as Generation
from .individual import Individual as Individual
from .observers import Observer as Observer
from .reading import read_recipe as read_recipe
from .reading import recipes as recipes
from .recipe import Recipe as Recipe
from .refinement.refine import refine as refine
from .repeating import replay as replay
from .toolbox import deap_toolbox as deap_toolbox
