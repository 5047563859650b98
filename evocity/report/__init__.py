"""What a run shows: a self-contained HTML report, and a sheet of pictures.

- `facts`: what a report tells, gathered from a run folder
- `failing`: why births failed, and how many repeat each other, which differ when replayed
- `pictures`: genomes as pictures on one scale of heights; the contact sheet
- `grid`: the grid of a run of MAP-Elites, a map in each filled cell
- `islands`: how good each island is, who lives where, who moved
- `summary`: the head of the page: cities, figures
- `kept`: the few that are worth keeping, beside archive and parents
- `front`: births over their measures, the living by generation
- `plots`: scatter plots and curves as inline SVG
- `gallery`: a card for each individual: picture, measures, lineage
- `tables`: births, generations, settings
- `words`: what words mean that a newcomer does not know
- `html`: the page, by the templates in `templates/`
"""

from evocity.rooms import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
