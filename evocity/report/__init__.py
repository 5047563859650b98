"""A run as a self-contained HTML report, and as a sheet of pictures.

- `html`: the page, by the template in `templates/`: its facts and its views are those of
  `evocity.analysis.page`
- `sheet`, `grid`: maps of a run on one picture
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
