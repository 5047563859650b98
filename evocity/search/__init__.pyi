"""Public names of the room, for type checkers; `__init__.py` loads each at first use."""

from evocity.recipe.reader import read_recipe as read_recipe
from evocity.recipe.reader import recipes as recipes
from evocity.recipe.recipe import Recipe as Recipe
from evocity.selection.algorithms import Algorithm as Algorithm
from evocity.selection.cells import Grid as Grid
from evocity.selection.individual import Individual as Individual

from .engine import Search as Search
from .record.archive import Archive as Archive
from .record.archive import archive as archive
from .record.commands import pick as pick
from .record.grid import binned as binned
from .resume.refine import refine as refine
from .resume.replay import replay as replay
from .steering.generation import Generation as Generation
from .steering.observers import Observer as Observer
from .toolbox import deap_toolbox as deap_toolbox
