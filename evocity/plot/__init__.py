"""Figures of runs with matplotlib, which the extra ``notebook`` installs.

- `objectives`, `convergence`, `diversity`: generation by generation
- `first_and_last`, `parallel`, `credit`: many births side by side
- `front`: two measures against each other, with maps
- `gallery`, `grid`, `pedigree`: maps side by side, in the cells of a grid, as a tree
- `lifs`, `usage`, `difference`: maps of one genome, of two cities
- `buildings`: the buildings of a city, compared with its parents'

Each takes ``ax=``, matplotlib's axes to draw on, and returns the axes; ``axes.figure.savefig``
writes them. Without ``ax`` it makes a new figure, without pyplot: a notebook shows it where the
call is the last line of a cell. No global setting of matplotlib is changed.
"""

from evocity.lazy_imports import lazy_names, library

_load, __dir__, __all__ = lazy_names(__name__, __file__)


def __getattr__(name: str) -> object:
    if name in __all__:
        library("matplotlib", f"plot.{name}")  # names what to install, before a module imports it
    return _load(name)
