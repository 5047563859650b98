"""The morning after: what a run tells, as plain tables; what command line, report, plots and
notebooks share.

- `open_run`, `Run`: a run as one asks it
- `individual`: one birth, with its city, parents, pictures, files
- `births`: all births as columns; `wanted`: what was wanted of them; `series`: generation by
  generation
- `asked`, `condition`: which births are meant, by ids, or by "fsi > 2 and crumbs < 4"
- `compromise`, `clusters`, `likeness`, `spread`: which is the best of many goals, which are alike,
  which differ most
- `pedigree`, `credit`: who descends from whom, which operators paid
- `keeping`: which few to keep, and why
- `scoring`: measures that the run did not log
- `comparing`: two runs beside each other
- `view`, `viewed`, `thumbnails`: births on a page of pictures and axes, as the page has them; small
  pictures of them
- `exporting`: CSV, and a zip of chosen births
- `extras`: libraries that are asked for when they are needed
"""

from evocity.analysis.individual import Individual
from evocity.analysis.run import Run, open_run
from evocity.analysis.view import View
from evocity.analysis.wanted import Aim

__all__ = ["Aim", "Individual", "Run", "View", "open_run"]
