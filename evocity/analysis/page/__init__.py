"""The page of a run: everything that a face of the run shows, as plain values.

- `page`: `Page`, built once from a run; report, notebook and studio render it
- `births`: births as columns, with axes, order and grid
- `shortlist`: the births to keep, with reasons, shares and commands
- `curves`: values by generation: hypervolume, goals, guards, figures, islands
- `summary`, `tables`, `islands`: figures of the run, and its tables
"""

from evocity.analysis.page.page import Page

__all__ = ["Page"]
