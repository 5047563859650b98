"""A run as a self-contained HTML report, and as a sheet of pictures.

- `html`: the page, by the templates in `templates/`, and its glossary
- `shown_births`: the individuals that the page shows, read and decoded once
- `summary`, `shortlist`, `front`, `gallery`, `islands`, `tables`: its sections
- `plots`: scatter plots and curves as inline SVG
- `pictures`, `grid`: maps on one scale of heights, the contact sheet, the grid of MAP-Elites
- `failed_births`: failures, repeated genomes, births that differ when replayed
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
