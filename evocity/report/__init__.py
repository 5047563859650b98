"""What a run shows: a self-contained HTML report, and a sheet of pictures.

- `facts`: what a report tells, gathered from a run folder
- `failing`: why births failed, and how many repeat each other, which differ when replayed
- `pictures`: genomes as pictures on one scale of heights; the contact sheet
- `grid`: the grid of a run of MAP-Elites, a map in each filled cell
- `islands`: how good each island is, who lives where, who moved
- `plots`: scatter plots and curves as inline SVG
- `gallery`: a card for each individual: picture, measures, lineage
- `html`: the page
"""

from evocity.rooms import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
