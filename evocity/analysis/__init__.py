"""The morning after: what a run tells, as plain tables; what command line, report, plots and
notebooks share.

- `open_run`, `Run`: a run as one asks it
- `individual`: one birth, with its city, parents, pictures, files
- `births`: all births as columns; `wanted`: what was wanted of them; `series`: generation by
  generation
- `condition`: births chosen by "fsi > 2 and crumbs < 4"
- `extras`: libraries that are asked for when they are needed
"""

from evocity.analysis.individual import Individual
from evocity.analysis.run import Run, open_run
from evocity.analysis.wanted import Aim

__all__ = ["Aim", "Individual", "Run", "open_run"]
