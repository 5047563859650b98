"""Public names of the room, for type checkers; `__init__.py` loads each on first use."""

from .fronts import front as front
from .galleries import gallery as gallery
from .generations import convergence as convergence
from .generations import diversity as diversity
from .generations import objectives as objectives
from .grids import grid as grid
from .maps import buildings as buildings
from .maps import difference as difference
from .maps import lifs as lifs
from .maps import usage as usage
from .pedigrees import pedigree as pedigree
from .populations import credit as credit
from .populations import first_and_last as first_and_last
from .populations import parallel as parallel
