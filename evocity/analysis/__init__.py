"""Runs after the search: births as tables, the best of many goals, likeness, descent, files. The
command line, the report, plots and notebooks use it.

- `open_run`, `Run`: a run folder
- `Individual`: one birth, with its map, parents, pictures and files
- `Aim`: a measure of a run and its goal
- `View`: births as a gallery with a filter, in a notebook
"""

from evocity.analysis.goals import Aim
from evocity.analysis.individual import Individual
from evocity.analysis.run import Run, open_run
from evocity.analysis.view import View

__all__ = ["Aim", "Individual", "Run", "View", "open_run"]
