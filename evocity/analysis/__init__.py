"""Runs after the search: births as tables, the best of many goals, likeness, descent, files. The
command line, the report, plots and notebooks use it.

- `open_run`, `Run`: a run folder
- `Individual`: one birth, with its map, parents, pictures and files
- `Aim`: a measure of a run and its goal
- `View`: births as a gallery with a filter, in a notebook
"""

import os

from evocity.analysis.goals import Aim
from evocity.analysis.individual import Individual
from evocity.analysis.run import Run
from evocity.analysis.view import View


def open_run(path: str | os.PathLike) -> Run:
    """Open a run folder for reading. Opening a run executes nothing in the folder and changes
    nothing.

    The run may still be in progress; the returned object shows only complete generations. Raises
    `RunError` if there is no run at ``path``, if the run is damaged, or if another release wrote
    the run with another schema.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> run.best("alignment").picture()  # doctest: +SKIP
    """
    return Run(path)


__all__ = ["Aim", "Individual", "Run", "View", "open_run"]
